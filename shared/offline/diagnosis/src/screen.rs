//! Which hypotheses are worth a fit: what the linear model foretells of them, without one more drive of the simulator.

use kerbside_geometry::math;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::bench::Whole;
use crate::bins::to_f64;
use crate::fit::{Fit, Search};
use crate::linear::Projection;

/// What a coordinate that is not moved costs an evidence, about: its place has to be found as well.
const UNMOVED: f64 = 2.0;
/// A begin's size is foretold within these multiples of where it was looked at.
const NEAR: (f64, f64) = (0.2, 6.0);

/// A point about which a candidate is linear.
pub(crate) struct Piece {
    pub candidate: usize,
    /// Coordinates.
    at: Vec<f64>,
    /// Change of the whitened residuals from no effect to here; none where there is none.
    offset: Option<Whole>,
    /// Coordinates that may move from here, with the change of the residuals per deviation of their priors.
    slopes: Vec<(usize, Whole)>,
    /// How far the last coordinate was moved to see the slope, where that is a secant.
    reach: f64,
}

/// What is foretold of a set of effects.
#[derive(Clone, Debug)]
pub(crate) struct Foretold {
    pub set: Vec<usize>,
    pub at: Vec<Vec<f64>>,
    pub log_evidence: f64,
}

/// Where a candidate's search may begin: secants from its neutral point to each of `begins`, or slopes at the neutral point.
pub(crate) fn openings(
    search: &Search<'_>,
    nothing: &Whole,
    candidate: usize,
    begins: Vec<Vec<f64>>,
) -> Vec<Piece> {
    let own = &search.candidates[candidate];
    let runs = search.bench.all();
    let Some(projection) = search.projection(&[candidate], &runs) else { return Vec::new() };
    if own.is_two_sided() {
        let slopes = |at: &Vec<f64>| {
            let slope = |c: usize| {
                let (set, at) = ([candidate], core::slice::from_ref(at));
                let coordinate = (0, c, &own.coordinates[c]);
                (c, search.slope(&set, at, coordinate, nothing, &projection))
            };
            (0..at.len()).map(slope).collect()
        };
        let piece =
            |at: Vec<f64>| Piece { candidate, slopes: slopes(&at), at, offset: None, reach: 0.0 };
        return begins.into_iter().map(piece).collect();
    }
    let secant = |begin: Vec<f64>| {
        let last = begin.len() - 1;
        let size = &own.coordinates[last];
        let reach = begin[last] - size.neutral;
        let there =
            search.bench.whole(&search.effects(&[candidate], core::slice::from_ref(&begin)));
        let slope = scaled_difference(&there, nothing, size.deviation / reach);
        let mut at = begin;
        at[last] = size.neutral;
        Piece { candidate, at, offset: None, slopes: vec![(last, slope)], reach }
    };
    begins.into_par_iter().map(secant).collect()
}

/// A fit as a point about which its candidate is linear.
pub(crate) fn fitted(search: &Search<'_>, nothing: &Whole, single: &Fit) -> Option<Piece> {
    let projection = search.projection(&single.set, &search.bench.all())?;
    let whole = search.bench.whole(&single.effects);
    let slopes = search.slopes(single, &whole, &projection).into_iter().enumerate().collect();
    let (candidate, at) = (*single.set.first()?, single.at.first()?.clone());
    let offset = Some(scaled_difference(&whole, nothing, 1.0));
    Some(Piece { candidate, at, offset, slopes, reach: 0.0 })
}

fn scaled_difference(there: &Whole, here: &Whole, scale: f64) -> Whole {
    there.iter().zip(here).map(|(there, here)| (there - here) * scale).collect()
}

/// What is foretold of each of a candidate's begins, likeliest first.
pub(crate) fn alone<'a>(
    search: &'a Search<'a>,
    nothing: &Whole,
    pieces: &[&'a Piece],
    projection: &Projection,
) -> Vec<Foretold> {
    Screen::new(search, nothing, pieces, projection).singles()
}

/// Inner products of everything that pieces are made of.
pub(crate) struct Screen<'a> {
    search: &'a Search<'a>,
    pieces: Vec<&'a Piece>,
    /// By piece: its offset's place among the products, and that of its first slope.
    places: Vec<(Option<usize>, usize)>,
    products: DMatrix<f64>,
}

