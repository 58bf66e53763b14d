//! Vehicles with effects: their agreement with an independent reading, and how effects combine.
// Helpers of tests are tests.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod support;
mod vectors;
