//! Trajectory tracking control.
//!
//! The [`Tracker`] turns the pose estimate and the standing plan into commands: one per odometry
//! while it drives, none otherwise. It is a pure stage: its step allocates nothing, knows no clock,
//! and gives the same bits for the same samples.
//!
//! - `trajectory`: its own copy of the plan it follows, and the reference at any time.
//! - `kanayama`: the control law.
//! - `feedforward`: what the actuators' delays, lags and the differential ask for in advance.
//! - `guard`: when the tracker gives up.
//! - `tracker`: when it begins, follows, finishes.

mod feedforward;
mod guard;
mod kanayama;
mod settings;
mod tracker;
mod trajectory;

pub use settings::TrackerSettings;
pub use tracker::{Tracker, TrackerInputs};
