//! Where on the floor a patch may lie: every disc is looked at, on the linear model about the paths.
//!
//! Slip in one stretch of a path moves all that is measured later by a known amount, and what a disc does is the sum over the
//! stretches that lie in it. So the inner products of the stretches foretell each disc without one more drive of the
//! simulator, wherever it lies and however large it is. A descent on the edges of a single disc ends in one of many small
//! valleys.

use kerbside_geometry::math;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::bench::{Bench, Whole};
use crate::bins::{REFERENCE, to_f64};
use crate::candidate::Coordinate;
use crate::fit::Search;
use crate::linear::{Projection, gram};
use crate::noise::OF_SLIP;

/// Stretches at most; longer paths have longer ones.
const STRETCHES: usize = 320;
/// Points within a bin at which it is asked whether a disc holds the car.
const POINTS: usize = 5;
/// Shortest stretch and pitch of the centres, in wheelbases.
const PITCH: f64 = 0.25;
/// Centres along the longer side of the map at most.
const CENTRES: f64 = 36.0;
/// Smallest radius, in wheelbases, and the ratio of one to the next.
const RADII: (f64, f64) = (0.25, 1.3);
/// Discs that are moved about, of all that were looked at.
const MOVED: usize = 40;
/// Discs whose effects are so much alike count as one.
const ALIKE: f64 = 0.97;

/// A stretch of a run's path: bins that follow on one another.
struct Stretch {
    run: usize,
    bins: core::ops::Range<usize>,
    /// Places of the rear-axle centre \[m\].
    points: Vec<(f64, f64)>,
}

/// A disc: x, y, radius \[m\].
type Disc = [f64; 3];

/// A disc with what is foretold of it.
#[derive(Clone, Debug)]
struct Looked {
    disc: Disc,
    /// Share of each stretch that it holds.
    held: Vec<(usize, f64)>,
    /// Gain in twice the log-likelihood, priors included.
    gain: f64,
    /// Its ratio.
    size: f64,
}

/// What slip in each place does.
pub(crate) struct Floor<'a> {
    search: &'a Search<'a>,
    projection: Projection,
    coordinates: &'a [Coordinate],
    stretches: Vec<Stretch>,
    /// By run: the whitened effects of slip of one deviation in each of its stretches.
    effects: Vec<DMatrix<f64>>,
    /// Their inner products, and those with the nuisances.
    products: DMatrix<f64>,
    nuisances: DMatrix<f64>,
}

impl<'a> Floor<'a> {
    /// About the paths of a bench.
    pub(crate) fn new(search: &'a Search<'a>, candidate: usize) -> Option<Self> {
        let bench = search.bench;
        let coordinates = &search.candidates[candidate].coordinates;
        let deviation = coordinates.last()?.deviation;
        let projection = search.projection(&[candidate], &bench.all())?;
        let stretches = stretches(bench);
        let of_run = |run: usize| {
            let own: Vec<&Stretch> = stretches.iter().filter(|one| one.run == run).collect();
            let columns: Vec<DVector<f64>> =
                own.par_iter().map(|stretch| effect(bench, stretch, deviation)).collect();
            let mut matrix = DMatrix::zeros(bench.whiteners[run].values, columns.len());
            columns.iter().enumerate().for_each(|(j, column)| matrix.set_column(j, column));
            matrix
        };
        let effects: Vec<DMatrix<f64>> = bench.all().into_iter().map(of_run).collect();
        let along: Vec<DMatrix<f64>> = effects
            .iter()
            .enumerate()
            .map(|(run, effects)| projection.along(&bench.designs, run, effects))
            .collect();
        let n = stretches.len();
        let mut nuisances = DMatrix::zeros(along.first()?.nrows(), n);
        let mut products = DMatrix::zeros(n, n);
        let mut first = 0;
        for (effects, along) in effects.iter().zip(&along) {
            let own = effects.ncols();
            nuisances.columns_mut(first, own).copy_from(along);
            products.view_mut((first, first), (own, own)).copy_from(&gram(effects));
            first += own;
        }
        products -= projection.taken(&nuisances, &nuisances);
        Some(Self { search, projection, coordinates, stretches, effects, products, nuisances })
    }

