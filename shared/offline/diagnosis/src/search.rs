//! Which sets of effects come into question: every single one, and pairs that grow from the best of them.

use rayon::prelude::*;

use crate::bench::Whole;
use crate::fit::{Fit, Search};
use crate::linear::Projection;

/// Discs tried along the paths, for each radius.
const PLACES: usize = 48;
/// Begins of a floor's patch that are fitted in full.
const PATCHES: usize = 6;
/// Rounds of a fit that only ranks.
const BRIEF: usize = 3;
/// Rounds of a fit that counts.
const FULL: usize = 10;

/// Fits every candidate together with `base`, briefly or in full; none where the candidate is in the base already.
pub(crate) fn extend(search: &Search<'_>, base: Option<&Fit>, full: bool) -> Vec<Fit> {
    let places = places(search);
    let all: Vec<usize> = (0..search.candidates.len()).collect();
    all.par_iter()
        .filter(|candidate| base.is_none_or(|base| fits_beside(search, base, **candidate)))
        .filter_map(|candidate| extended(search, base, *candidate, &places, full))
        .collect()
}

/// Whether a candidate is another effect than those of the base.
fn fits_beside(search: &Search<'_>, base: &Fit, candidate: usize) -> bool {
    let id = search.candidates[candidate].definition.id;
    base.set.iter().all(|member| search.candidates[*member].definition.id != id)
}

/// A base with one more effect, from the best of its begins.
fn extended(
    search: &Search<'_>,
    base: Option<&Fit>,
    candidate: usize,
    places: &[(f64, f64)],
    full: bool,
) -> Option<Fit> {
    let (set, at) =
        base.map_or((Vec::new(), Vec::new()), |base| (base.set.clone(), base.at.clone()));
    let mut set = set;
    set.push(candidate);
    let runs = search.bench.all();
    let projection = search.projection(&set, &runs)?;
    let begins = search.candidates[candidate].begins(&search.bench.extent, places);
    let with = |begin: &Vec<f64>| {
        let mut at = at.clone();
        at.push(begin.clone());
        at
    };
    let begins =
        if begins.len() > 8 { promising(search, &set, begins, &with, &projection) } else { begins };
    let rounds = if full { FULL } else { BRIEF };
    let fits = begins.iter().map(|begin| search.fit(&set, &with(begin), &projection, BRIEF));
    let mut best = fits.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    if full && search.candidates[candidate].definition.id == "floor_patch" {
        best = moved_about(search, best, &projection);
    }
    Some(if rounds > BRIEF { search.fit(&set, &best.at, &projection, rounds) } else { best })
}

/// A patch whose place and radius are tried in all directions, from far to near: its edge makes many small valleys.
fn moved_about(search: &Search<'_>, mut best: Fit, projection: &Projection) -> Fit {
    let mut step = 1.2 * search.bench.extent.wheelbase;
    let member = best.set.len() - 1;
    while step > 0.04 * search.bench.extent.wheelbase {
        let tries: Vec<Vec<Vec<f64>>> = COMPASS
            .iter()
            .map(|direction| {
                let mut at = best.at.clone();
                for (c, share) in direction.iter().enumerate() {
                    let coordinate = &search.candidates[best.set[member]].coordinates[c];
                    at[member][c] =
                        (at[member][c] + share * step).clamp(coordinate.low, coordinate.high);
                }
                at
            })
            .collect();
        let fits: Vec<Fit> =
            tries.par_iter().map(|at| search.sized(&best.set, at, member, projection)).collect();
        match fits.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost)) {
            Some(next) if next.cost < best.cost - 0.05 => best = next,
            _ => step *= 0.5,
        }
    }
    best
}

/// Directions of a patch's x, y and radius.
const COMPASS: [[f64; 3]; 14] = [
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
    [0.7, 0.7, 0.0],
    [-0.7, 0.7, 0.0],
    [0.7, -0.7, 0.0],
    [-0.7, -0.7, 0.0],
    [0.7, 0.0, 0.7],
    [-0.7, 0.0, 0.7],
    [0.0, 0.7, 0.7],
    [0.0, -0.7, 0.7],
];

