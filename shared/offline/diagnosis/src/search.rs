//! Which sets of effects come into question: every single one, and pairs that grow from the best of them.

use kerbside_simulation::Effects;
use rayon::prelude::*;

use crate::bench::Whole;
use crate::fit::{Fit, Search};
use crate::linear::Projection;
use crate::patch::Floor;
use crate::screen::{self, Foretold, Piece, Screen};

/// Discs of the map that come into question, alone and beside each of the likeliest singles.
const DISCS: usize = 16;
const DISCS_BESIDE: usize = 4;
/// Begins of a floor's patch that are fitted, and of any other candidate.
const PATCHES: usize = 6;
const BEGINS: usize = 2;
/// Valleys that are searched to their bottom.
const VALLEYS: usize = 3;
/// A single whose evidence lies farther below the likeliest, in logarithms, is not fitted in full.
const REACH: f64 = 40.0;
/// Pairs that are fitted, in a first look and in the end, those of which most is foretold.
const FIRST_PAIRS: usize = 3;
const PAIRS: usize = 8;
/// Likeliest singles each of which is fitted beside its likeliest partners, and how many of these.
const KEEP: usize = 2;
const PARTNERS: usize = 3;
/// Rounds of a fit that only ranks.
const BRIEF: usize = 3;
/// Rounds of a fit that counts.
const FULL: usize = 10;

/// Every candidate alone, from the begins that promise most and from where an earlier search has found it; briefly, but
/// those within reach of the likeliest in full.
pub(crate) fn singles(
    search: &Search<'_>,
    nothing: &Whole,
    openings: &[Piece],
    earlier: &[Fit],
    full: bool,
) -> Vec<Fit> {
    let all: Vec<usize> = (0..search.candidates.len()).collect();
    let mut fits: Vec<Vec<Fit>> = all
        .par_iter()
        .map(|candidate| {
            let own = openings.iter().filter(|piece| piece.candidate == *candidate);
            begun(search, nothing, &own.collect::<Vec<_>>(), earlier).unwrap_or_default()
        })
        .collect();
    fits.retain(|fits| !fits.is_empty());
    if full {
        let best = fits.iter().map(|fits| fits[0].log_evidence()).fold(f64::NEG_INFINITY, f64::max);
        fits.par_iter_mut().filter(|fits| fits[0].log_evidence() > best - REACH).for_each(|fits| {
            if let Some(fit) = finished(search, fits) {
                fits[0] = fit;
            }
        });
    }
    fits.into_iter().map(|mut fits| fits.swap_remove(0)).collect()
}

/// Brief fits of one candidate, the best first.
fn begun(
    search: &Search<'_>,
    nothing: &Whole,
    openings: &[&Piece],
    earlier: &[Fit],
) -> Option<Vec<Fit>> {
    let candidate = openings.first()?.candidate;
    let projection = search.projection(&[candidate], &search.bench.all())?;
    let foretold = screen::alone(search, nothing, openings, &projection);
    let count = if is_patch(search, candidate) { PATCHES } else { BEGINS };
    let before = earlier.iter().filter(|fit| fit.set == [candidate]).map(|fit| fit.at.clone());
    let begins = before.chain(foretold.into_iter().take(count).map(|foretold| foretold.at));
    let mut fits: Vec<Fit> =
        begins.map(|at| search.fit(&[candidate], &at, &projection, BRIEF)).collect();
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    Some(fits)
}

/// The best of a candidate's brief fits, in full.
fn finished(search: &Search<'_>, fits: &[Fit]) -> Option<Fit> {
    let set = &fits.first()?.set;
    let projection = search.projection(set, &search.bench.all())?;
    if !is_patch(search, set[0]) {
        return Some(search.fit(set, &fits[0].at, &projection, FULL));
    }
    let moved: Vec<Fit> = fits
        .iter()
        .take(VALLEYS)
        .map(|fit| moved_about(search, fit.clone(), &projection))
        .collect();
    let best = moved.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    Some(search.fit(set, &best.at, &projection, FULL))
}

fn is_patch(search: &Search<'_>, candidate: usize) -> bool {
    search.candidates[candidate].is_patch()
}

/// What slip in each place of the floor does, where that comes into question.
fn floor<'a>(search: &'a Search<'a>) -> Option<(usize, Floor<'a>)> {
    let patch = (0..search.candidates.len()).find(|candidate| is_patch(search, *candidate))?;
    Some((patch, Floor::new(search, patch)?))
}

/// Begins of every candidate on the residuals without any effect.
fn openings(search: &Search<'_>, nothing: &Whole, floor: Option<&Floor<'_>>) -> Vec<Piece> {
    let open = |candidate: usize| {
        let own = &search.candidates[candidate];
        let begins = if own.is_patch() {
            let map = floor.and_then(|floor| floor.map(nothing, &[]));
            map.map(|map| map.discs(DISCS)).unwrap_or_default()
        } else {
            own.begins().to_vec()
        };
        screen::openings(search, nothing, candidate, begins)
    };
    (0..search.candidates.len()).into_par_iter().flat_map(open).collect()
}

