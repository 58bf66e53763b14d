//! The kinematic limit: exact, and the same however it is reached.

// Tests may end loudly; so may what they call.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

use core::f64::consts::{FRAC_PI_2, TAU};

use kerbside_geometry::{Drive, Pose, angle};
use kerbside_proving_ground::{
    Chassis, Command, Leg, Manoeuvre, Pace, Physics, Plant, Recorded, Section, Sensors, State,
    TestDrive,
};
use proptest::prelude::*;

fn pace(speed: f64) -> Pace {
    Pace::paper(speed)
}

fn drive(manoeuvre: Manoeuvre) -> TestDrive {
    let sensors = Sensors::paper(1.0).without_errors();
    TestDrive::new(Chassis::paper(), Physics::NEUTRAL, sensors, manoeuvre)
}

fn end(recorded: &Recorded) -> State {
    *recorded.truth.last().expect("a truth")
}

fn assert_pose(pose: &Pose, expected: [f64; 3], tolerance: f64) {
    let [x, y, yaw] = expected;
    let close = pose.distance(&Pose::new(x, y, yaw)) < tolerance;
    assert!(close && (pose.yaw - yaw).abs() < tolerance, "{pose:?} against {expected:?}");
}

#[test]
fn straights_and_circles_end_where_geometry_says() {
    let straight = end(&drive(Manoeuvre::straight(5.0, pace(0.26))).record(1));
    assert_pose(&straight.pose, [5.0, 0.0, 0.0], 1e-12);
    let reverse = end(&drive(Manoeuvre::straight(-3.0, pace(0.09))).record(1));
    assert_pose(&reverse.pose, [-3.0, 0.0, 0.0], 1e-12);
    assert!((reverse.distance - 3.0).abs() < 1e-12);
    for (radius, forward, yaw) in
        [(1.5, true, TAU), (-1.5, true, -TAU), (1.5, false, -TAU), (-0.9, false, TAU)]
    {
        let circle = end(&drive(Manoeuvre::arc(radius, TAU, forward, pace(0.2))).record(1));
        assert_pose(&circle.pose, [0.0, 0.0, yaw], 1e-11);
    }
    let quarter = end(&drive(Manoeuvre::arc(1.2, FRAC_PI_2, true, pace(0.2))).record(1));
    assert_pose(&quarter.pose, [1.2, 1.2, FRAC_PI_2], 1e-12);
}

#[test]
fn wheels_roll_by_the_geometry_of_one_centre() {
    // Each wheel of a straight rolls its length; b = (right - left) / theta on an arc.
    let chassis = Chassis::paper();
    let straight = end(&drive(Manoeuvre::straight(5.0, pace(0.2))).record(1));
    for (rotation, radius) in straight.rotation.iter().zip(chassis.radius) {
        assert!((rotation * radius - 5.0).abs() < 1e-12);
    }
    let circle = end(&drive(Manoeuvre::arc(1.5, TAU, true, pace(0.2))).record(1));
    let travel: [f64; 4] = core::array::from_fn(|i| circle.rotation[i] * chassis.radius[i]);
    assert!(((travel[3] - travel[2]) / TAU - chassis.track_rear).abs() < 1e-12);
    // Section 2a, form (b).
    let cosine = |y: f64| (1.5 - y) / ((1.5 - y).powi(2) + 0.25).sqrt();
    let half = 0.5 * chassis.track_front;
    let along = [travel[0] * cosine(half), travel[1] * cosine(-half)];
    assert!(((along[1] - along[0]) / TAU - chassis.track_front).abs() < 1e-12);
    assert!((0.5 * (along[0] + along[1]) - TAU * 1.5).abs() < 1e-11);
}

#[test]
fn the_s_path_ends_parallel_to_its_beginning() {
    for speed in [0.09, 0.26] {
        let recorded = drive(Manoeuvre::s_path(pace(speed))).record(1);
        let end = end(&recorded);
        assert!((end.distance - 5.770).abs() < 1e-3 && end.pose.yaw.abs() < 1e-12);
        // 1.0 + 1.2 + 1.2 + 0.5 along, 1.2 + 0.5 + 1.2 across; the ramps cut the corners a little.
        assert_pose(&end.pose, [3.9, 2.9, 0.0], 0.01);
        let turned = recorded.truth.iter().map(|state| state.pose.yaw).fold(0.0, f64::max);
        assert!((turned - FRAC_PI_2).abs() < 1e-12);
    }
}

