//! Declaration, explanation, reference page and effective configuration say the same.

// The lint's exception for tests does not reach the helpers of an integration test.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::collections::BTreeSet;
use std::fs;

use kerbside_settings::*;

#[test]
fn every_key_is_declared_once_and_documented() {
    let mut seen = BTreeSet::new();
    for key in declarations() {
        assert!(seen.insert((key.file, key.path.clone())), "{} twice", key.path);
        assert!(key.doc.ends_with('.'), "{}: \"{}\" is no sentence", key.path, key.doc);
        let named = key.kind.unit_name() == "degrees";
        assert_eq!(key.path.ends_with("_degrees"), named, "{} hides its unit", key.path);
        let missing = key.presence == Presence::Default && key.default.is_none();
        assert!(!missing, "{} has no default", key.path);
    }
    assert!(seen.len() > 150, "{}", seen.len());
}

/// The names of the fields that `{:#?}` shows at the first level.
fn fields(value: &impl std::fmt::Debug) -> Vec<String> {
    let text = format!("{value:#?}");
    let first = text.lines().filter_map(|line| line.strip_prefix("    "));
    first.filter(|line| !line.starts_with([' ', '}'])).map(|line| name(line).to_owned()).collect()
}

fn name(line: &str) -> &str {
    line.split(':').next().unwrap()
}

#[test]
fn every_field_that_a_configuration_may_set_has_its_key() {
    let safety = kerbside_safety::SafetySettings::default();
    let sections = [
        ("ingest", fields(&kerbside_odometry::IngestSettings::default())),
        ("estimator", fields(&kerbside_odometry::EstimatorSettings::default())),
        ("planner", fields(&kerbside_planning::PlannerSettings::default())),
        ("tracker", fields(&kerbside_tracking::TrackerSettings::default())),
        ("timeouts", fields(&safety.timeouts)),
        ("restart", fields(&safety.restart)),
        ("safety", fields(&safety)),
    ];
    let keys: BTreeSet<_> = declarations().into_iter().map(|key| key.path).collect();
    for (section, fields) in sections {
        assert!(fields.len() >= 4, "{section}: {fields:?}");
        // These are tables of their own.
        let own = ["initial_pose", "timeouts", "restart"];
        for field in fields.iter().filter(|field| !own.contains(&field.as_str())) {
            assert!(keys.contains(&format!("{section}.{field}")), "{section}.{field}");
        }
    }
}

#[test]
fn explanation_and_reference_page_hold_every_key() {
    let (page, all) = (reference(), explain_all());
    for key in declarations() {
        assert!(page.contains(&format!("| `{}` | ", key.path)), "{}", key.path);
        let text = explain(&key.path).unwrap();
        for part in [&key.path, &key.doc, &key.kind.to_string()] {
            assert!(text.contains(part.as_str()), "{part} is not in {text}");
        }
        assert!(all.contains(&format!("{} ({})\n    {}\n", key.path, key.file, key.doc)));
    }
    let table = explain("actuators").unwrap();
    assert!(table.contains("actuators.speed_lag") && table.contains("actuators.steering_delay"));
}

#[test]
fn what_is_explained_as_default_is_what_holds() {
    let stack = Sources::compiled_in().stack().unwrap();
    let effective = |path: &str| stack.settings.iter().find(|setting| setting.key == path);
    let mut compared = 0;
    for key in declarations().iter().filter(|key| key.file == "stack.toml") {
        let Some(setting) = effective(&key.path) else { continue };
        if setting.origin != Origin::Default {
            continue;
        }
        let default = key.default.as_deref().unwrap();
        let first = default.split(';').next().unwrap();
        assert_eq!(first, setting.value.to_string(), "{}", key.path);
        if let Some(note) = &setting.note {
            let other = note.strip_suffix(" with real-time rights").unwrap();
            assert!(default.contains(&format!("with real-time rights: {other}")), "{default}");
        }
        compared += 1;
    }
    assert!(compared > 30, "{compared}");
    let explained = explain("timeouts.permit").unwrap();
    assert!(explained.contains("default: 0.15; with real-time rights: 0.04"), "{explained}");
    let explained = explain("tracker.corridor").unwrap();
    assert!(explained.contains("default: 0.15; for a wheelbase of 1 m: 0.3\n"), "{explained}");
}

#[test]
fn the_effective_configuration_names_origins() {
    let shown = Sources::compiled_in().stack().unwrap().show();
    for line in [
        "vehicle = \"paper-1-6\"                    # <compiled in>/stack.toml:3",
        "[timeouts]",
        "permit = 0.15                            # default; 0.04 with real-time rights",
        "level = \"info\"                           # <compiled in>/stack.toml:",
    ] {
        assert!(shown.contains(line), "{line} is not in\n{shown}");
    }
    assert!(!shown.contains("initial_pose"));
}

#[test]
fn the_effective_configuration_read_again_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let sources = Sources::compiled_in();
    for name in sources.names(FileKind::Stack) {
        let first = sources.stack_named(&name).unwrap();
        // Time-outs of the shown file are stated and so hold with rights, too.
        let path = folder.path().join("shown.toml");
        fs::write(&path, first.show()).unwrap();
        let again = Sources::in_folders(Some(&path), &[]).unwrap().stack().unwrap();
        assert_eq!(first.value.safety(false), again.value.safety(false));
        assert_eq!(first.value.tracker, again.value.tracker);
        assert_eq!(first.value.estimator, again.value.estimator);
        assert_eq!(first.value.vehicle, again.value.vehicle);
        assert!(again.settings.iter().all(|setting| setting.origin != Origin::Default));
    }
    for name in sources.names(FileKind::Vehicle) {
        let first = sources.vehicle(&name).unwrap();
        assert_eq!(parse_vehicle("shown", &first.show()).unwrap().value, first.value);
    }
    for name in sources.names(FileKind::Scenario) {
        let first = sources.scenario(&name).unwrap();
        let path = folder.path().join(format!("{name}.toml"));
        fs::write(&path, first.show()).unwrap();
        let again = sources.scenario(path.to_str().unwrap()).unwrap();
        assert_eq!(Scenario { file: first.value.file.clone(), ..again.value }, first.value);
    }
}

#[test]
fn free_keys_survive_being_shown() {
    let text = "name = \"a\"\n[conditions]\n\"odd key\" = \"with \\\"quotes\\\" and \
                \\u0007\"\nlist = [1, 2.0, true]\n";
    let first = parse_run("run.toml", text).unwrap();
    let again = parse_run("run.toml", &first.show()).unwrap();
    assert_eq!(first.value, again.value);
}
