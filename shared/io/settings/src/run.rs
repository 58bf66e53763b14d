//! `run.toml` of a recorded run.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use kerbside_geometry::Pose;

use crate::SettingsError;
use crate::declare::{Kind, Loaded, Range, Reading, Schema, SourceFile, Value};

/// What is known of a run besides its samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunInfo {
    /// Name; equals the folder's.
    pub name: String,
    /// What was driven; empty where not stated.
    pub manoeuvre: String,
    /// The run whose commands this one repeats.
    pub repeat_of: Option<String>,
    /// Tape-measured travel of the rear-axle centre \[m\].
    pub distance: Option<f64>,
    /// Pose at the end relative to the start, measured by hand.
    pub end_pose: Option<Pose>,
    /// Pose of the body at t = 0 in the reference frame.
    pub start: Option<Pose>,
    /// Free remarks: floor, load, battery, ...
    pub conditions: BTreeMap<String, Value>,
}

#[derive(Default)]
pub(crate) struct RunDraft {
    info: RunInfo,
    end_pose: Option<[f64; 3]>,
    start: Pose,
}

const PLACE: Kind = Kind::metres(Range::ANY);
const ANY: Kind = Kind::Number { unit: "m, m, rad", range: Range::ANY };

static SCHEMA: LazyLock<Schema<RunDraft>> = LazyLock::new(declare);

/// The keys of `run.toml`.
pub(crate) fn schema() -> &'static Schema<RunDraft> {
    &SCHEMA
}

fn declare() -> Schema<RunDraft> {
    Schema::new(
        "run.toml",
        "About one recorded run. SI units, angles in radians.",
        RunDraft::default,
    )
    .required("name", Kind::Text, "Name of the run; equals the folder's.", |r| &mut r.info.name)
    .optional(
        "manoeuvre",
        Kind::Text,
        "unknown",
        "What was driven, in free text; straight, circle, slalom, steps and parking are \
             recognised.",
        |r| &mut r.info.manoeuvre,
    )
    .optional(
        "repeat_of",
        Kind::Text,
        "no repetition",
        "The run with the same commands, from about the same place.",
        |r| &mut r.info.repeat_of,
    )
    .optional(
        "distance",
        Kind::metres(Range::from(0.0)),
        "not measured",
        "Tape-measured travel of the rear-axle centre.",
        |r| &mut r.info.distance,
    )
    .optional(
        "end_pose",
        Kind::List { of: &ANY, least: 3, most: 3 },
        "not measured",
        "Pose at the end, x, y and yaw relative to the start, measured by hand.",
        |r| &mut r.end_pose,
    )
    .optional(
        "conditions",
        Kind::Free,
        "none stated",
        "Free remarks: floor, load, tyre_pressure, battery, driver, ...",
        |r| &mut r.info.conditions,
    )
    .optional_section(
        "start",
        "Pose of the body at t = 0 in the reference frame. Absent: taken from the reference.",
    )
    .required("start.x", PLACE, "Position along x.", |r| &mut r.start.x)
    .required("start.y", PLACE, "Position along y.", |r| &mut r.start.y)
    .required("start.yaw", Kind::radians(Range::ANY), "Heading.", |r| &mut r.start.yaw)
}

/// Reads a run's file.
///
/// # Errors
/// [`SettingsError::Refused`] with every problem of the file.
pub(crate) fn load(file: &SourceFile) -> Result<Loaded<RunInfo>, SettingsError> {
    let reading = Reading::new(schema(), file);
    let mut draft = RunDraft::default();
    reading.apply(&mut draft);
    let settings = reading.settings(&mut draft);
    let end_pose = draft.end_pose.map(|[x, y, yaw]| Pose::new(x, y, yaw));
    let start = reading.has("start").then_some(draft.start);
    reading.finish(Some(RunInfo { end_pose, start, ..draft.info }), settings)
}
