//! From a case folder to a case.

use std::f64::consts::TAU;

use kerbside_diagnosis::Wheels;
use kerbside_geometry::Pose;

use super::cases::{Cases, write};
use super::*;

/// Equal, where what is missing equals what is missing.
fn same<const N: usize>(found: &[[f64; N]], expected: &[[f64; N]]) {
    let near = |(a, b): (&f64, &f64)| a.is_nan() && b.is_nan() || (a - b).abs() < 1e-12;
    let row = |(a, b): (&[f64; N], &[f64; N])| a.iter().zip(b).all(near);
    assert!(
        found.len() == expected.len() && found.iter().zip(expected).all(row),
        "{found:?} is not {expected:?}"
    );
}

fn read(cases: &Cases, name: &str) -> Input {
    Input::read(&cases.path(name)).unwrap()
}

const NONE: f64 = f64::NAN;

#[test]
fn counts_become_rotations_over_wraps_and_missing_fields() {
    let cases = Cases::new();
    cases.add("car");
    let input = read(&cases, "car");
    let Wheels::Rotation(rotation) = &input.case.runs[0].wheels else { panic!("rotations") };
    assert_eq!(rotation.t, [0.0, 0.1, 0.2, 0.3, 0.4]);
    // rl: 250, 5, 105, 240: up by 11, 100 and -121 of 256; rr: 10, 250, 200: down by 16 and 50.
    let (rl, rr) = (TAU / 100.0, TAU / 200.0);
    let expected = [
        [NONE, NONE, 0.0, 0.0],
        [NONE, NONE, 11.0 * rl, NONE],
        [NONE, NONE, 111.0 * rl, -16.0 * rr],
        [NONE, NONE, -10.0 * rl, NONE],
        [NONE, NONE, NONE, -66.0 * rr],
    ];
    same(&rotation.value, &expected);
    let told = "counts of fl are not used: vehicle.toml has no counts_per_revolution of it";
    assert!(input.notices.iter().any(|notice| notice == told), "{:?}", input.notices);
}

#[test]
fn yaw_is_unwrapped_and_half_a_position_is_none() {
    let cases = Cases::new();
    cases.add("car");
    let input = read(&cases, "car");
    let reference = &input.case.runs[0].reference;
    assert_eq!(reference.t, [0.0, 0.2, 0.3, 0.4]);
    let expected = [[0.0, 0.0, 3.1], [0.2, 0.0, TAU - 3.1], [NONE, NONE, 3.0], [0.4, 0.1, NONE]];
    same(&reference.value, &expected);
}

#[test]
fn the_rest_of_a_run_is_taken_as_it_is() {
    let cases = Cases::new();
    cases.add("car");
    let input = read(&cases, "car");
    let (case, run) = (&input.case, &input.case.runs[0]);
    assert_eq!((case.name.as_str(), run.name.as_str()), ("car", "straight-1"));
    assert_eq!(run.repeat_of.as_deref(), Some("straight-0"));
    assert_eq!(run.start, Some(Pose::new(1.0, 2.0, 0.5)));
    let commands: Vec<_> = run.commands.iter().map(|c| (c.t, c.speed, c.steering)).collect();
    assert_eq!(commands, [(0.0, 0.0, 0.1), (0.1, 0.4, 0.1), (0.2, 0.4, 0.2)]);
    assert_eq!(
        (&run.steering.t[..], &run.steering.value[..]),
        (&[0.0, 0.2][..], &[[0.0], [0.1]][..])
    );
    // The vehicle has no gyro.
    assert!(run.gyro.is_empty());
    for told in ["imu.csv is not used: vehicle.toml has no [gyro]", "imu.csv: column ax not used"] {
        assert!(input.notices.iter().any(|notice| notice == told), "{:?}", input.notices);
    }
}

#[test]
fn what_a_car_in_good_order_may_differ_by_is_taken_or_is_not_there() {
    let cases = Cases::new();
    cases.add("car");
    let allowance = read(&cases, "car").case.allowance.unwrap();
    assert_eq!((allowance.fields["wheelbase"], allowance.fields["radius"]), (0.001, 0.0001));
    let key = ("speed_gain".to_owned(), "gain".to_owned());
    assert_eq!(allowance.effects[&key], 0.003);
    cases.forget_uncertainty("car");
    assert_eq!(read(&cases, "car").case.allowance, None);
}

