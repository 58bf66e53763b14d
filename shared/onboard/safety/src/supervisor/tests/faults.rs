//! Faults of processes that live, and of what they say.

use kerbside_messages::{
    Actuator, AlterReason, Cause, EstimatorState, Mode, ResetReason, Verb, text,
};

use super::world::World;
use super::*;

/// The fault stops the vehicle, ends in `faulted` and names cause and culprit.
fn assert_faulted(world: &mut World, cause: Cause, culprit: Process) {
    world.run_until(400, |world| !world.supervisor.permits());
    world.run_until(3_000, |world| world.mode() == Mode::Faulted);
    assert_eq!((world.supervisor.cause(), world.supervisor.culprit()), (cause, Some(culprit)));
    assert_eq!(world.speed, 0.0);
    let state = world.state();
    assert_eq!((state.cause, state.culprit), (cause.code(), culprit as u8));
}

#[test]
fn five_missed_deadlines_in_a_second_are_a_fault_but_no_reason_to_kill() {
    let mut world = World::driving();
    world.actor(Process::Estimator).beat.misses = 4;
    world.run(1_100);
    assert_eq!(world.mode(), Mode::Driving);
    world.actor(Process::Estimator).beat.misses = 8;
    world.run(1_000);
    assert_eq!(world.mode(), Mode::Driving, "four more, a second later");
    world.actor(Process::Estimator).beat.misses = 9;
    assert_faulted(&mut world, Cause::DeadlineMisses, Process::Estimator);
    assert_eq!(world.count(Action::Kill(Process::Estimator)), 0);
    assert_eq!(world.state().rows()[2].misses, 9);
    world.run(1_000);
    assert_eq!(world.ask(Verb::Arm), Ok(()));
    world.actor(Process::Estimator).beat.misses = 99;
    world.run(50);
    let refusal = world.ask(Verb::Arm).expect_err("late again");
    assert_eq!(refusal, "estimator is not ready: it missed deadlines a moment ago");
}

#[test]
fn misses_of_a_start_do_not_count_and_a_late_process_hinders_the_arm() {
    let mut world = World::new(None);
    world.run(10);
    world.actor(Process::Ingest).beat.misses = 50;
    world.run(500);
    assert_eq!((world.mode(), world.state().healthy), (Mode::Ready, 1));
    world.actor(Process::Ingest).beat.misses = 55;
    world.run(50);
    assert_eq!((world.mode(), world.state().healthy), (Mode::Faulted, 0));
    world.run(1_000);
    assert_eq!((world.mode(), world.state().healthy), (Mode::Faulted, 1));
}

#[test]
fn checkpoints_out_of_order_are_a_fault_and_a_restart() {
    let mut world = World::driving();
    world.actor(Process::Tracker).beat.disorders = 1;
    assert_faulted(&mut world, Cause::Order, Process::Tracker);
    world.run_until(1_500, |world| world.supervisor.is_healthy());
    assert_eq!(world.count(Action::Kill(Process::Tracker)), 1);
}

#[test]
fn too_many_heartbeats_are_a_fault_as_well_as_too_few() {
    let mut world = World::driving();
    world.actor(Process::Ingest).rate = 2;
    world.run(1_000);
    assert_eq!(world.mode(), Mode::Driving, "twice as many are the limit");
    world.actor(Process::Ingest).rate = 3;
    assert_faulted(&mut world, Cause::TooManyBeats, Process::Ingest);
    let mut world = World::driving();
    let beat = world.actor(Process::Ingest).beat;
    world.actor(Process::Ingest).rate = 0;
    for _ in 0..3 {
        world.run(195);
        let header = kerbside_messages::Header { sent: world.now, ..beat.header };
        world.event(Event::Heartbeat(&kerbside_messages::Heartbeat { header, ..beat }));
    }
    assert_faulted(&mut world, Cause::Silent, Process::Ingest);
}

#[test]
fn a_failed_self_check_says_why() {
    let mut world = World::driving();
    let beat = &mut world.actor(Process::Estimator).beat;
    beat.failed = 1;
    beat.text = text::from_str("covariance");
    assert_faulted(&mut world, Cause::SelfCheck, Process::Estimator);
    assert_eq!(text::as_str(&world.state().text), "estimator: own check failed: covariance");
    world.run_until(2_000, |world| world.supervisor.is_healthy());
    assert_eq!(world.count(Action::Kill(Process::Estimator)), 1);
}

#[test]
fn a_silent_process_that_returns_in_disorder_is_not_trusted_again() {
    let mut world = World::driving();
    world.actor(Process::Ingest).stopped = true;
    world.run(500);
    world.actor(Process::Ingest).stopped = false;
    world.actor(Process::Ingest).beat.disorders = 1;
    world.run(450);
    assert_eq!(world.state().healthy, 0);
    world.run(500);
    assert_eq!(world.count(Action::Kill(Process::Ingest)), 1);
}

