//! The ways through the modes, and who may ask for what.

use kerbside_messages::{
    AlterReason, Cause, EstimatorState, Mode, ProcessState, ResetReason, Verb, text,
};

use super::world::{MS, World};
use super::*;

#[test]
fn starts_everything_at_once_and_is_ready_when_all_are() {
    let mut world = World::new(None);
    world.run(10);
    let spawns: Vec<_> = Process::SUPERVISED.map(Action::Spawn).to_vec();
    assert_eq!(world.log, spawns);
    assert_eq!(world.mode(), Mode::Starting);
    world.actor(Process::Planner).unready = true;
    world.actor(Process::Planner).waiting_for = "odometry";
    world.run(500);
    assert_eq!(world.mode(), Mode::Starting);
    let state = world.state();
    let rows = u32::try_from(Process::SUPERVISED.len()).unwrap();
    assert_eq!((state.rows, state.pid, state.healthy), (rows, 42, 0));
    assert_eq!(state.rows()[3].state, ProcessState::Starting.code());
    assert_eq!(text::as_str(&state.rows()[3].waiting_for), "odometry");
    world.actor(Process::Planner).unready = false;
    world.run(50);
    assert_eq!((world.mode(), world.state().healthy), (Mode::Ready, 1));
    assert!(world.state().rows().iter().all(|row| row.state == ProcessState::Healthy.code()));
}

#[test]
fn a_plan_is_driven_to_its_end() {
    let mut world = World::driving();
    let permit = world.permit.expect("published each cycle");
    assert_eq!((permit.granted, permit.arm, permit.mode), (1, 1, Mode::Driving.code()));
    assert_eq!(permit.expiry, permit.header.stamp + 150 * MS);
    world.run_until(6_000, |world| world.mode() == Mode::Done);
    world.run_until(1_000, |world| world.mode() == Mode::Ready);
    assert_eq!((world.supervisor.cause(), world.speed), (Cause::Completed, 0.0));
    world.run(1_000);
    let permit = world.permit.expect("published each cycle");
    assert_eq!((permit.granted, permit.arm), (0, 1));
    assert!(permit.expiry <= permit.header.stamp);
    assert_eq!((world.mode(), world.state().healthy), (Mode::Ready, 1));
    assert_eq!(
        world.log.iter().filter(|action| matches!(action, Action::Failed { .. })).count(),
        0
    );
}

#[test]
fn done_waits_for_standing() {
    let mut world = World::driving();
    let finished = kerbside_messages::Command {
        arm: 1,
        phase: kerbside_messages::TrackingPhase::Finished.code(),
        ..Default::default()
    };
    world.event(Event::Command(&finished));
    world.run(200);
    assert_eq!(world.mode(), Mode::Done, "the car still rolls");
    assert!(world.supervisor.permits());
}

#[test]
fn commands_of_another_arm_do_not_make_it_driving() {
    let mut world = World::armed();
    for arm in [0, 2] {
        let phase = kerbside_messages::TrackingPhase::Tracking.code();
        let old = kerbside_messages::Command { arm, phase, ..Default::default() };
        world.event(Event::Command(&old));
        assert_eq!(world.mode(), Mode::Armed);
    }
}

#[test]
fn without_a_plan_armed_ends_in_ready() {
    let mut world = World::armed();
    world.run(29_900);
    assert_eq!(world.mode(), Mode::Armed);
    world.run(100);
    assert_eq!((world.mode(), world.supervisor.cause()), (Mode::Ready, Cause::NoPlan));
    assert_eq!(world.ask(Verb::Arm), Ok(()));
    assert_eq!(world.supervisor.arms(), 2);
}

#[test]
fn an_operator_stops_to_ready_and_arms_again() {
    for mut world in [World::armed(), World::driving()] {
        let distance = world.distance;
        assert_eq!(world.ask(Verb::Stop), Ok(()));
        assert!(!world.supervisor.permits());
        world.run_until(3_000, |world| world.mode() == Mode::Ready);
        assert_eq!((world.supervisor.cause(), world.speed), (Cause::Operator, 0.0));
        // 0.4 m/s, 0.3 m/s^2, and two cycles until the gate knows.
        assert!(world.distance - distance < 0.16 / 0.6 + 0.4 * 0.02);
        world.run(1_000);
        assert_eq!(world.speed, 0.0, "the old plan is not taken up again");
        assert_eq!(world.ask(Verb::Arm), Ok(()));
        world.run(1_000);
        assert_eq!((world.mode(), world.speed), (Mode::Armed, 0.0), "nor by the next arm");
    }
}

