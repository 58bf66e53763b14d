//! What a soak in lockstep adds up to.

use std::collections::BTreeMap;

use kerbside_messages::{Nanos, Process, seconds};

use super::Outcome;
use crate::lockstep::{Broken, Invariant, Schedule, Stop};
use crate::manoeuvre::End;

/// A seed whose manoeuvre broke an invariant.
#[derive(Clone, Debug)]
pub struct Failed {
    /// The seed.
    pub seed: u64,
    /// The scene it drives in.
    pub scene: String,
    /// Its schedule.
    pub schedule: Schedule,
    /// What was broken.
    pub broken: Broken,
    /// The shortest schedule found that still breaks it, and how.
    pub shrunk: Option<(Schedule, Broken)>,
}

/// What all manoeuvres add up to.
#[derive(Clone, Debug)]
pub struct Totals {
    /// The first seed.
    pub first: u64,
    /// Faults by kind and process.
    pub faults: BTreeMap<&'static str, BTreeMap<Process, u64>>,
    /// How manoeuvres ended.
    pub ends: BTreeMap<String, u64>,
    /// Stops.
    pub stops: Vec<Stop>,
    /// Times until the stack was whole again \[s\].
    pub recoveries: Vec<f64>,
    /// Least distance to anything solid \[m\].
    pub clearance: f64,
    /// Seeds that broke something.
    pub failed: Vec<Failed>,
    /// Wall time \[s\].
    pub wall_seconds: f64,
    /// Time on a processor, all threads \[s\].
    pub processor_seconds: f64,
    /// Wall time of searches, all threads \[s\].
    pub search_seconds: f64,
    /// Threads.
    pub threads: usize,
    manoeuvres: u64,
    elapsed: Nanos,
}

impl Totals {
    /// Nothing yet; seeds count from `first`.
    #[must_use]
    pub fn new(first: u64) -> Self {
        Self {
            first,
            faults: BTreeMap::new(),
            ends: BTreeMap::new(),
            stops: Vec::new(),
            recoveries: Vec::new(),
            clearance: f64::INFINITY,
            failed: Vec::new(),
            wall_seconds: 0.0,
            processor_seconds: 0.0,
            search_seconds: 0.0,
            threads: 1,
            manoeuvres: 0,
            elapsed: 0,
        }
    }

    /// Manoeuvres.
    #[must_use]
    pub fn manoeuvres(&self) -> u64 {
        self.manoeuvres
    }

    /// Minutes of manoeuvres, on simulated time.
    #[must_use]
    pub fn minutes(&self) -> f64 {
        seconds(self.elapsed) / 60.0
    }

    /// Simulated over wall time and threads, and over time on a processor, which others on a busy machine take less of.
    #[must_use]
    pub fn speed(&self) -> (f64, f64) {
        #[allow(clippy::cast_precision_loss)] // threads
        let spent = self.wall_seconds * self.threads as f64;
        let simulated = seconds(self.elapsed);
        (simulated / spent.max(1e-9), simulated / self.processor_seconds.max(1e-9))
    }

    /// Faults that began.
    #[must_use]
    pub fn fault_count(&self) -> u64 {
        self.faults.values().flat_map(BTreeMap::values).sum()
    }

    /// How many seeds broke an invariant.
    #[must_use]
    pub fn broken(&self, invariant: Invariant) -> usize {
        self.failed.iter().filter(|failed| failed.broken.invariant == invariant).count()
    }

    /// Takes in a manoeuvre.
    pub fn add(&mut self, outcome: Outcome) {
        self.manoeuvres += 1;
        self.elapsed += outcome.elapsed;
        self.search_seconds += outcome.search_seconds;
        self.clearance = self.clearance.min(outcome.clearance);
        for fault in outcome.faults.faults() {
            let of_kind = self.faults.entry(fault.kind.name()).or_default();
            *of_kind.entry(fault.kind.process()).or_default() += 1;
        }
        self.stops.extend(outcome.stops);
        self.recoveries.extend(outcome.recoveries);
        *self.ends.entry(words(outcome.end)).or_default() += 1;
        if let Some(broken) = outcome.broken {
            self.failed.push(Failed {
                seed: outcome.seed,
                scene: outcome.scene,
                schedule: crate::lockstep::draw(outcome.seed),
                broken,
                shrunk: None,
            });
        }
    }
}

fn words(end: Option<End>) -> String {
    end.map_or_else(|| "invariant broken".to_owned(), |end| end.to_string())
}
