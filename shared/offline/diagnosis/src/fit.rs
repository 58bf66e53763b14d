//! The most likely sizes of a set of effects, by Gauss and Newton on the whitened residuals.

use kerbside_geometry::math;
use kerbside_simulation::Effects;
use nalgebra::{DMatrix, DVector};

use crate::bench::{Bench, Whole};
use crate::bins::Channels;
use crate::candidate::{Candidate, Coordinate};
use crate::linear::Projection;

/// Rounds at most.
const ROUNDS: usize = 12;
/// A gain in twice the log-likelihood below this ends a fit.
const ENOUGH: f64 = 0.02;

/// A set of effects, fitted.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// The candidates, by index.
    pub set: Vec<usize>,
    /// Coordinates of each.
    pub at: Vec<Vec<f64>>,
    /// Twice the negative logarithm of the posterior, but for constants.
    pub cost: f64,
    /// Curvature of half of it, priors included, in units of the priors' deviations.
    pub normal: DMatrix<f64>,
    /// Effects with these.
    pub effects: Effects,
}

impl Fit {
    /// Logarithm of the evidence, but for a constant that all hypotheses share: the integral of a Gaussian over all
    /// coordinates. One that stands on its bound counts with what is left of it.
    pub(crate) fn log_evidence(&self) -> f64 {
        let Some(root) = self.normal.clone().cholesky() else { return f64::NEG_INFINITY };
        let occam: f64 = root.l_dirty().diagonal().iter().map(|d| math::ln(*d)).sum();
        -0.5 * self.cost - occam
    }
}

/// What a fit needs.
pub(crate) struct Search<'a> {
    pub bench: &'a Bench<'a>,
    pub candidates: &'a [Candidate],
}

