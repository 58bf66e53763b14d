//! A machine that stalls a process for longer than its time-outs makes a fault that no test made: the stack is right to
//! stop, and the test starts anew. What comes again and again is no stall.

use std::panic::{AssertUnwindSafe, catch_unwind, panic_any, resume_unwind};

use kerbside_messages::{Cause, Process};

/// Attempts at a test.
const ATTEMPTS: u32 = 5;

/// What a test ends with when the machine disturbed it.
struct Disturbed(String);

/// Runs a test until it is not disturbed.
///
/// # Panics
/// Where the test does, or is disturbed each time.
pub(crate) fn undisturbed(test: impl Fn()) {
    for attempt in 1..=ATTEMPTS {
        let Err(payload) = catch_unwind(AssertUnwindSafe(&test)) else { return };
        match payload.downcast::<Disturbed>() {
            Ok(by) if attempt < ATTEMPTS => println!("disturbed, once more: {}", by.0),
            Ok(by) => panic!("disturbed {ATTEMPTS} times: {}", by.0),
            Err(other) => resume_unwind(other),
        }
    }
}

/// Ends the attempt where these words tell of lateness, and not of the process that the test harmed.
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
    if !blamed && late.iter().any(|cause| words.contains(cause.name())) {
        panic_any(Disturbed(words.to_owned()));
    }
}
