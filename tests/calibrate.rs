//! `calibrate`: what was put into a vehicle is found again within its intervals, and judged on runs that the fit has
//! not seen; bad input is named and never fitted. The vehicle is the proving ground's, which shares no code with what
//! calibrates it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod common_cli;

use std::f64::consts::TAU;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use common::Sandbox;
use common_cli::{Said, run};
use kerbside_geometry::{Pose, angle};
use kerbside_proving_ground::{
    Chassis, Manoeuvre, Pace, Physics, Recorded, Reference, Sensors, TestDrive,
};
use kerbside_recordings::run_folder::{self, CountRow, ReferenceRow, RunFile, SteeringRow, Table};
use kerbside_settings::{Value, load_vehicle};
use serde_json::Value as Json;
use tempfile::TempDir;

/// What the steering sensor reads while the wheels stand straight \[rad\].
const OFFSET: f64 = 0.0035;

/// The paper's car as measured by hand, with the noise that the proving ground has.
const VEHICLE: &str = r#"# The paper's car, by tape.
name = "by-tape"
wheelbase = 0.51   # between the hubs
track_front = 0.310
track_rear = 0.310
radius = { fl = 0.0725, fr = 0.0725, rl = 0.0725, rr = 0.0725 }   # 145 mm over all
drive = "rear"
[footprint]
length = 0.75
width = 0.37
rear_overhang = 0.13
[limits]
speed = 0.5
acceleration = 0.3
steering = 0.5236
steering_rate = 0.8
[encoders]
counts_per_revolution = { fl = 2000, fr = 2000, rl = 2000, rr = 2000 }
counter_bits = 32
noise_per_distance = 0.001
rate = 50.0
[steering_sensor]
noise = 0.0035   # data sheet
rate = 50.0
[reference]
noise = { position = 0.002, yaw = 0.002 }
rate = 50.0
marker = { x = 0.0, y = 0.0, yaw = 0.0 }
[uncertainty]
wheelbase = 0.01
"#;

/// Names, manoeuvres and recordings of the drives: straights, and circles to both sides.
static DRIVES: LazyLock<Vec<(String, &str, Recorded)>> = LazyLock::new(|| {
    let pace = Pace { speed: 0.4, acceleration: 0.3 };
    let mut sensors = Sensors::paper(1.0);
    sensors.reference = Some(Reference::fine());
    sensors.steering.as_mut().unwrap().offset = OFFSET;
    let drive =
        |manoeuvre| TestDrive::new(Chassis::paper(), Physics::NEUTRAL, sensors.clone(), manoeuvre);
    let kinds = [
        ("straight", drive(Manoeuvre::straight(4.0, pace))),
        ("left", drive(Manoeuvre::arc(1.2, TAU, true, pace))),
        ("right", drive(Manoeuvre::arc(-1.2, TAU, true, pace))),
    ];
    let mut drives = Vec::new();
    for (kind, (name, drive)) in kinds.iter().enumerate() {
        let driven = drive.driven();
        let manoeuvre = if kind == 0 { "straight" } else { "circle" };
        drives.extend((0..3).map(|k| {
            let seed = 10 * kind as u64 + k;
            (format!("{name}-{k}"), manoeuvre, driven.record(seed))
        }));
    }
    drives
});

/// A case in a folder of its own.
struct Case {
    folder: TempDir,
    sandbox: Sandbox,
}

/// How a run's truth is written down.
#[derive(Clone, Copy)]
enum Known {
    Reference,
    ByHand,
}

