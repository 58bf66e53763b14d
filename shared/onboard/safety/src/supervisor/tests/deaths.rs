//! Processes that die, stop, and come back.

use kerbside_messages::{Cause, EstimatorState, Mode, ProcessState, ResetReason, Verb, text};

use super::world::{MS, World, place};
use super::*;

fn control_path() -> impl Iterator<Item = Process> {
    Process::SUPERVISED.into_iter().filter(|process| process.on_control_path())
}

fn row(world: &World, process: Process) -> kerbside_messages::ProcessRow {
    world.state().processes[place(process)]
}

#[test]
fn a_death_on_the_control_path_stops_faults_and_restarts() {
    for process in control_path() {
        for make in [World::ready, World::armed, World::driving, World::stopping, World::faulted] {
            let mut world = make();
            let before = world.mode();
            world.kill(process);
            assert!(!world.supervisor.permits());
            world.run_until(3_000, |world| world.mode() == Mode::Faulted);
            world.run_until(1_000, |world| world.supervisor.is_healthy());
            if !matches!(before, Mode::Stopping | Mode::Faulted) {
                let why = (world.supervisor.cause(), world.supervisor.culprit());
                assert_eq!(why, (Cause::Died, Some(process)));
                let words = text::as_str(&world.state().text).to_owned();
                assert_eq!(words, format!("{process} died: signal 9"));
            }
            world.run(2_000);
            assert_eq!((world.mode(), world.speed), (Mode::Faulted, 0.0));
            assert_eq!(world.ask(Verb::Arm), Ok(()), "{process} in {before}");
        }
    }
}

#[test]
fn planner_and_recorder_die_without_stopping_the_vehicle() {
    for process in [Process::Planner, Process::Recorder, Process::Gateway] {
        for make in [World::ready, World::armed, World::driving] {
            let mut world = make();
            let before = world.mode();
            world.kill(process);
            world.run(10);
            assert_eq!((world.mode(), world.state().healthy), (before, 0));
            assert!(world.log.contains(&Action::Failed { process, cause: Cause::Died }));
            world.run(500);
            assert_eq!((world.mode(), world.state().healthy), (before, 1));
            assert_eq!(row(&world, process).restarts, 1);
            if before == Mode::Driving {
                world.run_until(9_000, |world| world.mode() == Mode::Ready);
                assert_eq!(world.supervisor.cause(), Cause::Completed);
            }
        }
    }
}

#[test]
fn a_stopped_process_is_a_fault_is_killed_and_comes_back() {
    for process in control_path() {
        let mut world = World::driving();
        let stopped = world.now;
        world.actor(process).stopped = true;
        world.run_until(400, |world| !world.supervisor.permits());
        world.run_until(400, |world| world.supervisor.cause() == Cause::Silent);
        assert_eq!(world.supervisor.culprit(), Some(process), "whatever showed first");
        assert_eq!(row(&world, process).state, ProcessState::Silent.code());
        world.run_until(1_500, |world| world.count(Action::Kill(process)) == 1);
        let silence = (world.now - stopped) / MS;
        assert!((980..1_020).contains(&silence), "{silence}");
        world.run_until(3_000, |world| {
            world.mode() == Mode::Faulted && world.supervisor.is_healthy()
        });
        assert_eq!((world.speed, world.ask(Verb::Arm)), (0.0, Ok(())));
    }
}

#[test]
fn a_stopped_planner_is_killed_while_the_plan_is_completed() {
    for process in [Process::Planner, Process::Recorder, Process::Gateway] {
        let mut world = World::driving();
        world.actor(process).stopped = true;
        world.run(1_900);
        assert_eq!(world.count(Action::Kill(process)), 0, "their window is longer");
        world.run(700);
        assert_eq!(world.count(Action::Kill(process)), 1);
        assert_eq!((world.mode(), world.state().healthy), (Mode::Driving, 1));
    }
}

#[test]
fn a_process_that_goes_on_within_a_second_is_healthy_after_a_window_of_beats() {
    let mut world = World::driving();
    world.actor(Process::Ingest).stopped = true;
    world.run(500);
    world.actor(Process::Ingest).stopped = false;
    world.run(100);
    assert_eq!(world.state().healthy, 0);
    world.run(400);
    assert_eq!((world.state().healthy, world.count(Action::Kill(Process::Ingest))), (1, 0));
    world.run(3_000);
    assert_eq!((world.mode(), world.speed), (Mode::Faulted, 0.0), "nothing resumes by itself");
}

