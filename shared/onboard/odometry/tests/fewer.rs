//! The fused filter with fewer measurements, and with other vehicles.

#![allow(clippy::unwrap_used)] // Helpers of tests are tests.

mod support;

use core::f64::consts::FRAC_PI_2;

use kerbside_geometry::{Pose, Vehicle};
use kerbside_messages::{
    EstimatorState, FilterKind, Header, Odometry, OdometryModel, Travel, WheelStatus, WheelUse,
};
use kerbside_odometry::{Estimator, EstimatorInputs, Parameter, Sensors};
use support::{Car, Chain, car, fine_car, placed, sensors};

/// Rolls the wheels of `sensors` by `step` \[m\] a reading.
fn turn(vehicle: &Vehicle, sensors: &Sensors, step: [f64; 4], angle: f64) -> Odometry {
    let mut estimator = Estimator::with_sensors(vehicle, sensors, &placed()).unwrap();
    let mut out = Odometry::default();
    let mut travel = Travel { counter_epoch: 1, steering: angle, ..Travel::default() };
    let (read, absent) = (WheelStatus::Valid.code(), WheelStatus::Absent.code());
    travel.status = sensors.wheels.map(|there| if there { read } else { absent });
    (travel.has_steering, travel.steering_is_new) = (1, 1);
    for reading in 0..=400_u32 {
        travel.header = Header::stamped(1_000_000_000 + u64::from(reading) * 5_000_000, 0);
        travel.travel = step.map(|step| step * f64::from(reading));
        let inputs = EstimatorInputs { travel: &travel, missing: 0, fix: None, restore: None };
        estimator.step(inputs, &mut out);
    }
    out
}

#[test]
fn a_front_wheel_at_a_quarter_turn_turns_the_vehicle_on_the_spot() {
    let mut vehicle = fine_car(32);
    (vehicle.track_front, vehicle.limits.steering) = (0.0, 1.6);
    let fl = sensors([true, false, false, false], true, false);
    for (angle, sign) in [(FRAC_PI_2, 1.0), (-FRAC_PI_2, -1.0)] {
        for step in [1e-3, -1e-3] {
            let out = turn(&vehicle, &fl, [step, 0.0, 0.0, 0.0], angle);
            let turned = sign * step * 400.0 / vehicle.wheelbase;
            assert!(out.x.hypot(out.y) < 1e-9, "{} {}", out.x, out.y);
            assert!((out.yaw - turned).abs() < 1e-9, "{} {turned}", out.yaw);
            assert!(out.covariance.iter().all(|entry| entry.is_finite()));
        }
    }
    let all = sensors([true, false, true, true], true, false);
    let half = 0.5 * vehicle.track_rear / vehicle.wheelbase * 1e-3;
    let out = turn(&vehicle, &all, [1e-3, 0.0, -half, half], FRAC_PI_2);
    assert!(out.x.hypot(out.y) < 1e-9, "{} {}", out.x, out.y);
    assert!((out.yaw - 0.4 / vehicle.wheelbase).abs() < 1e-9, "{}", out.yaw);
    assert_eq!(out.wheel_use[..3], [1, 0, 1]);
}

#[test]
fn two_driven_wheels_and_nothing_else_are_a_differential_drive() {
    let vehicle = fine_car(32);
    let rear = sensors([false, false, true, true], false, false);
    let out = turn(&vehicle, &rear, [0.0, 0.0, -1e-3, 1e-3], 0.0);
    assert!(out.x.hypot(out.y) < 1e-9);
    assert!((out.yaw - 0.8 / vehicle.track_rear).abs() < 1e-9, "{}", out.yaw);
    let out = turn(&vehicle, &rear, [0.0, 0.0, 1e-3, 1e-3], 0.0);
    assert!((out.x - 0.4).abs() < 1e-9 && out.y.abs() < 1e-9);
    assert_eq!(out.model, OdometryModel::Rear.code());
    assert_eq!(out.filter, FilterKind::Fused.code());
}

