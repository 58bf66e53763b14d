//! The checker checked: each guard broken on purpose is noticed, and nothing is where all guards hold.

use kerbside_messages::{AlterReason, Mode, Process};

use super::*;
use crate::lockstep::{Fault, Invariant, Kind, LineMishap, VICTIMS, Way, draw};

const SECOND: Nanos = 1_000_000_000;
/// A garage scene; the car is well on its way after [`UNDER_WAY`].
const GARAGE: u64 = 8;
const UNDER_WAY: Nanos = 8 * SECOND;

fn kill(process: Process) -> Schedule {
    Schedule::kills(&[(UNDER_WAY, process)])
}

/// No command reaches the vehicle for longer than it takes to stop.
fn deaf() -> Schedule {
    let kind = Kind::Line { way: Way::ToVehicle, mishap: LineMishap::Silence, span: 3 * SECOND };
    Schedule::new(vec![Fault { at: UNDER_WAY, kind }])
}

fn drive_with(schedule: &Schedule, prepare: impl FnOnce(&mut World)) -> Outcome {
    let scenes = Scenes::load().unwrap();
    manoeuvre_in(&scenes, &Atlas::default(), GARAGE, schedule, prepare).unwrap()
}

/// What is broken by `prepare` under `schedule`, under which nothing is broken without.
fn broken_by(schedule: &Schedule, prepare: impl FnOnce(&mut World)) -> Broken {
    let sound = drive_with(schedule, |_| {});
    assert_eq!(sound.broken, None, "{schedule:?}");
    drive_with(schedule, prepare).broken.expect("it is noticed")
}

#[test]
fn a_gate_that_does_not_stay_shut_is_noticed() {
    let broken = broken_by(&kill(Process::Tracker), |world| {
        world.forge_actuators(Box::new(|_, actuator| {
            if actuator.latch != AlterReason::None.code() {
                actuator.speed = 0.1;
            }
        }));
    });
    assert_eq!(broken.invariant, Invariant::Permit, "{broken}");
}

#[test]
fn a_gate_that_steers_without_a_permit_is_noticed() {
    let broken = broken_by(&kill(Process::Tracker), |world| {
        let mut angle = 0.0;
        world.forge_actuators(Box::new(move |_, actuator| {
            if actuator.latch != AlterReason::None.code() {
                angle += 1e-3;
                actuator.steering += angle;
            }
        }));
    });
    assert_eq!(broken.invariant, Invariant::Permit, "{broken}");
}

#[test]
fn a_vehicle_that_does_not_mind_silence_is_noticed() {
    let broken = broken_by(&deaf(), |world| world.slow_vehicle(8_000));
    assert_eq!(broken.invariant, Invariant::Stop, "{broken}");
}

#[test]
fn a_permit_that_comes_back_without_an_arm_is_noticed() {
    let broken = broken_by(&kill(Process::Tracker), |world| {
        world.forge_permits(Box::new(|now, permit| {
            if permit.mode == Mode::Faulted.code() {
                (permit.granted, permit.expiry) = (1, now + SECOND);
            }
        }));
    });
    assert_eq!(broken.invariant, Invariant::Rearm, "{broken}");
}

#[test]
fn a_permit_of_an_arm_that_nobody_gave_is_noticed() {
    let broken = broken_by(&kill(Process::Tracker), |world| {
        world.forge_permits(Box::new(|now, permit| {
            if permit.mode == Mode::Faulted.code() {
                (permit.granted, permit.expiry, permit.arm) = (1, now + SECOND, permit.arm + 1);
            }
        }));
    });
    assert_eq!(broken.invariant, Invariant::Rearm, "{broken}");
}

#[test]
fn an_estimate_that_drifts_until_the_car_touches_something_is_noticed() {
    let broken = broken_by(&Schedule::default(), |world| {
        let mut drift = 0.0;
        world.forge_odometry(Box::new(move |_, odometry| {
            if odometry.standstill == 0 {
                drift += 4e-5;
            }
            odometry.x += drift;
        }));
    });
    assert_eq!(broken.invariant, Invariant::Collision, "{broken}");
}

