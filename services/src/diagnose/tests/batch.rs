//! Many cases.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::cases::write;
use super::*;

/// Runs a batch; how many cases were diagnosed, and how it ended.
fn batch(cases: &Cases, change: impl FnOnce(&mut DiagnoseArgs)) -> (usize, Exit) {
    let mut args = DiagnoseArgs { batch: Some(cases.path("")), ..arguments(cases) };
    change(&mut args);
    let count = AtomicUsize::new(0);
    let counted = |case: &Case, progress: &dyn Fn(&str, f64)| {
        count.fetch_add(1, Ordering::Relaxed);
        by_name(case, progress)
    };
    let exit = run_with(&args, &counted).unwrap();
    (count.into_inner(), exit)
}

fn verdict(cases: &Cases, case: &str) -> Value {
    read_json(&cases.path("out").join(case).join(DIAGNOSIS))["verdict"].clone()
}

#[test]
fn a_broken_case_is_told_and_the_others_are_finished() {
    let cases = Cases::new();
    for name in ["none", "two", "ambiguous", "panic", "defect", "broken"] {
        cases.add(name);
    }
    let encoders = cases.path("broken/runs/straight-1/encoders.csv");
    write(&encoders, "t,rl\n0.0,1\n0.1,x\n");
    fs::create_dir_all(cases.path("bare/runs")).unwrap();
    fs::create_dir_all(cases.path("no-case")).unwrap();
    assert_eq!(batch(&cases, |_| {}), (5, Exit::Bad));
    for (case, expected) in [("none", "none"), ("two", "effects"), ("ambiguous", "ambiguous")] {
        assert_eq!(verdict(&cases, case), expected);
    }
    let rows = super::parquet::read(&cases.path("out/diagnoses.parquet"));
    let error = |case: &str| {
        let row = rows.iter().find(|row| row["case"] == case).unwrap();
        assert!(row["error"].is_null() || row["verdict"].is_null(), "{row:?}");
        row["error"].as_str().unwrap_or_default().to_owned()
    };
    assert_eq!(rows.len(), 7);
    assert!(error("broken").contains("encoders.csv:3: column rl"), "{}", error("broken"));
    assert!(error("bare").contains("no run in runs/") && error("panic").contains("a defect"));
    assert!(error("defect").contains("exceed 1") && error("two").is_empty());
    // Mended, it is all that is left to do.
    cases.add("broken");
    for case in ["panic", "defect", "bare"] {
        fs::remove_dir_all(cases.path(case)).unwrap();
    }
    assert_eq!(batch(&cases, |_| {}), (1, Exit::Good));
}

#[test]
fn what_the_same_version_diagnosed_is_kept() {
    let cases = Cases::new();
    for name in ["none", "two", "ambiguous"] {
        cases.add(name);
    }
    assert_eq!(batch(&cases, |_| {}), (3, Exit::Good));
    let first = fs::read(cases.path("out/diagnoses.parquet")).unwrap();
    assert_eq!(batch(&cases, |_| {}), (0, Exit::Good));
    let again = fs::read(cases.path("out/diagnoses.parquet")).unwrap();
    assert!(first == again, "the table of what is kept is the table of what was made");
    assert_eq!(batch(&cases, |args| args.fresh = true), (3, Exit::Good));
    // Half a file, another version's file and none are not kept.
    let path = |case: &str| cases.path("out").join(case).join(DIAGNOSIS);
    write(&path("none"), "{\"version\": ");
    let text = fs::read_to_string(path("two")).unwrap();
    let version = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    write(&path("two"), &text.replace(&version, "\"version\": \"0.0.0\""));
    assert_eq!(batch(&cases, |_| {}), (2, Exit::Good));
    fs::remove_file(path("ambiguous")).unwrap();
    assert_eq!(batch(&cases, |_| {}), (1, Exit::Good));
    // And neither is what was held against another overlay.
    let model = Some(cases.path("model.toml"));
    assert_eq!(batch(&cases, |args| args.model = model), (3, Exit::Good));
}

#[test]
fn shards_make_tables_that_are_the_whole_together() {
    let cases = Cases::new();
    for name in ["none-1", "none-2", "two-1", "two-2", "ambiguous"] {
        cases.add(name);
    }
    let mut names = Vec::new();
    for index in ["1/2", "2/2"] {
        let shard = Some(super::super::batch::parse_shard(index).unwrap());
        batch(&cases, |args| args.shard = shard);
        let table = format!("out/diagnoses-{}.parquet", index.replace('/', "-of-"));
        let rows = super::parquet::read(&cases.path(&table));
        names.extend(rows.iter().map(|row| row["case"].as_str().unwrap().to_owned()));
    }
    names.sort();
    assert_eq!(names, ["ambiguous", "none-1", "none-2", "two-1", "two-2"]);
    assert_eq!(batch(&cases, |_| {}), (0, Exit::Good));
}

#[test]
fn the_table_holds_what_was_found() {
    let cases = Cases::new();
    for name in ["none", "two", "ambiguous"] {
        cases.add(name);
    }
    batch(&cases, |_| {});
    let rows = super::parquet::read(&cases.path("out/diagnoses.parquet"));
    let names: Vec<&Value> = rows.iter().map(|row| &row["case"]).collect();
    assert_eq!(names, ["ambiguous", "none", "two"]);
    let [ambiguous, none, two] = &rows[..] else { panic!("three rows") };
    assert_eq!(two["where"], "speed_actuation + sensing");
    assert_eq!(two["effects"], "count_loss + speed_gain");
    assert_eq!(two["probability"], 0.96);
    assert_eq!(two["before_m"], 0.198);
    assert_eq!(two["sensing_gap"], 0.031);
    assert_eq!(two["sensing_unit"], "rad/s");
    let parameters: Value = serde_json::from_str(two["parameters"].as_str().unwrap()).unwrap();
    assert_eq!(parameters[0]["parameters"]["wheel"]["value"], "rl");
    assert_eq!((&none["probability"], &none["removed"]), (&0.97.into(), &Value::Null));
    assert_eq!((&none["effects"], &none["where"]), (&"".into(), &Value::Null));
    assert_eq!(none["reference_gap"], Value::Null);
    assert_eq!(ambiguous["next"], "circle with steps of the speed, small and large");
    assert_eq!(ambiguous["probability"], 0.5);
}
