//! The report of a calibration: from what was computed to what is drawn.

use kerbside_calibration::{
    EndError, LeftOut, Parameters, Path, Rejected, Run, Source, dead_reckon,
};
use kerbside_geometry::Pose;
use kerbside_reports::{
    CalibrateReport, CalibratedParameter, DerivedFigure, EndErrors, Provenance, ReckonedPath,
    RunNote, RunPaths, RunResidual,
};

use super::Calibration;
use super::fit::{Estimate, key};
use super::judge::{Rms, SOURCES};
use super::summary::{decimals_of, grouped, gyro_in_words, steering_in_words};

/// Runs whose paths are drawn, at most.
const DRAWN: usize = 8;

/// The report of `calibration`.
pub fn of(calibration: &Calibration) -> CalibrateReport {
    let (case, found) = (&calibration.case, &calibration.found);
    let residual = |run: &kerbside_calibration::RunResiduals| RunResidual {
        run: run.run.clone(),
        travel: run.travel,
        reference: (run.truth, run.truth_count as u64),
        axles: match run.comparison_count {
            0 => (f64::NAN, 0),
            count => (run.comparison, count as u64),
        },
    };
    let derived = |d: &kerbside_calibration::Derived| DerivedFigure {
        name: d.name.to_owned(),
        value: d.value,
        deviation: d.deviation,
        unit: d.unit.to_owned(),
    };
    let rms = SOURCES.into_iter().filter_map(|source| Rms::of(&calibration.left_out, source));
    let missing =
        found.missing.iter().map(|missing| note(key(missing.parameter), &missing.manoeuvre));
    let findings = grouped(&found.findings);
    let steering = steering_in_words(calibration);
    let steering = steering.map(|words| format!("The steering sensor {words}."));
    let gyro = gyro_in_words(calibration).map(|words| format!("The gyro {words}."));
    let sensors: Vec<String> = steering.into_iter().chain(gyro).collect();
    CalibrateReport {
        vehicle: case.vehicle().name.clone(),
        method: method(calibration),
        problem: calibration.problem(),
        runs: [found.runs.len() as u64, case.runs.len() as u64],
        parameters: found.estimates.iter().map(parameter).collect(),
        derived: found.derived.iter().map(derived).collect(),
        basis: calibration.basis().to_owned(),
        left_out: calibration.left_out.iter().map(end_errors).collect(),
        outliers: calibration.outliers.iter().map(end_errors).collect(),
        rms: rms.map(|rms| rms_errors(&rms)).collect(),
        judged: calibration.overall().map(|rms| rms_errors(&rms)),
        paths: paths(calibration),
        residuals: found.residuals.iter().map(residual).collect(),
        missing: missing.collect(),
        rejected: found.rejected.iter().map(|Rejected { run, why }| note(run, why)).collect(),
        findings: findings.iter().map(|(what, runs)| note(runs, what)).collect(),
        notes: case.notices.iter().cloned().chain(sensors).collect(),
        provenance: provenance(calibration),
    }
}

fn method(calibration: &Calibration) -> String {
    let inflation = calibration.found.inflation;
    match calibration.method {
        super::Method::Joint if inflation > 1.0 => format!(
            "joint least squares over all runs; residuals are larger than believed, variances widened {inflation:.1} times"
        ),
        super::Method::Joint => "joint least squares over all runs".to_owned(),
        super::Method::ClosedForm => {
            "the paper's closed form: straights give the radii, arcs the tracks".to_owned()
        }
    }
}

fn note(name: &str, text: &str) -> RunNote {
    RunNote { name: name.to_owned(), text: text.to_owned() }
}

fn parameter(estimate: &Estimate) -> CalibratedParameter {
    CalibratedParameter {
        name: key(estimate.parameter).to_owned(),
        unit: estimate.parameter.unit().to_owned(),
        nominal: estimate.nominal,
        value: estimate.value,
        interval: estimate.spread.map_or([f64::NAN; 2], |(_, interval)| interval),
        identified: estimate.identified,
        closed_form: estimate.closed_form.unwrap_or(f64::NAN),
        decimals: decimals_of(estimate),
    }
}