#[test]
fn an_estimate_that_jumps_and_says_nothing_is_noticed() {
    let broken = broken_by(&Schedule::default(), |world| {
        world.forge_odometry(Box::new(|now, odometry| {
            if now > 9 * SECOND {
                odometry.x += 0.3;
            }
        }));
    });
    assert_eq!(broken.invariant, Invariant::Jump, "{broken}");
}

#[test]
fn a_restored_pose_that_is_another_one_is_noticed() {
    let broken = broken_by(&kill(Process::Estimator), |world| {
        world.forge_odometry(Box::new(|_, odometry| {
            if odometry.reset_reason == kerbside_messages::ResetReason::Restored.code() {
                odometry.y += 0.2;
            }
        }));
    });
    assert_eq!(broken.invariant, Invariant::Jump, "{broken}");
}

#[test]
fn a_manoeuvre_without_a_verdict_is_noticed() {
    let broken = broken_by(&Schedule::default(), |world| {
        world.forge_states(Box::new(|_, state| state.healthy = 0));
    });
    assert_eq!(broken.invariant, Invariant::Hang, "{broken}");
}

#[test]
fn what_fails_is_shrunk_to_what_it_takes() {
    let scenes = Scenes::load().unwrap();
    let atlas = Atlas::default();
    let fault = |at: Nanos, kind| Fault { at: at * SECOND, kind };
    let schedule = Schedule::new(vec![
        fault(2, Kind::Kill(Process::Recorder)),
        fault(6, Kind::ClockStep(300_000_000)),
        deaf().faults()[0].clone(),
        fault(9, Kind::Kill(Process::Planner)),
    ]);
    let fails = |schedule: &Schedule| {
        let slow = |world: &mut World| world.slow_vehicle(8_000);
        let outcome = manoeuvre_in(&scenes, &atlas, GARAGE, schedule, slow).unwrap();
        outcome.broken.is_some_and(|broken| broken.invariant == Invariant::Stop)
    };
    assert!(fails(&schedule));
    let shrunk = crate::lockstep::shrink(&schedule, fails);
    let [only] = shrunk.faults() else { panic!("{shrunk:?}") };
    assert!(matches!(only.kind, Kind::Line { way: Way::ToVehicle, .. }), "{only}");
    assert!(only.kind.span() < 3 * SECOND, "{only}");
}

#[test]
fn a_seed_repeats_to_the_last_bit_with_and_without_a_known_plan() {
    let (scenes, atlas) = (Scenes::load().unwrap(), Atlas::default());
    for seed in [3, 11, 12] {
        let first = manoeuvre(&scenes, &atlas, seed, &draw(seed)).unwrap();
        let again = manoeuvre(&scenes, &atlas, seed, &draw(seed)).unwrap();
        assert_eq!((first.end, first.elapsed), (again.end, again.elapsed), "seed {seed}");
        assert_eq!(first.stops, again.stops, "seed {seed}");
        assert_eq!(first.clearance.to_bits(), again.clearance.to_bits(), "seed {seed}");
    }
}

#[test]
fn a_line_that_is_silent_in_one_direction_stops_the_vehicle_in_time() {
    for way in [Way::ToHost, Way::ToVehicle] {
        for span in [60, 150, 310, 360, 500, 1_000, 2_500].map(|ms| ms * 1_000_000) {
            let kind = Kind::Line { way, mishap: LineMishap::Silence, span };
            let outcome = drive_with(&Schedule::new(vec![Fault { at: UNDER_WAY, kind }]), |_| {});
            assert_eq!(outcome.broken, None, "{way} {span}");
            // What rolled by during so long a gap in the readings is not guessed.
            let lost = way == Way::ToHost && span > 2 * SECOND;
            let end = if lost { End::PoseLost } else { End::Completed };
            assert_eq!(outcome.end, Some(end), "{way} {span}");
        }
    }
}

#[test]
fn each_lasting_fault_alone_is_survived_in_the_middle_of_a_drive() {
    for process in VICTIMS {
        for span in [50, 150, 260, 700, 2_500].map(|ms| ms * 1_000_000) {
            let kind = Kind::Stall { process, span };
            let outcome = drive_with(&Schedule::new(vec![Fault { at: UNDER_WAY, kind }]), |_| {});
            assert_eq!(outcome.broken, None, "{process} {span}");
            assert_eq!(outcome.end, Some(End::Completed), "{process} {span}");
        }
    }
}
