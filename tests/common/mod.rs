//! What tests with real processes share: a sandbox of its own for each stack, the stack itself, and an observer that
//! tells from shared memory what the vehicle and the processes do.
//!
//! A test binary takes it in with `mod common;`. Every wait is on an event and bounded; every stack is ended, and held
//! against having left a process, a segment or a folder behind.

// A test that cannot go on panics: that is how it says so. No test binary uses everything.
#![allow(
    dead_code,
    unused_imports,
    unreachable_pub,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic
)]

pub(crate) mod disturbance;
pub(crate) mod judging;
pub(crate) mod observer;
pub(crate) mod sandbox;
pub(crate) mod stack;
pub(crate) mod witness;

pub(crate) use disturbance::undisturbed;
pub(crate) use observer::{OdometryLine, RowLine, Seen, StateLine, TruthLine};
pub(crate) use sandbox::Sandbox;
pub(crate) use stack::{Outcome, Signal, Stack};

use core::time::Duration;

/// Longest wait for anything: a busy machine is slow, but what did not come by then never comes.
pub(crate) const PATIENCE: Duration = Duration::from_secs(30);
