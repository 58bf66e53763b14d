//! Every model on circles and S curves, forward and in reverse, without noise.

mod support;

use kerbside_messages::OdometryModel as Model;
use kerbside_odometry::{EstimatorSettings, Filter, Sensors};
use support::{Car, Chain, fine_car, s_path, sensors};

const ALL: [bool; 4] = [true; 4];
const FRONT: [bool; 4] = [true, true, false, false];
const REAR: [bool; 4] = [false, false, true, true];
const FL: [bool; 4] = [true, false, false, false];
const FILTERS: [Filter; 4] = [Filter::Rear, Filter::Paper, Filter::PaperOwn, Filter::Fused];
const RR: [bool; 4] = [false, false, false, true];

/// Sensors, the model they give, and how far its end pose may be off \[m, rad\]: the gyro sees the
/// yaw rate at the readings alone and is off where it changes between them.
fn cases() -> Vec<(Sensors, Model, f64)> {
    vec![
        (sensors(ALL, true, false), Model::RearFront, 1e-6),
        (sensors(REAR, false, false), Model::Rear, 1e-6),
        (sensors(FRONT, true, false), Model::Front, 1e-6),
        (sensors(FL, true, false), Model::WheelSteering, 1e-6),
        (sensors(RR, true, false), Model::WheelSteering, 1e-6),
        (sensors(RR, false, true), Model::WheelGyro, 3e-3),
    ]
}

/// Drives `path` with every model; the end pose of each must be the truth.
fn drive(path: &[(f64, f64)], bits: u32) {
    for (filter, (sensors, model, bound)) in
        FILTERS.into_iter().flat_map(|filter| cases().into_iter().map(move |case| (filter, case)))
    {
        // The fused filter takes the steering angle between two readings for their mean; here it
        // changes at once.
        let bound = if filter == Filter::Fused { bound.max(1e-3) } else { bound };
        let vehicle = fine_car(bits);
        let settings = EstimatorSettings { filter, ..EstimatorSettings::default() };
        let mut chain = Chain::with(&vehicle, &sensors, &settings);
        let mut car = Car::new(vehicle).rolling(path[0].0, path[0].1);
        chain.feed(&car.raw());
        for (speed, angle) in path {
            car.roll(*speed, *angle);
            chain.feed(&car.raw());
        }
        assert_eq!(chain.odometry.model, model.code());
        assert_eq!((chain.odometry.gated, chain.odometry.unusable), (0, 0), "{model}");
        let error = chain.pose().distance(&car.truth);
        let turned = (chain.odometry.yaw - car.truth.yaw).abs();
        assert!(error < bound && turned < bound, "{filter:?} {model}: {error} m, {turned} rad");
    }
}

#[test]
fn circles_close_in_both_directions() {
    for angle in [-0.6_f64, -0.2, 0.05, 0.4] {
        let around = core::f64::consts::TAU * 0.5 / angle.tan().abs();
        for speed in [0.4, -0.4] {
            let samples = (around / 0.4 / 0.005).ceil() as usize;
            let mut path = vec![(0.0, angle)];
            path.extend(vec![(speed, angle); samples]);
            drive(&path, 48);
        }
    }
}

#[test]
fn s_curves_and_back() {
    let there = s_path(&fine_car(32), 0.3, 0.005);
    let back = there.iter().rev().map(|(speed, angle)| (-speed, *angle));
    let path: Vec<_> = there.iter().copied().chain(back).collect();
    drive(&there, 64);
    drive(&path, 27);
}

#[test]
fn the_sign_of_every_quantity() {
    let vehicle = fine_car(32);
    let mut chain = Chain::new(&vehicle, &EstimatorSettings::default());
    let mut car = Car::new(vehicle).rolling(-0.2, 0.3);
    chain.feed(&car.raw());
    for _ in 0..200 {
        car.roll(-0.2, 0.3);
        chain.feed(&car.raw());
    }
    let odometry = chain.odometry;
    assert!(odometry.x < -0.1, "backwards");
    assert!(odometry.yaw < -0.05, "steered left in reverse the nose turns right");
    assert!(odometry.y > 0.0, "and the tail swings to the left");
    assert!((odometry.speed + 0.2).abs() < 1e-6);
    assert!((odometry.yaw_rate - car.raw().yaw_rate).abs() < 1e-6);
    assert!((odometry.distance - 0.2).abs() < 1e-6);
    assert!((odometry.steering - 0.3).abs() < 1e-15);
}

#[test]
fn wheel_speeds_are_integrated() {
    let mut vehicle = fine_car(32);
    vehicle.encoders = None;
    let sensors = Sensors::of(&vehicle).with_speeds(ALL);
    let mut chain = Chain::with(&vehicle, &sensors, &EstimatorSettings::default());
    let mut car = Car::new(vehicle);
    chain.feed(&car.raw());
    for step in 0..400 {
        let angle = 0.4 * (f64::from(step) * 0.01).sin();
        car.roll(0.3 * (f64::from(step) / 399.0 * core::f64::consts::PI).sin(), angle);
        chain.feed(&car.raw());
    }
    let error = chain.pose().distance(&car.truth);
    assert_eq!(chain.odometry.model, Model::RearFront.code());
    assert!(error < 2e-3 && (chain.odometry.yaw - car.truth.yaw).abs() < 3e-3, "{error}");
}

#[test]
fn the_same_readings_give_the_same_bits() {
    let run = || {
        let vehicle = support::car();
        let mut chain = Chain::new(&vehicle, &support::placed());
        let path = s_path(&vehicle, 0.2, 0.005);
        let mut car = Car::new(vehicle).noisy(9, 0.001, 0.001, 0.0035);
        let mut odometries = Vec::new();
        for (speed, angle) in path {
            car.roll(speed, angle);
            chain.feed(&car.raw());
            odometries.push(chain.odometry);
        }
        odometries
    };
    let (one, other) = (run(), run());
    assert!(one.len() > 1000);
    for (left, right) in one.iter().zip(&other) {
        assert_eq!(format!("{left:?}"), format!("{right:?}"));
        assert_eq!(left.x.to_bits(), right.x.to_bits());
    }
}
