//! Where, before any effect is fitted: the links whose patterns the residuals of the nominal vehicle have. A pattern is
//! what one thing at a link, a little of it, does to all sensors: a listed effect as it begins, or an input of the
//! chain that depends on something. Whatever a car in good order may differ by is integrated out, so that evidence is
//! excess over floor and allowance.

use kerbside_simulation::Effects;
use kerbside_simulation::effects::Link;
use nalgebra::DVector;
use rayon::prelude::*;

use crate::analyse::Beside;
use crate::bench::Whole;
use crate::candidate::Candidate;
use crate::fit::Search;
use crate::linear::{Projection, group};

/// Logarithm of the evidence that a listed effect's pattern must gain.
const LISTED: f64 = 8.0;
/// The same of a shape that nobody listed: there are many.
const UNLISTED: f64 = 12.0;
/// Links named at most.
const MOST: usize = 2;
/// Share of the best link's evidence below which the second is what the first looks like from there.
const SECOND: f64 = 0.25;

/// The links that moved, the one with the most evidence first; none where nothing is beyond floor and allowance.
/// `shapes` are those beside no effect.
pub(crate) fn moved(search: &Search<'_>, shapes: &[Beside]) -> Vec<(Link, f64)> {
    let Some(projection) = search.projection(&[], &search.bench.all()) else { return Vec::new() };
    let nominal = search.bench.whole(&Effects::NEUTRAL);
    let follows = search.bench.only_follows();
    let mut seen: Vec<(Link, f64)> = search
        .candidates
        .par_iter()
        .filter(|candidate| {
            let link = candidate.definition.link;
            !(follows && matches!(link, Link::SpeedActuation | Link::SteeringActuation))
        })
        .map(|candidate| {
            let evidence = pattern(search, &projection, &nominal, candidate);
            (candidate.definition.link, evidence)
        })
        .filter(|(_, evidence)| *evidence > LISTED)
        .collect();
    let unlisted = shapes.iter().filter(|shape| shape.log_evidence > UNLISTED);
    seen.extend(unlisted.map(|shape| (shape.entry.link(), shape.log_evidence)));
    let best = |link: Link| {
        let own = seen.iter().filter(|(other, _)| *other == link).map(|(_, evidence)| *evidence);
        own.reduce(f64::max).map(|evidence| (link, evidence))
    };
    let mut links: Vec<(Link, f64)> = Link::ALL.into_iter().filter_map(best).collect();
    links.sort_by(|a, b| b.1.total_cmp(&a.1));
    let least = links.first().map_or(0.0, |first| SECOND * first.1);
    links.retain(|(_, evidence)| *evidence >= least);
    links.truncate(MOST);
    links
}

/// Logarithm of the evidence of what a little of an effect does.
fn pattern(
    search: &Search<'_>,
    projection: &Projection,
    nominal: &Whole,
    candidate: &Candidate,
) -> f64 {
    let evidence = |columns: &[Whole]| {
        let mut vectors: Vec<&[DVector<f64>]> = columns.iter().map(Vec::as_slice).collect();
        vectors.push(nominal);
        let products = projection.products(&search.bench.designs, &vectors);
        group(&products).map_or(f64::NEG_INFINITY, |found| found.log_evidence)
    };
    let column = |at: &[f64], size: f64| -> Whole {
        let mut effects = Effects::NEUTRAL;
        candidate.apply(at, &mut effects);
        let mut there = search.bench.whole(&effects);
        for (there, nominal) in there.iter_mut().zip(nominal) {
            *there -= nominal;
            *there /= size;
        }
        there
    };
    let one_sided =
        candidate.is_limit() || candidate.coordinates.iter().any(|c| c.low >= c.neutral);
    if one_sided {
        let size = |at: &Vec<f64>| {
            let off =
                candidate.coordinates.iter().zip(at).map(|(c, at)| (at - c.neutral) / c.deviation);
            off.map(|off| off * off).sum::<f64>().sqrt().max(1e-3)
        };
        let each = candidate.starts.iter().map(|at| evidence(&[column(at, size(at))]));
        return each.fold(f64::NEG_INFINITY, f64::max);
    }
    let neutral: Vec<f64> = candidate.coordinates.iter().map(|c| c.neutral).collect();
    let columns: Vec<Whole> = (0..neutral.len())
        .map(|c| {
            let mut at = neutral.clone();
            at[c] += LITTLE * candidate.coordinates[c].deviation;
            column(&at, LITTLE)
        })
        .collect();
    evidence(&columns)
}

/// How much of an effect is a little, in standard deviations of what is thought possible.
const LITTLE: f64 = 0.2;
