//! Configuration in TOML: declared once, checked, explained.
//!
//! Five kinds of files: `stack.toml` (how the processes behave), `vehicles/NAME.toml` (what the
//! vehicle is believed to be), `scenarios/NAME.toml` (where to park), `run.toml` (about a recorded
//! run) and overlays (effects to be added to a vehicle). Each key is declared in one place with type, unit, range, default and prose; from
//! that come reading and checking, the text of every error, [`explain()`], the [`reference()`] page
//! and [`Loaded::show`].
//!
//! [`Sources`] finds files by name: a folder or file given, `./config`, `/etc/kerbside`, then what
//! is compiled in. Paths inside a file are relative to the file. A reading collects every problem
//! of a file, not only the first; a [`Problem`] carries file, place, key, value, what is allowed,
//! and the source text, so that a command line can point at it.
//!
//! `vehicle.toml` and `run.toml` are SI throughout, angles in radians, as run folders are. In the
//! files that people write for the stack, a key that holds degrees says so in its name:
//! `yaw_degrees`.

mod check;
mod declare;
mod explain;
mod open;
mod overlay;
mod problem;
mod run;
mod scenario;
mod sources;
mod stack;
mod vehicle;

pub use check::check;
pub(crate) use declare::nearest;
pub use declare::{
    Declaration, Kind, Loaded, Origin, Presence, Range, SectionDeclaration, Setting, Value,
};
pub use explain::{declarations, explain, explain_all, reference};
pub use open::{Parking, load_run, load_vehicle, parse_run, parse_vehicle};
pub use overlay::{load_overlay, parse_overlay};
pub use problem::{Cause, Problem, SettingsError, Severity};
pub use run::RunInfo;
pub use scenario::{Disturbance, Gear, Obstacle, PlanLimits, Scenario, Tolerance};
pub use sources::{COMPILED_IN, FileKind, Sources};
pub use stack::{
    Compression, GatewaySettings, InterfaceKind, InterfaceSettings, LogFormat, LogLevel,
    LogSettings, REAL_TIME_TIMEOUTS, RealtimeMode, RealtimeSettings, RecorderSettings, Right,
    Stack, Start, scaled_tracker,
};
pub use vehicle::{CALIBRATED, Calibration, Uncertainty, VehicleFile};
