//! The benches run, and say what they promise to say. Whether a figure is met is no test's business: a machine that
//! builds and tests beside it is no place to measure.

// A test that cannot go on panics.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::process::{Command, Output};
use std::sync::{Mutex, PoisonError};

use serde_json::Value;

/// One at a time: they measure.
static TURN: Mutex<()> = Mutex::new(());

fn bench(arguments: &[&str]) -> (Value, Output) {
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::Builder::new().prefix("kbb").tempdir_in("/tmp").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_kerbside"))
        .arg("bench")
        .args(arguments)
        .arg("--json")
        .env("XDG_RUNTIME_DIR", folder.path())
        .env("XDG_STATE_HOME", folder.path().join("state"))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    let object = serde_json::from_str(&said).unwrap_or_else(|error| {
        panic!("{error}: {said}\n{}", String::from_utf8_lossy(&output.stderr))
    });
    let left: Vec<_> = std::fs::read_dir(folder.path().join("kerbside"))
        .map(|entries| entries.flatten().map(|entry| entry.file_name()).collect())
        .unwrap_or_default();
    assert!(left.is_empty(), "instances are left: {left:?}");
    (object, output)
}

/// Holds what every bench says; the exit code is that of its figures.
fn check(object: &Value, output: &Output) {
    let figures = object["figures"].as_array().unwrap();
    let passed = figures.iter().all(|figure| figure["passed"] == true);
    assert_eq!(object["passed"], passed);
    assert_eq!(output.status.code(), Some(i32::from(!passed)));
    assert!(!figures.is_empty());
    for row in object["rows"].as_array().unwrap() {
        assert!(row["name"].is_string() && row["rival"].is_string() && row["bytes"].is_u64());
        let number = |value: &Value| value.as_f64().is_some_and(|number| number > 0.0);
        for key in ["ours_us", "rival_us", "ratio_p99"] {
            assert!(number(&row[key]), "{key} of {row}");
        }
        for key in ["value", "low", "high"] {
            assert!(number(&row["ratio_p50"][key]), "{key} of {row}");
        }
    }
}

#[test]
fn transport_compares_each_hop_with_its_rivals() {
    let (object, output) = bench(&["transport", "--blocks", "2", "--samples", "20"]);
    check(&object, &output);
    for topic in ["raw", "travel", "odometry", "command", "actuator"] {
        let rows = object["rows"].as_array().unwrap();
        let rivals: Vec<_> = rows.iter().filter(|row| row["name"] == topic).collect();
        assert_eq!(rivals.len(), 2, "{topic}");
    }
}

#[test]
fn a_start_is_measured() {
    let (object, output) = bench(&["start", "--repeats", "2"]);
    check(&object, &output);
    assert_eq!(object["start_s"]["all"].as_array().unwrap().len(), 2);
}

#[test]
fn the_pipeline_is_measured_while_the_car_drives() {
    let (object, output) = bench(&["pipeline", "--seconds", "4", "--ordinary"]);
    check(&object, &output);
    let way = &object["ways"][0];
    assert!(way["latency_us"]["samples"].as_u64().unwrap() > 100, "{way}");
    assert!(way["work_us"].as_f64().unwrap() > 0.0, "{way}");
}

#[test]
fn a_filter_step_is_measured_against_its_twin_where_there_is_a_compiler() {
    let (object, output) = bench(&["filter", "--blocks", "4", "--steps", "1000"]);
    assert!(object["step_ns"].as_f64().is_some_and(|nanos| nanos > 0.0), "{object}");
    match object["twin"].as_str() {
        Some(why) => {
            eprintln!("skipped: {why}");
            assert_eq!((output.status.code(), &object["passed"]), (Some(0), &true.into()));
        }
        // What the two compute was compared, else the verb fails.
        None => {
            check(&object, &output);
            assert!(object["twin_ns"].as_f64().is_some_and(|nanos| nanos > 0.0), "{object}");
        }
    }
}

#[test]
fn the_control_path_is_measured_with_top_beside_it() {
    let (object, output) = bench(&["tools", "--seconds", "2"]);
    check(&object, &output);
    let rows = object["rows"].as_array().unwrap();
    assert!(rows.len() == 2 && rows.iter().all(|row| row["rival"] == "without top"), "{object}");
}

#[test]
fn the_control_path_is_measured_beside_those_who_mean_harm() {
    let (object, output) = bench(&["hostile", "--seconds", "3"]);
    check(&object, &output);
    let rows = object["rows"].as_array().unwrap();
    assert!(rows.len() == 4 && rows.iter().all(|row| row["rival"] == "alone"), "{object}");
}
