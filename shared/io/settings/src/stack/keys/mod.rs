//! The keys of `stack.toml`.

mod gateway;
mod motion;
mod supervision;
mod surroundings;

use std::sync::LazyLock;

use kerbside_messages::Process;
use kerbside_odometry::{EstimatorSettings, IngestSettings};
use kerbside_planning::PlannerSettings;
use kerbside_safety::SafetySettings;
use kerbside_tracking::TrackerSettings;

use super::defaults::{scaled_tracker, timeouts};
use super::{
    GatewaySettings, InterfaceKind, LogSettings, RealtimeSettings, RecorderSettings, Start,
};
use crate::declare::{Kind, Schema};

/// A stack as far as its file states it, on top of the defaults.
pub(crate) struct StackDraft {
    pub(in crate::stack) vehicle: String,
    pub(in crate::stack) safety: SafetySettings,
    pub(in crate::stack) ingest: IngestSettings,
    pub(in crate::stack) estimator: EstimatorSettings,
    pub(in crate::stack) planner: PlannerSettings,
    pub(in crate::stack) tracker: TrackerSettings,
    pub(in crate::stack) interface: InterfaceKind,
    pub(in crate::stack) device: Option<String>,
    pub(in crate::stack) baud: u32,
    pub(in crate::stack) realtime: RealtimeSettings,
    pub(in crate::stack) recorder: RecorderSettings,
    pub(in crate::stack) recorder_folder: Option<String>,
    pub(in crate::stack) gateway: GatewaySettings,
    pub(in crate::stack) gateway_socket: Option<String>,
    pub(in crate::stack) log: LogSettings,
    pub(in crate::stack) start: [Start; Process::SUPERVISED.len()],
    pub(in crate::stack) initial: InitialDraft,
}

/// `[initial_pose]`, in the units of the file.
#[derive(Clone, Copy)]
pub(in crate::stack) struct InitialDraft {
    pub(in crate::stack) x: f64,
    pub(in crate::stack) y: f64,
    pub(in crate::stack) yaw_degrees: f64,
    pub(in crate::stack) position_noise: f64,
    pub(in crate::stack) yaw_noise_degrees: f64,
}

impl StackDraft {
    /// The defaults for a vehicle of that wheelbase \[m\], with or without real-time rights.
    pub(in crate::stack) fn new(wheelbase: f64, realtime: bool) -> Self {
        let stated = f64::NAN;
        Self {
            vehicle: String::new(),
            safety: SafetySettings { timeouts: timeouts(realtime), ..SafetySettings::default() },
            ingest: IngestSettings::default(),
            estimator: EstimatorSettings::default(),
            planner: PlannerSettings::default(),
            tracker: scaled_tracker(wheelbase),
            interface: InterfaceKind::Line,
            device: None,
            baud: 921_600,
            realtime: RealtimeSettings::default(),
            recorder: RecorderSettings::default(),
            recorder_folder: None,
            gateway: GatewaySettings::default(),
            gateway_socket: None,
            log: LogSettings::default(),
            start: [Start::Supervisor; Process::SUPERVISED.len()],
            initial: InitialDraft {
                x: stated,
                y: stated,
                yaw_degrees: stated,
                position_noise: 0.002,
                yaw_noise_degrees: 0.1,
            },
        }
    }
}

static SCHEMA: LazyLock<Schema<StackDraft>> = LazyLock::new(declare);

/// The keys of `stack.toml`.
pub(crate) fn schema() -> &'static Schema<StackDraft> {
    &SCHEMA
}

fn declare() -> Schema<StackDraft> {
    let schema = Schema::new(
        "stack.toml",
        "How the processes of an instance behave. SI units; a key whose name ends in `_degrees` is \
         in degrees. Defaults shown are for the 1:6 car without real-time rights.",
        || StackDraft::new(0.5, false),
    )
    .variant("with real-time rights", || StackDraft::new(0.5, true))
    .variant("for a wheelbase of 1 m", || StackDraft::new(1.0, false))
    .required(
        "vehicle",
        Kind::Text,
        "The vehicle: a name to look for under `vehicles/`, or a path, relative to this file.",
        |s| &mut s.vehicle,
    );
    let schema = motion::declare(supervision::declare(schema));
    gateway::declare(surroundings::declare(schema))
}
