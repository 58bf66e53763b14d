//! The deaths of those who watch and of those who are driven: the supervisor, `park` itself, the simulated vehicle.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use core::time::Duration;

use common::judging::Halt;
use common::stack::poll;
use common::{Sandbox, Signal, Stack, undisturbed};
use kerbside_messages::{Mode, Nanos, Process};

/// The shortest whole manoeuvre, and where it starts.
const NEAR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/scenarios/near.toml");
const START: &str = "0,-0.02,90";
/// A service whose supervisor is silent for two seconds ends, and ending takes a moment.
const ORPHANED: Duration = Duration::from_secs(4);

fn driving(arguments: &[&str]) -> Stack {
    let mut all = vec![NEAR];
    all.extend(arguments);
    let stack = Stack::park(&all);
    stack.until_driving(0.1);
    stack
}

/// A stack of `up` that drives because somebody said `go`.
fn gone() -> Stack {
    let stack = Stack::up(&["--start", START]);
    stack.until_mode(Mode::Ready);
    stack.fix("0", "-0.02", "90");
    let go = stack.go(NEAR);
    stack.until_driving(0.1);
    std::thread::spawn(move || go.end());
    stack
}

/// Services of the stack that still run.
fn services(sandbox: &Sandbox) -> usize {
    let service = |process: &Process| {
        kerbside_runtime::FileLock::holder(&sandbox.instance().process_lock(*process)).is_some()
    };
    Process::SUPERVISED.iter().filter(|process| service(process)).count()
}

fn end_by_themselves(sandbox: &Sandbox) {
    let gone = poll(ORPHANED, || (services(sandbox) == 0).then_some(()));
    assert!(gone.is_some(), "{:?}", sandbox.processes());
}

fn park_without_its_supervisor(signal: Signal) {
    let stack = driving(&["--rearm"]);
    let (_, at) = stack.signal(Process::Supervisor, signal);
    let outcome = stack.end();
    Halt::after(&outcome.seen, at).assert_in_time("supervisor lost");
    assert_eq!(outcome.code, Some(1), "{outcome:?}");
    assert_eq!(outcome.cause(), "supervisor lost");
}

#[test]
fn park_ends_when_its_supervisor_is_killed() {
    undisturbed(|| {
        park_without_its_supervisor(Signal::KILL);
    });
}

#[test]
fn park_ends_when_its_supervisor_is_stopped() {
    undisturbed(|| {
        park_without_its_supervisor(Signal::STOP);
    });
}

#[test]
fn the_vehicle_stops_although_the_supervisor_cannot_act() {
    undisturbed(|| {
        for process in [Process::Tracker, Process::Actuation] {
            let stack = driving(&["--rearm"]);
            stack.signal(Process::Supervisor, Signal::STOP);
            let (_, at) = stack.signal(process, Signal::KILL);
            let outcome = stack.end();
            Halt::after(&outcome.seen, at)
                .assert_in_time(&format!("supervisor STOP, {process} KILL"));
            assert_eq!(outcome.cause(), "supervisor lost");
        }
    });
}

#[test]
fn a_killed_supervisor_has_a_successor_for_the_same_vehicle() {
    undisturbed(|| {
        let stack = gone();
        let vehicle = stack.pid(Process::Vehicle);
        let (_, at) = stack.signal(Process::Supervisor, Signal::KILL);
        stack.until_stands();
        Halt::after(&stack.seen(), at).assert_in_time("supervisor of up KILL");
        end_by_themselves(stack.sandbox());
        let (first, sandbox) = stack.end_and_keep();
        assert_eq!(first.code, None, "killed");
        let stack = Stack::up_in(sandbox, &[]);
        stack.until_mode(Mode::Ready);
        assert_eq!(stack.pid(Process::Vehicle), vehicle);
        let refused = stack.verb(&["arm"]);
        assert_eq!(refused.code, Some(1), "the pose died with the first supervisor: {refused:?}");
        assert!(refused.json["text"].as_str().unwrap().contains("fix"), "{refused:?}");
        assert_eq!(stack.down().code, Some(0));
    });
}

