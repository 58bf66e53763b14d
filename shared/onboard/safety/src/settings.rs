//! What a configuration may set of supervision and gate.

use core::time::Duration;

/// Time-outs of the stack.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeouts {
    /// Oldest sample of the control path that is acted on.
    pub freshness: Duration,
    /// Life of a permit.
    pub permit: Duration,
    /// Silence after which the vehicle stops by itself.
    pub vehicle_silence: Duration,
    /// Silence after which the line counts as lost and is opened again.
    pub line_silence: Duration,
    /// Time between heartbeats.
    pub heartbeat: Duration,
    /// Window over which heartbeats are judged.
    pub heartbeat_window: Duration,
    /// The same for planner and recorder, whose work comes in lumps.
    pub slow_window: Duration,
    /// Longest time from a step's newest input to its end.
    pub deadline: Duration,
    /// So many misses within a second are a fault.
    pub deadline_misses: u32,
    /// A process whose supervisor is silent for so long exits.
    pub supervisor_silence: Duration,
    /// An armed stack without a plan becomes ready again.
    pub arm: Duration,
}

impl Default for Timeouts {
    /// The defaults without real-time rights.
    fn default() -> Self {
        Self {
            freshness: Duration::from_millis(100),
            permit: Duration::from_millis(150),
            vehicle_silence: Duration::from_millis(300),
            line_silence: Duration::from_millis(100),
            heartbeat: Duration::from_millis(20),
            heartbeat_window: Duration::from_millis(200),
            slow_window: Duration::from_secs(2),
            deadline: Duration::from_millis(50),
            deadline_misses: 5,
            supervisor_silence: Duration::from_secs(2),
            arm: Duration::from_secs(30),
        }
    }
}

/// How dead processes come back.
#[derive(Clone, Debug, PartialEq)]
pub struct RestartSettings {
    /// First pause before a restart; doubles with each.
    pub backoff: Duration,
    /// Longest pause.
    pub backoff_limit: Duration,
    /// A process healthy for so long starts over with the first pause.
    pub healthy: Duration,
    /// So many deaths of one process ...
    pub deaths: u32,
    /// ... within so long, and it is not started again.
    pub deaths_window: Duration,
}

impl Default for RestartSettings {
    fn default() -> Self {
        Self {
            backoff: Duration::from_millis(100),
            backoff_limit: Duration::from_secs(5),
            healthy: Duration::from_secs(10),
            deaths: 5,
            deaths_window: Duration::from_secs(30),
        }
    }
}

/// The whole.
#[derive(Clone, Debug, PartialEq)]
pub struct SafetySettings {
    /// Time-outs.
    pub timeouts: Timeouts,
    /// Restarts.
    pub restart: RestartSettings,
    /// The supervisor's own cycle.
    pub cycle: Duration,
    /// The gate's own cycle, kept without commands.
    pub actuation_period: Duration,
    /// Distance within which the vehicle must be able to stop from full speed after any single
    /// fault \[m\].
    pub stop_distance: f64,
}

impl Default for SafetySettings {
    fn default() -> Self {
        Self {
            timeouts: Timeouts::default(),
            restart: RestartSettings::default(),
            cycle: Duration::from_millis(10),
            actuation_period: Duration::from_millis(5),
            stop_distance: 0.65,
        }
    }
}