#[test]
fn stop_is_accepted_where_nothing_moves_and_changes_nothing() {
    for (mut world, mode) in [(World::ready(), Mode::Ready), (World::faulted(), Mode::Faulted)] {
        assert_eq!(world.ask(Verb::Stop), Ok(()));
        assert_eq!(world.mode(), mode);
    }
}

#[test]
fn an_inhibit_stops_to_ready_and_forbids_the_arm_while_in_force() {
    for mut world in [World::armed(), World::driving()] {
        world.inhibit(5_000);
        assert!(!world.supervisor.permits());
        world.run_until(3_000, |world| world.mode() == Mode::Ready);
        assert_eq!((world.supervisor.cause(), world.state().healthy), (Cause::Inhibited, 0));
        assert_eq!(world.ask(Verb::Arm), Err("inhibited by bumper: touched".into()));
        world.run(5_000);
        assert_eq!((world.mode(), world.speed), (Mode::Ready, 0.0));
        assert_eq!(world.ask(Verb::Arm), Ok(()));
    }
}

#[test]
fn the_gates_own_word_of_an_inhibit_ends_in_ready_as_well() {
    let mut world = told_by_the_gate();
    world.run_until(3_000, |world| world.mode() == Mode::Ready);
    assert_eq!(world.supervisor.cause(), Cause::Inhibited);
}

#[test]
fn an_inhibit_that_comes_after_the_gates_word_says_why() {
    let mut world = told_by_the_gate();
    world.inhibit(5_000);
    world.run_until(3_000, |world| world.mode() == Mode::Ready);
    assert_eq!(text::as_str(&world.state().text), "inhibited by bumper: touched");
}

fn told_by_the_gate() -> World {
    let mut world = World::driving();
    let latched = kerbside_messages::Actuator {
        arm: 1,
        latch: AlterReason::Inhibited.code(),
        ..kerbside_messages::Actuator::default()
    };
    world.event(Event::Actuator(&latched));
    world
}

#[test]
fn a_fault_while_stopping_for_an_operator_ends_in_faulted() {
    let mut world = World::driving();
    world.ask(Verb::Stop).expect("accepted");
    world.kill(Process::Tracker);
    world.run_until(3_000, |world| world.mode() == Mode::Faulted);
    assert_eq!(world.supervisor.culprit(), Some(Process::Tracker));
}

#[test]
fn arm_is_refused_where_it_must_be_and_says_why() {
    let wrong_mode = "arm works in ready and faulted, the mode is ";
    type Make = fn() -> World;
    let cases: [(Make, &str); 4] = [
        (|| World::new(None), "starting"),
        (World::armed, "armed"),
        (World::driving, "driving"),
        (World::stopping, "stopping"),
    ];
    for (make, mode) in cases {
        let mut world = make();
        let arms = world.supervisor.arms();
        assert_eq!(world.ask(Verb::Arm), Err(format!("{wrong_mode}{mode}")));
        assert_eq!(world.supervisor.arms(), arms);
    }
    let poses = [
        (EstimatorState::Unset, ResetReason::None, "no pose yet: send a fix"),
        (EstimatorState::Lost, ResetReason::CounterReset, "the pose is lost: send a fix"),
    ];
    for (pose, reset, why) in poses {
        let mut world = World::ready();
        (world.pose, world.reset) = (pose, reset);
        world.run(10);
        assert_eq!((world.ask(Verb::Arm), world.state().healthy), (Err(why.into()), 1));
        (world.pose, world.reset) = (EstimatorState::Valid, ResetReason::Fix);
        world.run(10);
        assert_eq!(world.ask(Verb::Arm), Ok(()));
    }
    let mut world = World::ready();
    world.odometry_lost = true;
    world.run(150);
    assert_eq!(world.ask(Verb::Arm), Err("no estimate of the pose arrives".into()));
    let mut world = World::ready();
    world.kill(Process::Recorder);
    assert_eq!(world.ask(Verb::Arm), Err("recorder is not ready: dead".into()));
}

#[test]
fn a_healthy_faulted_stack_is_armed_again_and_drives() {
    let mut world = World::faulted();
    assert_eq!(world.ask(Verb::Arm), Ok(()));
    assert_eq!(world.supervisor.arms(), 2);
    world.plan();
    world.run(1_000);
    assert_eq!((world.mode(), world.ask(Verb::Stop)), (Mode::Driving, Ok(())));
    world.run_until(3_000, |world| !matches!(world.mode(), Mode::Stopping));
    assert_eq!(world.mode(), Mode::Ready, "the fault of an earlier arm is over");
    assert_eq!(world.ask(Verb::Arm), Ok(()));
    world.plan();
    world.run_until(9_000, |world| world.mode() == Mode::Ready);
    assert_eq!(world.supervisor.cause(), Cause::Completed);
}

