//! The nominal vehicle: its motion, its sensors, and its agreement with an independent reading.
// Helpers of tests are tests.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

mod bits;
mod motion;
mod sensing;
#[path = "../common/mod.rs"]
mod support;
mod vectors;
