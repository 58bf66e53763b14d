//! What may act beside the answer without showing: a second effect too small for these runs.
//!
//! The prior allows pairs. Of each effect beside the one that was found there is a part of its prior that these runs could
//! not have shown; what it holds is no evidence for the single effect alone, and is taken from its probability.

use kerbside_geometry::math;
use rayon::prelude::*;

use crate::analyse::Analysis;
use crate::decide::{Decision, answer, beside_single};
use crate::fit::{Fit, Search};
use crate::gauge::{SEEN, middle};

/// Takes from every single effect the probability that another acts beside it that these runs would not show.
pub(crate) fn account(found: &Analysis<'_>, search: &Search<'_>, decision: &mut Decision) {
    let single = |fit: usize| found.fits[fit].set.len() == 1;
    let Some(first) = decision.sets.iter().find(|set| single(set.fit)) else { return };
    let odds = odds(search, &found.fits[first.fit]) * beside_single(found);
    let share = odds / (1.0 + odds);
    for set in decision.sets.iter_mut().filter(|set| single(set.fit)) {
        set.unseen = share * set.probability;
        set.probability -= set.unseen;
    }
    decision.answer = 0;
    answer(decision);
}

/// Sum over all other effects of the part of the prior that would not show beside `single`.
fn odds(search: &Search<'_>, single: &Fit) -> f64 {
    let all: Vec<usize> = (0..search.candidates.len()).collect();
    let id = |candidate: usize| search.candidates[candidate].definition.id;
    let own = id(single.set[0]);
    let parts: Vec<(&str, f64)> = all
        .par_iter()
        .filter(|candidate| id(**candidate) != own)
        .filter_map(|candidate| Some((id(*candidate), hidden(search, single, *candidate)?)))
        .collect();
    // An effect that has a wheel has one candidate for each; any of them may be meant.
    let alike = |name: &str| parts.iter().filter(|part| part.0 == name).count();
    parts.iter().map(|(name, part)| part / crate::bins::to_f64(alike(name))).sum()
}

/// The part of the prior of a candidate that would not show beside `single`; none where nothing is known of it.
fn hidden(search: &Search<'_>, single: &Fit, candidate: usize) -> Option<f64> {
    let begin = middle(&search.candidates[candidate])?;
    let set = [single.set[0], candidate];
    let at = [single.at[0].clone(), begin];
    let projection = search.projection(&set, &search.bench.all())?;
    let fit = search.fit(&set, &at, &projection, 1);
    let spread = fit.normal.cholesky()?.inverse();
    let first = single.at[0].len();
    // In units of the prior's deviation: the coordinate that shows best.
    let variance =
        (first..spread.ncols()).map(|i| spread[(i, i)]).fold(1.0_f64, f64::min).max(1e-12);
    let noise = (variance / (1.0 - variance).max(1e-12)).sqrt();
    Some(within(SEEN * noise))
}

/// Probability that a standard normal deviate is within `limit` of zero.
fn within(limit: f64) -> f64 {
    // Abramowitz and Stegun (1964), 7.1.26, to 2e-7.
    let x = limit / core::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let series = [0.254_829_592, -0.284_496_736, 1.421_413_741, -1.453_152_027, 1.061_405_429];
    let sum = series.iter().rev().fold(0.0, |sum, c| t * (c + sum));
    1.0 - sum * math::exp(-x * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_probabilities_are_those_of_the_tables() {
        for (limit, expected) in [(0.0, 0.0), (1.0, 0.682_689), (1.96, 0.950_004), (5.0, 1.0)] {
            assert!((within(limit) - expected).abs() < 1e-5, "{limit}: {}", within(limit));
        }
    }
}
