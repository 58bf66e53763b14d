//! A process of the stack is killed or stopped while the vehicle drives.
//!
//! On the control path: the vehicle stops in time, the process comes back, the estimator with its pose, and nothing moves
//! without a new arm. Planner and recorder: the manoeuvre is completed.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::judging::{Halt, pose_jump};
use common::{Outcome, Seen, Signal, Stack, undisturbed};
use kerbside_messages::{Mode, Nanos, Process};

/// The shortest whole manoeuvre.
const NEAR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/scenarios/near.toml");
/// The estimate may jump so far through the death of its process \[m\].
const JUMP: f64 = 0.01;

/// A fault of `process` in the middle of a drive, and what `park` makes of it.
fn fault_while_driving(process: Process, signal: Signal) -> (Outcome, u32, Nanos) {
    let stack = Stack::park(&["garage", "--seed", "7"]);
    stack.until_driving(0.2);
    let (pid, at) = stack.signal(process, signal);
    (stack.end(), pid, at)
}

fn control_path(process: Process, signal: Signal) {
    let (outcome, pid, at) = fault_while_driving(process, signal);
    let what = format!("{process} {}", name(signal));
    let seen = &outcome.seen;
    Halt::after(seen, at).assert_in_time(&what);
    if signal == Signal::STOP && feeds_the_gate(process) {
        assert_eq!(latch(seen, at), "command stale", "{what}: the gate did not wait for anybody");
    }
    assert_eq!(outcome.code, Some(1), "{outcome:?}");
    assert!(outcome.cause().contains(process.name()), "{what}: {}", outcome.cause());
    assert_eq!(outcome.json["parked"], false);
    assert_eq!(outcome.json["collision"], false);
    assert_eq!(outcome.json["restarts"], 1, "{what}: {}", outcome.stderr);
    let jump = pose_jump(seen, at);
    println!("{what}: pose jumps by {:.2} mm", 1e3 * jump);
    assert!(jump < JUMP, "{what}: {jump} m");
    let faulted = Mode::Faulted.name();
    let back = seen.states.iter().find(|state| state.mode == faulted && state.healthy);
    let back = back.unwrap_or_else(|| panic!("{what}: {:#?}", seen.states.last()));
    println!("{what}: whole again after {:.3} s", kerbside_messages::seconds(back.sent - at));
    let row = back.row(process);
    assert_eq!(row.restarts, 1, "{what}");
    assert_ne!(row.pid, pid, "{what}");
    assert_eq!(back.rows.iter().map(|row| row.restarts).sum::<u32>(), 1, "{what}: {back:#?}");
    // Nothing was armed again.
    assert!(seen.states.iter().all(|state| state.arms <= 1), "{what}");
}

/// Those whose silence the gate notices by itself, sooner than the supervisor.
fn feeds_the_gate(process: Process) -> bool {
    matches!(process, Process::Ingest | Process::Estimator | Process::Tracker)
}

/// What latched the gate first after `at`.
fn latch(seen: &Seen, at: Nanos) -> &str {
    let after = seen.gate.iter().filter(|gate| gate.sent > at);
    after.map(|gate| gate.latch.as_str()).find(|latch| *latch != "none").unwrap_or_default()
}

fn name(signal: Signal) -> &'static str {
    if signal == Signal::KILL { "killed" } else { "stopped" }
}

fn beside_the_path(process: Process, signal: Signal) {
    let stack = Stack::park(&[NEAR]);
    stack.until_driving(0.02);
    stack.signal(process, signal);
    stack.until(&format!("another {process}"), |seen| {
        let row = seen.state()?.row(process);
        (row.restarts == 1 && row.state == "healthy").then_some(())
    });
    let outcome = stack.end();
    outcome.assert_good(Some(process));
    assert_eq!(outcome.json["parked"], true);
    assert_eq!(outcome.json["restarts"], 1);
    if process == Process::Recorder {
        assert!(outcome.cause().contains("recorder"), "the verdict says it: {}", outcome.cause());
    }
}

macro_rules! faults {
    ($($name:ident: $judge:ident($process:ident, $signal:ident);)*) => {
        $(#[test]
        fn $name() {
            undisturbed(|| $judge(Process::$process, Signal::$signal));
        })*
    };
}

faults! {
    interface_killed: control_path(Interface, KILL);
    interface_stopped: control_path(Interface, STOP);
    ingest_killed: control_path(Ingest, KILL);
    ingest_stopped: control_path(Ingest, STOP);
    estimator_killed: control_path(Estimator, KILL);
    estimator_stopped: control_path(Estimator, STOP);
    tracker_killed: control_path(Tracker, KILL);
    tracker_stopped: control_path(Tracker, STOP);
    actuation_killed: control_path(Actuation, KILL);
    actuation_stopped: control_path(Actuation, STOP);
    planner_killed: beside_the_path(Planner, KILL);
    planner_stopped: beside_the_path(Planner, STOP);
    recorder_killed: beside_the_path(Recorder, KILL);
    recorder_stopped: beside_the_path(Recorder, STOP);
}
