//! The tracker in closed loop with a small kinematic car, and its decisions.
// Helpers of tests are tests.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

mod car;
mod closed_loop;
mod decisions;
mod drive;
mod scene;