impl<'a> Screen<'a> {
    /// Of `pieces`, on the residuals without any effect.
    pub(crate) fn new(
        search: &'a Search<'a>,
        nothing: &Whole,
        pieces: &[&'a Piece],
        projection: &Projection,
    ) -> Self {
        let mut vectors: Vec<&[DVector<f64>]> = vec![nothing.as_slice()];
        let mut places = Vec::with_capacity(pieces.len());
        for piece in pieces {
            let offset = piece.offset.as_ref().map(|offset| {
                vectors.push(offset.as_slice());
                vectors.len() - 1
            });
            places.push((offset, vectors.len()));
            vectors.extend(piece.slopes.iter().map(|slope| slope.1.as_slice()));
        }
        let products = projection.products(&search.bench.designs, &vectors);
        Self { search, pieces: pieces.to_vec(), places, products }
    }

    /// What is foretold of each piece alone, likeliest first.
    pub(crate) fn singles(&self) -> Vec<Foretold> {
        let mut all: Vec<Foretold> =
            (0..self.pieces.len()).filter_map(|piece| self.foretold(&[piece])).collect();
        all.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        all
    }

    /// What is foretold of every pair of candidates, each from the likeliest of its points, likeliest first.
    pub(crate) fn pairs(&self) -> Vec<Foretold> {
        let id = |piece: usize| self.search.candidates[self.pieces[piece].candidate].definition.id;
        let with = |one: usize| {
            let mut best: Vec<Foretold> = Vec::new();
            for other in (0..self.pieces.len()).filter(|other| id(*other) != id(one)) {
                if self.pieces[other].candidate < self.pieces[one].candidate {
                    continue;
                }
                let Some(pair) = self.foretold(&[one, other]) else { continue };
                match best.iter_mut().find(|known| known.set == pair.set) {
                    Some(known) if known.log_evidence < pair.log_evidence => *known = pair,
                    Some(_) => {}
                    None => best.push(pair),
                }
            }
            best
        };
        let each: Vec<Vec<Foretold>> = (0..self.pieces.len()).into_par_iter().map(with).collect();
        let mut all: Vec<Foretold> = each.into_iter().flatten().collect();
        all.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        let mut seen: Vec<Vec<usize>> = Vec::new();
        all.retain(|pair| {
            let new = !seen.contains(&pair.set);
            if new {
                seen.push(pair.set.clone());
            }
            new
        });
        all
    }

    /// What is foretold of pieces together, each of another effect.
    fn foretold(&self, together: &[usize]) -> Option<Foretold> {
        let products = &self.products;
        let mut residual = vec![0];
        residual.extend(together.iter().filter_map(|piece| self.places[*piece].0));
        let moving: Vec<(usize, usize)> = together
            .iter()
            .enumerate()
            .flat_map(|(member, piece)| {
                (0..self.pieces[*piece].slopes.len()).map(move |slope| (member, slope))
            })
            .collect();
        let place = |(member, slope): (usize, usize)| self.places[together[member]].1 + slope;
        let coordinate = |(member, slope): (usize, usize)| {
            let piece = &self.pieces[together[member]];
            let c = piece.slopes[slope].0;
            (piece.at[c], &self.search.candidates[piece.candidate].coordinates[c])
        };
        let n = moving.len();
        let mut normal = DMatrix::<f64>::identity(n, n);
        let mut right = DVector::<f64>::zeros(n);
        for i in 0..n {
            for j in 0..n {
                normal[(i, j)] += products[(place(moving[i]), place(moving[j]))];
            }
            let along: f64 = residual.iter().map(|k| products[(*k, place(moving[i]))]).sum();
            let (at, own) = coordinate(moving[i]);
            right[i] = -along - (at - own.centre) / own.deviation;
        }
        let root = normal.clone().cholesky()?;
        let occam: f64 = root.l_dirty().diagonal().iter().map(|d| math::ln(*d)).sum();
        let bounds = |i: usize| {
            let (at, own) = coordinate(moving[i]);
            ((own.low - at) / own.deviation, (own.high - at) / own.deviation)
        };
        let step = bounded(&normal, &right, root.solve(&right), bounds)?;
        let square: f64 =
            residual.iter().flat_map(|i| residual.iter().map(move |j| products[(*i, *j)])).sum();
        let gain = 2.0 * right.dot(&step) - step.dot(&(&normal * &step));
        let (prior, unmoved) = self.priors(together);
        let log_evidence = -0.5 * (square + prior - gain) - occam - UNMOVED * to_f64(unmoved);
        let mut at: Vec<Vec<f64>> =
            together.iter().map(|piece| self.pieces[*piece].at.clone()).collect();
        for (i, (member, slope)) in moving.iter().enumerate() {
            let (_, own) = coordinate((*member, *slope));
            let piece = &self.pieces[together[*member]];
            let value = &mut at[*member][piece.slopes[*slope].0];
            *value += step[i] * own.deviation;
            if piece.reach != 0.0 {
                let ends =
                    [NEAR.0 * piece.reach, NEAR.1 * piece.reach].map(|end| own.neutral + end);
                *value = value.clamp(ends[0].min(ends[1]), ends[0].max(ends[1]));
            }
            *value = value.clamp(own.low, own.high);
        }
        let set = together.iter().map(|piece| self.pieces[*piece].candidate).collect();
        Some(Foretold { set, at, log_evidence })
    }

    /// Squares of all coordinates' offsets from their priors, and how many cannot move.
    fn priors(&self, together: &[usize]) -> (f64, usize) {
        let (mut sum, mut unmoved) = (0.0, 0);
        for piece in together {
            let piece = &self.pieces[*piece];
            let own = &self.search.candidates[piece.candidate].coordinates;
            for (at, c) in piece.at.iter().zip(own) {
                sum += ((at - c.centre) / c.deviation).powi(2);
            }
            unmoved += own.len() - piece.slopes.len();
        }
        (sum, unmoved)
    }
}

/// The step that keeps within bounds: what would leave them is put on them, and the rest moves once more.
fn bounded(
    normal: &DMatrix<f64>,
    right: &DVector<f64>,
    step: DVector<f64>,
    bounds: impl Fn(usize) -> (f64, f64),
) -> Option<DVector<f64>> {
    let n = step.len();
    let held: Vec<Option<f64>> = (0..n)
        .map(|i| {
            let (low, high) = bounds(i);
            (step[i] < low).then_some(low).or((step[i] > high).then_some(high))
        })
        .collect();
    if held.iter().all(Option::is_none) {
        return Some(step);
    }
    let free: Vec<usize> = (0..n).filter(|i| held[*i].is_none()).collect();
    let mut bounded = DVector::from_iterator(n, held.iter().map(|held| held.unwrap_or(0.0)));
    if free.is_empty() {
        return Some(bounded);
    }
    let rest = (right - normal * &bounded).select_rows(&free);
    let own = normal.select_rows(&free).select_columns(&free);
    let moved = own.cholesky()?.solve(&rest);
    for (i, value) in free.iter().zip(moved.iter()) {
        let (low, high) = bounds(*i);
        bounded[*i] = value.clamp(low, high);
    }
    Some(bounded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_on_a_bound_stays_there_and_the_rest_moves_once_more() {
        let normal = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0]);
        let right = DVector::from_vec(vec![3.0, -3.0]);
        let free = DVector::from_vec(vec![3.0, -3.0]);
        let wide = bounded(&normal, &right, free.clone(), |_| (-10.0, 10.0)).unwrap();
        assert_eq!(wide, free);
        let narrow = |i: usize| if i == 0 { (-10.0, 10.0) } else { (-1.0, 1.0) };
        // 2 x + 1 (-1) = 3 for the one that may move.
        let held = bounded(&normal, &right, free.clone(), narrow).unwrap();
        assert!((held - DVector::from_vec(vec![2.0, -1.0])).norm() < 1e-12);
        let none = bounded(&normal, &right, free, |_| (-1.0, 1.0)).unwrap();
        assert_eq!(none, DVector::from_vec(vec![1.0, -1.0]));
    }
}
