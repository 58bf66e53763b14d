//! The rule by which hypotheses become an answer; it is written here and nowhere else.
//!
//! Every hypothesis has a prior and an evidence: no effect; one listed effect; two; something that is not listed, alone
//! or beside a listed one. Evidences are tempered, since the noise is a model, too. Probabilities are the normalised
//! products.

use kerbside_geometry::math;
use kerbside_simulation::effects::Link;

use crate::analyse::{Analysis, Beside};
use crate::bins::to_f64;
use crate::fit::Fit;
use crate::verdict::Verdict;

/// Prior probabilities of: no effect, one, two, something not listed.
const NONE: f64 = 0.4;
const SINGLE: f64 = 0.35;
const PAIR: f64 = 0.1;
const UNKNOWN: f64 = 0.15;
/// Evidences count as if there were so many times fewer values: whitened values are never quite independent.
const TEMPER: f64 = 2.0;
/// Runs that are asked for.
const ENOUGH: f64 = 6.0;
/// A second effect has to make the runs this much likelier than the first alone, in logarithms.
const SECOND: f64 = 10.0;
/// What is not listed has to explain at least this share of what listed effects explain beside which it stands.
const SHARE: f64 = 0.02;
/// What is not listed has to make the runs this much likelier, in logarithms.
const UNLISTED: f64 = 12.0;
/// Probability that a set of alternatives reaches together.
pub(crate) const SET: f64 = 0.9;
/// Largest set that is an answer.
const LARGEST: usize = 3;

/// A set of listed effects with its probability.
#[derive(Clone, Debug)]
pub(crate) struct Weighed {
    /// Index among the analysis's fits.
    pub fit: usize,
    /// Probability of exactly these.
    pub probability: f64,
    /// Probability that these act with another beside them that the runs would not show.
    pub unseen: f64,
}

/// Probabilities of everything.
#[derive(Clone, Debug)]
pub(crate) struct Decision {
    pub verdict: Verdict,
    pub none: f64,
    pub unknown: f64,
    /// Sets of listed effects, likeliest first.
    pub sets: Vec<Weighed>,
    /// How many of them are the answer.
    pub answer: usize,
    /// The link and shape of what is not listed.
    pub shape: Option<Beside>,
    /// Links of what is not listed, by their share in it.
    pub unknown_links: Vec<(Link, f64)>,
    /// Why the likeliest listed effects are not the answer, in words; none where they may be.
    pub doubt: Option<String>,
}

/// Decides.
pub(crate) fn decide(found: &Analysis<'_>) -> Decision {
    let zero = found.nothing.log_evidence();
    let temper = temper(found);
    let names = distinct(found);
    let per_wheel = |fit: &Fit| {
        let wheels = fit.set.iter().filter(|c| found.candidates[**c].wheel.is_some()).count();
        to_f64(wheels) * math::ln(4.0)
    };
    let sets: Vec<(usize, f64)> = found
        .fits
        .iter()
        .enumerate()
        .filter(|(_, fit)| fit.set.len() == 1 || gains(found, fit))
        .map(|(i, fit)| {
            let prior = if fit.set.len() == 1 {
                math::ln(SINGLE / names)
            } else {
                math::ln(PAIR / (0.5 * names * (names - 1.0)))
            };
            (i, prior - per_wheel(fit) + (fit.log_evidence() - zero) / temper)
        })
        .collect();
    let shapes = unlisted(found, zero, temper);
    let highest = sets
        .iter()
        .map(|(_, weight)| *weight)
        .chain(shapes.iter().map(|(_, weight)| *weight))
        .fold(math::ln(NONE), f64::max);
    let none = math::exp(math::ln(NONE) - highest);
    let mut weighed: Vec<Weighed> = sets
        .iter()
        .map(|(fit, weight)| Weighed {
            fit: *fit,
            probability: math::exp(weight - highest),
            unseen: 0.0,
        })
        .collect();
    let mut links: Vec<(Link, f64)> = Link::ALL.into_iter().map(|link| (link, 0.0)).collect();
    for (beside, weight) in &shapes {
        for (link, sum) in &mut links {
            if *link == beside.entry.link() {
                *sum += math::exp(weight - highest);
            }
        }
    }
    let unknown: f64 = links.iter().map(|(_, sum)| sum).sum();
    let total = none + unknown + weighed.iter().map(|w| w.probability).sum::<f64>();
    for weighed in &mut weighed {
        weighed.probability /= total;
    }
    weighed.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    links.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut decision = Decision {
        verdict: Verdict::None,
        none: none / total,
        unknown: unknown / total,
        sets: weighed,
        answer: 0,
        shape: shapes.first().map(|(beside, _)| *beside),
        unknown_links: links
            .into_iter()
            .map(|(link, sum)| (link, sum / unknown.max(1e-300)))
            .collect(),
        doubt: None,
    };
    answer(&mut decision);
    decision
}

