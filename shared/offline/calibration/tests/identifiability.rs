//! Which parameters sets of runs identify.

#![allow(clippy::expect_used)] // Helpers of tests are tests.

mod support;

use core::f64::consts::TAU;

use kerbside_calibration::{Calibrated, Parameter, Run, Settings, calibrate};
use kerbside_geometry::Pose;
use support::{Car, nominal};

fn fine() -> Car {
    Car::new(0.002, 0.002)
}

fn calibrated(car: &Car, runs: &[Run]) -> Calibrated {
    calibrate(runs, &nominal(), &Settings { folds: 0, ..car.settings() }).expect("a calibration")
}

fn names(found: &Calibrated) -> Vec<&'static str> {
    let open = found.estimates.iter().filter(|estimate| !estimate.identified);
    open.map(|estimate| estimate.parameter.name()).collect()
}

fn needs(found: &Calibrated, parameter: Parameter) -> &str {
    let missing = found.missing.iter().find(|missing| missing.parameter == parameter);
    missing.map_or("", |missing| &missing.needs)
}

fn straights(car: &Car, count: u64) -> Vec<Run> {
    (0..count).map(|i| car.straight(&format!("straight-{i}"), 5.0, 60 + i)).collect()
}

fn circles(car: &Car, radii: &[f64]) -> Vec<Run> {
    let name = |i: usize| format!("circle-{i}");
    let drive = |(i, radius): (usize, &f64)| car.circle(&name(i), *radius, TAU, 80 + i as u64);
    radii.iter().enumerate().map(drive).collect()
}

#[test]
fn straights_with_poses_leave_tracks_and_wheelbase_open() {
    let car = fine();
    let found = calibrated(&car, &straights(&car, 4));
    assert_eq!(names(&found), ["track_front", "track_rear", "wheelbase"]);
    for parameter in [Parameter::TrackFront, Parameter::TrackRear, Parameter::Wheelbase] {
        assert!(needs(&found, parameter).contains("full circles"), "{:?}", found.missing);
    }
    // What is open stays where it was believed to be.
    assert!((found.parameters.get(Parameter::TrackRear) - 0.31).abs() < 0.02);
}

#[test]
fn a_straight_is_not_named_for_the_wheelbase_of_faint_bends() {
    let mut car = fine();
    car.reference = (0.05, 0.01);
    for (radius, turn) in [(100.0, 0.1), (60.0, 0.2), (40.0, 0.25)] {
        let found = calibrated(&car, &[car.circle("bend", radius, turn, 7)]);
        let estimate = found.estimate(Parameter::Wheelbase).expect("a wheelbase");
        let needed = needs(&found, Parameter::Wheelbase);
        assert!(estimate.identified || needed.contains("circles"), "{radius} m: {needed}");
    }
}

#[test]
fn arcs_alone_leave_the_scale_open_and_give_ratios() {
    let mut car = fine();
    car.reference = (0.05, 0.002);
    let mut runs = circles(&car, &[1.5, -1.5, 1.5, -1.5]);
    // Only headings: where the positions would give the scale away.
    for run in &mut runs {
        run.reference.clear();
        run.end_pose = None;
        run.net_turn = Some(TAU * if run.name.ends_with(['0', '2']) { 1.0 } else { -1.0 });
    }
    let found = calibrated(&car, &runs);
    let open = names(&found);
    for name in ["radius.fl", "radius.fr", "radius.rl", "radius.rr", "track_front", "track_rear"] {
        assert!(open.contains(&name), "{open:?}");
    }
    assert!(needs(&found, Parameter::RadiusRearLeft).contains("straight"), "{:?}", found.missing);
    let ratio = |name: &str| *found.derived.iter().find(|d| d.name == name).expect("a ratio");
    let truth = &car.truth.values;
    for (name, value) in [
        ("radius rl / rr", truth[2] / truth[3]),
        ("track rear / radius rl", truth[5] / truth[2]),
        ("wheelbase / radius rl", truth[6] / truth[2]),
    ] {
        let found = ratio(name);
        assert!(found.deviation < 0.01 * value, "{found:?}");
        assert!((found.value - value).abs() < 5.0 * found.deviation, "{found:?} {value}");
    }
}

#[test]
fn straights_and_circles_to_both_sides_give_all() {
    let car = fine();
    let runs = [straights(&car, 3), circles(&car, &[1.5, -1.5])].concat();
    let found = calibrated(&car, &runs);
    assert_eq!(names(&found), [""; 0]);
    assert!(found.missing.is_empty(), "{:?}", found.missing);
}