/// The begins whose last coordinate, changed alone, gains most.
fn promising(
    search: &Search<'_>,
    set: &[usize],
    begins: Vec<Vec<f64>>,
    with: &impl Fn(&Vec<f64>) -> Vec<Vec<f64>>,
    projection: &Projection,
) -> Vec<Vec<f64>> {
    let runs = search.bench.all();
    let whole = |at: &[Vec<f64>]| -> Whole {
        let effects = search.effects(set, at);
        runs.iter()
            .map(|run| search.bench.whitened(*run, &search.bench.raw_of(*run, &effects)))
            .collect()
    };
    let Some(first) = begins.first() else { return begins };
    let mut neutral = first.clone();
    if let Some(last) = neutral.last_mut() {
        *last = 0.0;
    }
    let without = whole(&with(&neutral));
    let mut ranked: Vec<(f64, Vec<f64>)> = begins
        .into_iter()
        .map(|mut begin| {
            let size = begin.last().copied().unwrap_or_default();
            let mut there = whole(&with(&begin));
            for (there, without) in there.iter_mut().zip(&without) {
                *there -= without;
            }
            let products = projection.products(&search.bench.designs, &[&there, &without]);
            let share = -products[(0, 1)] / (products[(0, 0)] + 1.0);
            let gain =
                if share > 0.0 { products[(0, 1)].powi(2) / (products[(0, 0)] + 1.0) } else { 0.0 };
            if let Some(last) = begin.last_mut() {
                *last = (share * size).clamp(0.2 * size, 6.0 * size);
            }
            (gain, begin)
        })
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranked.into_iter().take(PATCHES).map(|(_, begin)| begin).collect()
}

/// Places along the paths, spread evenly.
fn places(search: &Search<'_>) -> Vec<(f64, f64)> {
    let pitch = 0.8 * search.bench.extent.wheelbase;
    let mut places: Vec<(f64, f64)> = Vec::new();
    for pose in search.bench.paths.iter().flat_map(|path| &path.pose) {
        let far = |place: &(f64, f64)| (place.0 - pose.x).hypot(place.1 - pose.y) > pitch;
        if places.iter().all(far) {
            places.push((pose.x, pose.y));
        }
    }
    let stride = places.len().div_ceil(PLACES).max(1);
    places.into_iter().step_by(stride).collect()
}

/// No effect at all.
pub(crate) fn nothing(search: &Search<'_>) -> Option<Fit> {
    let projection = search.projection(&[], &search.bench.all())?;
    Some(search.fit(&[], &[], &projection, 1))
}

/// Singles, and pairs grown from the `keep` likeliest of them, each fitted in full where it can still win.
pub(crate) fn hypotheses(search: &Search<'_>, keep: usize) -> Vec<Fit> {
    let mut singles = extend(search, None, true);
    rank(&mut singles);
    let mut fits = Vec::new();
    let mut seen: Vec<Vec<usize>> = Vec::new();
    for single in singles.iter().take(keep) {
        let mut pairs = extend(search, Some(single), false);
        rank(&mut pairs);
        for pair in pairs.into_iter().take(keep) {
            let mut set = pair.set.clone();
            set.sort_unstable();
            if seen.contains(&set) {
                continue;
            }
            seen.push(set);
            fits.push(pair);
        }
    }
    let pairs: Vec<Fit> = fits
        .par_iter()
        .filter_map(|pair| {
            let projection = search.projection(&pair.set, &search.bench.all())?;
            Some(search.fit(&pair.set, &pair.at, &projection, FULL))
        })
        .collect();
    singles.extend(pairs);
    rank(&mut singles);
    singles
}

/// Likeliest first.
pub(crate) fn rank(fits: &mut [Fit]) {
    fits.sort_by(|a, b| b.log_evidence().total_cmp(&a.log_evidence()));
}