#[test]
fn planner_faults_restart_the_planner_alone() {
    let mut world = World::driving();
    world.actor(Process::Planner).beat.disorders = 1;
    world.run(2_000);
    assert_eq!((world.mode(), world.count(Action::Kill(Process::Planner))), (Mode::Driving, 1));
}

#[test]
fn a_lost_line_is_a_fault_and_its_return_is_found() {
    for make in [World::armed, World::driving] {
        let mut world = make();
        world.line_lost = true;
        world.run_until(400, |world| !world.supervisor.permits());
        world.run_until(3_000, |world| world.mode() == Mode::Faulted);
        let why = (world.supervisor.cause(), world.supervisor.culprit());
        assert_eq!(why, (Cause::LineLost, Some(Process::Interface)));
        let refusal = world.ask(Verb::Arm).expect_err("no line");
        assert_eq!(refusal, "interface is not ready: starting");
        world.line_lost = false;
        world.run(50);
        assert_eq!(world.ask(Verb::Arm), Ok(()));
    }
    let mut world = World::ready();
    world.line_lost = true;
    world.run(300);
    assert_eq!((world.mode(), world.state().healthy), (Mode::Ready, 0));
    assert_eq!(world.count(Action::Kill(Process::Interface)), 0);
}

#[test]
fn a_process_that_is_ready_no_more_stops_the_vehicle() {
    let mut world = World::driving();
    world.actor(Process::Ingest).unready = true;
    assert_faulted(&mut world, Cause::Stale, Process::Ingest);
    let mut world = World::driving();
    world.actor(Process::Planner).unready = true;
    world.run(500);
    assert_eq!((world.mode(), world.state().healthy), (Mode::Driving, 0));
}

#[test]
fn a_tracker_that_gives_up_is_a_fault_with_its_reason() {
    let mut world = World::driving();
    world.give_up = true;
    assert_faulted(&mut world, Cause::Tracker, Process::Tracker);
    let words = text::as_str(&world.state().text).to_owned();
    assert_eq!(words, "tracker stopped: left the corridor of the plan");
    world.give_up = false;
    assert_eq!(world.ask(Verb::Arm), Ok(()), "the processes are healthy");
}

#[test]
fn a_lost_pose_is_a_fault_while_armed_and_needs_a_fix() {
    for make in [World::armed, World::driving] {
        for pose in [EstimatorState::Lost, EstimatorState::Unset] {
            let mut world = make();
            (world.pose, world.reset) = (pose, ResetReason::CounterReset);
            assert_faulted(&mut world, Cause::PoseLost, Process::Estimator);
            assert!(world.ask(Verb::Arm).expect_err("no pose").contains("send a fix"));
        }
    }
}

#[test]
fn the_gate_stopping_by_itself_is_a_fault() {
    let cases = [
        (AlterReason::CommandStale, Cause::Stale, Process::Tracker),
        (AlterReason::CommandInvalid, Cause::Gate, Process::Actuation),
        (AlterReason::PermitExpired, Cause::Gate, Process::Actuation),
        (AlterReason::Latched, Cause::Gate, Process::Actuation),
        (AlterReason::TrackerStop, Cause::Tracker, Process::Tracker),
    ];
    for (latch, cause, culprit) in cases {
        for make in [World::armed, World::driving] {
            let mut world = make();
            let old = Actuator { latch: latch.code(), arm: 0, ..Actuator::default() };
            world.event(Event::Actuator(&old));
            assert!(world.supervisor.permits(), "a latch of an earlier arm says nothing");
            world.event(Event::Actuator(&Actuator { arm: 1, ..old }));
            assert_faulted(&mut world, cause, culprit);
        }
    }
}

#[test]
fn lost_commands_are_found_through_the_gate() {
    let mut world = World::driving();
    world.commands_lost = true;
    assert_faulted(&mut world, Cause::Stale, Process::Tracker);
}

#[test]
fn a_gate_that_was_replaced_under_a_standing_permit_does_not_move_and_is_noticed() {
    let mut world = World::new(Some(Process::Actuation));
    world.run(500);
    world.ask(Verb::Arm).expect("accepted");
    world.plan();
    world.run(2_000);
    assert!(world.speed > 0.39);
    world.start(Process::Actuation);
    world.run_until(400, |world| !world.supervisor.permits());
    assert_eq!(world.out.speed, 0.0);
    world.run_until(3_000, |world| world.mode() == Mode::Faulted);
}
