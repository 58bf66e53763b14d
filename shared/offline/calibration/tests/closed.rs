//! The paper's closed form: names, signs, sums and traps.

#![allow(clippy::expect_used)] // Helpers of tests are tests.

mod support;

use core::f64::consts::TAU;

use kerbside_calibration::{
    CalibrationError, Noise, Parameter, Run, Series, Settings, calibrate, closed_form,
};
use support::{Car, nominal};

/// Nothing errs but the counts, two hundred times finer than the paper's.
fn exact() -> Car {
    let mut car = Car::new(0.0, 0.0);
    (car.wheel, car.steering) = (0.0, 0.0);
    car
}

fn noise() -> Noise {
    let mut noise = Noise::of(&nominal());
    (noise.position, noise.yaw) = (1e-3, 1e-3);
    noise
}

#[test]
fn tables_1_and_2_come_out_with_their_names_and_signs() {
    let car = exact();
    let runs = [
        car.straight("straight", 20.0, 1),
        car.circle("left", 1.5, 3.0 * TAU, 2),
        car.circle("right", -1.5, 3.0 * TAU, 3),
    ];
    let form = closed_form(&runs, &nominal(), &noise());
    assert!(form.missing.is_empty(), "{:?}", form.missing);
    assert_eq!(form.straights, ["straight"]);
    assert_eq!(form.arcs, ["left", "right"]);
    // A count is 0.22 mm on 20 m.
    for (i, allowed) in [1.2e-6; 4].into_iter().chain([1e-4; 2]).enumerate() {
        let error = form.parameters.values[i] - car.truth.values[i];
        assert!(error.abs() < allowed, "{i}: {error}");
    }
    // Left minus right, both negative.
    assert!((form.parameters.epsilon(true) + 0.17e-3).abs() < 2e-6);
    assert!((form.parameters.epsilon(false) + 0.09e-3).abs() < 2e-6);
    // The smaller track is the front one.
    assert!(form.parameters.get(Parameter::TrackFront) < form.parameters.get(Parameter::TrackRear));
}

#[test]
fn the_front_track_is_the_same_at_two_radii() {
    let car = exact();
    let track = |radius: f64| {
        let runs = [
            car.straight("straight", 20.0, 1),
            car.circle("left", radius, 3.0 * TAU, 2),
            car.circle("right", -radius, 3.0 * TAU, 3),
        ];
        closed_form(&runs, &nominal(), &noise()).parameters.get(Parameter::TrackFront)
    };
    let (tight, wide) = (track(1.2), track(3.0));
    // Without the wheels' angles they would differ by 7 %.
    assert!((tight - wide).abs() < 2e-4, "{tight} {wide}");
}

/// Equations (10) and (12) with two numbers: R = S / sum of rotations, each wheel on its own.
#[test]
fn a_wheel_rolls_the_length_of_the_straight() {
    let t: Vec<f64> = (0..=100).map(f64::from).collect();
    let rolling =
        |whole: f64| Series { t: t.clone(), value: t.iter().map(|t| whole * t / 100.0).collect() };
    let run = Run {
        name: "tape".to_owned(),
        rotation: [None, None, Some(rolling(70.0)), Some(rolling(70.5))],
        distance: Some(5.0),
        ..Run::default()
    };
    let form = closed_form(&[run], &nominal(), &noise());
    assert!((form.parameters.values[2] - 5.0 / 70.0).abs() < 1e-12);
    assert!((form.parameters.values[3] - 5.0 / 70.5).abs() < 1e-12);
    assert_eq!(form.missing, [CalibrationError::NoArc]);
    assert!(!form.identified[Parameter::TrackRear.index()]);
}

/// Averages of epsilon over samples are biased by the counts' variance; sums are not.
#[test]
fn sums_do_not_have_the_bias_of_averages() {
    let car = exact();
    let run = car.straight("straight", 20.0, 4);
    let steps = |wheel: usize| -> Vec<f64> {
        let value = &run.rotation[wheel].as_ref().expect("a wheel").value;
        value.windows(2).map(|pair| pair[1] - pair[0]).collect()
    };
    let (left, right) = (steps(2), steps(3));
    let ratios: Vec<f64> =
        left.iter().zip(&right).filter(|(l, _)| **l != 0.0).map(|(l, r)| r / l - 1.0).collect();
    let averaged = 0.0696 * ratios.iter().sum::<f64>() / ratios.len() as f64;
    let summed = closed_form(&[run], &nominal(), &noise()).parameters.epsilon(false);
    assert!((summed + 0.09e-3).abs() < 2e-6, "{summed}");
    assert!((averaged + 0.09e-3).abs() > 10e-6, "{averaged}");
}

#[test]
fn reverse_runs_and_turned_headings_count_the_same() {
    let car = exact();
    let steering = (0.5_f64 / 1.5).atan();
    let runs = [
        car.drive("back", "straight", &[(0.0, -20.0)], 5),
        car.drive("left-back", "circle", &[(steering, -1.5 * 3.0 * TAU)], 6),
        car.drive("right-back", "circle", &[(-steering, -1.5 * 3.0 * TAU)], 7),
    ];
    let form = closed_form(&runs, &nominal(), &noise());
    for i in 0..6 {
        let error = form.parameters.values[i] - car.truth.values[i];
        assert!(error.abs() < if i < 4 { 1.2e-6 } else { 1e-4 }, "{i}: {error}");
    }
}

#[test]
fn the_joint_fit_takes_reversals_and_slaloms() {
    let mut car = Car::new(0.002, 0.002);
    car.truth.set(Parameter::SteeringZero, 0.003);
    let legs = [(0.3, 2.0), (-0.3, 3.0), (0.1, -2.0), (0.0, 2.0), (-0.2, -3.0), (0.3, 2.0)];
    let runs: Vec<Run> =
        (0..8).map(|i| car.drive(&format!("slalom-{i}"), "slalom", &legs, 30 + i)).collect();
    let settings = Settings { folds: 0, ..car.settings() };
    let found = calibrate(&runs, &nominal(), &settings).expect("a calibration");
    assert!(found.rejected.is_empty(), "{:?}", found.rejected);
    for i in 0..8 {
        let error = found.parameters.values[i] - car.truth.values[i];
        let deviation = found.covariance[(i, i)].sqrt();
        assert!(error.abs() < 4.0 * deviation, "{i}: {error} against {deviation}");
        assert!(found.information.identified[i], "{i}");
    }
}
