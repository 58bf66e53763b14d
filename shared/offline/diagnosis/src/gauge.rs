//! What these runs could show: the size at which each effect would have been seen.

use rayon::prelude::*;

use crate::candidate::Candidate;
use crate::fit::Search;

/// Sizes of the noise at which an effect is seen.
pub(crate) const SEEN: f64 = 5.0;
/// Sizes of the noise below which an effect of ordinary size is not excited.
const EXCITED: f64 = 3.0;

/// What the runs could show of one effect.
#[derive(Clone, Debug)]
pub(crate) struct Gauge {
    pub id: &'static str,
    /// The smallest size that would have been seen, of the parameter that shows best.
    pub smallest: f64,
    /// Whether an effect of ordinary size shows.
    pub excited: bool,
}

/// Of every effect. An ordinary size is a quarter of what a search covers.
pub(crate) fn gauge(search: &Search<'_>) -> Vec<Gauge> {
    let all: Vec<usize> = (0..search.candidates.len()).collect();
    let mut gauges: Vec<Gauge> =
        all.par_iter().filter_map(|candidate| one(search, *candidate)).collect();
    gauges.dedup_by(|b, a| {
        let same = a.id == b.id;
        if same {
            a.smallest = a.smallest.min(b.smallest);
            a.excited |= b.excited;
        }
        same
    });
    gauges
}

/// Where an effect of ordinary size is looked at; none of one whose place comes from the map.
pub(crate) fn middle(candidate: &Candidate) -> Option<Vec<f64>> {
    candidate.starts.get(candidate.starts.len() / 2).cloned()
}

fn one(search: &Search<'_>, candidate: usize) -> Option<Gauge> {
    let own = &search.candidates[candidate];
    let id = own.definition.id;
    let begin = middle(own)?;
    let projection = search.projection(&[candidate], &search.bench.all())?;
    let fit = search.fit(&[candidate], core::slice::from_ref(&begin), &projection, 1);
    let mut best = f64::INFINITY;
    let mut excited = false;
    for (i, coordinate) in own.coordinates.iter().enumerate() {
        let sensitivity = (fit.normal[(i, i)] - 1.0).max(0.0).sqrt() / coordinate.deviation;
        best = best.min(SEEN / sensitivity.max(1e-12));
        excited |= 0.5 * coordinate.deviation * sensitivity >= EXCITED;
    }
    let smallest = if own.is_limit() { own.parameters(&[-best.min(4.0)]).first()?.1 } else { best };
    Some(Gauge { id, smallest, excited })
}
