//! Trajectory tracking control.

mod settings;

pub use settings::TrackerSettings;