#[test]
fn external_processes_are_awaited_faulted_and_never_killed() {
    let mut world = World::new(Some(Process::Tracker));
    *world.actor(Process::Tracker) = Default::default();
    world.run(6_000);
    assert_eq!(world.mode(), Mode::Starting);
    assert_eq!(row(&world, Process::Tracker).state, ProcessState::External.code());
    world.start(Process::Tracker);
    world.run(200);
    assert_eq!(world.mode(), Mode::Ready);
    world.ask(Verb::Arm).expect("accepted");
    world.run(20);
    world.plan();
    world.run(500);
    assert_eq!(world.mode(), Mode::Driving);
    world.actor(Process::Tracker).stopped = true;
    world.run(5_000);
    let why = (world.supervisor.cause(), world.supervisor.culprit());
    assert_eq!((world.mode(), why), (Mode::Faulted, (Cause::Silent, Some(Process::Tracker))));
    assert_eq!(world.count(Action::Kill(Process::Tracker)), 0);
    assert_eq!(world.count(Action::Spawn(Process::Tracker)), 0);
    world.start(Process::Tracker);
    world.run(500);
    assert_eq!(world.ask(Verb::Arm), Ok(()));
    assert_eq!(row(&world, Process::Tracker).restarts, 1);
}

#[test]
fn an_external_restart_faster_than_any_window_is_seen() {
    let mut world = World::new(Some(Process::Ingest));
    world.run(500);
    world.ask(Verb::Arm).expect("accepted");
    world.plan();
    world.run(500);
    world.start(Process::Ingest);
    world.run(120);
    assert!(!world.supervisor.permits());
    world.run_until(3_000, |world| world.mode() == Mode::Faulted);
    let why = (world.supervisor.cause(), world.supervisor.culprit());
    assert_eq!(why, (Cause::Died, Some(Process::Ingest)));
}

#[test]
fn heartbeats_of_another_life_do_not_count() {
    let mut world = World::ready();
    let mut old = world.actor(Process::Ingest).beat;
    old.failed = 1;
    old.pid = 1;
    world.event(Event::Heartbeat(&old));
    assert_eq!((world.mode(), world.state().healthy), (Mode::Ready, 1));
}

#[test]
fn the_pause_before_a_restart_doubles_and_ten_healthy_seconds_reset_it() {
    let mut world = World::ready();
    let mut pauses = Vec::new();
    for round in 0..4 {
        if round == 3 {
            world.run(10_200);
        }
        let (died, starts) = (world.now, world.count(Action::Spawn(Process::Ingest)));
        world.kill(Process::Ingest);
        let again = |world: &World| world.count(Action::Spawn(Process::Ingest)) > starts;
        world.run_until(6_000, again);
        pauses.push((world.now - died) / MS);
        world.run(300);
    }
    assert_eq!(pauses, [100, 200, 400, 100]);
}

#[test]
fn the_pause_has_an_end() {
    let mut world = World::ready();
    let mut longest = 0;
    for _ in 0..9 {
        world.run(8_000);
        let (died, starts) = (world.now, world.count(Action::Spawn(Process::Ingest)));
        world.kill(Process::Ingest);
        world.run_until(6_000, |world| world.count(Action::Spawn(Process::Ingest)) > starts);
        longest = (world.now - died) / MS;
    }
    assert_eq!(longest, 5_000);
}

#[test]
fn five_deaths_in_thirty_seconds_are_given_up_and_named() {
    for process in [Process::Ingest, Process::Recorder] {
        let mut world = World::driving();
        for death in 1..=5 {
            let given_up =
                |world: &World| row(world, process).state == ProcessState::GivenUp.code();
            assert!(!given_up(&world), "death {death}");
            world.run_until(3_000, |world| world.runs(process));
            world.kill(process);
        }
        assert_eq!(row(&world, process).state, ProcessState::GivenUp.code());
        world.run(60_000);
        let why = (world.supervisor.cause(), world.supervisor.culprit());
        assert_eq!((world.mode(), why), (Mode::Faulted, (Cause::GaveUp, Some(process))));
        assert_eq!(world.count(Action::Spawn(process)), 5);
        let refusal = world.ask(Verb::Arm).expect_err("one is missing");
        assert_eq!(refusal, format!("{process} is not ready: given up"));
    }
}

#[test]
fn failing_starts_are_deaths() {
    let mut world = World::new(None);
    world.spawns_fail = true;
    world.run(10_000);
    assert_eq!((world.mode(), world.supervisor.cause()), (Mode::Faulted, Cause::GaveUp));
    assert_eq!(world.count(Action::Spawn(Process::Planner)), 5);
}

