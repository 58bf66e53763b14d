//! The motion against closed solutions and symmetries.

use crate::support;
use kerbside_geometry::{Drive, Pose, Vehicle, WHEELS, math};
use kerbside_simulation::{Noise, Simulator};
use proptest::prelude::*;

/// The car of the paper with equal radii.
fn car() -> Vehicle {
    Vehicle { radius: [0.0725; 4], ..support::vectors("paper").vehicle }
}

fn simulator(vehicle: &Vehicle) -> Simulator {
    Simulator::new(vehicle, Pose::default(), &Noise::NONE, 0)
}

/// A car that drives at `speed` on a settled steering angle, and its pose at 10 s.
fn settled(vehicle: &Vehicle, speed: f64, steering: f64) -> Simulator {
    let mut simulator = simulator(vehicle);
    simulator.command(0.0, 0.0, steering);
    simulator.command(5.0, speed, steering);
    simulator.advance(10.0);
    simulator
}

#[test]
fn a_ramp_begins_within_a_step_at_stamp_plus_delay() {
    let mut simulator = simulator(&car());
    simulator.command(0.0113, 0.5, 0.0);
    for (time, since) in [(0.03, 0.0), (0.0313, 0.0), (0.0353, 0.004), (0.2, 0.1687)] {
        simulator.advance(time);
        assert!((simulator.speed() - 0.3 * since).abs() < 1e-12, "{time}: {}", simulator.speed());
        assert!((simulator.pose().x - 0.15 * since * since).abs() < 1e-12);
    }
}

#[test]
fn the_speed_approaches_its_target_as_ramp_and_exponential() {
    let mut simulator = simulator(&car());
    simulator.command(0.0, 0.2, 0.0);
    // 0.02 s delay; the ramp of 0.3 m/s^2 ends 0.03 m/s below the target, after 17/30 s.
    let ramp = 0.17 / 0.3;
    simulator.advance(0.02 + ramp + 0.15);
    let expected = 0.2 - 0.03 * (-1.5_f64).exp();
    assert!((simulator.speed() - expected).abs() < 1e-12);
    let distance = 0.15 * ramp * ramp + 0.2 * 0.15 - 0.03 * 0.1 * (1.0 - (-1.5_f64).exp());
    assert!((simulator.distance() - distance).abs() < 1e-9, "{}", simulator.distance());
}

#[test]
fn commands_beyond_the_limits_are_cut_and_broken_ones_left_out() {
    let mut simulator = simulator(&car());
    simulator.command(0.0, -7.0, 3.0);
    simulator.command(0.1, f64::NAN, 0.0);
    simulator.advance(20.0);
    let limits = car().limits;
    assert_eq!((simulator.speed(), simulator.steering()), (-limits.speed, limits.steering));
}

#[test]
fn a_settled_car_drives_a_circle_and_its_wheels_roll_without_slip() {
    for (speed, steering) in [(0.3, 0.4), (-0.3, 0.4), (0.2, -0.3), (-0.2, 0.0)] {
        let vehicle = car();
        let mut simulator = settled(&vehicle, speed, steering);
        let (start, rotation) = (simulator.pose(), simulator.rotation());
        simulator.advance(20.0);
        let curvature = math::tan(steering) / vehicle.wheelbase;
        let expected = start.advance(speed * 10.0, speed * 10.0 * curvature);
        let error = simulator.pose().seen_from(&expected);
        assert!(error.x.abs() + error.y.abs() + error.yaw.abs() < 1e-9, "{error:?}");
        for wheel in WHEELS {
            let (x, y) = vehicle.wheel_position(wheel);
            let path = speed * 10.0 * math::hypot(1.0 - y * curvature, x * curvature);
            let rolled = (simulator.rotation()[wheel.index()] - rotation[wheel.index()]) * 0.0725;
            assert!((rolled - path).abs() < 1e-9, "{wheel:?}: {rolled} {path}");
        }
    }
}

#[test]
fn the_differential_keeps_the_mean_rotation_of_the_driven_wheels() {
    for drive in [Drive::Rear, Drive::Front, Drive::All] {
        let radius = [0.0725, 0.0715, 0.0735, 0.0718];
        let vehicle = Vehicle { drive, radius, ..car() };
        let rate = settled(&vehicle, 0.3, 0.4).rotation_rate();
        let mean = match drive {
            Drive::Rear => 0.5 * (rate[2] + rate[3]),
            Drive::Front => 0.5 * (rate[0] + rate[1]),
            Drive::All => rate.iter().sum::<f64>() / 4.0,
        };
        assert!((mean - 0.3 / vehicle.driven_radius()).abs() < 1e-9, "{drive:?}");
    }
}