/// By what evidences are divided: few runs tell chance from cause less surely than their many values seem to.
pub(crate) fn temper(found: &Analysis<'_>) -> f64 {
    let runs = found.bench.independent().max(1.0);
    TEMPER * (ENOUGH / runs).clamp(1.0, ENOUGH)
}

/// The answer that the probabilities give.
pub(crate) fn answer(decision: &mut Decision) {
    let named: f64 = decision.sets.iter().map(|w| w.probability).sum();
    let listed = named + decision.sets.iter().map(|w| w.unseen).sum::<f64>();
    if decision.none >= listed && decision.none >= decision.unknown {
        decision.verdict = Verdict::None;
        return;
    }
    if decision.unknown >= listed {
        decision.verdict = Verdict::Unknown;
        return;
    }
    let mut reached = 0.0;
    for weighed in decision.sets.iter().take(LARGEST) {
        if reached >= SET * named {
            break;
        }
        reached += weighed.probability;
        decision.answer += 1;
    }
    decision.verdict = if decision.answer == 1 { Verdict::Effects } else { Verdict::Ambiguous };
}

/// By how much a given pair with an effect is less likely beforehand than that effect alone.
pub(crate) fn beside_single(found: &Analysis<'_>) -> f64 {
    let names = distinct(found);
    (PAIR / (0.5 * names * (names - 1.0))) / (SINGLE / names)
}

/// How many effects the library has.
fn distinct(found: &Analysis<'_>) -> f64 {
    let mut names: Vec<&str> = found.candidates.iter().map(|c| c.definition.id).collect();
    names.dedup();
    to_f64(names.len())
}

/// Whether both of a pair are needed.
fn gains(found: &Analysis<'_>, pair: &Fit) -> bool {
    let alone =
        |member: &usize| found.fits.iter().find(|fit| fit.set == [*member]).map(Fit::log_evidence);
    let best = pair.set.iter().filter_map(alone).fold(f64::NEG_INFINITY, f64::max);
    pair.log_evidence() > best + SECOND
}

/// What is not listed, alone and beside the likeliest listed effects, with its logarithmic weight, heaviest first.
fn unlisted(found: &Analysis<'_>, zero: f64, temper: f64) -> Vec<(Beside, f64)> {
    let count = to_f64(found.beside_nothing.len().max(1));
    let prior = math::ln(UNKNOWN / count);
    let worth = |beside: &&Beside| beside.log_evidence > UNLISTED;
    let mut all: Vec<(Beside, f64)> = found
        .beside_nothing
        .iter()
        .filter(worth)
        .map(|beside| (*beside, prior + beside.log_evidence / temper))
        .collect();
    if let Some(best) = found.fits.first() {
        let listed = (found.nothing.cost - best.cost).max(0.0);
        let base = best.log_evidence() - zero;
        let prior = prior - math::ln(distinct(found));
        let enough =
            found.beside_best.iter().filter(worth).filter(|beside| beside.gain > SHARE * listed);
        all.extend(enough.map(|beside| (*beside, prior + (base + beside.log_evidence) / temper)));
    }
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all
}
