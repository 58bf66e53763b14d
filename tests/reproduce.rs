//! `reproduce` and `compare filters` with few trials: what they print, their exit codes, the same bytes for the same seed.
//! Neither starts a stack.

#![allow(clippy::unwrap_used, clippy::panic)] // Helpers of tests are tests.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn kerbside(arguments: &[&str], state: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kerbside"));
    command.args(arguments).env("XDG_STATE_HOME", state).output().unwrap()
}

fn json(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    let object = serde_json::from_str(&text);
    object.unwrap_or_else(|error| {
        panic!("{error}: {text}{}", String::from_utf8_lossy(&output.stderr))
    })
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn cases() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/cases/paper-1-6")
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_a_report() {
    let (state, out) = (folder(), folder());
    let out = out.path().to_str().unwrap();
    let run = |seed: &str| {
        let rows = ["reproduce", "--trials", "2", "--rows", "4,5", "--json", "--out", out];
        kerbside(&[&rows[..], &["--seed", seed]].concat(), state.path())
    };
    let (one, same, other) = (run("3"), run("3"), run("4"));
    assert_eq!(one.stdout, same.stdout);
    assert_ne!(one.stdout, other.stdout);
    let object = json(&one);
    for key in ["schema", "version", "seed", "trials", "passed", "figures", "rows", "report"] {
        assert!(!object[key].is_null(), "{key}");
    }
    assert_eq!(object["seed"], 3);
    let rows = object["rows"].as_array().unwrap();
    assert!(rows.iter().all(|row| row["row"] == 4 || row["row"] == 5));
    for key in ["row", "paper", "ours", "low", "high", "accept", "passed"] {
        assert!(rows.iter().all(|row| row.get(key).is_some()), "{key}");
    }
    let passed = object["passed"].as_bool().unwrap();
    assert_eq!(one.status.code(), Some(i32::from(!passed)));
    let page = std::fs::read_to_string(object["report"].as_str().unwrap()).unwrap();
    assert!(page.contains("figure-7-90") && page.contains("What the paper leaves open"));
}

#[test]
fn parking_of_the_stack_in_lockstep_stands_beside_row_9() {
    let (state, out) = (folder(), folder());
    let out = out.path().to_str().unwrap();
    let rows = ["reproduce", "--trials", "2", "--rows", "9", "--json", "--out", out];
    let object = json(&kerbside(&rows, state.path()));
    let stack = object["stack"].as_array().unwrap();
    let scenes: Vec<_> = stack.iter().map(|line| line["scene"].as_str().unwrap()).collect();
    assert_eq!(scenes, ["garage", "parallel", "garage-full-size", "parallel-full-size"]);
    assert!(stack.iter().all(|line| line["parked"] == line["of"]), "{stack:?}");
}

#[test]
fn tables_keep_to_eighty_columns_and_name_the_report() {
    let (state, out) = (folder(), folder());
    let out = out.path().to_str().unwrap();
    let rows = ["reproduce", "--trials", "2", "--rows", "3,4,6", "--out", out];
    let output = kerbside(&rows, state.path());
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("report.html"), "{text}");
    let lines = text.lines().filter(|line| !line.starts_with("report"));
    for line in lines {
        assert!(line.chars().count() <= 80, "{line}");
    }
}

#[test]
fn what_cannot_be_asked_is_refused() {
    let state = folder();
    for arguments in [
        ["reproduce", "--trials", "1"],
        ["reproduce", "--rows", "10"],
        ["reproduce", "--rows", "0"],
    ] {
        assert_eq!(kerbside(&arguments, state.path()).status.code(), Some(2), "{arguments:?}");
    }
    let nothing_to_write = kerbside(&["compare", "filters", "--out", "somewhere"], state.path());
    assert_eq!(nothing_to_write.status.code(), Some(2));
    let missing = kerbside(&["compare", "filters", "/nowhere"], state.path());
    assert_eq!(missing.status.code(), Some(65));
}

#[test]
fn filters_are_compared_on_recorded_runs() {
    let (state, out) = (folder(), folder());
    let (cases, out) = (cases(), out.path().to_str().unwrap().to_owned());
    let arguments = ["compare", "filters", cases.to_str().unwrap(), "--json", "--out", &out];
    let (one, same) = (kerbside(&arguments, state.path()), kerbside(&arguments, state.path()));
    assert_eq!(one.status.code(), Some(0));
    assert_eq!(one.stdout, same.stdout);
    let object = json(&one);
    let runs = object["runs"].as_array().unwrap();
    assert!(!runs.is_empty());
    for run in runs {
        let filters = run["filters"].as_array().unwrap();
        let names: Vec<_> = filters.iter().map(|one| one["filter"].as_str().unwrap()).collect();
        assert_eq!(names, ["rear", "paper (i)", "paper (ii)", "fused"]);
    }
}

#[test]
fn filters_are_compared_on_the_proving_ground() {
    let state = folder();
    let output = kerbside(&["compare", "filters", "--trials", "2", "--json"], state.path());
    let object = json(&output);
    let cases = object["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 12);
    for case in cases {
        let filters = case["filters"].as_array().unwrap();
        assert!(filters.iter().all(|filter| filter["mean_error_m"].as_f64().unwrap() < 0.5));
    }
    assert!(matches!(output.status.code(), Some(0 | 1)));
}
