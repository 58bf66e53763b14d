//! Modes, supervision, permits and the actuation gate as pure decisions.

mod settings;

pub use settings::{RestartSettings, SafetySettings, Timeouts};
