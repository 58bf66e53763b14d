//! What the report draws.

use kerbside_geometry::math;
use kerbside_simulation::Effects;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use crate::bins::{CHANNELS, Channels, GYRO, REFERENCE, STEERING, to_f64};
use crate::diagnose::Found;
use crate::floor::{drawn, in_frame};
use crate::folds::errors;
use crate::generic::{Axis, Entry, shapes};
use crate::links;
use crate::verdict::{MapPoint, RegimePlot, RunPaths};

/// Every run's paths and errors.
pub(crate) fn paths(found: &Found<'_>, after: Option<&Effects>) -> Vec<RunPaths> {
    let bench = &found.analysis.bench;
    bench
        .all()
        .into_iter()
        .map(|run| {
            let prepared = &bench.ready.runs[run];
            let binned = &prepared.binned;
            let nominal = bench.ready.predicted(run, &Effects::NEUTRAL);
            let with = after.map(|effects| bench.ready.predicted(run, effects));
            let before = errors(binned.width, &binned.measured, &nominal);
            let less = with.as_ref().map(|with| errors(binned.width, &binned.measured, with));
            let error = |k: usize| less.as_ref().map_or(f64::NAN, |less| less[k].1);
            RunPaths {
                name: binned.name.clone(),
                measured: points(&binned.measured),
                nominal: points(&nominal),
                after: with.as_deref().map(points).unwrap_or_default(),
                map: map(found, run),
                errors: before.iter().enumerate().map(|(k, e)| (e.0, e.1, error(k))).collect(),
            }
        })
        .collect()
}

fn points(rows: &[Channels]) -> Vec<(f64, f64)> {
    rows.iter()
        .map(|row| (row[REFERENCE], row[REFERENCE + 1]))
        .filter(|(x, y)| x.is_finite() && y.is_finite())
        .collect()
}

/// Two-second residuals of the reference along the path, over their own root mean square floor.
fn map(found: &Found<'_>, run: usize) -> Vec<MapPoint> {
    let bench = &found.analysis.bench;
    let residuals = bench.raw_of(run, &Effects::NEUTRAL);
    let width = bench.coefficients[run].width;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let span = (links::HORIZON / width).round() as usize;
    let scale = 0.01 * bench.extent.wheelbase;
    let windows = links::windows(bench, run, &residuals);
    let of = |signal: links::Signal| &windows[signal as usize];
    let (along, across) = (of(links::Signal::Distance), of(links::Signal::Lateral));
    let path = &bench.paths[run];
    along
        .iter()
        .filter_map(|(from, x)| {
            let y = across.iter().find(|(other, _)| other == from)?.1;
            let pose = path.pose.get(from + span / 2)?;
            let turned = pose.yaw + math::atan2(y, *x);
            Some(MapPoint {
                x: pose.x,
                y: pose.y,
                excess: math::hypot(*x, y) / scale,
                direction: turned,
            })
        })
        .collect()
}

