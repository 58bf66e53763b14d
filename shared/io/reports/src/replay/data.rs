//! What a replay report is made from.

use kerbside_geometry::{Pose, Wheel};

use crate::{Motion, Provenance};

/// A recorded drive, replayed through ingest and estimator. Samples of each kind are in the order
/// of their times.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayReport {
    /// What was replayed.
    pub input: String,
    /// Name of the vehicle.
    pub vehicle: String,
    /// How it was replayed, for people: through processes, or in one.
    pub mode: String,
    /// Why it was refused or ended badly; none: it went through.
    pub problem: Option<String>,
    /// What of the odometry must not be overlooked, a sentence.
    pub caution: Option<String>,
    /// Duration of the drive \[s\].
    pub duration: f64,
    /// Distance rolled, both directions added \[m\].
    pub distance: f64,
    /// Readings replayed.
    pub samples: u64,
    /// Drive time over replay time; not a number where it was not measured.
    pub speed_factor: f64,
    /// SHA-256 of the odometry, in hexadecimal.
    pub odometry_sha256: String,
    /// The odometry model and what the vehicle lacks.
    pub model: Model,
    /// The odometry; where there is a reference, of the reference's marker and in its frame.
    pub odometry: Vec<Motion>,
    /// The reference, of the marker as well; a yaw that is unknown is not a number.
    pub reference: Vec<Motion>,
    /// Drift against the reference; none without one.
    pub drift: Option<Drift>,
    /// Travel of each wheel that reports.
    pub travel: Vec<WheelTravel>,
    /// Stretches without usable readings.
    pub gaps: Vec<Gap>,
    /// Readings that were refused, by reason.
    pub refusals: Vec<RefusalCount>,
    /// What else is to be known, a sentence each.
    pub notes: Vec<String>,
    /// What it takes to repeat it.
    pub provenance: Provenance,
}

/// The odometry model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Its name.
    pub name: String,
    /// What it uses.
    pub uses: Vec<String>,
    /// What the vehicle or the recording lacks, and what follows from that.
    pub missing: Vec<String>,
}

/// How far odometry went astray.
#[derive(Clone, Debug, PartialEq)]
pub struct Drift {
    /// Error of position over the distance, median over windows \[%\].
    pub position_percent: f64,
    /// Error of heading over the distance, median over windows \[rad/m\].
    pub heading_per_metre: f64,
    /// Odometry minus reference at the end, along the axes of the reference's frame.
    pub end_error: Pose,
    /// How this was measured, for people: windows, alignment.
    pub basis: String,
}

/// Travel of a wheel.
#[derive(Clone, Debug, PartialEq)]
pub struct WheelTravel {
    /// Which.
    pub wheel: Wheel,
    /// (time \[s\], cumulative travel \[m\]); not a number where the wheel was not valid.
    pub points: Vec<[f64; 2]>,
}

/// A stretch without usable readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Gap {
    /// Beginning \[s\].
    pub start: f64,
    /// End \[s\].
    pub end: f64,
    /// What was missing, and what was made of it.
    pub text: String,
}

/// Refused readings of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct RefusalCount {
    /// Why.
    pub reason: String,
    /// How many.
    pub count: u64,
}