#[test]
fn a_vehicle_that_has_not_begun_to_roll_stands_only_once_the_gate_says_so() {
    let mut world = World::armed();
    world.plan();
    world.run(5);
    let header = kerbside_messages::Header { sent: world.now, ..Default::default() };
    let out = kerbside_messages::Actuator { header, speed: 0.1, ..Default::default() };
    world.event(Event::Actuator(&out));
    assert_eq!(world.mode(), Mode::Driving);
    world.ask(Verb::Stop).expect("accepted");
    assert_eq!(world.mode(), Mode::Stopping);
    world.run(500);
    assert_eq!(world.mode(), Mode::Ready);
}

#[test]
fn stopping_does_not_wait_for_ever_for_a_vehicle_that_seems_to_roll() {
    let mut world = World::driving();
    world.ask(Verb::Stop).expect("accepted");
    world.speed = 0.3;
    for _ in 0..13_000 / 5 {
        world.run(5);
        world.speed = 0.3;
    }
    assert_eq!((world.mode(), world.supervisor.cause()), (Mode::Faulted, Cause::Gate));
    assert!(text::as_str(&world.state().text).contains("does not come to rest"));
}

#[test]
fn blind_it_waits_for_the_gates_zero_or_as_long_as_a_stop_takes() {
    let mut world = World::driving();
    world.odometry_lost = true;
    world.ask(Verb::Stop).expect("accepted");
    let begun = world.now;
    world.run_until(3_000, |world| world.mode() == Mode::Ready);
    let took = (world.now - begun) / MS;
    assert!((1_500..1_700).contains(&took), "0.4 / 0.3 s of ramp, 0.2 s to settle: {took}");
    assert_eq!(world.speed, 0.0);
    let mut world = World::driving();
    (world.odometry_lost, world.line_lost) = (true, true);
    world.run_until(3_000, |world| world.mode() == Mode::Faulted);
    let begun = world.state().since;
    assert!(world.log.contains(&Action::Entered {
        mode: Mode::Stopping,
        cause: Cause::LineLost,
        culprit: Some(Process::Interface)
    }));
    assert!(begun > 0 && world.speed == 0.0);
}

#[test]
fn down_stops_the_vehicle_before_it_ends_the_processes() {
    let mut world = World::driving();
    assert_eq!(world.ask(Verb::Down), Ok(()));
    assert_eq!(world.mode(), Mode::Down);
    world.run(500);
    assert!(world.speed > 0.0 && world.runs(Process::Actuation));
    world.run_until(3_000, |world| world.log.contains(&Action::Finished { exit: 0 }));
    assert_eq!(world.speed, 0.0);
    let asked: Vec<_> =
        world.log.iter().filter(|action| matches!(action, Action::Terminate(_))).collect();
    let mut reverse = Process::SUPERVISED.map(Action::Terminate);
    reverse.reverse();
    assert!(asked.into_iter().eq(&reverse));
    world.run(1_000);
    assert_eq!(world.count(Action::Finished { exit: 0 }), 1);
    assert_eq!(world.count(Action::Spawn(Process::Actuation)), 1, "nothing is started again");
}

#[test]
fn what_does_not_end_is_killed_after_a_second() {
    let mut world = World::ready();
    world.actor(Process::Ingest).stopped = true;
    world.event(Event::Shutdown);
    world.run(990);
    assert_eq!(world.count(Action::Kill(Process::Ingest)), 0);
    world.run(20);
    assert_eq!(world.count(Action::Kill(Process::Ingest)), 1);
    assert_eq!(world.count(Action::Finished { exit: 1 }), 1);
    let swept = world.count(Action::CleanUp);
    assert_eq!(swept, Process::SUPERVISED.len() + 1, "after each death, and at the end");
}

#[test]
fn down_leaves_external_processes_alone_and_does_not_wait_for_them() {
    let mut world = World::new(Some(Process::Planner));
    world.run(500);
    assert_eq!(world.mode(), Mode::Ready);
    world.ask(Verb::Down).expect("accepted");
    world.run(20);
    assert_eq!(world.count(Action::Finished { exit: 0 }), 1);
    assert_eq!(world.count(Action::Terminate(Process::Planner)), 0);
    assert!(world.runs(Process::Planner));
}