    /// On the residuals `whole`, beside what else may move, by its slopes.
    pub(crate) fn map(&self, whole: &Whole, slopes: &[Whole]) -> Option<Map<'_>> {
        let mut across = self.across(whole);
        let mut products = self.products.clone();
        if !slopes.is_empty() {
            let mut vectors: Vec<&[DVector<f64>]> = slopes.iter().map(Vec::as_slice).collect();
            vectors.push(whole);
            let own = self.projection.products(&self.search.bench.designs, &vectors);
            let m = slopes.len();
            let mut normal = own.view((0, 0), (m, m)).into_owned();
            (0..m).for_each(|i| normal[(i, i)] += 1.0);
            let columns: Vec<DVector<f64>> =
                slopes.iter().map(|slope| self.across(slope)).collect();
            let beside = DMatrix::from_columns(&columns);
            let root = normal.cholesky()?;
            products -= &beside * root.solve(&beside.transpose());
            across -= &beside * root.solve(&own.view((0, m), (m, 1)));
        }
        let extent = &self.search.bench.extent;
        Some(Map {
            coordinates: self.coordinates,
            stretches: &self.stretches,
            products,
            along: across,
            wheelbase: extent.wheelbase,
            place: extent.place,
        })
    }

    /// Inner products of the stretches' effects with a vector of every run.
    fn across(&self, whole: &Whole) -> DVector<f64> {
        let mut plain = DVector::zeros(self.stretches.len());
        let mut along = DMatrix::zeros(self.nuisances.nrows(), 1);
        let mut first = 0;
        for (run, (effects, own)) in self.effects.iter().zip(whole).enumerate() {
            plain.rows_mut(first, effects.ncols()).copy_from(&effects.tr_mul(own));
            let column = DMatrix::from_columns(core::slice::from_ref(own));
            along += self.projection.along(&self.search.bench.designs, run, &column);
            first += effects.ncols();
        }
        plain - self.projection.taken(&self.nuisances, &along).column(0)
    }
}

/// The map of what slip in each place would explain.
pub(crate) struct Map<'a> {
    coordinates: &'a [Coordinate],
    stretches: &'a [Stretch],
    /// Inner products of the stretches' effects per deviation of the ratio, and with the residual.
    products: DMatrix<f64>,
    along: DVector<f64>,
    wheelbase: f64,
    place: [f64; 4],
}

impl Map<'_> {
    /// Coordinates of the `count` discs of which most is foretold, no two alike.
    pub(crate) fn discs(&self, count: usize) -> Vec<Vec<f64>> {
        let mut looked: Vec<Looked> =
            self.grid().into_par_iter().filter_map(|disc| self.look(disc)).collect();
        looked.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let mut moved: Vec<Looked> = self
            .unlike(looked, MOVED)
            .into_par_iter()
            .map(|looked| self.moved_about(looked))
            .collect();
        moved.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let at = |looked: Looked| {
            let [x, y, radius] = looked.disc;
            vec![x, y, radius, looked.size]
        };
        self.unlike(moved, count).into_iter().map(at).collect()
    }

    /// All centres on a grid about the paths, with all radii.
    fn grid(&self) -> Vec<Disc> {
        let [x0, y0, x1, y1] = self.place;
        let side = (x1 - x0).max(y1 - y0);
        let pitch = (PITCH * self.wheelbase).max(side / CENTRES);
        let line = |from: f64, to: f64| {
            let steps = ((to - from) / pitch).ceil().max(0.0);
            let n = core::iter::successors(Some(0.0), move |k| (*k < steps).then_some(k + 1.0));
            n.map(move |k| from + k * pitch)
        };
        let largest = self.coordinates[2].high.min(0.6 * math::hypot(x1 - x0, y1 - y0));
        let radius = |r: &f64| Some(r * RADII.1).filter(|r| *r <= largest);
        let radii: Vec<f64> =
            core::iter::successors(Some(RADII.0 * self.wheelbase), radius).collect();
        let mut grid = Vec::new();
        for x in line(x0, x1) {
            for y in line(y0, y1) {
                grid.extend(radii.iter().map(|radius| [x, y, *radius]));
            }
        }
        grid
    }

    /// What is foretold of a disc; none where no path enters it.
    fn look(&self, disc: Disc) -> Option<Looked> {
        let [x, y, radius] = disc;
        let square = |value: f64| value * value;
        let inside = |(px, py): &&(f64, f64)| square(px - x) + square(py - y) <= square(radius);
        let held: Vec<(usize, f64)> = self
            .stretches
            .iter()
            .enumerate()
            .filter_map(|(i, stretch)| {
                let count = stretch.points.iter().filter(inside).count();
                (count > 0).then(|| (i, to_f64(count) / to_f64(stretch.points.len())))
            })
            .collect();
        if held.is_empty() {
            return None;
        }
        let normal = self.product(&held, &held) + 1.0;
        let ratio = &self.coordinates[3];
        let right: f64 = -held.iter().map(|(i, share)| share * self.along[*i]).sum::<f64>()
            + ratio.centre / ratio.deviation;
        let highest = ratio.high / ratio.deviation;
        let size = (right / normal).clamp(0.0, highest);
        let prior: f64 = disc
            .iter()
            .zip(self.coordinates)
            .map(|(value, own)| ((value - own.centre) / own.deviation).powi(2))
            .sum();
        let gain = size * (2.0 * right - size * normal) - prior;
        Some(Looked { disc, held, gain, size: size * ratio.deviation })
    }

    fn product(&self, one: &[(usize, f64)], other: &[(usize, f64)]) -> f64 {
        let row = |(i, share): &(usize, f64)| {
            let column = self.products.column(*i);
            share * other.iter().map(|(j, share)| share * column[*j]).sum::<f64>()
        };
        one.iter().map(row).sum()
    }

    /// The first `count` that are not alike.
    fn unlike(&self, looked: Vec<Looked>, count: usize) -> Vec<Looked> {
        let mut kept: Vec<(Looked, f64)> = Vec::new();
        for one in looked {
            let own = self.product(&one.held, &one.held);
            let alike = |known: &(Looked, f64)| {
                let both = self.product(&one.held, &known.0.held);
                both > ALIKE * (own * known.1).sqrt()
            };
            if one.size > 0.0 && !kept.iter().any(alike) {
                kept.push((one, own));
                if kept.len() == count {
                    break;
                }
            }
        }
        kept.into_iter().map(|(looked, _)| looked).collect()
    }

    /// Moved, grown and shrunk while that gains, from far to near.
    fn moved_about(&self, mut best: Looked) -> Looked {
        let mut step = 0.5 * PITCH * self.wheelbase;
        while step > 0.01 * self.wheelbase {
            let near = (0..27).filter_map(|k| {
                let mut disc = best.disc;
                for (c, part) in [k % 3, k / 3 % 3, k / 9].into_iter().enumerate() {
                    let own = &self.coordinates[c];
                    disc[c] = (disc[c] + step * (to_f64(part) - 1.0)).clamp(own.low, own.high);
                }
                self.look(disc)
            });
            match near.max_by(|a, b| a.gain.total_cmp(&b.gain)) {
                Some(next) if next.gain > best.gain + 1e-9 => best = next,
                _ => step *= 0.5,
            }
        }
        best
    }
}