impl Case {
    /// The case of all drives, each changed by `change` before it is written.
    fn new(known: Known, change: impl Fn(&mut run_folder::Run)) -> Self {
        let case = Self { folder: tempfile::tempdir().unwrap(), sandbox: Sandbox::new() };
        fs::write(case.path("vehicle.toml"), VEHICLE).unwrap();
        for (name, manoeuvre, recorded) in DRIVES.iter() {
            let mut run = written(name, manoeuvre, recorded, known);
            change(&mut run);
            run.write(&case.path("runs").join(name)).unwrap();
        }
        case
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Calibrates into the folder `out` of the case.
    fn calibrate(&self, more: &[&str]) -> Said {
        let (case, out) = (self.folder.path().to_owned(), self.path("out"));
        let arguments = ["calibrate", text(&case), "--out", text(&out)];
        run(&self.sandbox, &[&arguments, more].concat())
    }

    fn calibrated(&self, more: &[&str]) -> Json {
        let said = self.calibrate(&[&["--json"], more].concat());
        assert_eq!(said.code, Some(0), "{said:?}");
        let json = said.json();
        assert_eq!(json["passed"], true, "{json}");
        json
    }
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn written(name: &str, manoeuvre: &str, recorded: &Recorded, known: Known) -> run_folder::Run {
    let counts = recorded.counts.iter().map(|row| CountRow {
        t: row.time,
        counts: row.value.map(Option::unwrap),
        mask: 0b1111,
    });
    let steering =
        recorded.steering.iter().map(|row| SteeringRow { t: row.time, angle: Some(row.value) });
    let reference = recorded.reference.iter().map(|row| {
        let Pose { x, y, yaw } = row.value;
        ReferenceRow { t: row.time, x: Some(x), y: Some(y), yaw: Some(angle::wrap(yaw)) }
    });
    let mut info = format!("name = \"{name}\"\nmanoeuvre = \"{manoeuvre}\"\n");
    let end = recorded.truth.last().unwrap().pose.seen_from(&recorded.truth[0].pose);
    if let Known::ByHand = known {
        // A tape is read to the millimetre, an angle to the milliradian.
        let [x, y, yaw] = [end.x, end.y, angle::wrap(end.yaw)].map(|v| (v * 1e3).round() * 1e-3);
        info.push_str(&format!("end_pose = [{x:?}, {y:?}, {yaw:?}]\n"));
    }
    let with_reference = matches!(known, Known::Reference);
    run_folder::Run {
        about: RunFile::parse(Path::new("run.toml"), info).unwrap(),
        encoders: Some(Table::new(counts.collect(), 0b1111)),
        wheels: None,
        steering: Some(Table::new(steering.collect(), 1)),
        gyro: None,
        commands: None,
        reference: with_reference.then(|| Table::new(reference.collect(), 0b111)),
    }
}

/// What is true of the vehicle, by the keys of its file.
fn truth() -> Vec<(&'static str, f64)> {
    let car = Chassis::paper();
    let [fl, fr, rl, rr] = car.radius;
    vec![
        ("radius.fl", fl),
        ("radius.fr", fr),
        ("radius.rl", rl),
        ("radius.rr", rr),
        ("track_front", car.track_front),
        ("track_rear", car.track_rear),
        ("wheelbase", car.wheelbase),
        ("steering_sensor.offset", OFFSET),
    ]
}

/// Every parameter is identified, and no farther from the truth than so many standard deviations.
fn holds_the_truth(json: &Json, deviations: f64) {
    for (name, truth) in truth() {
        let found = &json["parameters"][name];
        let number = |key: &str| found[key].as_f64().unwrap_or_else(|| panic!("{name}: {found}"));
        assert_eq!(found["identified"], true, "{name}: {found}");
        let off = (number("value") - truth).abs();
        assert!(off <= deviations * number("deviation"), "{name}: {found}, true {truth}");
        assert!(number("low") < number("value") && number("value") < number("high"));
    }
}

fn rms(json: &Json, side: &str) -> f64 {
    json["left_out"][side]["position_rms_m"].as_f64().unwrap()
}

#[test]
fn what_was_put_in_is_found_within_its_intervals_and_loads_again() {
    let case = Case::new(Known::Reference, |_| {});
    let json = case.calibrated(&[]);
    holds_the_truth(&json, 3.0);
    for key in ["method", "left_out", "rejected", "missing", "vehicle", "report", "figures"] {
        assert!(json.get(key).is_some(), "{key} is missing: {json}");
    }
    assert_eq!((&json["method"], &json["seed"]), (&"joint".into(), &Json::Null));
    assert_eq!(json["left_out"]["runs"].as_array().unwrap().len(), 3 * DRIVES.len());
    assert!(rms(&json, "after") < 0.25 * rms(&json, "before"), "{}", json["left_out"]);
    let drift = &json["drift"]["medians"];
    let percent = |side: &str| drift[side]["position_percent"].as_f64().unwrap();
    assert!(percent("after") < 0.5 * percent("before"), "{drift}");
    assert!(percent("after") < 1.5 * percent("floor") + 0.5, "{drift}");
    assert_eq!(drift["position_reached"], true);
    assert_eq!(json["drift"]["runs"].as_array().unwrap().len(), DRIVES.len());
    loads_again(&case, &json);
    drifts_less(&case, &json);
    let report = fs::read_to_string(json["report"].as_str().unwrap()).unwrap();
    for words in ["Calibration report", "straight-0, before", "left-0, after", "track_front"] {
        assert!(report.contains(words), "{words:?} is missing");
    }
}

/// The written file is the input's text with other values, and says where they come from.
fn loads_again(case: &Case, json: &Json) {
    let path = PathBuf::from(json["vehicle"].as_str().unwrap());
    assert_eq!(path, case.path("out/vehicle.toml"));
    let written = fs::read_to_string(&path).unwrap();
    for kept in
        ["# The paper's car, by tape.", "# between the hubs", "# 145 mm over all", "# data sheet"]
    {
        assert!(written.contains(kept), "{kept:?} is lost:\n{written}");
    }
    let file = load_vehicle(&path).unwrap();
    assert!(file.warnings.is_empty(), "{:?}", file.warnings);
    let (vehicle, found) = (&file.value.vehicle, &json["parameters"]);
    let near = |value: f64, name: &str| {
        let (expected, deviation) = (&found[name]["value"], &found[name]["deviation"]);
        let off = (value - expected.as_f64().unwrap()).abs();
        assert!(off < 0.01 * deviation.as_f64().unwrap(), "{name}: {value}, {expected}");
    };
    near(vehicle.radius[2], "radius.rl");
    near(vehicle.track_front, "track_front");
    near(vehicle.wheelbase, "wheelbase");
    near(vehicle.steering_sensor.unwrap().offset, "steering_sensor.offset");
    let stated = file.value.uncertainty.field("wheelbase");
    let deviation = found["wheelbase"]["deviation"].as_f64().unwrap();
    assert!(file.value.uncertainty.effect("steering_sensor_offset", "offset") > 0.0);
    let calibration = file.value.calibration.unwrap();
    assert_eq!((calibration.method.as_str(), calibration.runs.len()), ("joint", DRIVES.len()));
    let variance = calibration.covariance_of("wheelbase", "wheelbase").unwrap();
    assert!((variance.sqrt() / deviation - 1.0).abs() < 1e-3, "{variance}");
    // What differs from drive to drive is stated with it.
    let in_use = calibration.covariance_in_use("wheelbase", "wheelbase").unwrap().sqrt();
    assert!(in_use >= deviation && (stated / in_use - 1.0).abs() < 0.01, "{stated}, {in_use}");
    assert!(matches!(calibration.residuals.get("runs"), Some(Value::Table(_))));
    let said = run(
        &case.sandbox,
        &["calibrate", text(case.folder.path()), "--out", text(&case.path("out"))],
    );
    assert_eq!(said.code, Some(0), "{said:?}");
    let tables = said.stdout.lines().filter(|line| line.starts_with([' ', '─', '═']));
    tables.for_each(|line| assert!(line.chars().count() <= 80, "{line}"));
}

/// The calibrated file does better than the tape in what else reads it.
fn drifts_less(case: &Case, json: &Json) {
    let drift = |vehicle: &str| {
        let drive = case.path("runs/left-0");
        let out = case.path("replay");
        let options = ["--pure", "--json", "--vehicle", vehicle, "--out", text(&out)];
        let said = run(&case.sandbox, &[&["replay", text(&drive)], &options[..]].concat());
        assert_eq!(said.code, Some(0), "{said:?}");
        said.json()["drift"]["heading_rad_per_m"].as_f64().unwrap()
    };
    let (before, after) =
        (drift(text(&case.path("vehicle.toml"))), drift(json["vehicle"].as_str().unwrap()));
    assert!(after < 0.5 * before, "{before} rad/m by tape, {after} calibrated");
}

#[test]
fn end_poses_measured_by_hand_are_enough() {
    let case = Case::new(Known::ByHand, |_| {});
    let json = case.calibrated(&[]);
    holds_the_truth(&json, 3.0);
    assert!(rms(&json, "after") < 0.25 * rms(&json, "before"), "{}", json["left_out"]);
}

#[test]
fn a_fit_of_some_runs_is_judged_on_the_others() {
    let case = Case::new(Known::Reference, |_| {});
    let chosen = case.calibrated(&["--runs", "straight-0", "straight-1,left-0", "right-0"]);
    assert_eq!(chosen["runs"].as_array().unwrap().len(), 4);
    assert_eq!(chosen["left_out"]["basis"], "runs left out by name");
    assert_eq!(chosen["left_out"]["runs"].as_array().unwrap().len(), 3 * 5, "{chosen}");
    assert!(rms(&chosen, "after") < 0.25 * rms(&chosen, "before"), "{}", chosen["left_out"]);
    let left = case.calibrated(&["--leave-out", "right-2", "--method", "closed-form"]);
    assert_eq!(left["method"], "closed-form");
    assert_eq!(
        left["parameters"]["radius.rl"]["low"],
        Json::Null,
        "the closed form has no interval"
    );
    assert_eq!(left["left_out"]["runs"].as_array().unwrap().len(), 3);
    let missing = left["missing"].to_string();
    assert!(missing.contains("wheelbase") && missing.contains("joint method"), "{missing}");
    case.calibrate(&["--runs", "nobody"]).refuses(2, &["no run is named nobody", "straight-0"]);
}

#[test]
fn what_runs_do_not_tell_is_named_with_the_manoeuvre_that_would() {
    let case = Case::new(Known::Reference, |_| {});
    // Whether half a calibration ends nearer to the truth is chance.
    let json = case.calibrate(&["--json", "--runs", "straight-0", "straight-1"]).json();
    assert_eq!(json["parameters"]["track_rear"]["identified"], false, "{}", json["parameters"]);
    let missing = json["missing"].as_array().unwrap();
    let of = missing.iter().find(|missing| missing["parameter"] == "track_rear").unwrap();
    assert!(of["manoeuvre"].as_str().unwrap().contains("circles"), "{of}");
    // What is not identified stays as it was, and is not said to be calibrated.
    let file = load_vehicle(&case.path("out/vehicle.toml")).unwrap().value;
    assert_eq!((file.vehicle.track_rear, file.vehicle.wheelbase), (0.31, 0.51));
    assert!(file.vehicle.radius[2] < 0.07);
    let calibrated = file.calibration.unwrap().parameters;
    assert!(!calibrated.contains(&"track_rear".to_owned()), "{calibrated:?}");
}

#[test]
fn the_gain_is_found_where_it_is_asked_for() {
    let case = Case::new(Known::Reference, |_| {});
    let json = case.calibrated(&["--free-gain"]);
    holds_the_truth(&json, 3.0);
    let gain = &json["parameters"]["steering_sensor.gain"];
    let number = |key: &str| gain[key].as_f64().unwrap();
    assert!((number("value") - 1.0).abs() < 3.0 * number("deviation"), "{gain}");
    let sensor =
        load_vehicle(&case.path("out/vehicle.toml")).unwrap().value.vehicle.steering_sensor;
    assert!((sensor.unwrap().gain - number("value")).abs() < 1e-4, "{sensor:?}");
}

/// A wheel that counts backwards.
fn reverse(run: &mut run_folder::Run, wheel: usize) {
    for row in &mut run.encoders.as_mut().unwrap().rows {
        row.counts[wheel] = -row.counts[wheel];
    }
}

#[test]
fn a_bad_run_is_rejected_by_name_and_bad_runs_alone_are_refused() {
    let one = Case::new(Known::Reference, |run| {
        if run.about.info.name == "left-1" {
            reverse(run, 3);
        }
    });
    let json = one.calibrated(&[]);
    let rejected = json["rejected"].as_array().unwrap();
    assert_eq!((rejected.len(), &rejected[0]["run"]), (1, &"left-1".into()), "{rejected:?}");
    assert!(rejected[0]["why"].as_str().unwrap().contains("counts backwards"), "{rejected:?}");
    holds_the_truth(&json, 3.0);
    drop(one);

    let all = Case::new(Known::Reference, |run| reverse(run, 2));
    for method in ["joint", "closed-form"] {
        let said = all.calibrate(&["--method", method]);
        said.refuses(65, &["run left-0", "run straight-2", "wheel rl counts backwards"]);
        assert!(!all.path("out").exists(), "nothing is written");
    }
}

#[test]
fn input_that_is_not_as_the_format_says_is_refused_by_file_and_line() {
    let case = Case::new(Known::Reference, |_| {});
    let edit = |file: &str, from: &str, to: &str| {
        let path = case.path(file);
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{file}: no {from}");
        fs::write(&path, text.replacen(from, to, 1)).unwrap();
    };
    let file = "runs/left-0/reference.csv";
    edit(file, "\n0.02,", "\n0.02,nan,0.0,0.0\n0.021,");
    case.calibrate(&[]).refuses(65, &["reference.csv:3", "nan"]);
    edit(file, "\n0.02,nan,0.0,0.0", "");
    edit("vehicle.toml", "track_rear", "track_raer");
    case.calibrate(&[]).refuses(78, &["vehicle.toml:5", "track_raer"]);
    let json = case.calibrate(&["--json"]).json();
    assert_eq!((&json["passed"], &json["exit"]), (&false.into(), &78.into()));
    let empty = case.path("empty");
    fs::create_dir(&empty).unwrap();
    run(&case.sandbox, &["calibrate", text(&empty)]).refuses(65, &["there is no run in runs/"]);
}
