//! Fuzzing: whatever a file of the configuration holds, it is read or refused with every problem in its place.

// A test may end loudly.
#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "../../../../tests/common_fuzz/mod.rs"]
mod common_fuzz;

use std::fs;
use std::path::Path;

use kerbside_settings::{
    COMPILED_IN, Problem, SettingsError, Sources, check, parse_overlay, parse_run, parse_vehicle,
};

use common_fuzz::{corpus, damaged};

/// Shipped files of every kind, and what people write beside them.
fn examples() -> Vec<Vec<u8>> {
    let shipped = COMPILED_IN.iter().map(|(_, text)| text.as_bytes().to_vec());
    shipped.chain(corpus(env!("CARGO_MANIFEST_DIR"), "configuration")).collect()
}

/// A problem points into the text it is about, at a line and column that are there.
fn well_placed(problem: &Problem) {
    let source: &str = &problem.source;
    assert!(problem.span.start <= problem.span.end, "{problem:?}");
    assert!(problem.span.end <= source.len(), "{problem:?}");
    assert!(source.is_char_boundary(problem.span.start), "{problem:?}");
    assert!(source.is_char_boundary(problem.span.end), "{problem:?}");
    assert!(problem.line >= 1 && problem.column >= 1, "{problem:?}");
    assert!(!problem.to_string().is_empty());
}

fn judged<T>(result: Result<T, SettingsError>, warnings: impl Fn(&T) -> Vec<Problem>) {
    match result {
        Ok(value) => warnings(&value).iter().for_each(well_placed),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            error.problems().iter().for_each(well_placed);
        }
    }
}

/// The text as a file of every kind.
fn examine(folder: &Path, bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    judged(parse_vehicle("vehicle.toml", &text), |loaded| {
        // What is shown in full can be read again.
        let again = parse_vehicle("vehicle.toml", &loaded.show()).unwrap();
        assert_eq!(again.value.vehicle, loaded.value.vehicle);
        loaded.warnings.clone()
    });
    judged(parse_run("run.toml", &text), |loaded| loaded.warnings.clone());
    judged(parse_overlay("overlay.toml", &text), |_| Vec::new());
    let stack = folder.join("stack.toml");
    fs::write(&stack, bytes).unwrap();
    let sources = Sources::in_folders(Some(&stack), &[]).unwrap();
    judged(sources.stack(), |loaded| loaded.warnings.clone());
    fs::write(folder.join("scenarios/some.toml"), bytes).unwrap();
    judged(sources.scenario("some"), |loaded| loaded.warnings.clone());
}

#[test]
fn configuration() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("scenarios")).unwrap();
    let examples = examples();
    examples.iter().for_each(|example| examine(folder.path(), example));
    // Everything that is found beside each other is checked in one go, too.
    let sources = Sources::in_folders(Some(folder.path()), &[]).unwrap();
    check(&sources).iter().for_each(well_placed);
    let folder = folder.path().to_owned();
    bolero::check!().for_each(|bytes: &[u8]| {
        examine(&folder, bytes);
        examine(&folder, &damaged(&examples, bytes));
    });
}
