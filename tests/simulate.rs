//! `simulate`: predictions have the rows of what was recorded and begin where that begins, effects change what they say
//! they change, and what cannot be read is named.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod common_cli;

use std::fs;
use std::path::{Path, PathBuf};

use common::Sandbox;
use common_cli::{file, run};
use kerbside_geometry::angle;

const RUN: &str = "slalom-1";

/// A copy of the recorded case, to be changed.
fn case() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/cases/paper-1-6");
    fs::copy(from.join("vehicle.toml"), folder.path().join("vehicle.toml")).unwrap();
    let to = folder.path().join("runs").join(RUN);
    fs::create_dir_all(&to).unwrap();
    for entry in fs::read_dir(from.join("runs").join(RUN)).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
    }
    folder
}

fn recorded(case: &tempfile::TempDir, name: &str) -> PathBuf {
    case.path().join("runs").join(RUN).join(name)
}

/// The header, and the fields of each row; not a number where one is empty.
fn table(path: &Path) -> (String, Vec<Vec<f64>>) {
    let text = fs::read_to_string(path).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let field = |field: &str| if field.is_empty() { f64::NAN } else { field.parse().unwrap() };
    let rows = rows.lines().map(|line| line.split(',').map(field).collect());
    (header.to_owned(), rows.collect())
}

/// Predictions of the case, with what else is asked.
fn predict(
    sandbox: &Sandbox,
    case: &tempfile::TempDir,
    more: &[&str],
) -> (PathBuf, serde_json::Value) {
    let out = case.path().join(format!("out{}", more.len()));
    let (folder, to) = (case.path().to_str().unwrap(), out.to_str().unwrap());
    let said = run(sandbox, &[&["simulate", folder, "--out", to, "--json"], more].concat());
    assert_eq!(said.code, Some(0), "{said:?}");
    (out.join(RUN), said.json())
}

/// Largest distance of two tracks [m].
fn apart(one: &[Vec<f64>], other: &[Vec<f64>]) -> f64 {
    let far = one.iter().zip(other).map(|(a, b)| (a[1] - b[1]).hypot(a[2] - b[2]));
    far.fold(0.0, f64::max)
}

#[test]
fn predictions_have_the_rows_that_were_recorded_and_come_close_to_them() {
    let (sandbox, case) = (Sandbox::new(), case());
    // A field that was not read stays empty.
    let path = recorded(&case, "steering.csv");
    let text = fs::read_to_string(&path).unwrap();
    let (stamp, _) = text.lines().nth(3).unwrap().split_once(',').unwrap();
    let line = text.lines().nth(3).unwrap();
    fs::write(&path, text.replace(line, &format!("{stamp},"))).unwrap();
    let (out, told) = predict(&sandbox, &case, &[]);
    assert_eq!(told["runs"][0]["driven_by"], "commands");
    for name in ["encoders.csv", "steering.csv", "imu.csv", "reference.csv"] {
        let (header, rows) = table(&out.join(name));
        let (expected, measured) = table(&recorded(&case, name));
        assert_eq!((header, rows.len()), (expected, measured.len()), "{name}");
        for (row, measured) in rows.iter().zip(&measured) {
            assert_eq!(row[0], measured[0], "{name}");
            let gaps = |row: &[f64]| row.iter().map(|value| value.is_nan()).collect::<Vec<_>>();
            assert_eq!(gaps(row), gaps(measured), "{name}");
        }
    }
    let (_, counts) = table(&out.join("encoders.csv"));
    assert_eq!(counts[0], table(&recorded(&case, "encoders.csv")).1[0]);
    assert!(counts.last().unwrap()[1].fract() != 0.0, "counts keep their fractions");
    let (_, track) = table(&out.join("reference.csv"));
    let (_, measured) = table(&recorded(&case, "reference.csv"));
    assert!(apart(&track, &measured) < 0.05, "{}", apart(&track, &measured));
    // Without commands the measured motion drives the body, and leads there as well.
    fs::remove_file(recorded(&case, "commands.csv")).unwrap();
    fs::remove_dir_all(&out).unwrap();
    let (out, told) = predict(&sandbox, &case, &[]);
    assert_eq!(told["runs"][0]["driven_by"], "measured motion");
    let mut files: Vec<_> =
        fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    files.sort();
    assert_eq!(files, ["imu.csv", "reference.csv"]);
    let (_, followed) = table(&out.join("reference.csv"));
    assert!(apart(&followed, &measured) < 0.05, "{}", apart(&followed, &measured));
    // It knows how the rack stood: heading errs by the reference's noise and little more.
    let turned = |track: &[Vec<f64>]| {
        let errors = track.iter().zip(&measured).map(|(a, b)| angle::wrap(a[3] - b[3]).abs());
        errors.fold(0.0, f64::max)
    };
    assert!(turned(&followed) < 0.012 && turned(&track) > 0.02, "{}", turned(&followed));
}