#[test]
fn radii_that_differ_leave_a_straight_straight() {
    let vehicle = Vehicle { radius: [0.0725, 0.0715, 0.0735, 0.0718], ..car() };
    let simulator = settled(&vehicle, 0.3, 0.0);
    assert_eq!((simulator.pose().y, simulator.pose().yaw), (0.0, 0.0));
    let travel: Vec<f64> = simulator
        .rotation()
        .iter()
        .zip(vehicle.radius)
        .map(|(turn, radius)| turn * radius)
        .collect();
    assert!(travel.iter().all(|travel| (travel - simulator.pose().x).abs() < 1e-9), "{travel:?}");
}

#[test]
fn a_standing_car_steers_without_moving() {
    let mut simulator = simulator(&car());
    simulator.command(0.0, 0.0, 0.4);
    simulator.advance(3.0);
    assert_eq!((simulator.pose(), simulator.distance()), (Pose::default(), 0.0));
    assert_eq!(simulator.steering(), 0.4);
}

#[test]
fn actuators_without_lag_follow_their_rate_limits_alone() {
    let vehicle = Vehicle { actuators: None, ..car() };
    let mut simulator = simulator(&vehicle);
    simulator.command(0.5, 0.3, 0.4);
    simulator.advance(1.0);
    assert!((simulator.speed() - 0.15).abs() < 1e-12 && (simulator.steering() - 0.4).abs() < 1e-12);
}

#[test]
fn time_that_is_past_changes_nothing() {
    let mut simulator = settled(&car(), 0.3, 0.2);
    let pose = simulator.pose();
    simulator.advance(3.0);
    assert_eq!((simulator.pose(), simulator.time()), (pose, 10.0));
}

/// Commands 0.05 to 0.8 s apart.
fn drives() -> impl Strategy<Value = Vec<(f64, f64, f64)>> {
    prop::collection::vec((0.05..0.8, -0.5..0.5, -0.5..0.5), 3..12)
}

fn command_all(simulator: &mut Simulator, drive: &[(f64, f64, f64)], mirror: f64) -> f64 {
    let mut time = 0.0;
    for (pause, speed, steering) in drive {
        time += pause;
        simulator.command(time, *speed, mirror * steering);
    }
    time + 1.0
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_step_changes_nothing_but_rounding(drive in drives(), step in 0.0004_f64..0.004) {
        let mut coarse = simulator(&car());
        let end = command_all(&mut coarse, &drive, 1.0);
        coarse.advance(end);
        let mut fine = simulator(&car()).with_step(step);
        command_all(&mut fine, &drive, 1.0);
        while fine.time() < end {
            fine.advance((fine.time() + 0.0071).min(end));
        }
        let error = coarse.pose().seen_from(&fine.pose());
        prop_assert!(error.x.abs() + error.y.abs() + error.yaw.abs() < 1e-7, "{error:?}");
        for wheel in 0..4 {
            prop_assert!((coarse.rotation()[wheel] - fine.rotation()[wheel]).abs() < 1e-6);
        }
        prop_assert!((coarse.steering() - fine.steering()).abs() < 1e-12);
    }

    #[test]
    fn a_mirrored_drive_is_the_mirror_image(drive in drives()) {
        let (mut left, mut right) = (simulator(&car()), simulator(&car()));
        let end = command_all(&mut left, &drive, 1.0);
        command_all(&mut right, &drive, -1.0);
        left.advance(end);
        right.advance(end);
        let (pose, image) = (left.pose(), right.pose());
        prop_assert_eq!((pose.x, pose.y, pose.yaw), (image.x, -image.y, -image.yaw));
        let [fl, fr, rl, rr] = left.rotation();
        prop_assert_eq!([fr, fl, rr, rl], right.rotation());
    }

    #[test]
    fn commands_given_ahead_act_like_commands_given_in_time(drive in drives()) {
        let (mut ahead, mut live) = (simulator(&car()), simulator(&car()));
        let end = command_all(&mut ahead, &drive, 1.0);
        let mut time = 0.0;
        for (pause, speed, steering) in &drive {
            time += pause;
            live.advance(time);
            live.command(time, *speed, *steering);
        }
        live.advance(end);
        ahead.advance(end);
        let error = ahead.pose().seen_from(&live.pose());
        prop_assert!(error.x.abs() + error.y.abs() + error.yaw.abs() < 1e-7, "{error:?}");
    }
}
