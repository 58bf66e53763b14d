//! What no listed effect is, as a rival: groups of shapes on top of a set of effects.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use kerbside_geometry::math;

use crate::bench::{Bench, Whole};
use crate::bins::{CHANNELS, Channels, to_f64};
use crate::generic::{Axis, Entry, columns};
use crate::linear::{Group, Projection, group};
use crate::oscillation;

/// The shapes of one entry along one axis, whitened.
#[derive(Clone, Debug)]
pub(crate) struct Shapes {
    pub entry: Entry,
    pub axis: Axis,
    /// Logarithm of how many were compared before this one was looked at.
    pub chosen: f64,
    /// `[shape]` of every run.
    pub columns: Vec<Whole>,
    /// The same, not whitened: `[shape][run]`.
    pub raw: Vec<Vec<Vec<Channels>>>,
}

/// All groups that the bench's runs can show; oscillations are those of `residuals`.
pub(crate) fn shapes(bench: &Bench<'_>, residuals: &[&Whole]) -> Vec<Shapes> {
    // Of motor and rack nothing is known where they are what was measured.
    let shown =
        |entry: &Entry| !(bench.only_follows() && matches!(entry, Entry::Speed | Entry::Rack));
    let pairs: Vec<(Entry, Axis)> = Entry::all()
        .into_iter()
        .filter(shown)
        .flat_map(|entry| Axis::ALL.into_iter().map(move |axis| (entry, axis)))
        .filter(|(_, axis)| *axis != Axis::Direction || goes_both_ways(bench))
        .filter(|(entry, axis)| *axis != Axis::Spot || OF_A_SPOT.contains(entry))
        .filter(|(_, axis)| {
            !matches!(axis, Axis::Place | Axis::Spot) || !bench.is_cut() || comes_back(bench)
        })
        .filter(|(entry, axis)| {
            *axis != Axis::Turn || matches!(entry, Entry::Wheel(_) | Entry::Curvature | Entry::Slip)
        })
        .collect();
    let mut all: Vec<Shapes> =
        pairs.par_iter().map(|(entry, axis)| of(bench, *entry, *axis)).collect();
    let mut swings: Vec<(Axis, f64)> = Vec::new();
    for residual in residuals {
        let (axes, of) = oscillation::strongest(bench, residual);
        for axis in axes {
            if swings.iter().all(|(other, _)| *other != axis) {
                swings.push((axis, math::ln(to_f64(of))));
            }
        }
    }
    let swinging: Vec<(Entry, Axis, f64)> = THAT_SWING
        .into_iter()
        .filter(shown)
        .flat_map(|entry| swings.iter().map(move |(axis, chosen)| (entry, *axis, *chosen)))
        .collect();
    all.par_extend(swinging.par_iter().map(|(entry, axis, chosen)| Shapes {
        chosen: *chosen,
        ..run_by_run(bench, of(bench, *entry, *axis))
    }));
    all
}

/// Where something may act on small spots.
const OF_A_SPOT: [Entry; 5] =
    [Entry::Slip, Entry::Curvature, Entry::Side, Entry::Position, Entry::Yaw];
/// What may swing by itself.
const THAT_SWING: [Entry; 7] = [
    Entry::Speed,
    Entry::Rack,
    Entry::Slip,
    Entry::Curvature,
    Entry::Side,
    Entry::SteeringSensor,
    Entry::Gyro,
];

/// The same with shapes of its own for each run.
fn run_by_run(bench: &Bench<'_>, shapes: Shapes) -> Shapes {
    let runs = bench.all();
    let mut raw = Vec::new();
    let mut columns: Vec<Whole> = Vec::new();
    for (shape, whitened) in shapes.raw.iter().zip(&shapes.columns) {
        for run in &runs {
            let still = |other: usize| vec![[0.0; CHANNELS]; shape[other].len()];
            let own =
                |other: &usize| if other == run { shape[*run].clone() } else { still(*other) };
            raw.push(runs.iter().map(own).collect());
            let nothing = |other: usize| DVector::zeros(whitened[other].len());
            let own =
                |other: &usize| if other == run { whitened[*run].clone() } else { nothing(*other) };
            columns.push(runs.iter().map(own).collect());
        }
    }
    Shapes { raw, columns, ..shapes }
}

