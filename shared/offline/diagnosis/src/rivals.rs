//! What no listed effect is, as a rival: groups of shapes on top of a set of effects.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::bench::{Bench, Whole};
use crate::bins::Channels;
use crate::generic::{Axis, Entry, columns};
use crate::linear::{Group, Projection, group};

/// The shapes of one entry along one axis, whitened.
#[derive(Clone, Debug)]
pub(crate) struct Shapes {
    pub entry: Entry,
    pub axis: Axis,
    /// `[shape]` of every run.
    pub columns: Vec<Whole>,
    /// The same, not whitened: `[shape][run]`.
    pub raw: Vec<Vec<Vec<Channels>>>,
}

/// All groups that the bench's runs can show.
pub(crate) fn shapes(bench: &Bench<'_>) -> Vec<Shapes> {
    // Of motor and rack nothing is known where they are what was measured.
    let shown =
        |entry: &Entry| !(bench.only_follows() && matches!(entry, Entry::Speed | Entry::Rack));
    let pairs: Vec<(Entry, Axis)> = Entry::all()
        .into_iter()
        .filter(shown)
        .flat_map(|entry| Axis::ALL.into_iter().map(move |axis| (entry, axis)))
        .filter(|(_, axis)| *axis != Axis::Direction || goes_both_ways(bench))
        .filter(|(_, axis)| *axis != Axis::Place || !bench.is_cut() || comes_back(bench))
        .filter(|(entry, axis)| {
            *axis != Axis::Turn || matches!(entry, Entry::Wheel(_) | Entry::Curvature | Entry::Slip)
        })
        .collect();
    pairs.par_iter().map(|(entry, axis)| of(bench, *entry, *axis)).collect()
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
    Shapes { entry, axis, columns, raw }
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
    group(&condition(products, slopes.len()))
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
