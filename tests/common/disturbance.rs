//! A machine that keeps a process from running for longer than its time-outs makes a fault that no test made: the stack
//! is right to stop, and the test cannot say what it wants to say. It starts anew then, but only where the
//! [`witness`] saw the machine do it; the same fault on a machine that stalled nobody is a defect, and fails.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, panic_any, resume_unwind};

use kerbside_messages::{Cause, Nanos, Process};

use super::witness;

/// Attempts at a test.
const ATTEMPTS: u32 = 5;

thread_local! {
    /// When the attempt under way on this thread began.
    static BEGUN: Cell<Nanos> = const { Cell::new(0) };
}

/// What a test ends with when the machine disturbed it.
struct Disturbed(String);

/// Runs a test until the machine lets it.
///
/// # Panics
/// Where the test does, or is disturbed each time.
pub(crate) fn undisturbed(test: impl Fn()) {
    witness::begin();
    for attempt in 1..=ATTEMPTS {
        BEGUN.set(kerbside_runtime::now());
        let Err(payload) = catch_unwind(AssertUnwindSafe(&test)) else { return };
        match payload.downcast::<Disturbed>() {
            Ok(by) if attempt < ATTEMPTS => println!("disturbed, once more: {}", by.0),
            Ok(by) => panic!("disturbed {ATTEMPTS} times: {}", by.0),
            Err(other) => resume_unwind(other),
        }
    }
}

/// Ends the attempt where these words tell of lateness, not of the process that the test harmed, and the machine stalled
/// somebody since the attempt began.
pub(crate) fn end_if_stalled(words: &str, harmed: Option<Process>) {
    let late = [
        Cause::Silent,
        Cause::DeadlineMisses,
        Cause::Stale,
        Cause::LineLost,
        Cause::Gate,
        Cause::Tracker,
    ];
    let blamed = harmed.is_some_and(|process| words.contains(process.name()));
    if blamed || !late.iter().any(|cause| words.contains(cause.name())) {
        return;
    }
    match witness::stalled_since(BEGUN.get()) {
        Some(stall) => panic_any(Disturbed(format!("{words}; {stall}"))),
        None => println!("late, on a machine that stalled nobody: {words}"),
    }
}