fn pose(error: &EndError) -> Pose {
    Pose::new(error.x, error.y, error.yaw.unwrap_or(f64::NAN))
}

fn end_errors(row: &LeftOut) -> EndErrors {
    EndErrors {
        run: row.run.clone(),
        manoeuvre: row.manoeuvre.clone(),
        source: row.source.name().to_owned(),
        before: pose(&row.before),
        after: pose(&row.after),
    }
}

fn rms_errors(rms: &Rms) -> EndErrors {
    let side = |index: usize| Pose::new(rms.position[index], 0.0, rms.yaw[index]);
    EndErrors {
        run: format!("rms of {}", rms.runs),
        manoeuvre: String::new(),
        source: rms.source.name().to_owned(),
        before: side(0),
        after: side(1),
    }
}

/// A run of each manoeuvre, those that were left out by name before those that were fitted.
fn paths(calibration: &Calibration) -> Vec<RunPaths> {
    let rejected = |run: &&Run| calibration.found.rejected.iter().all(|out| out.run != run.name);
    let mut runs: Vec<&Run> = calibration.case.runs.iter().filter(rejected).collect();
    let is_judged =
        |run: &Run| calibration.named.as_ref().is_some_and(|out| out.contains(&run.name));
    runs.sort_by_key(|run| !is_judged(run));
    let mut drawn: Vec<RunPaths> = Vec::new();
    for run in runs {
        let known = drawn.iter().any(|drawn| drawn.manoeuvre == run.manoeuvre);
        if drawn.len() < DRAWN && !known {
            drawn.extend(paths_of(calibration, run));
        }
    }
    drawn
}

fn paths_of(calibration: &Calibration, run: &Run) -> Option<RunPaths> {
    let vehicle = calibration.case.vehicle();
    let nominal = Parameters::nominal(vehicle);
    let reckon = |parameters: &Parameters, source: Source| {
        dead_reckon(run, vehicle, parameters, &calibration.settings, source).ok().flatten()
    };
    let marker = vehicle.reference.map_or(Pose::default(), |reference| reference.marker);
    let marker = if run.reference.is_empty() { Pose::default() } else { marker };
    let points = |path: &Path| {
        let at = |(_, pose): &(f64, Pose)| pose.compose(&marker);
        path.poses.iter().map(at).map(|pose| [pose.x, pose.y]).collect()
    };
    let both = |source: Source| {
        let (before, after) =
            (reckon(&nominal, source)?, reckon(&calibration.found.parameters, source)?);
        let (before, after) = (points(&before), points(&after));
        Some(ReckonedPath { source: source.name().to_owned(), before, after })
    };
    let reckoned: Vec<_> = SOURCES.into_iter().filter_map(both).collect();
    // One axle may be all there is.
    let reckoned = match &reckoned[..] {
        [one, all] if one.after == all.after => vec![one.clone()],
        _ => reckoned,
    };
    let reference: Vec<[f64; 2]> = run.reference.iter().map(|seen| [seen.x, seen.y]).collect();
    let last =
        run.reference.last().map(|seen| Pose::new(seen.x, seen.y, seen.yaw.unwrap_or(f64::NAN)));
    let by_hand = run.end_pose.map(|end| run.start.unwrap_or_default().compose(&end));
    let (name, manoeuvre) = (run.name.clone(), run.manoeuvre.clone());
    (!reckoned.is_empty()).then(|| RunPaths {
        run: name,
        manoeuvre,
        reference,
        end: last.or(by_hand),
        reckoned,
    })
}

fn provenance(calibration: &Calibration) -> Provenance {
    Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: None,
        command_line: calibration.command_line.clone(),
        configuration: vec![calibration.case.origin.clone()],
        instance: String::new(),
        recording: String::new(),
        machine: crate::machine::facts(),
    }
}
