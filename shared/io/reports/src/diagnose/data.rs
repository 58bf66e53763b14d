//! What the report of a diagnosis is made from.

use kerbside_diagnosis::{Diagnosis, RunPaths};
use kerbside_simulation::effects::Link;

use crate::Provenance;

/// A diagnosis, and what it takes to repeat it.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnoseReport {
    /// What was found.
    pub diagnosis: Diagnosis,
    /// Name of the vehicle.
    pub vehicle: String,
    /// Names of the runs, in the order that left-out gains have.
    pub runs: Vec<String>,
    /// The file with the effects beside the report; empty where there is none.
    pub overlay: String,
    /// The file with the commands of the next manoeuvre beside the report; empty where there is none.
    pub next_file: String,
    /// What else is to be known of the input, a sentence each.
    pub notes: Vec<String>,
    /// What it takes to repeat it.
    pub provenance: Provenance,
}

/// A name of a file's words as people write it.
pub(super) fn plain(name: &str) -> String {
    name.replace('_', " ")
}

/// From what to what a link goes.
pub(super) const fn way(link: Link) -> &'static str {
    match link {
        Link::SpeedActuation => "speed command to wheels",
        Link::SteeringActuation => "steering command to sensor",
        Link::Sensing => "motion to counts, angle, gyro",
        Link::Ground => "wheels and steering to body",
        Link::Reference => "body to reference",
    }
}

/// Points as figures take them.
pub(super) fn points(path: &[(f64, f64)]) -> Vec<[f64; 2]> {
    path.iter().map(|(x, y)| [*x, *y]).collect()
}

impl DiagnoseReport {
    /// Runs that are worth a figure of their own, those that went astray most first.
    pub(super) fn drawn(&self, most: usize) -> Vec<&RunPaths> {
        let worst = |run: &RunPaths| {
            let errors = run.errors.iter().map(|(_, nominal, _)| *nominal);
            errors.filter(|error| error.is_finite()).fold(0.0, f64::max)
        };
        let drawable = |run: &&RunPaths| !(run.measured.is_empty() && run.nominal.is_empty());
        let mut runs: Vec<&RunPaths> = self.diagnosis.paths.iter().filter(drawable).collect();
        runs.sort_by(|a, b| worst(b).total_cmp(&worst(a)));
        runs.truncate(most);
        runs
    }
}