impl Search<'_> {
    /// The projection that belongs to a set: nuisances that are parameters of its effects are not integrated out beside
    /// them.
    pub(crate) fn projection(&self, set: &[usize], runs: &[usize]) -> Option<Projection> {
        self.bench.projection(runs, |nuisance| {
            set.iter().any(|candidate| self.candidates[*candidate].shares(nuisance.parameter))
        })
    }

    pub(crate) fn effects(&self, set: &[usize], at: &[Vec<f64>]) -> Effects {
        let mut effects = Effects::NEUTRAL;
        for (candidate, x) in set.iter().zip(at) {
            self.candidates[*candidate].apply(x, &mut effects);
        }
        effects
    }

    fn whole(&self, set: &[usize], at: &[Vec<f64>], runs: &[usize]) -> Whole {
        let effects = self.effects(set, at);
        let mut whole = vec![DVector::zeros(0); self.bench.raw.len()];
        for run in runs {
            whole[*run] = self.bench.whitened(*run, &self.bench.raw_of(*run, &effects));
        }
        whole
    }

    fn coordinates(&self, set: &[usize]) -> Vec<(usize, usize, &Coordinate)> {
        let of = |(member, candidate): (usize, &usize)| {
            let coordinates = &self.candidates[*candidate].coordinates;
            coordinates
                .iter()
                .enumerate()
                .map(move |(c, coordinate)| (member, c, coordinate))
                .collect::<Vec<_>>()
        };
        set.iter().enumerate().flat_map(of).collect()
    }

    fn cost_of(
        &self,
        set: &[usize],
        at: &[Vec<f64>],
        projection: &Projection,
        whole: &Whole,
    ) -> f64 {
        let square = projection.products(&self.bench.designs, &[whole])[(0, 0)];
        square + self.prior(set, at)
    }

    fn prior(&self, set: &[usize], at: &[Vec<f64>]) -> f64 {
        let off = |(member, c, coordinate): &(usize, usize, &Coordinate)| {
            ((at[*member][*c] - coordinate.centre) / coordinate.deviation).powi(2)
        };
        self.coordinates(set).iter().map(off).sum()
    }

    /// Fits a set from `begin`, over the runs of `projection`, in at most `rounds`.
    pub(crate) fn fit(
        &self,
        set: &[usize],
        begin: &[Vec<f64>],
        projection: &Projection,
        rounds: usize,
    ) -> Fit {
        let coordinates = self.coordinates(set);
        let n = coordinates.len();
        let mut at = begin.to_vec();
        let mut whole = self.whole(set, &at, projection.runs());
        let mut cost = self.cost_of(set, &at, projection, &whole);
        let mut damping = 1e-3;
        let mut normal = DMatrix::identity(n, n);
        for round in 0..rounds.min(ROUNDS) {
            let slopes: Vec<Whole> = coordinates
                .iter()
                .map(|(member, c, coordinate)| {
                    self.slope(set, &at, (*member, *c, coordinate), &whole, projection)
                })
                .collect();
            let mut vectors: Vec<&[DVector<f64>]> = slopes.iter().map(Vec::as_slice).collect();
            vectors.push(&whole);
            let products = projection.products(&self.bench.designs, &vectors);
            let mut right = DVector::zeros(n);
            normal = products.view((0, 0), (n, n)).into_owned();
            for (i, (member, c, coordinate)) in coordinates.iter().enumerate() {
                normal[(i, i)] += 1.0;
                right[i] = -products[(i, n)]
                    - (at[*member][*c] - coordinate.centre) / coordinate.deviation;
            }
            if round + 1 == rounds.min(ROUNDS) {
                break;
            }
            let mut gained = 0.0;
            for _ in 0..5 {
                let mut damped = normal.clone();
                for i in 0..n {
                    damped[(i, i)] *= 1.0 + damping;
                }
                let Some(root) = damped.cholesky() else { break };
                let step = root.solve(&right);
                let next = self.stepped(&at, &coordinates, &step);
                let there = self.whole(set, &next, projection.runs());
                let value = self.cost_of(set, &next, projection, &there);
                if value < cost {
                    gained = cost - value;
                    (at, whole, cost) = (next, there, value);
                    damping = (damping * 0.2).max(1e-6);
                    break;
                }
                damping = (damping * 8.0).max(1e-2);
            }
            if gained < ENOUGH {
                break;
            }
        }
        Fit { set: set.to_vec(), effects: self.effects(set, &at), at, cost, normal }
    }

    fn stepped(
        &self,
        at: &[Vec<f64>],
        coordinates: &[(usize, usize, &Coordinate)],
        step: &DVector<f64>,
    ) -> Vec<Vec<f64>> {
        let mut next = at.to_vec();
        for (i, (member, c, coordinate)) in coordinates.iter().enumerate() {
            let value = &mut next[*member][*c];
            *value =
                (*value + step[i] * coordinate.deviation).clamp(coordinate.low, coordinate.high);
        }
        next
    }

    /// Change of the whitened residuals per standard deviation of a coordinate.
    pub(crate) fn slope(
        &self,
        set: &[usize],
        at: &[Vec<f64>],
        (member, c, coordinate): (usize, usize, &Coordinate),
        whole: &Whole,
        projection: &Projection,
    ) -> Whole {
        let probe = self.candidates[set[member]].probe(c, &self.bench.extent);
        let probe = if at[member][c] + probe > coordinate.high { -probe } else { probe };
        let mut moved = at.to_vec();
        moved[member][c] += probe;
        let mut there = self.whole(set, &moved, projection.runs());
        let scale = coordinate.deviation / probe;
        for run in projection.runs() {
            there[*run] = (&there[*run] - &whole[*run]) * scale;
        }
        there
    }

    /// Change of the whitened residuals per standard deviation of each coordinate of a fit.
    pub(crate) fn slopes(&self, fit: &Fit, whole: &Whole, projection: &Projection) -> Vec<Whole> {
        let slope = |(member, c, coordinate): &(usize, usize, &Coordinate)| {
            self.slope(&fit.set, &fit.at, (*member, *c, coordinate), whole, projection)
        };
        self.coordinates(&fit.set).iter().map(slope).collect()
    }

    /// The same of the residuals that are not whitened, by run.
    pub(crate) fn raw_slopes(&self, fit: &Fit) -> Vec<Vec<Vec<Channels>>> {
        let base: Vec<Vec<Channels>> =
            self.bench.all().iter().map(|run| self.bench.raw_of(*run, &fit.effects)).collect();
        let slope = |(member, c, coordinate): &(usize, usize, &Coordinate)| {
            let probe = self.candidates[fit.set[*member]].probe(*c, &self.bench.extent);
            let probe = if fit.at[*member][*c] + probe > coordinate.high { -probe } else { probe };
            let mut moved = fit.at.clone();
            moved[*member][*c] += probe;
            let effects = self.effects(&fit.set, &moved);
            let scale = coordinate.deviation / probe;
            let run = |run: usize| {
                let mut there = self.bench.raw_of(run, &effects);
                for (there, base) in there.iter_mut().zip(&base[run]) {
                    for (there, base) in there.iter_mut().zip(base) {
                        *there = (*there - base) * scale;
                    }
                }
                there
            };
            (0..base.len()).map(run).collect()
        };
        self.coordinates(&fit.set).iter().map(slope).collect()
    }

    /// Offsets of a fit's coordinates from the centres of their priors, in deviations.
    pub(crate) fn offsets(&self, fit: &Fit) -> DVector<f64> {
        let off = |(member, c, coordinate): &(usize, usize, &Coordinate)| {
            (fit.at[*member][*c] - coordinate.centre) / coordinate.deviation
        };
        DVector::from_vec(self.coordinates(&fit.set).iter().map(off).collect())
    }

    /// The effects of a fit whose coordinates have moved by `step`, in units of their priors.
    pub(crate) fn moved(&self, fit: &Fit, step: &DVector<f64>) -> Effects {
        self.effects(&fit.set, &self.stepped(&fit.at, &self.coordinates(&fit.set), step))
    }

    /// A set at a point, where the last coordinate of `member` alone is fitted, by one step.
    pub(crate) fn sized(
        &self,
        set: &[usize],
        at: &[Vec<f64>],
        member: usize,
        projection: &Projection,
    ) -> Fit {
        let whole = self.whole(set, at, projection.runs());
        let coordinates = self.coordinates(set);
        let last = at[member].len() - 1;
        let own = coordinates.iter().find(|(m, c, _)| *m == member && *c == last);
        let mut there = at.to_vec();
        let mut cost = self.cost_of(set, &there, projection, &whole);
        if let Some((_, c, coordinate)) = own {
            let slope = self.slope(set, at, (member, *c, coordinate), &whole, projection);
            let products = projection.products(&self.bench.designs, &[&slope, &whole]);
            let offset = (at[member][*c] - coordinate.centre) / coordinate.deviation;
            let step = -(products[(0, 1)] + offset) / (products[(0, 0)] + 1.0);
            let value = &mut there[member][*c];
            *value = (*value + step * coordinate.deviation).clamp(coordinate.low, coordinate.high);
            // The model is linear in a size: what the step gains is what it foretells.
            let taken = (*value - at[member][*c]) / coordinate.deviation;
            cost += taken * (2.0 * (products[(0, 1)] + offset) + taken * (products[(0, 0)] + 1.0));
        }
        let n = coordinates.len();
        Fit {
            set: set.to_vec(),
            effects: self.effects(set, &there),
            at: there,
            cost,
            normal: DMatrix::identity(n, n),
        }
    }
}
