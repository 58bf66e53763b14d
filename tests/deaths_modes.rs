//! A process is killed or stopped while the vehicle does not drive: the stack comes back, and arms as it should.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::disturbance::end_if_stalled;
use common::stack::Verb;
use common::{Sandbox, Signal, Stack, undisturbed};
use kerbside_messages::{Mode, Nanos, Process};

/// The shortest whole manoeuvre, and where it starts.
const NEAR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/scenarios/near.toml");
const START: &str = "0,-0.02,90";

/// A stack that is ready and knows its pose.
fn ready() -> Stack {
    let stack = Stack::up(&["--start", START]);
    stack.until_mode(Mode::Ready);
    stack.fix("0", "-0.02", "90");
    stack
}

/// Signals a process, and waits until the stack is whole again in `faulted`.
fn fault(stack: &Stack, process: Process, signal: Signal) -> Nanos {
    let (pid, at) = stack.signal(process, signal);
    stack.until(&format!("a fault of {process}"), |seen| {
        let state = seen.state().filter(|state| state.sent > at)?;
        (!state.healthy).then_some(())
    });
    let whole = stack.until_recovered(Mode::Faulted, at);
    let state = stack.seen().state().cloned().unwrap();
    assert_ne!(state.row(process).pid, pid, "{state:#?}");
    end_if_stalled(&format!("{}: {}", state.cause, state.words), Some(process));
    assert!(state.words.contains(process.name()), "{state:#?}");
    println!("{process} {signal:?}: {:.3} s", kerbside_messages::seconds(whole - at));
    whole
}

fn arm(stack: &Stack) {
    let answer = stack.must(&["arm"]);
    assert_eq!(answer["mode"], Mode::Armed.name());
    stack.until_mode(Mode::Armed);
}

fn come_back_in_every_mode(signal: Signal) {
    let stack = ready();
    fault(&stack, Process::Estimator, signal); // in ready
    arm(&stack);
    fault(&stack, Process::Ingest, signal); // in armed
    let moved = stack.seen().distance();
    assert!(moved < 1e-3, "{moved} m before the first plan");
    let go = stack.go(NEAR);
    stack.until_driving(0.05);
    let stop = stack.begin(&["stop"]);
    stack.until_mode(Mode::Stopping);
    fault(&stack, Process::Tracker, signal); // in stopping
    assert_eq!(stop.end().code, Some(0));
    assert_eq!(go.end().code, Some(1));
    let rest = stack.seen().distance();
    let (_, at) = stack.signal(Process::Actuation, signal); // in faulted
    stack.until("an unhealthy stack", |seen| {
        seen.state().filter(|state| state.sent > at && !state.healthy).map(|_| ())
    });
    let refused = stack.verb(&["arm"]);
    assert_eq!(refused.code, Some(1), "{refused:?}");
    stack.until_recovered(Mode::Faulted, at);
    let moved = stack.seen().distance() - rest;
    assert!(moved < 1e-3, "{moved} m without an arm");
    arm(&stack);
    let ended = stack.down();
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let restarts: u32 = ended.seen.state().unwrap().rows.iter().map(|row| row.restarts).sum();
    assert_eq!(restarts, 4);
}

#[test]
fn killed_processes_come_back_in_every_mode() {
    undisturbed(|| come_back_in_every_mode(Signal::KILL));
}

#[test]
fn stopped_processes_come_back_in_every_mode() {
    undisturbed(|| come_back_in_every_mode(Signal::STOP));
}

/// A stack whose recorder somebody else starts: until then it is starting.
fn starting() -> Stack {
    let sandbox = Sandbox::new();
    let config = sandbox.file("stack.toml");
    let text = "vehicle = \"paper-1-6\"\n[safety]\nstop_distance = 0.65\n[process.recorder]\nstart = \"external\"\n";
    std::fs::write(&config, text).unwrap();
    Stack::up_in(sandbox, &["--config", config.to_str().unwrap()])
}

fn come_back_in_starting(process: Process, signal: Signal) {
    let stack = starting();
    let healthy = |life: u32| {
        stack.until(&format!("life {life} of {process}"), |seen| {
            let row = seen.in_mode(Mode::Starting)?.row(process);
            (row.restarts == life && row.state == "healthy").then_some(())
        });
    };
    healthy(0);
    stack.signal(process, signal);
    healthy(1);
    assert_eq!(stack.verb(&["arm"]).code, Some(1), "a stack that starts does not arm");
    let mut recorder = stack.sandbox().kerbside();
    recorder.args(["service", "recorder", "--instance", stack.instance().name()]);
    let recorder = Verb::start(recorder);
    stack.until_mode(Mode::Ready);
    stack.must(&["down"]);
    // Nobody but its own starter ends it, unless its supervisor stays silent.
    let recorder = recorder.end();
    assert_eq!(recorder.code, Some(75), "{recorder:?}");
    assert_eq!(stack.end().code, Some(0));
}

#[test]
fn a_killed_process_comes_back_in_starting() {
    come_back_in_starting(Process::Tracker, Signal::KILL);
}

#[test]
fn a_stopped_process_comes_back_in_starting() {
    come_back_in_starting(Process::Estimator, Signal::STOP);
}
