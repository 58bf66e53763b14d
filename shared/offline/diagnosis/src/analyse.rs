//! From a case to ranked hypotheses: noise, listed effects, and what is not listed.

use kerbside_simulation::Effects;
use rayon::prelude::*;

use crate::bench::{Bench, Whole};
use crate::bins::{Channels, to_f64};
use crate::candidate::{Candidate, candidates};
use crate::case::Wheels;
use crate::fit::{Fit, Search};
use crate::generic::{Axis, Entry};
use crate::noise::{self, Noise};
use crate::nuisance::Nuisance;
use crate::outliers::white;
use crate::prepare::Ready;
use crate::rivals::{self, Shapes};
use crate::search::{self, Hypotheses};

/// Rows that show another noise than the usual one by this factor are believed.
const CONTRADICTS: f64 = 4.0;
/// Least noise of a speed, as a share of the limit.
const LEAST: f64 = 1e-4;
/// Groups of shapes that the noise is estimated beside, at most.
const GROUPS: usize = 3;
/// Logarithm of the evidence that a group must gain to be one of them.
const WORTH: f64 = 10.0;

/// A group of shapes beside a set of effects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beside {
    pub entry: Entry,
    pub axis: Axis,
    /// Logarithm of the evidence with the group over that without.
    pub log_evidence: f64,
    /// Twice the gain in log-likelihood.
    pub gain: f64,
}

/// What the runs say of every hypothesis.
pub(crate) struct Analysis<'a> {
    pub bench: Bench<'a>,
    pub candidates: Vec<Candidate>,
    pub noise: Noise,
    /// Without any effect.
    pub nothing: Fit,
    /// Singles and pairs, likeliest first.
    pub fits: Vec<Fit>,
    /// Shapes beside no effect, likeliest first.
    pub beside_nothing: Vec<Beside>,
    /// Shapes beside the likeliest set, likeliest first.
    pub beside_best: Vec<Beside>,
}

/// Analyses a case.
pub(crate) fn analyse<'a>(
    ready: &'a Ready<'a>,
    nuisances: &'a [Nuisance],
    progress: &dyn Fn(&str, f64),
) -> Option<Analysis<'a>> {
    let prior = prior(ready);
    progress("first look", 0.05);
    let mut bench = Bench::new(ready, nuisances, &Effects::NEUTRAL, &prior);
    let mut all = candidates(ready.vehicle, &bench.extent);
    if bench.is_cut() && !rivals::comes_back(&bench) {
        // A place that is passed once is a time: what happens there is an event, and nothing that the floor does.
        all.retain(|candidate| candidate.definition.id != "floor_patch");
    }
    // Noise about no effect is no noise: a first search finds about which effects it is to be measured.
    let (first, earlier) = {
        let found = Hypotheses::brief(&Search { bench: &bench, candidates: &all });
        let first = found.pairs.first().or(found.singles.first())?.clone();
        (first, found.singles)
    };
    progress("noise floor", 0.25);
    bench = Bench::new(ready, nuisances, &first.effects, &prior);
    let mut noise = prior;
    for _ in 0..2 {
        let columns = beside(&bench, &all, &first);
        noise = noise::fit(&bench.evidence(&columns), &prior, &noise);
        bench.whiten(&noise);
    }
    progress("hypotheses", 0.5);
    let search = Search { bench: &bench, candidates: &all };
    let nothing = search::nothing(&search)?;
    let fits = Hypotheses::full(&search, &earlier).all();
    progress("what is not listed", 0.8);
    let residuals: Vec<Whole> = [Some(&nothing), fits.first()]
        .into_iter()
        .flatten()
        .map(|f| bench.whole(&f.effects))
        .collect();
    let shapes = rivals::shapes(&bench, &residuals.iter().collect::<Vec<_>>());
    let beside_nothing = ranked(&bench, &search, &nothing, &shapes);
    let beside_best =
        fits.first().map(|best| ranked(&bench, &search, best, &shapes)).unwrap_or_default();
    Some(Analysis { noise, nothing, fits, beside_nothing, beside_best, candidates: all, bench })
}