#[test]
fn the_integrated_vehicle_covers_the_same_path() {
    let manoeuvres = [
        Manoeuvre::s_path(pace(0.26)),
        Manoeuvre::s_path(pace(0.09)),
        Manoeuvre::arc(-0.9, TAU, false, pace(0.2)),
        Manoeuvre::slalom(1.1, 0.8, 5, 0.2, pace(0.2)),
        Manoeuvre::shuttle(1.0, 0.7, 2, pace(0.2)),
        // Curvature that jumps while the car rolls.
        Manoeuvre::path(
            vec![Leg::new(true, &[Section::straight(0.507), Section::arc(1.3, 1.0)], 0.0)],
            pace(0.2),
        ),
    ];
    for manoeuvre in manoeuvres {
        let drive = drive(manoeuvre);
        let (exact, integrated) = (drive.record(3), drive.driven_integrated().record(3));
        assert_eq!(exact.truth.len(), integrated.truth.len());
        for (a, b) in exact.truth.iter().zip(&integrated.truth) {
            let bound = 1e-9 * a.distance + 1e-11;
            assert_pose(&b.pose, [a.pose.x, a.pose.y, a.pose.yaw], bound);
            assert!((a.time, (a.distance - b.distance).abs() < bound) == (b.time, true));
            let rates = [a.speed - b.speed, a.yaw_rate - b.yaw_rate, a.steering - b.steering];
            assert!(rates.iter().all(|rate| rate.abs() < 1e-8), "{a:?} against {b:?}");
            for (r, s) in a.rotation.iter().zip(b.rotation) {
                assert!((r - s).abs() * 0.07 < bound, "{r} against {s}");
            }
        }
    }
}

#[test]
fn held_commands_are_exact_arcs_and_integrated_ones_agree() {
    for drive in [Drive::Rear, Drive::Front, Drive::All] {
        let chassis = Chassis { drive, ..Chassis::paper() };
        let mut exact = Plant::new(&chassis, &Physics::NEUTRAL, Pose::default(), 0.0);
        let mut integrated = exact.clone().with_integration();
        for k in 0..500 {
            let command = Command {
                speed: if k < 300 { 0.2 } else { -0.3 },
                steering: 0.5 - 0.002 * f64::from(k),
            };
            exact.step(0.02, command);
            integrated.step(0.02, command);
        }
        let (a, b) = (exact.state(), integrated.state());
        assert!((a.time - 10.0).abs() < 1e-9);
        assert_pose(&b.pose, [a.pose.x, a.pose.y, a.pose.yaw], 1e-9);
        for i in 0..4 {
            assert!((a.rotation[i] - b.rotation[i]).abs() < 1e-8, "{:?}", drive);
        }
    }
}

#[test]
fn a_driven_front_wheel_turned_by_90_degrees_turns_the_car_on_the_spot() {
    let chassis = Chassis { drive: Drive::Front, track_front: 0.0, ..Chassis::paper() };
    let mut plant = Plant::new(&chassis, &Physics::NEUTRAL, Pose::default(), 0.0);
    plant.step(1.0, Command { speed: 0.25, steering: FRAC_PI_2 });
    assert_pose(&plant.state().pose, [0.0, 0.0, 0.5], 1e-12);
    assert!((plant.state().rotation[0] * chassis.radius[0] - 0.25).abs() < 1e-12);
    assert!(plant.state().rotation[2] < 0.0, "the inner wheel rolls backwards");
}

#[test]
fn a_path_may_begin_anywhere() {
    let mut drive = drive(Manoeuvre::s_path(pace(0.26)));
    let there = end(&drive.record(1)).pose;
    drive.start = Pose::new(-2.0, 1.0, 2.5);
    let moved = drive.start.compose(&there);
    assert_pose(&end(&drive.record(1)).pose, [moved.x, moved.y, moved.yaw], 1e-11);
    assert_eq!(drive.record(1).truth[0].pose, drive.start);
}

#[test]
fn commands_by_time_are_followed() {
    let rows = vec![
        (0.5, Command { speed: 0.2, steering: 0.2 }),
        (2.513, Command { speed: -0.1, steering: -0.3 }),
        (3.0, Command { speed: 0.0, steering: -0.3 }),
    ];
    let drive = drive(Manoeuvre::commands(rows, 4.0));
    let turn = |steering: f64| kerbside_geometry::math::tan(steering) / 0.5;
    let expected = Pose::default()
        .advance(0.2 * 2.013, 0.2 * 2.013 * turn(0.2))
        .advance(-0.1 * 0.487, -0.1 * 0.487 * turn(-0.3));
    let close =
        |state: &State| assert_pose(&state.pose, [expected.x, expected.y, expected.yaw], 1e-10);
    close(&end(&drive.record(1)));
    close(&end(&drive.driven_integrated().record(1)));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(24) })]

    #[test]
    fn the_mirrored_path_is_the_mirror_of_the_path(
        curvature in -1.2..1.2_f64,
        length in 0.2..3.0_f64,
        forward: bool,
        speed in 0.05..0.5_f64,
    ) {
        let chassis = Chassis { radius: [0.07; 4], ..Chassis::paper() };
        let run = |curvature: f64| {
            let sections = [Section::straight(0.2), Section { length, curvature }];
            let manoeuvre = Manoeuvre::path(vec![Leg::new(forward, &sections, 0.1)], pace(speed));
            let sensors = Sensors::paper(1.0).without_errors();
            end(&TestDrive::new(chassis, Physics::NEUTRAL, sensors, manoeuvre).record(1))
        };
        let (left, right) = (run(curvature), run(-curvature));
        let mirrored = [left.pose.x, -left.pose.y, -left.pose.yaw];
        assert_pose(&right.pose, mirrored, 1e-11);
        prop_assert!((left.rotation[0] - right.rotation[1]).abs() < 1e-9);
        prop_assert!((left.rotation[2] - right.rotation[3]).abs() < 1e-9);
        prop_assert!((angle::wrap(left.steering + right.steering)).abs() < 1e-12);
    }
}