#[test]
fn an_overlay_changes_what_its_effects_say_and_the_start_undoes_those_of_the_reference() {
    let (sandbox, case) = (Sandbox::new(), case());
    let (nominal, _) = predict(&sandbox, &case, &[]);
    let text = "[[effect]]\nid = \"gyro_bias\"\nbias = 0.02\n[[effect]]\nid = \"reference_marker\"\n\
                x = 0.05\ny = -0.03\nyaw = 0.1\n[[effect]]\nid = \"reference_scale\"\nscale = 1.03\n";
    let model = file(&sandbox, "model.toml", text);
    let (altered, told) = predict(&sandbox, &case, &["--model", model.to_str().unwrap()]);
    assert_eq!(told["effects"].as_array().unwrap().len(), 3);
    let both = |name: &str| (table(&nominal.join(name)).1, table(&altered.join(name)).1);
    let (before, after) = both("imu.csv");
    assert!(before.iter().zip(&after).all(|(b, a)| (a[1] - b[1] - 0.02).abs() < 1e-9));
    let (before, after) = both("encoders.csv");
    assert_eq!(before, after, "the vehicle drives as before");
    // The standing car is seen where it was seen.
    let (before, after) = both("reference.csv");
    assert!(apart(&before[..1], &after[..1]) < 1e-6 && apart(&before, &after) > 0.01);
}

#[test]
fn a_reference_without_yaw_gives_the_heading_of_the_first_motion() {
    let (sandbox, case) = (Sandbox::new(), case());
    let (_, with) = predict(&sandbox, &case, &[]);
    let path = recorded(&case, "reference.csv");
    let text = fs::read_to_string(&path).unwrap();
    let line = |line: &str| line.rsplit_once(',').unwrap().0.to_owned() + "\n";
    fs::write(&path, text.lines().map(line).collect::<String>()).unwrap();
    let (out, without) = predict(&sandbox, &case, &[]);
    let yaw = |told: &serde_json::Value| told["runs"][0]["start"]["yaw"].as_f64().unwrap();
    let error = angle::wrap(yaw(&with) - yaw(&without));
    assert!(error.abs() < 0.03, "{error}");
    assert!(without["runs"][0]["notes"].to_string().contains("no yaw"));
    assert_eq!(table(&out.join("reference.csv")).0, "t,x,y");
}

#[test]
fn what_cannot_be_read_is_named() {
    let (sandbox, case) = (Sandbox::new(), case());
    let folder = case.path().to_str().unwrap();
    let model = file(&sandbox, "model.toml", "[[effect]]\nid = \"drive_slip\"\nratio = 2.0\n");
    let said = run(&sandbox, &["simulate", folder, "--model", model.to_str().unwrap()]);
    said.refuses(78, &["model.toml:3", "ratio", "2.0", "-1 to 0.95"]);
    let said = run(&sandbox, &["simulate", folder, "--runs", "/nowhere"]);
    said.refuses(65, &["/nowhere", "there is no run"]);
    fs::remove_file(recorded(&case, "commands.csv")).unwrap();
    fs::remove_file(recorded(&case, "steering.csv")).unwrap();
    let path = recorded(&case, "encoders.csv");
    let one = |line: &str| line.split(',').take(2).collect::<Vec<_>>().join(",") + "\n";
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.lines().map(one).collect::<String>()).unwrap();
    let said = run(&sandbox, &["simulate", folder]);
    said.refuses(65, &[RUN, "no commands.csv", "steering.csv", "rear wheels"]);
}