#[test]
fn a_successor_ends_what_is_left_at_once() {
    let stack = Stack::up(&[]);
    stack.until_mode(Mode::Ready);
    let vehicle = stack.pid(Process::Vehicle);
    let tracker = stack.pid(Process::Tracker);
    // A stopped orphan does not end by itself.
    stack.signal(Process::Tracker, Signal::STOP);
    stack.signal(Process::Supervisor, Signal::KILL);
    let (_, sandbox) = stack.end_and_keep();
    assert!(services(&sandbox) > 0);
    let stack = Stack::up_in(sandbox, &[]);
    stack.until_mode(Mode::Ready);
    assert_eq!(stack.pid(Process::Vehicle), vehicle);
    assert_ne!(stack.pid(Process::Tracker), tracker);
    let processes = stack.sandbox().processes();
    assert!(processes.iter().all(|(pid, _)| *pid != tracker), "{processes:?}");
    assert_eq!(stack.down().code, Some(0));
}

#[test]
fn a_stopped_supervisor_keeps_its_instance_and_comes_back() {
    undisturbed(|| {
        let stack = gone();
        let (pid, at) = stack.signal(Process::Supervisor, Signal::STOP);
        stack.until_stands();
        Halt::after(&stack.seen(), at).assert_in_time("supervisor of up STOP");
        end_by_themselves(stack.sandbox());
        let mut second = stack.sandbox().kerbside();
        second.args(["up", "--instance", stack.instance().name()]);
        let refused = common::stack::Verb::start(second).end();
        assert_eq!(refused.code, Some(75), "{refused:?}");
        assert!(refused.stderr.contains(&pid.to_string()), "{refused:?}");
        common::stack::send(pid, Signal::CONT);
        let rest = stack.seen().distance();
        stack.until("the stack to be whole again", |seen| {
            seen.in_mode(Mode::Faulted).filter(|state| state.healthy && state.sent > at).map(|_| ())
        });
        let moved = stack.seen().distance() - rest;
        assert!(moved < 1e-3, "{moved} m without an arm");
        assert_eq!(stack.down().code, Some(0));
    });
}

#[test]
fn nothing_outlives_a_park_that_is_killed() {
    undisturbed(|| {
        let stack = driving(&[]);
        stack.signal_main(Signal::KILL);
        let (outcome, sandbox) = stack.end_and_keep();
        assert_eq!(outcome.code, None);
        let gone = poll(ORPHANED, || sandbox.processes().is_empty().then_some(()));
        assert!(gone.is_some(), "{:?}", sandbox.processes());
        assert_eq!(sandbox.segments(), Vec::<String>::new());
    });
}

#[test]
fn park_ends_when_the_vehicle_is_killed() {
    undisturbed(|| {
        let stack = driving(&["--rearm"]);
        stack.signal(Process::Vehicle, Signal::KILL);
        let outcome = stack.end();
        assert_eq!(outcome.code, Some(1), "{outcome:?}");
        assert_eq!(outcome.cause(), "vehicle lost");
    });
}

#[test]
fn a_stopped_vehicle_is_a_lost_line_and_found_again() {
    undisturbed(|| {
        let stack = driving(&["--rearm"]);
        let (pid, _) = stack.signal(Process::Vehicle, Signal::STOP);
        let lost = |seen: &common::Seen| {
            let state = seen.in_mode(Mode::Faulted)?;
            (state.cause == "line lost" && !state.healthy).then_some(seen.distance())
        };
        let rolled = stack.until("a lost line", lost);
        common::stack::send(pid, Signal::CONT);
        let at = kerbside_runtime::now();
        let found = found_again(&stack, at);
        println!("the line is found after {found:.3} s");
        assert!(found < 1.0, "{found} s");
        let outcome = stack.end();
        outcome.assert_good(None);
        assert_eq!(outcome.json["restarts"], 0);
        assert!(outcome.seen.distance() > rolled);
    });
}

/// Time from `at` until the interface is ready again \[s\].
fn found_again(stack: &Stack, at: Nanos) -> f64 {
    let sent = stack.until("the line", |seen| {
        let state = seen.states.iter().find(|state| state.sent > at && state.healthy)?;
        Some(state.sent)
    });
    kerbside_messages::seconds(sent - at)
}

