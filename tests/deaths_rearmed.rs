//! After a fault the operator arms again, or the stack gives up.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use core::time::Duration;

use common::judging::Halt;
use common::{Signal, Stack, undisturbed};
use kerbside_messages::{Mode, Process};

/// The shortest whole manoeuvre, and where it starts.
const NEAR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/scenarios/near.toml");
const START: &str = "0,-0.02,90";
/// Long enough to stop, and to be refused an arm.
const INHIBIT: Duration = Duration::from_secs(3);

fn completed_under_a_new_arm(process: Process) {
    let stack = Stack::park(&[NEAR, "--rearm"]);
    stack.until_driving(0.1);
    let (_, at) = stack.signal(process, Signal::KILL);
    stack.until("another drive", |seen| {
        seen.in_mode(Mode::Driving).filter(|state| state.arms == 2).map(|_| ())
    });
    let stood = stack.seen();
    let outcome = stack.end();
    outcome.assert_good(Some(process));
    assert_eq!(outcome.json["parked"], true);
    assert_eq!(outcome.json["restarts"], 1);
    let again = stood.states.iter().find(|state| state.arms == 2).unwrap();
    println!("{process}: armed again after {:.3} s", kerbside_messages::seconds(again.sent - at));
}

#[test]
fn an_estimator_that_died_drives_on_after_a_new_arm() {
    undisturbed(|| completed_under_a_new_arm(Process::Estimator));
}

#[test]
fn a_tracker_that_died_drives_on_after_a_new_arm() {
    undisturbed(|| completed_under_a_new_arm(Process::Tracker));
}

#[test]
fn an_inhibit_stops_and_only_an_arm_leads_on() {
    undisturbed(inhibited);
}

fn inhibited() {
    let mut stack = Stack::up(&["--start", START]);
    stack.until_mode(Mode::Ready);
    stack.fix("0", "-0.02", "90");
    let go = stack.go(NEAR);
    stack.until_driving(0.1);
    let at = kerbside_runtime::now();
    let inhibited = kerbside_messages::nanos(INHIBIT.as_secs_f64());
    stack.inhibit(INHIBIT);
    stack.until_mode(Mode::Ready);
    stack.until_stands();
    Halt::after(&stack.seen(), at).assert_in_time("inhibit");
    let stopped = go.end();
    assert_eq!(stopped.code, Some(1), "{stopped:?}");
    assert!(stopped.cause().contains("in the way"), "{stopped:?}");
    assert_eq!(stack.verb(&["arm"]).code, Some(1), "the inhibit is still in force");
    let rest = stack.seen().distance();
    stack.until("the inhibit's end", |seen| {
        let state = seen.in_mode(Mode::Ready)?;
        (state.healthy && state.sent > at + inhibited).then_some(())
    });
    let moved = stack.seen().distance() - rest;
    assert!(moved < 1e-3, "{moved} m without an arm");
    stack.go(NEAR).end().assert_good(None);
    assert_eq!(stack.down().code, Some(0));
}

#[test]
fn five_deaths_are_too_many() {
    let stack = Stack::park(&["garage", "--rearm"]);
    for life in 0..5 {
        stack.until(&format!("life {life} of the estimator"), |seen| {
            let row = seen.state()?.row(Process::Estimator);
            (row.restarts == life && row.state == "healthy").then_some(())
        });
        stack.signal(Process::Estimator, Signal::KILL);
    }
    let outcome = stack.end();
    assert_eq!(outcome.code, Some(1), "{outcome:?}");
    assert!(outcome.cause().contains("too often"), "{}", outcome.cause());
    assert_eq!(outcome.json["restarts"], 4);
    let last = outcome.seen.in_mode(Mode::Faulted).or(outcome.seen.state()).unwrap();
    assert_eq!(last.row(Process::Estimator).state, "given up");
}