/// The rate at which the residual grows against the circumstance that explains it best.
pub(crate) fn plot(found: &Found<'_>, after: Option<&Effects>) -> Option<RegimePlot> {
    let bench = &found.analysis.bench;
    let shape = found.decision.shape.or_else(|| found.analysis.beside_nothing.first().copied())?;
    if matches!(shape.axis, Axis::Place | Axis::Spot | Axis::Heading | Axis::Turn) {
        return None;
    }
    let channel = match shape.entry {
        Entry::Rack | Entry::SteeringSensor => STEERING,
        Entry::Gyro => GYRO,
        Entry::Curvature | Entry::Yaw => REFERENCE + 2,
        Entry::Side => REFERENCE + 1,
        Entry::Slip | Entry::Position => REFERENCE,
        Entry::Speed => 2,
        Entry::Wheel(wheel) => wheel,
    };
    let swings = matches!(shape.axis, Axis::Oscillation { .. });
    // What swings begins anywhere in each run: one of them shows it.
    let runs = if swings { vec![0] } else { bench.all() };
    let mut points = Vec::new();
    for run in runs {
        let binned = &bench.ready.runs[run].binned;
        let axis = shapes(shape.axis, shape.entry, &bench.paths[run], &bench.extent, binned.width);
        let before = bench.raw_of(run, &Effects::NEUTRAL);
        let with = after.map(|effects| bench.raw_of(run, effects));
        let level = matches!(channel, STEERING | GYRO) || (binned.speeds && channel < 4);
        let value = |rows: &[Channels], k: usize| {
            if level {
                rows[k][channel]
            } else {
                (rows[k][channel] - rows[k - 1][channel]) / binned.width
            }
        };
        for (k, along) in axis[0].iter().enumerate().skip(1) {
            let at = value(&before, k);
            if at.is_finite() {
                let along = if swings { binned.width * to_f64(k) } else { *along };
                points.push((along, at, with.as_ref().map_or(f64::NAN, |with| value(with, k))));
            }
        }
    }
    let stride = points.len().div_ceil(1500).max(1);
    let unit = match channel {
        STEERING => "rad",
        GYRO => "rad/s",
        8 => "rad/s",
        _ => "m/s",
    };
    Some(RegimePlot {
        axis: if swings {
            format!("time in {} [s]", bench.ready.runs[0].run.name)
        } else {
            format!("{}, as a share of its largest", shape.axis.words())
        },
        signal: format!("residual of {} [{unit}]", shape.entry.words()),
        points: points.into_iter().step_by(stride).collect(),
    })
}

/// Growth of the position error with the horizon: nominal, with the effects, and floor.
pub(crate) fn horizons(found: &Found<'_>, after: Option<&Effects>) -> Vec<(f64, f64, f64, f64)> {
    let bench = &found.analysis.bench;
    let of = |run: usize, effects: &Effects| {
        (bench.ready.runs[run].binned.measured.clone(), bench.ready.predicted(run, effects))
    };
    let nominal: Vec<_> = bench.all().iter().map(|run| of(*run, &Effects::NEUTRAL)).collect();
    let with: Option<Vec<_>> =
        after.map(|effects| bench.all().iter().map(|run| of(*run, effects)).collect());
    let noise: Vec<_> = bench.all().iter().map(|run| noise_alone(found, *run)).collect();
    let width = bench.ready.runs.first().map_or(crate::bins::WIDTH, |run| run.binned.width);
    let mut rows = Vec::new();
    for horizon in [0.5, 1.0, 2.0, 4.0, 8.0, 16.0] {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let span = (horizon / width).round() as usize;
        let before = grown(&nominal, width, span);
        if before.is_finite() {
            let less = with.as_ref().map_or(f64::NAN, |with| grown(with, width, span));
            rows.push((horizon, before, less, grown(&noise, width, span)));
        }
    }
    rows
}

/// A run as it would be measured if the model were right, and as it is predicted.
fn noise_alone(found: &Found<'_>, run: usize) -> (Vec<Channels>, Vec<Channels>) {
    let bench = &found.analysis.bench;
    let mut random = Pcg64Mcg::seed_from_u64(43 + run as u64);
    let drawn = drawn(bench, &found.analysis.noise, run, &mut random);
    let path = &bench.paths[run];
    let zero = vec![[0.0; CHANNELS]; path.pose.len()];
    let mut noisy = in_frame(path, &drawn);
    for (row, measured) in noisy.iter_mut().zip(&bench.ready.runs[run].binned.measured) {
        for (value, measured) in row.iter_mut().zip(measured) {
            if !measured.is_finite() {
                *value = f64::NAN;
            }
        }
    }
    (noisy, in_frame(path, &zero))
}

/// Root mean square of the position error after `span` bins, over windows that overlap by half.
fn grown(runs: &[(Vec<Channels>, Vec<Channels>)], width: f64, span: usize) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (measured, predicted) in runs {
        let mut from = 0;
        while from + span < measured.len() {
            let range = from..=from + span;
            if let Some(last) = errors(width, &measured[range.clone()], &predicted[range]).last() {
                sum += last.1 * last.1;
                count += 1.0;
            }
            from += span.div_ceil(2).max(1);
        }
    }
    if count > 0.0 { (sum / count).sqrt() } else { f64::NAN }
}