/// What is believed of the noise before the runs speak.
pub(crate) fn prior(ready: &Ready<'_>) -> Noise {
    let count = to_f64(ready.runs.len().max(1));
    let mut rows = [0.0; 4];
    for run in &ready.runs {
        for (sum, rows) in rows.iter_mut().zip(run.binned.rows_per_bin()) {
            *sum += rows / count;
        }
    }
    let vehicle = ready.vehicle;
    let speeds = ready.runs.iter().any(|run| matches!(run.run.wheels, Wheels::Speed(_)));
    let per_turn = vehicle
        .encoders
        .and_then(|e| e.counts_per_revolution.iter().flatten().copied().reduce(f64::min));
    let resolution = match per_turn {
        Some(counts) if !speeds => {
            core::f64::consts::TAU * vehicle.driven_radius() / counts / 12.0_f64.sqrt() + 2e-5
        }
        _ => by_speeds(ready, rows[0]),
    };
    Noise::prior(vehicle, rows, resolution, false)
}

/// White noise of a bin's mean speed \[m/s\]: what is usual, unless the rows themselves say that it is quite another.
fn by_speeds(ready: &Ready<'_>, rows: f64) -> f64 {
    let usual = 0.004 * ready.vehicle.limits.speed;
    let mut seen: Vec<f64> = ready
        .runs
        .iter()
        .filter(|run| matches!(run.run.wheels, Wheels::Speed(_)))
        .flat_map(|run| (0..4).filter_map(|wheel| white(run.run.wheels.series(), wheel)))
        .collect();
    seen.sort_by(f64::total_cmp);
    let Some(seen) = seen.get(seen.len() / 2).map(|one| one / rows.max(1.0).sqrt()) else {
        return usual;
    };
    if (usual / CONTRADICTS..usual * CONTRADICTS).contains(&seen) {
        usual
    } else {
        seen.max(LEAST * ready.vehicle.limits.speed)
    }
}

/// Columns beside which the noise is estimated: the effects of a fit, and the likeliest shapes one after the other, so
/// that what is not listed does not pass for noise.
fn beside(bench: &Bench<'_>, all: &[Candidate], fit: &Fit) -> Vec<Vec<Vec<Channels>>> {
    let search = Search { bench, candidates: all };
    let mut columns = search.raw_slopes(fit);
    let Some(projection) = search.projection(&fit.set, &bench.all()) else { return columns };
    let whole = bench.whole(&fit.effects);
    let mut along = search.slopes(fit, &whole, &projection);
    let mut shapes = rivals::shapes(bench, &[&whole]);
    for _ in 0..GROUPS {
        let evidence = |group: &Shapes| {
            rivals::judge(bench, &projection, &whole, &along, group)
                .map_or(f64::NEG_INFINITY, |found| found.log_evidence)
        };
        let evidences: Vec<f64> = shapes.par_iter().map(evidence).collect();
        let best = (0..shapes.len()).max_by(|a, b| evidences[*a].total_cmp(&evidences[*b]));
        let Some(best) = best.filter(|best| evidences[*best] > WORTH) else { break };
        let group = shapes.swap_remove(best);
        columns.extend(group.raw);
        along.extend(group.columns);
    }
    columns
}

/// Whether a shape explains little but one block of a recording: that is an event, and nothing that the vehicle does.
fn rests_on_one(
    bench: &Bench<'_>,
    search: &Search<'_>,
    fit: &Fit,
    (whole, slopes): (&Whole, &[Whole]),
    group: &Shapes,
) -> bool {
    let all = bench.all();
    let evidence = |runs: &[usize]| {
        search
            .projection(&fit.set, runs)
            .and_then(|projection| rivals::judge(bench, &projection, whole, slopes, group))
            .map_or(f64::NEG_INFINITY, |found| found.log_evidence)
    };
    if evidence(&all) <= WORTH || all.len() < 3 {
        return false;
    }
    all.iter().any(|run| {
        let others: Vec<usize> = all.iter().copied().filter(|other| other != run).collect();
        evidence(&others) <= WORTH
    })
}

/// Shapes beside a fit, likeliest first.
pub(crate) fn ranked(
    bench: &Bench<'_>,
    search: &Search<'_>,
    fit: &Fit,
    shapes: &[Shapes],
) -> Vec<Beside> {
    let Some(projection) = search.projection(&fit.set, &bench.all()) else { return Vec::new() };
    let whole = bench.whole(&fit.effects);
    let slopes = search.slopes(fit, &whole, &projection);
    let mut all: Vec<Beside> = shapes
        .par_iter()
        .filter_map(|group| {
            let found = rivals::judge(bench, &projection, &whole, &slopes, group)?;
            if bench.is_cut() && rests_on_one(bench, search, fit, (&whole, &slopes), group) {
                return None;
            }
            Some(Beside {
                entry: group.entry,
                axis: group.axis,
                log_evidence: found.log_evidence,
                gain: found.gain,
            })
        })
        .collect();
    all.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    all
}