/// Discs that come into question beside the likeliest singles.
fn discs_beside(
    search: &Search<'_>,
    nothing: &Whole,
    singles: &[Fit],
    (patch, floor): &(usize, Floor<'_>),
) -> Vec<Piece> {
    let beside = |fit: &Fit| {
        let projection = search.projection(&fit.set, &search.bench.all())?;
        let whole = search.bench.whole(&fit.effects);
        let map = floor.map(&whole, &search.slopes(fit, &whole, &projection))?;
        Some(map.discs(DISCS_BESIDE))
    };
    let others = singles.iter().filter(|fit| fit.set != [*patch]).take(KEEP);
    let begins = others.filter_map(beside).flatten().collect();
    screen::openings(search, nothing, *patch, begins)
}

/// The `count` pairs of which most is foretold, fitted in `rounds`, and for each of the likeliest singles its likeliest
/// partners.
pub(crate) fn pairs(
    search: &Search<'_>,
    nothing: &Whole,
    mut pieces: Vec<Piece>,
    singles: &[Fit],
    (count, rounds): (usize, usize),
) -> Vec<Fit> {
    let all = search.bench.all();
    let fitted: Vec<Piece> =
        singles.par_iter().filter_map(|fit| screen::fitted(search, nothing, fit)).collect();
    pieces.extend(fitted);
    // Pieces of one candidate stand together, in the order of candidates.
    pieces.sort_by_key(|piece| piece.candidate);
    let Some(projection) = search.projection(&[], &all) else { return Vec::new() };
    let foretold =
        Screen::new(search, nothing, &pieces.iter().collect::<Vec<_>>(), &projection).pairs();
    let mut chosen: Vec<&Foretold> = foretold.iter().take(count).collect();
    for single in singles.iter().take(KEEP) {
        let beside = foretold.iter().filter(|pair| pair.set.contains(&single.set[0]));
        for pair in beside.take(PARTNERS) {
            if chosen.iter().all(|known| known.set != pair.set) {
                chosen.push(pair);
            }
        }
    }
    chosen
        .par_iter()
        .filter_map(|pair| {
            let projection = search.projection(&pair.set, &all)?;
            Some(search.fit(&pair.set, &pair.at, &projection, rounds))
        })
        .collect()
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

/// Directions of a patch's x, y and radius; one that grows or shrinks aslant keeps an edge where it is.
const COMPASS: [[f64; 3]; 18] = [
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
    [0.7, 0.0, -0.7],
    [-0.7, 0.0, -0.7],
    [0.0, 0.7, -0.7],
    [0.0, -0.7, -0.7],
];

/// No effect at all.
pub(crate) fn nothing(search: &Search<'_>) -> Option<Fit> {
    let projection = search.projection(&[], &search.bench.all())?;
    Some(search.fit(&[], &[], &projection, 1))
}

/// What a search has found.
pub(crate) struct Hypotheses {
    /// Every candidate alone, likeliest first.
    pub singles: Vec<Fit>,
    /// Pairs, likeliest first.
    pub pairs: Vec<Fit>,
}

impl Hypotheses {
    /// A first look: brief fits.
    pub(crate) fn brief(search: &Search<'_>) -> Self {
        Self::new(search, &[], false)
    }

    /// Everything that can still win in full; `earlier` are singles that a first look has found.
    pub(crate) fn full(search: &Search<'_>, earlier: &[Fit]) -> Self {
        Self::new(search, earlier, true)
    }

    fn new(search: &Search<'_>, earlier: &[Fit], full: bool) -> Self {
        let nothing = search.bench.whole(&Effects::NEUTRAL);
        let floor = floor(search);
        let mut openings = openings(search, &nothing, floor.as_ref().map(|known| &known.1));
        let mut singles = self::singles(search, &nothing, &openings, earlier, full);
        rank(&mut singles);
        if let Some(floor) = floor.filter(|_| full) {
            openings.extend(discs_beside(search, &nothing, &singles, &floor));
        }
        let effort = if full { (PAIRS, FULL) } else { (FIRST_PAIRS, BRIEF) };
        let mut pairs = self::pairs(search, &nothing, openings, &singles, effort);
        rank(&mut pairs);
        if full {
            deepen(search, &mut singles, &pairs);
            rank(&mut singles);
        }
        Self { singles, pairs }
    }

    /// Both, likeliest first.
    pub(crate) fn all(self) -> Vec<Fit> {
        let mut all = self.singles;
        all.extend(self.pairs);
        rank(&mut all);
        all
    }
}

/// Begins singles again where a pair has found a better place for one of its two.
fn deepen(search: &Search<'_>, singles: &mut [Fit], pairs: &[Fit]) {
    for single in singles {
        let own = single.set[0];
        for pair in pairs {
            let at = pair.set.iter().zip(&pair.at).find(|(member, _)| **member == own);
            let Some((_, at)) = at else { continue };
            let Some(projection) = search.projection(&single.set, &search.bench.all()) else {
                continue;
            };
            let again = search.fit(&single.set, core::slice::from_ref(at), &projection, BRIEF);
            if again.cost < single.cost - 0.1 {
                *single = search.fit(&single.set, &again.at, &projection, FULL);
            }
        }
    }
}

/// Likeliest first.
pub(crate) fn rank(fits: &mut [Fit]) {
    fits.sort_by(|a, b| b.log_evidence().total_cmp(&a.log_evidence()));
}
