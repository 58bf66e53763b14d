//! `trial` with real processes: a few short cases from the sealing to the score, and again from what is kept.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn trial(out: &Path, more: &[&str]) -> Output {
    let words = ["trial", "--cases", "4", "--seed", "2", "--duration", "6", "--plant", "simulator"];
    Command::new(env!("CARGO_BIN_EXE_kerbside"))
        .args(words)
        .arg("--out")
        .arg(out)
        .args(more)
        .output()
        .expect("it starts")
}

#[test]
fn a_small_trial_is_sealed_diagnosed_opened_and_scored() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("trial");
    let first = trial(&out, &["--json"]);
    let errors = String::from_utf8_lossy(&first.stderr).into_owned();
    assert!(matches!(first.status.code(), Some(0 | 1)), "{errors}");
    let document: Value = serde_json::from_slice(&first.stdout).expect("one object");
    let root = document["commitment"].as_str().unwrap().to_owned();
    let at = errors.find(&root).expect("the commitment is told while the labels are sealed");
    assert!(errors[..at].contains("sealed"), "{errors}");
    let published = std::fs::read_to_string(out.join("commitments.txt")).unwrap();
    assert!(published.lines().last().unwrap().starts_with(&root));
    let rows = document["rows"].as_array().unwrap();
    assert_eq!(document["cases"], rows.len());
    assert!(!rows.is_empty());
    for row in rows {
        let name = row["case"].as_str().unwrap();
        assert!(row["verdict"].is_string(), "{row}: the diagnosis ran");
        let label =
            std::fs::read_to_string(out.join("opened").join(name).join("label.toml")).unwrap();
        assert!(label.contains(row["kind"].as_str().unwrap()));
        let size = row["size"].as_f64();
        assert!(row["kind"] == "null" || size.is_some_and(|size| size > 0.0), "{row}");
    }
    for figure in document["figures"].as_array().unwrap() {
        assert!(figure["name"].is_string() && figure["passed"].is_boolean(), "{figure}");
    }

    // Nothing is diagnosed again, and the result is the same.
    let answer = out.join("diagnoses/case0001/diagnosis.json");
    let before = std::fs::metadata(&answer).unwrap().modified().unwrap();
    let again = trial(&out, &["--json"]);
    assert_eq!(before, std::fs::metadata(&answer).unwrap().modified().unwrap());
    let again: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(again, document);

    let people = trial(&out, &[]);
    let text = String::from_utf8_lossy(&people.stdout);
    let widest = text.lines().map(|line| line.chars().count()).max().unwrap();
    assert!(text.contains("single effects, by size d") && text.contains(&root));
    let long: Vec<&str> = text.lines().filter(|line| line.chars().count() > 80).collect();
    let paths_alone = long.iter().all(|line| line.starts_with("answers"));
    assert!(paths_alone, "{widest} columns: {long:?}");
}
