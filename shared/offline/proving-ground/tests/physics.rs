//! The vehicle with its physics on.

// Tests may end loudly; so may what they call.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

use kerbside_geometry::Pose;
use kerbside_proving_ground::{
    Actuators, Chassis, Command, Manoeuvre, Pace, Physics, Plant, Sensors, State, TestDrive,
};

fn s_path(physics: Physics, speed: f64) -> State {
    let sensors = Sensors::paper(1.0).without_errors();
    let manoeuvre = Manoeuvre::s_path(Pace::paper(speed)).with_pause(2.0);
    let drive = TestDrive::new(Chassis::paper(), physics, sensors, manoeuvre);
    *drive.record(1).truth.last().expect("a truth")
}

#[test]
fn weaker_physics_come_closer_to_the_kinematic_limit() {
    let ideal = s_path(Physics::NEUTRAL, 0.26).pose;
    let off = |strength: f64| {
        let mut physics = Physics::ordinary().at_strength(strength);
        physics.actuators = Actuators::NEUTRAL;
        s_path(physics, 0.26).pose.distance(&ideal)
    };
    let [full, half, hundredth] = [1.0, 0.5, 0.01].map(off);
    assert!(full > 2e-3 && full < 0.2, "{full}");
    assert!(half < 0.8 * full && hundredth < 0.03 * full, "{full}, {half}, {hundredth}");
}

#[test]
fn without_a_command_nothing_moves() {
    let start = Pose::new(1.0, 2.0, 0.5);
    let mut plant = Plant::new(&Chassis::paper(), &Physics::ordinary(), start, 0.3);
    for _ in 0..1000 {
        plant.step(0.02, Command { speed: 0.0, steering: 0.3 });
    }
    let state = plant.state();
    assert_eq!((state.pose, state.speed, state.yaw_rate), (start, 0.0, 0.0));
    assert_eq!((state.rotation, state.turned, state.steering), ([0.0; 4], [0.0; 4], 0.3));
    // Nor does it when the wheels are turned.
    plant.step(1.0, Command { speed: 0.0, steering: -0.3 });
    assert_eq!(plant.state().pose, start);
}

#[test]
fn a_car_that_is_let_go_comes_to_rest_and_stays_there() {
    let mut plant = Plant::new(&Chassis::paper(), &Physics::ordinary(), Pose::default(), 0.0);
    for _ in 0..100 {
        plant.step(0.02, Command { speed: 0.2, steering: 0.2 });
    }
    for _ in 0..150 {
        plant.step(0.02, Command { speed: 0.0, steering: 0.2 });
    }
    let rest = *plant.state();
    plant.step(1.0, Command { speed: 0.0, steering: 0.2 });
    assert!(plant.state().pose.distance(&rest.pose) < 1e-9);
    assert!(rest.pose.x > 0.3);
}

#[test]
fn slip_lets_the_car_understeer_more_the_faster_it_is() {
    let mut physics = Physics::NEUTRAL;
    physics.tyres.lateral_compliance = [0.2, 0.1];
    physics.tyres.longitudinal_compliance = 0.01;
    let turned = |speed: f64, steering: f64| {
        let mut plant = Plant::new(&Chassis::paper(), &physics, Pose::default(), steering);
        plant.step(2.0 / speed, Command { speed, steering }).pose.yaw
    };
    let ideal = 2.0 * kerbside_geometry::math::tan(0.2) / 0.5;
    let (slow, fast) = (turned(0.1, 0.2), turned(0.8, 0.2));
    assert!(slow < ideal && fast < slow - 1e-3, "{ideal}, {slow}, {fast}");
    // The car's own asymmetry is that of its radii: on the other side it is the same within that.
    assert!((turned(0.8, -0.2) + fast).abs() < 1e-3);
}

#[test]
fn actuators_delay_lag_and_keep_their_limits() {
    let mut physics = Physics::NEUTRAL;
    physics.actuators =
        Actuators { speed_delay: 0.03, steering_delay: 0.013, ..Actuators::paper_parking() };
    let mut plant = Plant::new(&Chassis::paper(), &physics, Pose::default(), 0.0);
    let command = Command { speed: 0.2, steering: 0.9 };
    plant.step(0.013, command);
    assert_eq!((plant.state().speed, plant.state().steering), (0.0, 0.0));
    plant.step(0.1, command);
    // 1 rad/s from 0.013 s on.
    assert!((plant.state().steering - 0.1).abs() < 1e-6, "{:?}", plant.state());
    let lagged = 0.2 * (1.0 - kerbside_geometry::math::exp(-(0.113 - 0.03) / 0.1));
    assert!((plant.state().speed - lagged).abs() < 1e-6, "{:?}", plant.state());
    plant.step(2.0, command);
    assert!((plant.state().steering - 35.0_f64.to_radians()).abs() < 1e-6);
}

#[test]
fn steps_of_any_length_give_the_same_drive() {
    let run = |step: f64, count: u32| {
        let mut plant = Plant::new(&Chassis::paper(), &Physics::ordinary(), Pose::default(), 0.0);
        for _ in 0..count {
            plant.step(step, Command { speed: 0.2, steering: 0.3 });
        }
        *plant.state()
    };
    let (coarse, fine) = (run(0.02, 200), run(0.002, 2000));
    assert!((coarse.time - fine.time).abs() < 1e-9);
    assert!(coarse.pose.distance(&fine.pose) < 1e-6, "{coarse:?} against {fine:?}");
}

#[test]
fn bad_commands_and_times_change_nothing() {
    for physics in [Physics::NEUTRAL, Physics::ordinary()] {
        let mut plant = Plant::new(&Chassis::paper(), &physics, Pose::default(), 0.0);
        plant.step(0.1, Command { speed: f64::NAN, steering: 0.0 });
        plant.step(0.1, Command { speed: 0.1, steering: f64::INFINITY });
        plant.step(-1.0, Command { speed: 0.1, steering: 0.0 });
        plant.step(f64::NAN, Command { speed: 0.1, steering: 0.0 });
        assert_eq!(*plant.state(), State::default());
    }
}

#[test]
fn a_closed_loop_can_drive_it() {
    // A line follower, as small as one can be: the car goes to y = 0 from 5 cm beside it, physics and all.
    let start = Pose::new(0.0, 0.05, 0.0);
    let mut plant = Plant::new(&Chassis::paper(), &Physics::ordinary(), start, 0.0);
    for _ in 0..1000 {
        let Pose { y, yaw, .. } = plant.state().pose;
        let steering = (-2.0 * y - 2.0 * yaw).clamp(-0.5, 0.5);
        plant.step(0.02, Command { speed: 0.2, steering });
    }
    let Pose { x, y, yaw } = plant.state().pose;
    assert!(x > 3.5 && y.abs() < 2e-3 && yaw.abs() < 2e-3, "{x}, {y}, {yaw}");
}
