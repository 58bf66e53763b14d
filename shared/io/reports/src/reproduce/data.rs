//! What a report on the paper's experiments is made from.

use kerbside_geometry::Pose;
use kerbside_reproduction::Reproduction;

use crate::Provenance;

/// The paper's experiments, repeated.
#[derive(Clone, Debug, PartialEq)]
pub struct ReproductionReport {
    /// What came out.
    pub reproduction: Reproduction,
    /// Parkings of the whole stack; empty where none were made.
    pub stack: Vec<StackParking>,
    /// What it takes to repeat it.
    pub provenance: Provenance,
}

/// A scene parked by the whole stack, several times.
#[derive(Clone, Debug, PartialEq)]
pub struct StackParking {
    /// The scenario.
    pub scene: String,
    /// How it ran, for people.
    pub mode: String,
    /// True ends in the frame of the goal; none where there was none.
    pub ends: Vec<Option<Pose>>,
    /// How many were judged to be parked.
    pub parked: usize,
    /// Why the others were not, a sentence each.
    pub causes: Vec<String>,
}
