//! Random long schedules: one fault at any moment, on the whole loop of supervisor, gate and car.

use kerbside_messages::{Cause, EstimatorState, Mode, ResetReason, Verb};
use proptest::prelude::*;

use super::world::{LIMITS, World};
use super::*;

/// 5 ms steps of gate and car, and a supervisor's cycle, are the world's own resolution.
const RESOLUTION: f64 = 0.02;

#[derive(Clone, Copy, Debug)]
enum Fault {
    Kill(Process),
    Stop(Process),
    Unready(Process),
    Disorder(Process),
    Misses(Process),
    Inhibit,
    OperatorStop,
    LineLost,
    CommandsLost,
    OdometryLost,
    PoseLost,
    GiveUp,
    Unsupervised,
    Down,
}

impl Fault {
    fn happen(self, world: &mut World) {
        match self {
            Self::Kill(process) => world.kill(process),
            Self::Stop(process) => world.actor(process).stopped = true,
            Self::Unready(process) => world.actor(process).unready = true,
            Self::Disorder(process) => world.actor(process).beat.disorders += 1,
            Self::Misses(process) => world.actor(process).beat.misses += 5,
            Self::Inhibit => world.inhibit(100),
            Self::OperatorStop => world.ask(Verb::Stop).expect("accepted"),
            Self::LineLost => world.line_lost = true,
            Self::CommandsLost => world.commands_lost = true,
            Self::OdometryLost => world.odometry_lost = true,
            Self::PoseLost => {
                (world.pose, world.reset) = (EstimatorState::Lost, ResetReason::CounterReset);
            }
            Self::GiveUp => world.give_up = true,
            Self::Unsupervised => world.unsupervised = true,
            Self::Down => world.ask(Verb::Down).expect("accepted"),
        }
    }

    /// Undoes what does not pass by itself.
    fn end(self, world: &mut World) {
        if let Self::Unready(process) = self {
            world.actor(process).unready = false;
        }
        (world.line_lost, world.commands_lost, world.odometry_lost) = (false, false, false);
        world.give_up = false;
    }

    /// Those the vehicle need not stop for.
    fn harmless(self) -> bool {
        match self {
            Self::Kill(process)
            | Self::Stop(process)
            | Self::Unready(process)
            | Self::Disorder(process)
            | Self::Misses(process) => !process.on_control_path(),
            // The world's tracker needs none; a real one falls silent, which `CommandsLost` is.
            Self::OdometryLost => true,
            _ => false,
        }
    }

    fn ends_in(self) -> Mode {
        match self {
            Self::Inhibit | Self::OperatorStop => Mode::Ready,
            Self::Down => Mode::Down,
            _ => Mode::Faulted,
        }
    }
}

fn fault() -> impl Strategy<Value = Fault> {
    let process = || prop::sample::select(Process::SUPERVISED.to_vec());
    prop_oneof![
        4 => process().prop_map(Fault::Kill),
        4 => process().prop_map(Fault::Stop),
        1 => process().prop_map(Fault::Unready),
        1 => process().prop_map(Fault::Disorder),
        1 => process().prop_map(Fault::Misses),
        1 => prop::sample::select(vec![
            Fault::Inhibit,
            Fault::OperatorStop,
            Fault::LineLost,
            Fault::CommandsLost,
            Fault::OdometryLost,
            Fault::PoseLost,
            Fault::GiveUp,
            Fault::Unsupervised,
            Fault::Down,
        ])
    ]
}

/// The bound of the configuration for an ideal car: time-outs, then the stop ramp.
fn bound() -> f64 {
    LIMITS.speed * 0.305 + LIMITS.speed * LIMITS.speed / (2.0 * LIMITS.deceleration)
}

/// Runs until the car has stood for a while; fails where it goes too far.
fn stands_within_the_bound(world: &mut World) {
    let from = world.distance;
    world.run(4_000);
    let rolled = world.distance - from;
    assert!(rolled <= bound() + RESOLUTION, "rolled {rolled} m");
    assert_eq!(world.speed, 0.0);
}

/// Whatever comes back by itself has time to; the car must not.
fn does_not_resume(world: &mut World) {
    let from = world.distance;
    world.run(3_000);
    assert_eq!(world.distance, from);
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 150,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn after_any_single_fault_the_car_stands_within_the_bound(
        at in 0_u64..7_500, fault in fault(), arm_again in any::<bool>(),
    ) {
        let mut world = World::armed();
        world.plan();
        world.run(at);
        let finished = world.mode() == Mode::Ready;
        fault.happen(&mut world);
        if fault.harmless() {
            world.run_until(9_000, |world| world.mode() == Mode::Ready);
            prop_assert_eq!(world.supervisor.cause(), Cause::Completed);
            return Ok(());
        }
        stands_within_the_bound(&mut world);
        does_not_resume(&mut world);
        fault.end(&mut world);
        does_not_resume(&mut world);
        let steady = [Mode::Ready, Mode::Faulted, Mode::Down].contains(&world.mode());
        prop_assert!(steady || matches!(fault, Fault::Unsupervised), "{}", world.mode());
        let completed = finished || world.supervisor.cause() == Cause::Completed;
        if !completed && !matches!(fault, Fault::Unsupervised) {
            prop_assert_eq!(world.mode(), fault.ends_in());
        }
        if arm_again && world.mode() != Mode::Down && !world.unsupervised {
            if matches!(fault, Fault::PoseLost) {
                (world.pose, world.reset) = (EstimatorState::Valid, ResetReason::Fix);
                world.run(50);
            }
            prop_assert_eq!(world.ask(Verb::Arm), Ok(()));
            world.plan();
            world.run_until(9_000, |world| world.mode() == Mode::Ready);
            prop_assert_eq!(world.supervisor.cause(), Cause::Completed);
        }
    }

    #[test]
    fn several_faults_in_a_row_still_end_standing(
        schedule in prop::collection::vec((0_u64..1_500, fault()), 1..6),
    ) {
        let mut world = World::armed();
        world.plan();
        for (pause, fault) in schedule {
            world.run(pause);
            if !(world.unsupervised && matches!(fault, Fault::OperatorStop | Fault::Down)) {
                fault.happen(&mut world);
            }
        }
        // An unhurt plan needs seven seconds, a stop three.
        world.run(12_000);
        prop_assert_eq!(world.speed, 0.0);
        does_not_resume(&mut world);
    }
}
