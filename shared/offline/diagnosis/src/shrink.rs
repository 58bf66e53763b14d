//! How far the gap of the whole trajectory shrinks, on runs that neither chose nor fitted the effects.

use kerbside_simulation::Effects;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::bins::{CHANNELS, Channels, REFERENCE, to_f64};
use crate::diagnose::Found;
use crate::fit::Search;
use crate::floor::{drawn, in_frame};
use crate::folds::{chosen, errors};
use crate::noise::normal;
use crate::verdict::{Interval, Judged, Shrinkage};

/// Draws of the noise for the floor.
const DRAWS: usize = 12;
/// Draws of the bootstrap.
const BOOTSTRAP: usize = 400;
/// Below this ratio of gap to floor there is nothing to explain.
const WORTH: f64 = 1.25;

/// Root mean squares of one run \[m, rad\].
#[derive(Clone, Copy, Debug, Default)]
struct Rms {
    position: f64,
    yaw: f64,
}

fn rms(errors: &[(f64, f64, f64)]) -> Rms {
    let count = to_f64(errors.len().max(1));
    let position = errors.iter().map(|e| e.1 * e.1).sum::<f64>() / count;
    let yaws: Vec<f64> = errors.iter().map(|e| e.2).filter(|yaw| yaw.is_finite()).collect();
    let yaw = yaws.iter().map(|yaw| yaw * yaw).sum::<f64>() / to_f64(yaws.len().max(1));
    Rms { position: position.sqrt(), yaw: yaw.sqrt() }
}

/// The gap before and after; none without a reference.
pub(crate) fn shrinkage(
    found: &Found<'_>,
    search: &Search<'_>,
    rivals: &[usize],
    by_hand: Option<&Effects>,
    named: bool,
) -> Option<Shrinkage> {
    let bench = &found.analysis.bench;
    let runs: Vec<usize> = bench
        .all()
        .into_iter()
        .filter(|run| {
            bench.ready.runs[*run].binned.measured.iter().any(|row| row[REFERENCE].is_finite())
        })
        .collect();
    if runs.is_empty() {
        return None;
    }
    let of = |run: usize, effects: &Effects| {
        let binned = &bench.ready.runs[run].binned;
        rms(&errors(binned.width, &binned.measured, &bench.ready.predicted(run, effects)))
    };
    let alone = bench.all().len() == 1;
    let folds = match by_hand {
        Some(effects) => vec![*effects; bench.all().len()],
        None if named && alone => vec![found.analysis.fits[found.decision.sets[0].fit].effects],
        None if named => chosen(found.analysis, search, rivals),
        None => vec![Effects::NEUTRAL; bench.all().len()],
    };
    let before: Vec<Rms> = runs.iter().map(|run| of(*run, &Effects::NEUTRAL)).collect();
    let after: Vec<Rms> = runs.iter().map(|run| of(*run, &folds[*run])).collect();
    let floor: Vec<Rms> = runs.iter().map(|run| floor(found, *run)).collect();
    let mean = |values: &[Rms], pick: fn(&Rms) -> f64| {
        values.iter().map(pick).sum::<f64>() / to_f64(values.len())
    };
    let position = |r: &Rms| r.position;
    let yaw = |r: &Rms| r.yaw;
    let (b, a, f) = (mean(&before, position), mean(&after, position), mean(&floor, position));
    let removed =
        (b > WORTH * f && (named || by_hand.is_some())).then(|| removed(&before, &after, &floor));
    Some(Shrinkage {
        before: b,
        after: a,
        floor: f,
        removed,
        judged: match by_hand {
            Some(_) => Judged::ByHand,
            None if alone => Judged::Fitted,
            None => Judged::LeftOut,
        },
        yaw: [mean(&before, yaw), mean(&after, yaw), mean(&floor, yaw)],
        steps: steps(found, named, &|effects| {
            runs.iter().map(|run| of(*run, effects).position).sum::<f64>() / to_f64(runs.len())
        }),
    })
}

fn removed(before: &[Rms], after: &[Rms], floor: &[Rms]) -> Interval {
    let share = |picks: &[usize]| {
        let sum = |values: &[Rms]| picks.iter().map(|i| values[*i].position).sum::<f64>();
        (sum(before) - sum(after)) / (sum(before) - sum(floor)).max(1e-12)
    };
    let all: Vec<usize> = (0..before.len()).collect();
    let value = share(&all);
    if all.len() < 2 {
        return Interval { value, low: f64::NAN, high: f64::NAN };
    }
    let mut random = Pcg64Mcg::seed_from_u64(11);
    let mut drawn: Vec<f64> = (0..BOOTSTRAP)
        .map(|_| share(&all.iter().map(|_| random.random_range(0..all.len())).collect::<Vec<_>>()))
        .collect();
    drawn.sort_by(f64::total_cmp);
    Interval {
        value,
        low: drawn[BOOTSTRAP / 20].min(value),
        high: drawn[BOOTSTRAP - 1 - BOOTSTRAP / 20].max(value),
    }
}

/// What noise alone, and what a car in good order may have, make of a run's errors from a common start.
fn floor(found: &Found<'_>, run: usize) -> Rms {
    let bench = &found.analysis.bench;
    let prepared = &bench.ready.runs[run];
    let mut random = Pcg64Mcg::seed_from_u64(29 + run as u64);
    let path = &bench.paths[run];
    let zero: Vec<Channels> = in_frame(path, &vec![[0.0; CHANNELS]; path.pose.len()]);
    let mut sum = Rms::default();
    for _ in 0..DRAWS {
        let mut drawn = drawn(bench, &found.analysis.noise, run, &mut random);
        for column in bench.raw_columns(run) {
            let size = normal(&mut random);
            for (drawn, column) in drawn.iter_mut().zip(column) {
                for (drawn, column) in drawn.iter_mut().zip(column) {
                    *drawn += size * column;
                }
            }
        }
        let one = rms(&errors(prepared.binned.width, &in_frame(path, &drawn), &zero));
        sum.position += one.position / to_f64(DRAWS);
        sum.yaw += one.yaw / to_f64(DRAWS);
    }
    sum
}

/// The gap after each effect of the answer is added.
fn steps(found: &Found<'_>, named: bool, gap: &dyn Fn(&Effects) -> f64) -> Vec<f64> {
    let Some(best) = found.decision.sets.first().filter(|_| named) else { return Vec::new() };
    let fit = &found.analysis.fits[best.fit];
    let mut effects = Effects::NEUTRAL;
    fit.set
        .iter()
        .zip(&fit.at)
        .map(|(candidate, at)| {
            found.analysis.candidates[*candidate].apply(at, &mut effects);
            gap(&effects)
        })
        .collect()
}
