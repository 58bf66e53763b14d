//! Whether what fits best holds up: the same in every drive, within what is plausible, and of use on drives left out.

use rayon::prelude::*;

use crate::analyse::Analysis;
use crate::bins::to_f64;
use crate::decide::{Decision, answer};
use crate::fit::{Fit, Search};
use crate::folds::{Linearised, jackknife, left_out};
use kerbside_geometry::angle;
use kerbside_simulation::effects::Link;

/// An effect is at least so many of the standard errors that drives left out show of its size.
const REPEATS: f64 = 2.5;
/// Share of the blocks of a cut drive that an effect helps while they are left out.
const HELPS: f64 = 0.5;
/// Sets below this probability are not asked.
const WORTH: f64 = 0.02;
/// Headings closer than this are one \[rad\].
const ONE_WAY: f64 = 0.25;
/// Sets that are asked at most.
const MOST: usize = 6;

/// Takes out of the decision the sets that do not hold up: their probability is that of an unknown cause.
pub(crate) fn distrust(found: &Analysis<'_>, search: &Search<'_>, decision: &mut Decision) {
    if heads_one_way(search) {
        without_slopes(found, decision);
    }
    let nothing = Linearised::new(search, &found.nothing);
    let asked: Vec<usize> = decision
        .sets
        .iter()
        .take(MOST)
        .filter(|set| set.probability > WORTH)
        .map(|set| set.fit)
        .collect();
    let doubts: Vec<(usize, Option<(Link, String)>)> = asked
        .par_iter()
        .map(|fit| (*fit, doubt(search, &found.fits[*fit], nothing.as_ref())))
        .collect();
    let first = decision.sets.first().map(|set| set.fit);
    for (fit, doubt) in doubts {
        let Some((link, words)) = doubt else { continue };
        if first == Some(fit) {
            decision.doubt = Some(words);
            decision.unknown_links.retain(|(other, _)| *other != link);
            decision.unknown_links.insert(0, (link, 1.0));
        }
        let gone = decision.sets.iter().filter(|set| set.fit == fit).map(|set| set.probability);
        decision.unknown += gone.sum::<f64>();
        decision.sets.retain(|set| set.fit != fit);
    }
    decision.answer = 0;
    answer(decision);
    if decision.doubt.is_some() {
        decision.shape = None;
    }
}

/// Whether all paths head so nearly the same way that a slope of the floor is a marker askew and a scale.
fn heads_one_way(search: &Search<'_>) -> bool {
    let poses = || search.bench.paths.iter().flat_map(|path| &path.pose);
    let Some(first) = poses().next() else { return false };
    poses().all(|pose| angle::wrap(pose.yaw - first.yaw).abs() < ONE_WAY)
}

/// Takes out the sets with a slope of the floor, as if they had not been asked.
fn without_slopes(found: &Analysis<'_>, decision: &mut Decision) {
    let slopes = |fit: usize| {
        let set = &found.fits[fit].set;
        set.iter().any(|member| found.candidates[*member].definition.id == "floor_slope")
    };
    decision.sets.retain(|set| !slopes(set.fit));
    let listed: f64 = decision.sets.iter().map(|set| set.probability).sum();
    let total = listed + decision.none + decision.unknown;
    if total < 1e-12 {
        let words = "floor_slope cannot be told from a marker askew where all drives head one way";
        decision.doubt = Some(words.to_owned());
        decision.unknown = 1.0;
        return;
    }
    decision.none /= total;
    decision.unknown /= total;
    decision.sets.iter_mut().for_each(|set| set.probability /= total);
}

/// What speaks against a set, and the link of the effect that it speaks against.
fn doubt(search: &Search<'_>, fit: &Fit, nothing: Option<&Linearised>) -> Option<(Link, String)> {
    let own = Linearised::new(search, fit)?;
    let errors = jackknife(search, fit, &own);
    let mut row = 0;
    for (candidate, at) in fit.set.iter().zip(&fit.at) {
        let candidate = &search.candidates[*candidate];
        let (id, link) = (candidate.definition.id, candidate.definition.link);
        // The place of a patch is no size, and few drives cross it.
        let is_patch = id == "floor_patch";
        let beyond = candidate.coordinates.iter().zip(at).any(|(c, at)| {
            let edge = 1e-3 * (c.high - c.low);
            let neutral = |bound: f64| (bound - c.neutral).abs() < 0.01 * c.deviation;
            (*at > c.high - edge && !neutral(c.high)) || (*at < c.low + edge && !neutral(c.low))
        });
        if beyond && !is_patch {
            return Some((link, format!("{id} would have to be larger than is plausible")));
        }
        let repeats = errors.as_ref().is_none_or(|errors| {
            candidate.coordinates.iter().zip(at).enumerate().any(|(i, (c, at))| {
                (at - c.neutral).abs() > REPEATS * errors[row + i] * c.deviation
            })
        });
        if !repeats && !is_patch {
            let words = format!("{id} changes from drive to drive by as much as it is");
            return Some((link, words));
        }
        row += at.len();
    }
    // Runs of their own are evidence of their own; blocks of one drive share what happened in it.
    if search.bench.groups().len() == search.bench.all().len() {
        return None;
    }
    let mut gains = left_out(search, nothing?, fit, &own);
    gains.retain(|gain| gain.is_finite());
    let helped = to_f64(gains.iter().filter(|gain| **gain > 0.0).count());
    let first = search.candidates[*fit.set.first()?].definition;
    (helped < HELPS * to_f64(gains.len()) && gains.len() > 1).then(|| {
        (
            first.link,
            format!("{} helps fewer than half of the blocks while they are left out", first.id),
        )
    })
}