#[test]
fn every_set_of_sensors_has_a_covariance_that_is_one() {
    let all = [true; 4];
    let (front, rear) = ([true, true, false, false], [false, false, true, true]);
    for sensors in [
        sensors(all, true, true),
        sensors(all, false, false),
        sensors(all, false, true),
        sensors([true, false, true, true], true, false),
        sensors(front, true, false),
        sensors(rear, true, false),
        sensors([false, false, false, true], true, false),
        sensors([false, false, false, true], false, true),
    ] {
        let vehicle = car();
        let mut chain = Chain::with(&vehicle, &sensors, &placed());
        let mut car = Car::new(vehicle).noisy(5, 0.001, 0.001, 0.0035);
        for period in 0..1500 {
            let speed = if period / 400 % 2 == 0 { 0.2 } else { -0.2 };
            car.roll(speed, 0.4 * (f64::from(period) * 0.004).sin());
            chain.feed(&car.raw());
            let matrix = nalgebra::Matrix3::from_row_slice(&chain.odometry.covariance);
            assert!(matrix.symmetric_eigenvalues().min() >= -1e-15, "{sensors:?} {period}");
        }
        let error = chain.pose().distance(&car.truth);
        assert!(error < 0.03, "{sensors:?}: {error}");
        let spread = chain.estimator.parameters().unwrap().covariance;
        assert!(spread.symmetric_eigenvalues().min() > 0.0, "{sensors:?}");
        assert!((spread - spread.transpose()).abs().max() < 1e-18);
    }
}

#[test]
fn a_wheel_that_is_not_read_any_more_is_done_without() {
    for mask in [0b1110, 0b1101, 0b1011, 0b0111] {
        let vehicle = fine_car(32);
        let mut chain = Chain::new(&vehicle, &placed());
        let mut car = Car::new(vehicle).rolling(0.3, 0.2);
        for period in 0..1000 {
            let mut raw = car.raw();
            // Ingest calls the pose lost after 2 s.
            if (200..500).contains(&period) {
                raw.counts_mask = mask;
            }
            chain.feed(&raw);
            car.roll(0.3, 0.2);
        }
        chain.feed(&car.raw());
        let error = chain.pose().distance(&car.truth);
        assert_eq!(chain.odometry.state, EstimatorState::Valid.code());
        assert!(error < 2e-3, "{mask:b}: {error}");
        assert!((chain.odometry.yaw - car.truth.yaw).abs() < 1e-3);
        assert_eq!(chain.odometry.wheel_use, [WheelUse::Used.code(); 4]);
    }
}

#[test]
fn a_gyro_tells_its_bias_at_rest_and_the_heading_in_motion() {
    let vehicle = car();
    let bias = 0.015;
    let mut errors = [0.0_f64; 2];
    for seed in 0..10 {
        for (error, gyro) in errors.iter_mut().zip([true, false]) {
            let (estimator, truth, odometry) = with_gyro(&vehicle, seed, gyro, bias);
            if gyro {
                let learnt = estimator.parameters().unwrap();
                let index = Parameter::GyroBias.index();
                let off = (learnt.deviation[index] - bias).abs();
                assert!(off < 1e-3, "{off}");
                assert!(learnt.covariance[(index, index)].sqrt() < 1e-3);
            }
            *error += (odometry.yaw - truth.yaw).powi(2);
        }
    }
    let errors = errors.map(|square| (square / 10.0).sqrt());
    println!("heading off by {:.4} rad with the gyro, {:.4} without", errors[0], errors[1]);
    assert!(errors[0] < 0.5 * errors[1] && errors[0] < 0.01, "{errors:?}");
}

/// Stands for 3 s and drives for 17 s with a gyro of that bias.
fn with_gyro(vehicle: &Vehicle, seed: u64, gyro: bool, bias: f64) -> (Estimator, Pose, Odometry) {
    let sensors = sensors([false, false, true, true], false, gyro);
    let mut chain = Chain::with(vehicle, &sensors, &placed());
    let mut car = Car::new(vehicle.clone()).noisy(seed, 0.001, 0.004, 0.0);
    for period in 0..4000 {
        let speed = if period < 600 { 0.0 } else { 0.3 };
        car.roll(speed, 0.3 * (f64::from(period) * 0.003).sin());
        let mut raw = car.raw();
        raw.yaw_rate += bias;
        chain.feed(&raw);
    }
    (chain.estimator, car.truth, chain.odometry)
}
