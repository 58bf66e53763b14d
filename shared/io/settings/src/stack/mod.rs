//! `stack.toml`: how the processes of an instance behave.

mod bounds;
mod defaults;
mod gateway;
mod keys;
mod load;
mod prior;

use std::path::PathBuf;

use kerbside_geometry::Vehicle;
use kerbside_messages::Process;
use kerbside_odometry::{EstimatorSettings, IngestSettings};
use kerbside_planning::PlannerSettings;
use kerbside_safety::SafetySettings;
use kerbside_tracking::TrackerSettings;

use crate::declare::choices;
use crate::{Calibration, Uncertainty};

pub use defaults::{REAL_TIME_TIMEOUTS, scaled_tracker};
pub use gateway::{GatewaySettings, Right};
pub(crate) use keys::{StackDraft, schema};
pub(crate) use load::load;

/// The configuration of an instance.
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    /// The vehicle.
    pub vehicle: Vehicle,
    /// The file the vehicle comes from, as messages name it.
    pub vehicle_file: String,
    /// The vehicle's effective file, for recordings.
    pub vehicle_text: String,
    /// How far a car in good order may differ from the nominal one.
    pub uncertainty: Uncertainty,
    /// The calibration that the vehicle's values come from, where there was one.
    pub calibration: Option<Calibration>,
    /// Supervision and gate, with and without real-time rights: see [`Stack::safety`].
    safety: [SafetySettings; 2],
    /// Of the ingest stage.
    pub ingest: IngestSettings,
    /// Of the estimator; holds the initial pose.
    pub estimator: EstimatorSettings,
    /// Of the planner.
    pub planner: PlannerSettings,
    /// Of the tracker, scaled to the vehicle where the file says nothing.
    pub tracker: TrackerSettings,
    /// What the vehicle is reached through.
    pub interface: InterfaceSettings,
    /// Scheduling.
    pub realtime: RealtimeSettings,
    /// Recording.
    pub recorder: RecorderSettings,
    /// The door for other users.
    pub gateway: GatewaySettings,
    /// Logging.
    pub log: LogSettings,
    /// Who starts each process, in the order of [`Process::SUPERVISED`]: see [`Stack::start_of`].
    start: [Start; Process::SUPERVISED.len()],
}

impl Stack {
    /// Supervision and gate, with the time-outs of an instance that has real-time rights or of one
    /// that has not.
    #[must_use]
    pub fn safety(&self, realtime: bool) -> &SafetySettings {
        &self.safety[usize::from(realtime)]
    }

    /// Who starts a process. Processes outside the supervised set are never started by the
    /// supervisor.
    #[must_use]
    pub fn start_of(&self, process: Process) -> Start {
        let place = Process::SUPERVISED.iter().position(|supervised| *supervised == process);
        place.map_or(Start::External, |place| self.start[place])
    }
}

/// What the vehicle is reached through.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum InterfaceSettings {
    /// The serial line.
    Line {
        /// The device; none: the instance's simulated vehicle.
        device: Option<PathBuf>,
        /// Speed of the line \[bit/s\].
        baud: u32,
    },
    /// A recording.
    Replay,
}

choices! {
    /// Kinds of vehicle interface.
    pub enum InterfaceKind {
        /// The serial line.
        Line = "line",
        /// A recording.
        Replay = "replay",
    }
}

choices! {
    /// Whether real-time scheduling is asked for.
    pub enum RealtimeMode {
        /// Used where the rights are there.
        Auto = "auto",
        /// Demanded: without the rights the stack does not start.
        On = "on",
        /// Not used.
        Off = "off",
    }
}

/// Scheduling.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RealtimeSettings {
    /// Whether it is asked for.
    pub enabled: RealtimeMode,
    /// Priority of the control path under `SCHED_FIFO`.
    pub priority: u8,
    /// Whether memory is locked.
    pub lock_memory: bool,
    /// Cores the control path may run on; none: the last one there is.
    pub cores: Option<Vec<usize>>,
}

impl Default for RealtimeSettings {
    fn default() -> Self {
        Self { enabled: RealtimeMode::Auto, priority: 50, lock_memory: true, cores: None }
    }
}

choices! {
    /// Compression of recordings.
    pub enum Compression {
        /// LZ4.
        Lz4 = "lz4",
        /// None.
        None = "none",
    }
}

/// Recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecorderSettings {
    /// Whether anything is recorded.
    pub enabled: bool,
    /// Folder of the recordings; none: the user's XDG state folder.
    pub folder: Option<PathBuf>,
    /// Size of a chunk before compression \[byte\]; a recorder that is killed loses one at most.
    pub chunk_size: u32,
    /// Compression of chunks.
    pub compression: Compression,
    /// Size at which a recording is closed and the next one begun \[byte\].
    pub file_bytes: u64,
    /// Most that the recordings of an instance take together \[byte\]; none: all are kept.
    pub keep_bytes: Option<u64>,
    /// Days after which a recording is removed; none: all are kept.
    pub keep_days: Option<u32>,
}

impl Default for RecorderSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            folder: None,
            chunk_size: 262_144,
            compression: Compression::Lz4,
            file_bytes: 1_000_000_000,
            keep_bytes: None,
            keep_days: None,
        }
    }
}

choices! {
    /// Least severity that is logged.
    pub enum LogLevel {
        /// Errors alone.
        Error = "error",
        /// And warnings.
        Warn = "warn",
        /// And what an operator wants to know.
        Info = "info",
        /// And what a developer wants to know.
        Debug = "debug",
        /// Everything.
        Trace = "trace",
    }
}

choices! {
    /// Form of log lines.
    pub enum LogFormat {
        /// For people.
        Text = "text",
        /// One JSON object a line.
        Json = "json",
    }
}

/// Logging.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogSettings {
    /// Least severity; `RUST_LOG` overrides it.
    pub level: LogLevel,
    /// Form of the lines.
    pub format: LogFormat,
}

impl Default for LogSettings {
    fn default() -> Self {
        Self { level: LogLevel::Info, format: LogFormat::Text }
    }
}

choices! {
    /// Who starts a process.
    pub enum Start {
        /// The supervisor, which also ends and restarts it.
        Supervisor = "supervisor",
        /// Somebody else: it is awaited, watched and faulted, never killed.
        External = "external",
    }
}
