//! Whatever a file holds, reading it ends in a value or in problems with a place; never in a panic.

// The lint's exception for tests does not reach the helpers of an integration test.
#![allow(clippy::unwrap_used, clippy::panic)]

use kerbside_settings::*;
use proptest::prelude::*;

/// Texts that TOML and its keys are made of.
const PIECES: &[&str] = &[
    "[",
    "]",
    "{",
    "}",
    "=",
    ".",
    ",",
    "\"",
    "'",
    "\"\"\"",
    "#",
    "\n",
    "\r\n",
    "-",
    "1e400",
    "nan",
    "-inf",
    "0x1F",
    "9223372036854775808",
    "true",
    "2024-01-01",
    "radius",
    "[[encoders]]",
    "uncertainty.effect",
    "\u{e9}",
    "\u{0}",
    "limits.speed = 1\n",
    "slot",
    "boxes = [[",
    "x = [1, 2]\n",
    "\\u12",
    "encoders",
    "\"limits.speed\" = 1\n",
];

/// What is done to a text: at which place (of 1000), how much is cut, and what is put in.
fn edits() -> impl Strategy<Value = Vec<(usize, usize, usize)>> {
    prop::collection::vec((0..1000_usize, 0..40_usize, 0..PIECES.len()), 1..6)
}

fn mutate(text: &str, edits: &[(usize, usize, usize)]) -> String {
    let mut text: Vec<char> = text.chars().collect();
    for (place, cut, piece) in edits {
        let start = place * text.len() / 1000;
        let end = (start + cut).min(text.len());
        text.splice(start..end, PIECES[*piece].chars());
    }
    text.into_iter().collect()
}

fn examine<T>(result: Result<T, SettingsError>) {
    let Err(error) = result else { return };
    assert!(!error.to_string().is_empty());
    if let SettingsError::Refused(problems) = &error {
        assert!(problems.iter().any(|problem| problem.severity == Severity::Error), "{error}");
        for problem in problems {
            assert!(problem.line >= 1 && problem.column >= 1);
            assert!(problem.line <= 1 + problem.source.matches('\n').count(), "{problem:?}");
            assert!(problem.span.start <= problem.span.end);
            assert!(problem.span.end <= problem.source.len(), "{problem:?}");
        }
    }
}

fn read_as_every_kind(text: &str) {
    examine(parse_vehicle("vehicle.toml", text));
    examine(parse_run("run.toml", text));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stack.toml");
    std::fs::write(&path, text).unwrap();
    let sources = Sources::in_folders(Some(&path), &[]).unwrap();
    examine(sources.stack());
    examine(sources.scenario(path.to_str().unwrap()));
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 200,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_mutated_file_never_panics(file in 0..COMPILED_IN.len(), edits in edits()) {
        read_as_every_kind(&mutate(COMPILED_IN[file].1, &edits));
    }

    #[test]
    fn any_text_never_panics(text in "\\PC{0,200}") {
        read_as_every_kind(&text);
    }

    #[test]
    fn a_number_is_taken_exactly_when_it_is_in_range(value in prop::num::f64::ANY) {
        let file = COMPILED_IN.iter().find(|(path, _)| *path == "vehicles/paper-1-6.toml");
        let stated = format!("speed_lag = {value:?}").to_lowercase();
        let text = file.unwrap().1.replace("speed_lag = 0.10", &stated);
        let allowed = (0.0..=10.0).contains(&value);
        match parse_vehicle("vehicle.toml", &text) {
            Ok(loaded) => {
                prop_assert!(allowed);
                prop_assert_eq!(loaded.value.vehicle.actuators.map(|a| a.speed_lag), Some(value));
            }
            Err(error) => prop_assert!(!allowed, "{}", error),
        }
    }

    #[test]
    fn explaining_any_key_never_panics(key in "[a-z_.]{0,300}") {
        let _ = explain(&key);
    }
}

#[test]
fn deep_nesting_is_refused() {
    for text in [format!("x = {}", "[".repeat(100_000)), "a.".repeat(50_000)] {
        examine(parse_vehicle("vehicle.toml", &text));
    }
    let nested = format!("name = \"a\"\nconditions.x = {}{}", "[".repeat(60), "]".repeat(60));
    assert!(parse_run("run.toml", &nested).is_ok());
}
