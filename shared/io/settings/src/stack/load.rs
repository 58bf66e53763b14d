//! From what a file states to a stack.

use std::path::PathBuf;

use kerbside_geometry::{Pose, angle};
use kerbside_odometry::InitialPose;

use super::{InterfaceKind, InterfaceSettings, Stack, StackDraft, bounds, schema};
use crate::declare::{Loaded, Reading, Setting, SourceFile};
use crate::sources::Sources;
use crate::{SettingsError, VehicleFile, vehicle};

/// Reads a stack's file and its vehicle's; `vehicle` overrides the one that the file names.
///
/// # Errors
/// [`SettingsError::Refused`] with every problem of both files.
pub(crate) fn load(
    sources: &Sources,
    file: &SourceFile,
    vehicle: Option<&str>,
) -> Result<Loaded<Stack>, SettingsError> {
    let mut reading = Reading::new(schema(), file);
    let mut named = StackDraft::new(1.0, false);
    reading.apply(&mut named);
    let Some(vehicle) = vehicle::named(sources, &mut reading, &named.vehicle, vehicle) else {
        return reading.finish(None, Vec::new());
    };
    let wheelbase = vehicle.value.vehicle.wheelbase;
    let mut drafts = [false, true].map(|realtime| {
        let mut draft = StackDraft::new(wheelbase, realtime);
        reading.apply(&mut draft);
        draft
    });
    if reading.is_sound() {
        bounds::check(&mut reading, &mut drafts, &vehicle.value.vehicle);
    }
    let [mut draft, mut with_rights] = drafts;
    let settings = settings(&reading, &mut draft, &mut with_rights);
    let stack = stack(&reading, draft, with_rights, vehicle);
    reading.finish(Some(stack), settings)
}

fn settings(
    reading: &Reading<'_, StackDraft>,
    draft: &mut StackDraft,
    with_rights: &mut StackDraft,
) -> Vec<Setting> {
    let mut settings = reading.settings(draft);
    let others = reading.settings(with_rights);
    for setting in &mut settings {
        let other = others.iter().find(|other| other.key == setting.key);
        if let Some(other) = other.filter(|other| other.value != setting.value) {
            setting.note = Some(format!("{} with real-time rights", other.value));
        }
    }
    settings
}

fn stack(
    reading: &Reading<'_, StackDraft>,
    draft: StackDraft,
    with_rights: StackDraft,
    vehicle: Loaded<VehicleFile>,
) -> Stack {
    let local = |path: Option<String>| path.map(|path| local(&reading.file, path));
    let mut estimator = draft.estimator;
    estimator.initial_pose = reading.has("initial_pose").then(|| InitialPose {
        pose: Pose::new(
            draft.initial.x,
            draft.initial.y,
            angle::radians(draft.initial.yaw_degrees),
        ),
        position_noise: draft.initial.position_noise,
        yaw_noise: angle::radians(draft.initial.yaw_noise_degrees),
    });
    let mut recorder = draft.recorder;
    recorder.folder = local(draft.recorder_folder);
    let mut gateway = draft.gateway;
    gateway.socket = local(draft.gateway_socket);
    let interface = match draft.interface {
        InterfaceKind::Line => {
            InterfaceSettings::Line { device: local(draft.device), baud: draft.baud }
        }
        InterfaceKind::Replay => InterfaceSettings::Replay,
    };
    Stack {
        vehicle_text: vehicle.show(),
        vehicle: vehicle.value.vehicle,
        vehicle_file: vehicle.file,
        uncertainty: vehicle.value.uncertainty,
        calibration: vehicle.value.calibration,
        safety: [draft.safety, with_rights.safety],
        ingest: draft.ingest,
        estimator,
        planner: draft.planner,
        tracker: draft.tracker,
        interface,
        realtime: draft.realtime,
        recorder,
        gateway,
        log: draft.log,
        start: draft.start,
    }
}

/// A path of a file, relative to the file's folder.
fn local(file: &SourceFile, path: String) -> PathBuf {
    match &file.folder {
        Some(folder) => folder.join(path),
        None => PathBuf::from(path),
    }
}