#[test]
fn without_rearming_a_lost_line_is_the_verdict() {
    undisturbed(|| {
        let stack = driving(&[]);
        stack.signal(Process::Vehicle, Signal::STOP);
        let outcome = stack.end();
        assert_eq!(outcome.code, Some(1), "{outcome:?}");
        assert!(outcome.cause().contains("line lost"), "{}", outcome.cause());
    });
}

#[test]
fn another_vehicle_has_no_pose() {
    let stack = Stack::up(&[]);
    stack.until_mode(Mode::Ready);
    stack.fix("0", "0", "0");
    let (_, at) = stack.signal(Process::Vehicle, Signal::KILL);
    stack.until("a lost line", |seen| {
        let state = seen.state().filter(|state| state.sent > at)?;
        (state.row(Process::Interface).state != "healthy").then_some(())
    });
    let mut vehicle = stack.sandbox().kerbside();
    vehicle.args(["service", "vehicle", "--instance", stack.instance().name()]);
    let vehicle = common::stack::Verb::start(vehicle);
    let back = kerbside_runtime::now();
    found_again(&stack, back);
    let refused = stack.verb(&["arm"]);
    assert_eq!(refused.code, Some(1), "{refused:?}");
    assert!(refused.json["text"].as_str().unwrap().contains("fix"), "{refused:?}");
    stack.fix("0", "0", "0");
    stack.must(&["arm"]);
    assert_eq!(stack.down().code, Some(0));
    assert_eq!(vehicle.end().code, Some(0), "it belongs to the stack that drives it");
}

#[test]
fn a_vehicle_that_outlives_its_stack_does_not_disturb_the_next() {
    let sandbox = Sandbox::new();
    let mut vehicle = sandbox.kerbside();
    vehicle.args(["service", "vehicle", "--instance", sandbox.instance().name()]);
    let vehicle = common::stack::Verb::start(vehicle);
    let first = Stack::start(sandbox, &["up"]);
    first.until_mode(Mode::Ready);
    first.until("truth", |seen| seen.truth.last().map(|_| ()));
    first.must(&["down"]);
    let (ended, sandbox) = first.end_and_keep();
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let second = Stack::start(sandbox, &["up"]);
    // By now the vehicle has let go of what it held of the first.
    second.until("truth", |seen| seen.truth.last().map(|_| ()));
    let (_, at) = second.signal(Process::Tracker, Signal::KILL);
    second.until("another tracker", |seen| {
        let state = seen.state().filter(|state| state.sent > at)?;
        let row = state.row(Process::Tracker);
        (row.restarts == 1 && row.state == "healthy").then_some(())
    });
    let pid = second.pid(Process::Vehicle);
    second.must(&["down"]);
    let (ended, _sandbox) = second.end_and_keep();
    assert_eq!(ended.code, Some(0), "{ended:?}");
    common::stack::send(pid, Signal::TERM);
    assert_eq!(vehicle.end().code, Some(0));
}

#[test]
fn two_stacks_side_by_side_do_not_meet() {
    undisturbed(|| {
        let sandbox = Sandbox::new();
        let beside = sandbox.beside();
        let calm = Stack::park_in(sandbox, &[NEAR]);
        let faulty = Stack::park_in(beside, &[NEAR]);
        for stack in [&calm, &faulty] {
            stack.until_driving(0.01);
        }
        let mut status = calm.sandbox().kerbside();
        status.arg("status");
        let several = common::stack::Verb::start(status).end();
        assert_eq!(several.code, Some(75), "{several:?}");
        assert!(several.stderr.contains("one") && several.stderr.contains("two"), "{several:?}");
        faulty.signal(Process::Tracker, Signal::KILL);
        let outcome = faulty.end();
        assert_eq!(outcome.code, Some(1), "{outcome:?}");
        let outcome = calm.end();
        outcome.assert_good(None);
        assert_eq!(outcome.json["restarts"], 0);
        assert!(outcome.seen.states.iter().all(|state| state.mode != Mode::Faulted.name()));
    });
}
