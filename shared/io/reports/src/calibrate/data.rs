//! What a calibration report is made from.

use kerbside_geometry::Pose;

use crate::Provenance;

/// A calibration. Not a number stands for what is not known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CalibrateReport {
    /// Name of the vehicle.
    pub vehicle: String,
    /// How it was calibrated, for people.
    pub method: String,
    /// Why the result is bad; none where it is good.
    pub problem: Option<String>,
    /// Runs fitted, and runs of the case.
    pub runs: [u64; 2],
    /// Parameters that the sensors involve.
    pub parameters: Vec<CalibratedParameter>,
    /// Differences and ratios.
    pub derived: Vec<DerivedFigure>,
    /// How runs were left out, for people.
    pub basis: String,
    /// End errors of runs left out, of each run and source.
    pub left_out: Vec<EndErrors>,
    /// The same of rejected runs, which do not count.
    pub outliers: Vec<EndErrors>,
    /// Root mean squares of those that count per source; `run` says over how many runs.
    pub rms: Vec<EndErrors>,
    /// The one of them that counts.
    pub judged: Option<EndErrors>,
    /// Paths to draw.
    pub paths: Vec<RunPaths>,
    /// Residuals per fitted run.
    pub residuals: Vec<RunResidual>,
    /// Parameters that are not identified, and what would identify them.
    pub missing: Vec<RunNote>,
    /// Runs that were rejected, and why.
    pub rejected: Vec<RunNote>,
    /// What else was found in the runs.
    pub findings: Vec<RunNote>,
    /// What else is to be known, a sentence each.
    pub notes: Vec<String>,
    /// What it takes to repeat it.
    pub provenance: Provenance,
}

/// An identified parameter, each number in its unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CalibratedParameter {
    /// The key of vehicle.toml that holds it.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Before.
    pub nominal: f64,
    /// After.
    pub value: f64,
    /// 95 % interval; not numbers where the method gives none.
    pub interval: [f64; 2],
    /// Whether the runs identify it.
    pub identified: bool,
    /// What the paper's closed form finds; not a number where it does not identify it.
    pub closed_form: f64,
    /// Decimals worth showing.
    pub decimals: usize,
}

/// A quantity computed from parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DerivedFigure {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// Unit; `-` for a pure number.
    pub unit: String,
}

/// End errors before and after, in the frame of the start; a yaw that is unknown is not a number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EndErrors {
    /// The run.
    pub run: String,
    /// What was driven.
    pub manoeuvre: String,
    /// By which sensors.
    pub source: String,
    /// By the nominal vehicle.
    pub before: Pose,
    /// By the calibrated one.
    pub after: Pose,
}

/// The paths of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunPaths {
    /// The run.
    pub run: String,
    /// What was driven.
    pub manoeuvre: String,
    /// The reference's positions \[m\]; empty without.
    pub reference: Vec<[f64; 2]>,
    /// What is known of the end: marker or body, as the reference shows it.
    pub end: Option<Pose>,
    /// Dead reckoning, in the same frame.
    pub reckoned: Vec<ReckonedPath>,
}

/// A path by dead reckoning.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReckonedPath {
    /// By which sensors.
    pub source: String,
    /// By the nominal vehicle \[m\].
    pub before: Vec<[f64; 2]>,
    /// By the calibrated vehicle \[m\].
    pub after: Vec<[f64; 2]>,
}

/// Residuals of a run in standard deviations, as believed: 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunResidual {
    /// The run.
    pub run: String,
    /// Travel \[m\].
    pub travel: f64,
    /// Root mean square of what is known of poses, distance and turn, and how many that are.
    pub reference: (f64, u64),
    /// Root mean square of what front wheels, rear wheels and steering disagree on, and how many.
    pub axles: (f64, u64),
}

/// Something to be said of a run or a parameter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunNote {
    /// The run or the parameter.
    pub name: String,
    /// What.
    pub text: String,
}