#[test]
fn speeds_stand_in_where_no_count_can_be_used() {
    let cases = Cases::new();
    let run = cases.add("car").join("runs/straight-1");
    write(&run.join("wheels.csv"), "t,rl,rr\n0.0,0.1,\n0.1,,\n0.2,0.2,0.3\n");
    assert!(matches!(read(&cases, "car").case.runs[0].wheels, Wheels::Rotation(_)));
    std::fs::remove_file(run.join("encoders.csv")).unwrap();
    let input = read(&cases, "car");
    let Wheels::Speed(speeds) = &input.case.runs[0].wheels else { panic!("speeds") };
    assert_eq!(speeds.t, [0.0, 0.2]);
    same(&speeds.value, &[[NONE, NONE, 0.1, NONE], [NONE, NONE, 0.2, 0.3]]);
    // Counts of a wheel that nobody describes are of no use.
    std::fs::remove_file(run.join("wheels.csv")).unwrap();
    write(&run.join("encoders.csv"), "t,fl\n0.0,5\n0.1,6\n");
    let failure = Input::read(&cases.path("car")).unwrap_err();
    assert_eq!(failure.exit, Exit::Data);
    assert!(failure.report.to_string().contains("no wheel can be used"), "{}", failure.report);
}

/// Labels, withheld runs and whatever else lies beside are not looked at, be they readable or not.
#[test]
fn nothing_but_vehicle_and_runs_is_read() {
    let cases = Cases::new();
    let case = cases.add("car");
    let alone = read(&cases, "car");
    write(&case.join("label.toml"), "kind = \"single\"\u{0}not TOML = = =");
    write(&case.join("holdout/straight-2/run.toml"), "\u{0}");
    write(&case.join("holdout/straight-2/encoders.csv"), "t,rl\n1,1\n0,0\n");
    write(&case.join("diagnosis.json"), "{");
    write(&case.join("runs/straight-1/notes.csv"), "\u{0}");
    write(&case.join("runs/readme/README.md"), "no run");
    let among = read(&cases, "car");
    assert_eq!(format!("{:?}", among.case), format!("{:?}", alone.case));
    assert_eq!(among.notices, alone.notices);
    // And a folder in their place.
    std::fs::remove_file(case.join("label.toml")).unwrap();
    std::fs::create_dir(case.join("label.toml")).unwrap();
    std::fs::remove_dir_all(case.join("holdout")).unwrap();
    write(&case.join("holdout"), "a file");
    assert_eq!(format!("{:?}", read(&cases, "car").case), format!("{:?}", alone.case));
}

#[test]
fn a_broken_run_or_vehicle_is_refused_by_file_and_line() {
    let cases = Cases::new();
    let case = cases.add("car");
    let refused = |words: &[&str]| {
        let failure = Input::read(&case).unwrap_err();
        assert_eq!(failure.exit, Exit::Data);
        let refused = failure.report.downcast_ref::<crate::configuration::Refused>();
        let lines: Vec<String> = refused.iter().flat_map(|refused| refused.lines()).collect();
        let text = format!("{} {}", failure.report, lines.join(" "));
        words.iter().for_each(|word| assert!(text.contains(word), "{word:?} in {text}"));
    };
    write(&case.join("runs/straight-2/run.toml"), "name = \"straight-2\"\n");
    refused(&["straight-2", "neither encoders.csv nor wheels.csv"]);
    write(&case.join("runs/straight-2/encoders.csv"), "t,rl\n0.0,1\n0.1,x\n");
    refused(&["encoders.csv:3", "column rl", "\"x\""]);
    std::fs::remove_dir_all(case.join("runs/straight-2")).unwrap();
    write(&case.join("vehicle.toml"), "name = \"a\"\nwheelbase = -1.0\n");
    refused(&["vehicle.toml:2", "wheelbase = -1.0"]);
    std::fs::remove_file(case.join("vehicle.toml")).unwrap();
    refused(&["vehicle.toml"]);
    std::fs::remove_dir_all(case.join("runs")).unwrap();
    refused(&["no run in runs/"]);
}
