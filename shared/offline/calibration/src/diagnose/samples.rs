//! Readings that are no readings.

use super::{Findings, Problem};
use crate::run::{Run, Series};

/// Finite numbers, increasing stamps, a reading per stamp.
pub(crate) fn check(found: &mut Findings, run: &Run) {
    for (name, series) in ["fl", "fr", "rl", "rr"].into_iter().zip(&run.rotation) {
        series.iter().for_each(|series| check_series(found, name, series));
    }
    run.steering.iter().for_each(|series| check_series(found, "steering", series));
    run.yaw_rate.iter().for_each(|series| check_series(found, "yaw rate", series));
    check_reference(found, run);
    let poses = [("start", run.start), ("end pose", run.end_pose)];
    for (name, pose) in poses {
        if pose.is_some_and(|pose| !pose.is_finite()) {
            found.forbid(Problem::NotANumber, name.to_owned());
        }
    }
    for (name, value) in [("distance", run.distance), ("net turn", run.net_turn)] {
        if value.is_some_and(|value| !value.is_finite()) {
            found.forbid(Problem::NotANumber, name.to_owned());
        }
    }
}

fn check_series(found: &mut Findings, name: &str, series: &Series) {
    if series.t.len() != series.value.len() {
        let (stamps, readings) = (series.t.len(), series.value.len());
        found.forbid(Problem::Stamps, format!("{name}: {stamps} stamps for {readings} readings"));
        return;
    }
    let both = series.t.iter().zip(&series.value);
    if let Some(bad) = both.into_iter().position(|(t, value)| !(t.is_finite() && value.is_finite()))
    {
        found.forbid(
            Problem::NotANumber,
            format!("{name}: reading {} of {}", bad + 1, series.len()),
        );
        return;
    }
    check_stamps(found, name, &series.t);
}

fn check_stamps(found: &mut Findings, name: &str, stamps: &[f64]) {
    if let Some(at) = stamps.windows(2).position(|pair| pair[1] <= pair[0]) {
        let evidence = format!("{name}: {} s after {} s", stamps[at + 1], stamps[at]);
        found.forbid(Problem::Stamps, evidence);
    }
}

fn check_reference(found: &mut Findings, run: &Run) {
    let bad = run.reference.iter().position(|reading| {
        let yaw = reading.yaw.is_none_or(f64::is_finite);
        !(reading.t.is_finite() && reading.x.is_finite() && reading.y.is_finite() && yaw)
    });
    if let Some(bad) = bad {
        let evidence = format!("reference: reading {} of {}", bad + 1, run.reference.len());
        found.forbid(Problem::NotANumber, evidence);
        return;
    }
    let stamps: Vec<f64> = run.reference.iter().map(|reading| reading.t).collect();
    check_stamps(found, "reference", &stamps);
}