#[test]
fn a_start_that_leads_nowhere_is_killed_but_waiting_aloud_is_no_fault() {
    let mut world = World::new(None);
    world.run(10);
    world.actor(Process::Ingest).stopped = true;
    world.actor(Process::Planner).unready = true;
    world.actor(Process::Estimator).unready = true;
    world.actor(Process::Estimator).waiting_for = "travel";
    world.run(4_980);
    let killed = |world: &World| world.log.iter().any(|action| matches!(action, Action::Kill(_)));
    assert!(!killed(&world));
    world.run(20);
    assert_eq!(world.count(Action::Kill(Process::Ingest)), 1);
    assert_eq!(world.count(Action::Kill(Process::Planner)), 1);
    world.run(60_000);
    assert_eq!(world.count(Action::Kill(Process::Estimator)), 0);
    assert_eq!(world.mode(), Mode::Starting);
    world.actor(Process::Estimator).unready = false;
    world.run(100);
    assert_eq!(world.mode(), Mode::Ready);
}

#[test]
fn a_start_nobody_answers_is_tried_again() {
    let supervised = [Supervised { process: Process::Ingest, external: false }];
    let stop = super::world::stop_times();
    let mut supervisor = Supervisor::new(&SafetySettings::default(), &supervised, stop, 1);
    let mut actions = Actions::default();
    let mut spawns = 0;
    for cycle in 0..1_100 {
        supervisor.step(cycle * 10 * MS, Event::Tick, &mut actions);
        spawns += actions.iter().filter(|action| matches!(action, Action::Spawn(_))).count();
    }
    assert_eq!(spawns, 3, "at once, and after 5 s twice");
}

#[test]
fn the_pose_survives_the_estimators_death() {
    let mut world = World::driving();
    world.kill(Process::Estimator);
    world.run_until(3_000, |world| world.mode() == Mode::Faulted);
    world.run(500);
    assert_eq!((world.pose, world.reset), (EstimatorState::Valid, ResetReason::Restored));
    assert!(world.supervisor.restore().is_none(), "taken up");
    let published = world.count(Action::PublishRestore);
    assert!((2..=40).contains(&published), "each cycle until then: {published}");
    assert_eq!(world.ask(Verb::Arm), Ok(()));
}

#[test]
fn what_a_dead_estimator_sent_last_does_not_end_the_restore() {
    let mut world = World::ready();
    let pid = world.actor(Process::Estimator).pid;
    world.kill(Process::Estimator);
    let header =
        kerbside_messages::Header { epoch: pid.into(), sent: world.now, ..Default::default() };
    let state = EstimatorState::Valid.code();
    let last = Odometry { header, state, x: 7.0, ..Odometry::default() };
    world.event(Event::Odometry(&last));
    assert_eq!(world.supervisor.restore().map(|restore| restore.x), Some(7.0));
}

#[test]
fn a_restarted_estimator_at_its_configured_start_is_not_believed() {
    let mut world = World::ready();
    world.kill(Process::Estimator);
    world.run_until(2_000, |world| world.runs(Process::Estimator));
    (world.pose, world.reset) = (EstimatorState::Valid, ResetReason::Initial);
    world.run(500);
    assert!(world.supervisor.restore().is_some());
    assert_eq!(world.ask(Verb::Arm), Err("no pose yet: send a fix".into()));
    world.reset = ResetReason::Restored;
    world.run(50);
    assert!(world.supervisor.restore().is_none());
    assert_eq!(world.ask(Verb::Arm), Ok(()));
}

#[test]
fn a_configured_start_is_believed_of_the_first_life() {
    let mut world = World::new(None);
    world.reset = ResetReason::Initial;
    world.run(500);
    assert_eq!(world.ask(Verb::Arm), Ok(()));
}

#[test]
fn a_lost_pose_does_not_come_back_through_a_restart() {
    let mut world = World::ready();
    (world.pose, world.reset) = (EstimatorState::Lost, ResetReason::CounterReset);
    world.run(50);
    world.kill(Process::Estimator);
    world.run(1_000);
    assert!(world.runs(Process::Estimator));
    assert_eq!(world.count(Action::PublishRestore), 0);
    assert_eq!(world.pose, EstimatorState::Unset);
    assert_eq!(world.ask(Verb::Arm), Err("no pose yet: send a fix".into()));
}