#[test]
fn without_steering_sensor_the_front_wheels_longer_way_gives_the_wheelbase() {
    let mut car = fine();
    car.has_steering = false;
    let runs = [straights(&car, 5), circles(&car, &[1.5, -1.5, 1.5, -1.5])].concat();
    let found = calibrated(&car, &runs);
    let wheelbase = found.estimate(Parameter::Wheelbase).expect("a wheelbase");
    assert!(wheelbase.identified && wheelbase.deviation > 0.5e-3, "{wheelbase:?}");
    assert!(found.estimate(Parameter::SteeringZero).is_none());
    assert_eq!(needs(&found, Parameter::SteeringZero), "a steering sensor");
    for i in 0..7 {
        let error = found.parameters.values[i] - car.truth.values[i];
        let deviation = found.covariance[(i, i)].sqrt();
        assert!(error.abs() < 4.5 * deviation, "{i}: {error} against {deviation}");
    }
}

#[test]
fn a_gain_that_is_freed_is_found_beside_the_wheelbase_where_positions_tell_the_radius() {
    let mut car = fine();
    car.truth.set(Parameter::SteeringGain, 1.03);
    let runs = [straights(&car, 3), circles(&car, &[1.5, -1.5, 3.0, -3.0])].concat();
    let settings = Settings { folds: 0, free_gain: true, ..car.settings() };
    let found = calibrate(&runs, &nominal(), &settings).expect("a calibration");
    for parameter in [Parameter::SteeringGain, Parameter::Wheelbase] {
        let estimate = found.estimate(parameter).expect("an estimate");
        let error = estimate.value - car.truth.get(parameter);
        assert!(!estimate.identified || error.abs() < 4.5 * estimate.deviation, "{estimate:?}");
    }
}

#[test]
fn rear_wheels_alone_and_one_wheel_with_steering_do() {
    let mut car = fine();
    car.has_steering = false;
    car.wheels = [false, false, true, true];
    let runs = [straights(&car, 3), circles(&car, &[1.5, -1.5])].concat();
    let found = calibrated(&car, &runs);
    let asked: Vec<_> = found.estimates.iter().map(|e| e.parameter.name()).collect();
    assert_eq!(asked, ["radius.rl", "radius.rr", "track_rear"]);
    assert_eq!(names(&found), [""; 0]);
    assert!((found.parameters.get(Parameter::TrackRear) - 0.292).abs() < 2e-3);
    assert!(needs(&found, Parameter::TrackFront).contains("front"), "{:?}", found.missing);

    let mut car = fine();
    car.wheels = [false, true, false, false];
    let runs = [straights(&car, 3), circles(&car, &[1.5, -1.5])].concat();
    let found = calibrated(&car, &runs);
    assert!((found.parameters.values[1] - car.truth.values[1]).abs() < 2e-4);
}

#[test]
fn a_tape_and_a_hand_measured_end_pose_are_enough_to_start() {
    let car = fine();
    let mut runs = [straights(&car, 4), circles(&car, &[1.5, -1.5, 1.5, -1.5])].concat();
    for run in &mut runs {
        let (first, last) = (run.reference[0], run.reference[1]);
        let pose =
            |r: kerbside_calibration::ReferencePose| Pose::new(r.x, r.y, r.yaw.expect("a heading"));
        run.end_pose = Some(pose(last).seen_from(&pose(first)));
        run.reference.clear();
        if run.manoeuvre == "straight" {
            run.distance = Some(5.0);
        }
    }
    let found = calibrated(&car, &runs);
    assert_eq!(names(&found), [""; 0]);
    for i in 0..8 {
        let error = found.parameters.values[i] - car.truth.values[i];
        let deviation = found.covariance[(i, i)].sqrt();
        assert!(error.abs() < 4.5 * deviation, "{i}: {error} against {deviation}");
    }
}

#[test]
fn a_guide_rail_fixes_epsilon_whatever_the_reference() {
    let car = Car::new(0.05, 0.087);
    let mut runs = straights(&car, 10);
    let epsilon = |found: &Calibrated| {
        found.derived.iter().find(|d| d.name == "epsilon rear").expect("an epsilon").deviation
    };
    let free = epsilon(&calibrated(&car, &runs));
    runs.iter_mut().for_each(|run| run.net_turn = Some(0.0));
    let guided = epsilon(&calibrated(&car, &runs));
    assert!(free > 100e-6 || guided < 0.5 * free, "{free} {guided}");
    assert!(guided < 25e-6, "{guided}");
}
