//! `soak`: in lockstep by the thousand seconds, and with real processes for half a minute.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::Sandbox;
use serde_json::Value;

fn soak(sandbox: &Sandbox, arguments: &[&str]) -> (Option<i32>, Value, String) {
    let output = sandbox.kerbside().arg("soak").args(arguments).output().unwrap();
    let json = serde_json::from_slice(&output.stdout).unwrap_or_default();
    (output.status.code(), json, String::from_utf8_lossy(&output.stderr).into_owned())
}

fn count(json: &Value) -> u64 {
    let kinds = json["faults"].as_object().unwrap().values();
    kinds.flat_map(|counts| counts.as_object().unwrap().values()).filter_map(Value::as_u64).sum()
}

#[test]
fn random_faults_in_lockstep_break_nothing_and_repeat() {
    let sandbox = Sandbox::new();
    let arguments = ["--lockstep", "--manoeuvres", "40", "--seed", "1000", "--json"];
    let (code, json, stderr) = soak(&sandbox, &arguments);
    assert_eq!(code, Some(0), "{json:#} {stderr}");
    assert_eq!((&json["schema"], &json["passed"]), (&"kerbside.soak.v1".into(), &true.into()));
    assert_eq!(json["manoeuvres"], 40);
    // Some thousand seconds.
    assert!(json["minutes"].as_f64().unwrap() > 15.0, "{json:#}");
    assert!(count(&json) > 40, "{json:#}");
    assert!(json["stop"]["worst_share"].as_f64().unwrap() <= 1.0, "{json:#}");
    // One thread or several: the same seeds, the same course.
    let few = |threads| {
        let few = ["--lockstep", "--manoeuvres", "5", "--seed", "1000", "--json"];
        soak(&sandbox, &[&few[..], &["--threads", threads]].concat()).1
    };
    let (one, several) = (few("1"), few("3"));
    for key in ["minutes", "ends", "faults", "min_clearance_m"] {
        assert_eq!(one[key], several[key], "{key}");
    }
}

#[test]
fn one_seed_is_replayed_alone() {
    let sandbox = Sandbox::new();
    let (code, json, stderr) = soak(&sandbox, &["--lockstep", "--seed", "61", "--json"]);
    assert_eq!((code, &json["manoeuvres"]), (Some(0), &1.into()), "{json:#} {stderr}");
    assert_eq!((&json["seed"], &json["last_seed"]), (&61.into(), &61.into()));
}

#[test]
fn what_does_not_go_together_is_refused() {
    let sandbox = Sandbox::new();
    for arguments in [
        &["--lockstep", "--matrix"][..],
        &["--lockstep", "--load", "cpu"],
        &["--minutes", "0"],
        &["--minutes", "1", "--manoeuvres", "1"],
        &["--load", "earthquake"],
    ] {
        let (code, _, stderr) = soak(&sandbox, arguments);
        assert_eq!(code, Some(2), "{arguments:?}: {stderr}");
    }
}

#[test]
fn real_processes_are_soaked_for_half_a_minute_and_leave_nothing() {
    let sandbox = Sandbox::new();
    let out = sandbox.file("out");
    let arguments = ["--minutes", "0.45", "--load", "peer,disk", "--seed", "3", "--json"];
    let place = ["--instance", "one", "--out", out.to_str().unwrap()];
    let (code, json, stderr) = soak(&sandbox, &[&arguments[..], &place].concat());
    // What a busy machine makes late is no defect of the stack; everything else is.
    let broken: Vec<&Value> = json["figures"]
        .as_array()
        .unwrap_or_else(|| panic!("{stderr}"))
        .iter()
        .filter(|figure| figure["passed"] == false)
        .filter(|figure| !figure["name"].as_str().unwrap().contains("deadline misses"))
        .collect();
    assert!(broken.is_empty(), "{broken:#?}\n{json:#}\n{stderr}");
    assert!(matches!(code, Some(0 | 1)), "{code:?} {stderr}");
    assert!(count(&json) >= 3, "{json:#}");
    assert!(json["cells"].as_array().unwrap().len() >= 2, "{json:#}");
    assert_eq!((&json["orphans"], &json["segments_left"]), (&0.into(), &0.into()));
    let report = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(report.contains("Stops against the bound"));
    sandbox.assert_empty();
}