/// Whether the car went forwards and in reverse, each farther than it is long: else what depends on the direction is the
/// same throughout, as listed effects are.
fn goes_both_ways(bench: &Bench<'_>) -> bool {
    let ways = || bench.paths.iter().flat_map(|path| path.steps.iter().map(|step| step.distance));
    let way = |sign: f64| ways().map(|way| (sign * way).max(0.0)).sum::<f64>();
    way(1.0).min(way(-1.0)) > bench.extent.wheelbase
}

/// Whether the paths of different runs meet in most of the map: a place that is passed once is a time.
pub(crate) fn comes_back(bench: &Bench<'_>) -> bool {
    let [x0, y0, x1, y1] = bench.extent.place;
    let pitch = ((x1 - x0).max(y1 - y0) / PARTS).max(1e-9);
    let mut seen: Vec<((i64, i64), usize)> = Vec::new();
    for (run, path) in bench.paths.iter().enumerate() {
        for pose in &path.pose {
            #[allow(clippy::cast_possible_truncation)] // Few.
            let cell = (((pose.x - x0) / pitch) as i64, ((pose.y - y0) / pitch) as i64);
            if !seen.contains(&(cell, run)) {
                seen.push((cell, run));
            }
        }
    }
    seen.sort_unstable();
    let mut cells: Vec<(i64, i64)> = seen.iter().map(|(cell, _)| *cell).collect();
    cells.dedup();
    let passed = |cell: &(i64, i64)| seen.iter().filter(|(other, _)| other == cell).count();
    2 * cells.iter().filter(|cell| passed(cell) > 2).count() > cells.len()
}

/// Parts of a map's longer side that count as one place.
const PARTS: f64 = 20.0;

fn of(bench: &Bench<'_>, entry: Entry, axis: Axis) -> Shapes {
    let mut raw: Vec<Vec<Vec<Channels>>> = Vec::new();
    for run in bench.all() {
        let along = (&bench.ready.runs[run].binned, &bench.paths[run], &bench.coefficients[run]);
        for (shape, column) in columns(entry, axis, along, &bench.extent).into_iter().enumerate() {
            if raw.len() <= shape {
                raw.push(Vec::new());
            }
            raw[shape].push(column);
        }
    }
    let columns = raw
        .iter()
        .map(|runs| {
            runs.iter().enumerate().map(|(run, column)| bench.whitened(run, column)).collect()
        })
        .collect();
    Shapes { entry, axis, chosen: 0.0, columns, raw }
}

/// How much likelier a group makes what is left of a set of effects, whose sizes (`slopes`) may move along.
pub(crate) fn judge(
    bench: &Bench<'_>,
    projection: &Projection,
    residual: &Whole,
    slopes: &[Whole],
    shapes: &Shapes,
) -> Option<Group> {
    let mut vectors: Vec<&[DVector<f64>]> = slopes.iter().map(Vec::as_slice).collect();
    vectors.extend(shapes.columns.iter().map(Vec::as_slice));
    vectors.push(residual);
    let products = projection.products(&bench.designs, &vectors);
    let found = group(&condition(products, slopes.len()))?;
    Some(Group { log_evidence: found.log_evidence - shapes.chosen, ..found })
}

/// Integrates the first `count` vectors out of a matrix of products, each with a unit prior.
fn condition(products: DMatrix<f64>, count: usize) -> DMatrix<f64> {
    let n = products.ncols() - count;
    if count == 0 {
        return products;
    }
    let mut own = products.view((0, 0), (count, count)).into_owned();
    for i in 0..count {
        own[(i, i)] += 1.0;
    }
    let across = products.view((0, count), (count, n)).into_owned();
    let rest = products.view((count, count), (n, n)).into_owned();
    match own.cholesky() {
        Some(root) => rest - across.tr_mul(&root.solve(&across)),
        None => rest,
    }
}