/// All paths, cut.
fn stretches(bench: &Bench<'_>) -> Vec<Stretch> {
    let length: f64 =
        bench.paths.iter().flat_map(|path| &path.steps).map(|step| step.distance.abs()).sum();
    let pitch = (PITCH * bench.extent.wheelbase).max(length / to_f64(STRETCHES));
    let mut all = Vec::new();
    for (run, path) in bench.paths.iter().enumerate() {
        let poses = poses(bench, run);
        let (mut begin, mut gone) = (0, 0.0);
        for (k, step) in path.steps.iter().enumerate() {
            gone += step.distance.abs();
            if gone >= pitch || k + 1 == path.steps.len() {
                let bins = begin..k + 1;
                let points = bins.clone().flat_map(|bin| within(&poses, bin)).collect();
                all.push(Stretch { run, bins, points });
                (begin, gone) = (k + 1, 0.0);
            }
        }
    }
    all
}

/// Where the rear-axle centre was in each bin: measured where the reference tells, else predicted.
fn poses(bench: &Bench<'_>, run: usize) -> Vec<(f64, f64)> {
    let binned = &bench.ready.runs[run].binned;
    let measured = binned.measured.iter().map(|row| (row[REFERENCE], row[REFERENCE + 1]));
    let known = |(x, y): (f64, f64)| binned.has_yaw && x.is_finite() && y.is_finite();
    // Without a yaw the compared point is the marker.
    let (mx, my) = match (binned.has_yaw, bench.ready.vehicle.reference) {
        (false, Some(reference)) => (reference.marker.x, reference.marker.y),
        _ => (0.0, 0.0),
    };
    let predicted = bench.paths[run].pose.iter().map(|pose| {
        let (sin, cos) = math::sin_cos(pose.yaw);
        (pose.x - cos * mx + sin * my, pose.y - sin * mx - cos * my)
    });
    predicted.zip(measured).map(|(path, seen)| if known(seen) { seen } else { path }).collect()
}

/// Points from half a bin before the middle of `bin` to half a bin after.
fn within(poses: &[(f64, f64)], bin: usize) -> impl Iterator<Item = (f64, f64)> {
    let at = |k: usize| poses[k.min(poses.len() - 1)];
    let (before, own, after) = (at(bin.saturating_sub(1)), at(bin), at(bin + 1));
    (0..POINTS).map(move |k| {
        let part = (to_f64(k) + 0.5) / to_f64(POINTS) - 0.5;
        let (to, part) = if part < 0.0 { (before, -part) } else { (after, part) };
        (own.0 + part * (to.0 - own.0), own.1 + part * (to.1 - own.1))
    })
}

/// Change of a run's whitened residuals (measured less predicted) by slip of one deviation in a stretch.
fn effect(bench: &Bench<'_>, stretch: &Stretch, deviation: f64) -> DVector<f64> {
    let mut size = vec![0.0; bench.paths[stretch.run].pose.len()];
    size[stretch.bins.clone()].fill(-deviation);
    let channels = bench.coefficients[stretch.run].response(OF_SLIP, &size);
    bench.whitened(stretch.run, &channels)
}
