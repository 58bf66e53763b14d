//! What a soak with real processes adds up to.

use std::collections::BTreeMap;

use hdrhistogram::Histogram;
use kerbside_messages::{Mode, Nanos, Process};

use super::flight::{Allowed, Course, Flight};
use super::resources::{Resource, Sample, Slope};
use super::strike::Blow;
use crate::manoeuvre::End;
use crate::park::trace::{Trace, histogram};

/// A soak ends early after so many broken invariants.
const HOPELESS: usize = 10;

/// What became of one fault.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Whom it befell.
    pub process: Process,
    /// What.
    pub blow: Blow,
    /// In which mode.
    pub mode: Mode,
    /// Motion ended for it.
    pub stopped: bool,
    /// Rolled until the vehicle stood \[m\].
    pub rolled: f64,
    /// What is allowed from the fastest speed \[m\].
    pub bound: f64,
    /// Time until it stood \[s\].
    pub seconds: f64,
    /// From the process's death to a stack that is whole again \[s\].
    pub recovery: Option<f64>,
    /// The vehicle moved, and had to stop.
    pub held: bool,
    /// It did not stop within the bound.
    pub not_stopped: bool,
    /// What failed did not come back.
    pub not_back: bool,
}

/// The whole soak.
#[derive(Debug)]
pub struct Totals {
    /// Its seed.
    pub seed: u64,
    /// Its instance.
    pub instance: String,
    /// Minutes.
    pub minutes: f64,
    /// Manoeuvres that ended.
    pub manoeuvres: u64,
    /// How they ended.
    pub ends: BTreeMap<String, u64>,
    /// Faults.
    pub flights: Vec<Cell>,
    /// Faults of the matrix that met nobody: the process was not there.
    pub missed: Vec<(Process, Blow, Mode)>,
    /// Loads.
    pub burdens: Vec<&'static str>,
    /// Hostile peers that were killed.
    pub peers: u64,
    /// Recorders whose disk was full.
    pub full_disks: u64,
    /// Deadline misses outside of faults.
    pub misses: u64,
    /// The same of the bare thread.
    pub bare_misses: u64,
    /// Beats of the bare thread.
    pub pulse_beats: u64,
    /// From reading to command \[us\], all of it.
    pub latency: Histogram<u64>,
    /// The same by minute.
    pub latency_by_minute: BTreeMap<u64, Histogram<u64>>,
    /// How fast memory, descriptors and segments grow.
    pub slopes: Vec<(String, Resource, Option<Slope>)>,
    /// What they were.
    pub samples: BTreeMap<(String, Resource), Vec<Sample>>,
    /// Processes that were left.
    pub orphans: Vec<(u32, String)>,
    /// Segments that were left.
    pub segments_left: Vec<String>,
}

impl Totals {
    /// Nothing yet.
    #[must_use]
    pub fn new(seed: u64, instance: &str) -> Self {
        Self {
            seed,
            instance: instance.to_owned(),
            minutes: 0.0,
            manoeuvres: 0,
            ends: BTreeMap::new(),
            flights: Vec::new(),
            missed: Vec::new(),
            burdens: Vec::new(),
            peers: 0,
            full_disks: 0,
            misses: 0,
            bare_misses: 0,
            pulse_beats: 0,
            latency: histogram(),
            latency_by_minute: BTreeMap::new(),
            slopes: Vec::new(),
            samples: BTreeMap::new(),
            orphans: Vec::new(),
            segments_left: Vec::new(),
        }
    }

    /// Takes in a fault that is over.
    pub(super) fn take(&mut self, flight: Flight, course: Course, allowed: &Allowed) {
        let (bound, _) = allowed.from(flight.fastest);
        self.flights.push(Cell {
            process: flight.process,
            blow: flight.blow,
            mode: flight.mode,
            stopped: flight.stopped,
            rolled: flight.rolled,
            bound,
            seconds: flight.stop_time(),
            recovery: flight.recovery(),
            held: flight.blow.must_stop(flight.process) && flight.fastest > 0.05,
            not_stopped: course == Course::NotStopped,
            not_back: course == Course::NotBack,
        });
    }

    /// A fault that met nobody.
    pub(super) fn missed(&mut self, process: Process, blow: Blow, mode: Mode) {
        self.missed.push((process, blow, mode));
    }

    /// Takes in a manoeuvre that is over.
    pub(super) fn ended(&mut self, end: End, outward: bool) {
        self.manoeuvres += 1;
        let way = if outward { "leaving" } else { "parking" };
        *self.ends.entry(format!("{way}: {end}")).or_default() += 1;
    }

    /// Takes in the latencies of a manoeuvre, or of a part of it.
    pub(super) fn saw(&mut self, began: Nanos, trace: &Trace) {
        let minute = trace.began.saturating_sub(began) / 60_000_000_000;
        let of_minute = self.latency_by_minute.entry(minute).or_insert_with(histogram);
        // The bounds are the same: what one holds the other does too.
        let _ = of_minute.add(&trace.latency);
        let _ = self.latency.add(&trace.latency);
    }

    /// Faults that broke an invariant.
    #[must_use]
    pub fn broken(&self) -> Vec<&Cell> {
        self.flights.iter().filter(|cell| cell.not_stopped || cell.not_back).collect()
    }

    /// Whether to go on makes no sense.
    #[must_use]
    pub fn is_hopeless(&self) -> bool {
        self.broken().len() >= HOPELESS
    }

    /// Manoeuvres that hung.
    #[must_use]
    pub fn hangs(&self) -> u64 {
        let hung = self.ends.iter().filter(|(end, _)| end.contains("timed out"));
        hung.map(|(_, count)| count).sum()
    }

    /// What leaks.
    #[must_use]
    pub fn leaks(&self) -> Vec<(&str, Resource, Slope)> {
        let mut leaking = Vec::new();
        for (name, resource, slope) in &self.slopes {
            if let Some(slope) = slope.filter(|slope| slope.leaks(name, *resource)) {
                leaking.push((name.as_str(), *resource, slope));
            }
        }
        leaking
    }

    /// Times from death to a whole stack \[s\], of supervised processes.
    #[must_use]
    pub fn recoveries(&self) -> Vec<f64> {
        self.flights.iter().filter_map(|cell| cell.recovery).collect()
    }

    /// Faults that a driving vehicle had to stop for.
    #[must_use]
    pub fn stops(&self) -> Vec<&Cell> {
        self.flights.iter().filter(|cell| cell.held).collect()
    }
}
