//! Where the car ends up.

use kerbside_geometry::{Actuators, Drive, Pose, Vehicle, angle};
use kerbside_messages::{TrackingPhase, TrackingStop};
use proptest::prelude::*;

use crate::car::vehicle;
use crate::drive::Loop;
use crate::scene::{GARAGE, PARALLEL, Path, Scene, mirrored};

const START: Pose = Pose::new(0.4, -0.3, 0.8);

/// Drives `path` from `offset`, seen from the plan's beginning.
fn driven(vehicle: &Vehicle, path: &Path, offset: Pose) -> Loop {
    let scene = Scene::new(vehicle.wheelbase, START, path);
    let mut drive = Loop::new(vehicle, scene, START.compose(&offset));
    let verdict = drive.run(|_| ());
    assert_eq!(verdict, (TrackingPhase::Finished, TrackingStop::None), "{:?}", drive.command);
    drive
}

#[test]
fn with_lags_and_delays_the_end_is_met_to_two_millimetres() {
    for path in [GARAGE, PARALLEL] {
        let drive = driven(&vehicle(), path, Pose::default());
        let miss = drive.miss();
        assert!(miss.x.abs() < 0.002 && miss.y.abs() < 0.002, "{miss:?}");
        assert!(angle::degrees(miss.yaw).abs() < 0.15, "{miss:?}");
        let worst = drive.sent.iter().map(|c| c.error_along.hypot(c.error_across));
        assert!(worst.fold(0.0, f64::max) < 0.003, "the whole way is near the plan");
    }
}

#[test]
fn a_front_driven_car_is_told_that_its_wheels_roll_farther() {
    let front = Vehicle { drive: Drive::Front, ..vehicle() };
    let drive = driven(&front, GARAGE, Pose::default());
    let worst = drive.sent.iter().map(|command| command.error_along.abs()).fold(0.0, f64::max);
    assert!(worst < 0.003, "{worst}");
}

#[test]
fn without_compensation_the_same_car_would_lag_behind() {
    // The tracker believes in ideal actuators: what the feed-forward is worth.
    let scene = Scene::new(0.5, START, GARAGE);
    let mut drive = Loop::new(&vehicle(), scene, START);
    let ideal = Vehicle { actuators: Some(Actuators::default()), ..vehicle() };
    drive.tracker = kerbside_tracking::Tracker::new(&ideal, &Default::default());
    drive.run(|_| ());
    let worst = drive.sent.iter().map(|command| command.error_along.abs()).fold(0.0, f64::max);
    assert!(worst > 0.01, "{worst}");
}

#[test]
fn initial_errors_decay_forward_and_in_reverse() {
    for length in [2.5, -2.5] {
        for (x, y, yaw) in [(0.03, 0.0, 0.0), (0.0, 0.03, 3.0), (-0.02, -0.03, 3.0)] {
            let offset = Pose::new(x, y, angle::radians(yaw));
            for steering in [0.0, 0.3] {
                let miss = driven(&vehicle(), &[(length, steering)], offset).miss();
                assert!(miss.x.abs() < 0.0025 && miss.y.abs() < 0.002, "{length} {miss:?}");
                assert!(angle::degrees(miss.yaw).abs() < 0.25, "{length} {miss:?}");
            }
        }
    }
}

#[test]
fn arcs_begin_with_the_right_angle_and_the_car_stands_while_it_steers() {
    let scene = Scene::new(0.5, START, GARAGE);
    let mut drive = Loop::new(&vehicle(), scene, START);
    for _ in 0..20_000 {
        drive.step(|_| ());
        let Some(command) = drive.sent.last() else { continue };
        if command.phase != TrackingPhase::Tracking.code() {
            return;
        }
        let index = ((command.plan_time / 0.02) as usize).min(drive.scene.points.len() - 1);
        let reference = &drive.scene.points[index];
        if reference.speed != 0.0 {
            let error = drive.car.steering - reference.steering;
            assert!(error.abs() < 0.01, "{error} at {}", command.plan_time);
        }
        if reference.steering_rate != 0.0 {
            assert_eq!(command.speed, 0.0);
        }
    }
    panic!("never finished");
}

#[test]
fn the_mirrored_plan_is_driven_as_the_mirror_image() {
    let start = Pose::default();
    let offset = Pose::new(0.01, 0.02, 0.03);
    let image = Pose::new(0.01, -0.02, -0.03);
    let scenes = [Scene::new(0.5, start, GARAGE), Scene::new(0.5, start, &mirrored(GARAGE))];
    let [left, right] = scenes;
    let mut left = Loop::new(&vehicle(), left, offset);
    let mut right = Loop::new(&vehicle(), right, image);
    assert_eq!(left.run(|_| ()), right.run(|_| ()));
    assert_eq!(left.sent.len(), right.sent.len());
    for (one, other) in left.sent.iter().zip(&right.sent) {
        assert_eq!((one.speed, one.steering), (other.speed, -other.steering));
    }
}

#[test]
fn the_same_samples_give_the_same_bits() {
    let offset = Pose::new(0.01, 0.02, 0.03);
    let (one, other) = (driven(&vehicle(), PARALLEL, offset), driven(&vehicle(), PARALLEL, offset));
    assert_eq!(one.sent, other.sent);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_small_disturbance_is_survived_within_the_limits(
        x in -0.03..0.03, y in -0.03..0.03, yaw in -0.05..0.05, parallel: bool,
    ) {
        let path = if parallel { PARALLEL } else { GARAGE };
        let drive = driven(&vehicle(), path, Pose::new(x, y, yaw));
        let limits = vehicle().limits;
        for command in &drive.sent {
            prop_assert!(command.steering.abs() <= limits.steering);
            prop_assert!(command.speed.abs() <= limits.speed);
        }
        let miss = drive.miss();
        prop_assert!(miss.x.abs() < 0.01 && miss.y.abs() < 0.015, "{miss:?}");
    }
}
