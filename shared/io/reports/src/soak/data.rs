//! What a report on a soak is made from.

use crate::Provenance;

/// A soak with real processes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SoakReport {
    /// What broke, in sentences; empty where nothing did.
    pub broken: Vec<String>,
    /// What it is held against, each with its limit.
    pub figures: Vec<SoakFigure>,
    /// Minutes.
    pub minutes: f64,
    /// How manoeuvres ended, as (how, how often).
    pub ends: Vec<(String, u64)>,
    /// What became of each fault.
    pub faults: Vec<SoakFault>,
    /// Latency from reading to command over time, as (minute, p50, p99, longest) \[min, us\].
    pub latency: Vec<[f64; 4]>,
    /// How fast what grows.
    pub slopes: Vec<SoakSlope>,
    /// Loads and other circumstances, as (name, value).
    pub circumstances: Vec<(String, String)>,
    /// What it takes to repeat it.
    pub provenance: Provenance,
}

/// A figure with its limit.
#[derive(Clone, Debug, PartialEq)]
pub struct SoakFigure {
    /// What it is, with unit.
    pub name: String,
    /// What was measured.
    pub value: f64,
    /// What is allowed at most.
    pub limit: f64,
    /// Whether it is as allowed.
    pub passed: bool,
}

/// What became of a fault.
#[derive(Clone, Debug, PartialEq)]
pub struct SoakFault {
    /// Kind: killed or stopped.
    pub kind: String,
    /// Whom it befell.
    pub process: String,
    /// In which mode.
    pub mode: String,
    /// What it did, in a word or two.
    pub effect: String,
    /// Rolled until the vehicle stood, and what is allowed \[m\]; none where it did not have to stop.
    pub stop: Option<(f64, f64)>,
    /// From the process's death to a stack that is whole again \[s\].
    pub recovery: Option<f64>,
    /// Whether all was as it should be.
    pub passed: bool,
}

/// How fast something grows.
#[derive(Clone, Debug, PartialEq)]
pub struct SoakSlope {
    /// Process.
    pub process: String,
    /// What of it, with unit.
    pub resource: String,
    /// Slope with its 95 % interval \[per minute\]; none where there was too little to tell.
    pub slope: Option<[f64; 3]>,
    /// Whether it leaks.
    pub leaks: bool,
    /// What it was over time, as (minute, value).
    pub points: Vec<[f64; 2]>,
}
