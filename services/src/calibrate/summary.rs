//! What `calibrate` says at the end: tables for people, or one JSON object.

use kerbside_calibration::{EndError, Finding, LeftOut, Parameter, Source};
use kerbside_geometry::angle;
use serde_json::{Map, Value, json};

use super::drift::{Drifted, Medians, RunDrift};
use super::fit::{Estimate, key};
use super::judge::{Rms, SOURCES};
use super::{CalibrateArgs, Calibration};
use crate::exit::Exit;
use crate::figures::Figure;
use crate::tables;

/// Tells what came of it.
pub fn tell(args: &CalibrateArgs, calibration: &Calibration) -> Exit {
    kerbside_runtime::end_on_broken_pipe();
    let passed = calibration.problem().is_none();
    if args.json {
        println!("{}", as_json(calibration));
    } else {
        print(calibration);
    }
    if passed { Exit::Good } else { Exit::Bad }
}

fn as_json(calibration: &Calibration) -> Value {
    let found = &calibration.found;
    let parameters: Map<String, Value> = found
        .estimates
        .iter()
        .map(|estimate| (key(estimate.parameter).to_owned(), parameter_as_json(estimate)))
        .collect();
    let rejected = found.rejected.iter().map(|run| {
        let ends = calibration.outliers.iter().filter(|row| row.run == run.run);
        let ends: Vec<Value> = ends.map(end_as_json).collect();
        json!({ "run": run.run, "why": run.why, "ends": ends })
    });
    let missing = found.missing.iter().map(
        |missing| json!({ "parameter": key(missing.parameter), "manoeuvre": missing.manoeuvre }),
    );
    let derived: Map<String, Value> = found
        .derived
        .iter()
        .map(|d| (d.name.to_owned(), json!({ "value": d.value, "deviation": d.deviation })))
        .collect();
    let residuals = found.residuals.iter().map(|run| {
        json!({ "run": run.run, "travel_m": run.travel, "reference": run.truth, "axles": run.comparison, "lag_s": run.lag })
    });
    let figures: Vec<Value> = calibration.figures().iter().map(Figure::as_json).collect();
    json!({
        "schema": "kerbside.calibrate.v1",
        "version": env!("CARGO_PKG_VERSION"),
        "seed": null,
        "passed": calibration.problem().is_none(),
        "figures": figures,
        "case": calibration.case.origin,
        "method": calibration.method.name(),
        "runs": found.runs,
        "parameters": parameters,
        "covariance": covariance_as_json(calibration),
        "inflation": found.inflation,
        "allowance": allowance_as_json(calibration),
        "derived": derived,
        "gyro_bias": found.gyro_bias.map(|bias| json!({ "value": bias.value, "deviation": bias.deviation })),
        "left_out": left_out_as_json(calibration),
        "drift": drift_as_json(calibration),
        "residuals": residuals.collect::<Vec<_>>(),
        "rejected": rejected.collect::<Vec<_>>(),
        "missing": missing.collect::<Vec<_>>(),
        "findings": found.findings.iter().map(finding_as_json).collect::<Vec<_>>(),
        "steering": steering_as_json(calibration),
        "cause": calibration.problem().unwrap_or_default(),
        "notes": calibration.case.notices,
        "vehicle": calibration.vehicle,
        "report": calibration.report,
    })
}

/// Of the parameters that were identified; none where the method gives none.
fn covariance_as_json(calibration: &Calibration) -> Value {
    let Some(matrix) = &calibration.found.covariance else { return Value::Null };
    let identified = calibration.found.estimates.iter().filter(|found| found.identified);
    let parameters: Vec<Parameter> = identified.map(|found| found.parameter).collect();
    let entry = |a: &Parameter, b: &Parameter| matrix[(a.index(), b.index())];
    let row = |one: &Parameter| parameters.iter().map(|other| entry(one, other)).collect();
    let rows: Vec<Vec<f64>> = parameters.iter().map(row).collect();
    let names: Vec<&str> = parameters.iter().map(|parameter| key(*parameter)).collect();
    json!({ "parameters": names, "rows": rows })
}

/// Standard deviations from drive to drive of the parameters that were identified, each in its unit.
fn allowance_as_json(calibration: &Calibration) -> Value {
    let found = &calibration.found;
    let identified = found.estimates.iter().filter(|estimate| estimate.identified);
    let of = |estimate: &Estimate| found.between[estimate.parameter.index()].sqrt();
    identified.map(|e| (key(e.parameter).to_owned(), json!(of(e)))).collect()
}

fn parameter_as_json(estimate: &Estimate) -> Value {
    let (deviation, interval) = estimate.spread.unzip();
    json!({
        "value": estimate.value,
        "low": interval.map(|[low, _]| low),
        "high": interval.map(|[_, high]| high),
        "deviation": deviation,
        "identified": estimate.identified,
        "nominal": estimate.nominal,
        "closed_form": estimate.closed_form,
        "unit": estimate.parameter.unit(),
    })
}

fn left_out_as_json(calibration: &Calibration) -> Value {
    let table = &calibration.left_out;
    let side = |rms: &Rms, after: usize| json!({ "position_rms_m": rms.position[after], "yaw_rms_rad": rms.yaw[after] });
    let overall = calibration.overall();
    let by_source = SOURCES.into_iter().filter_map(|source| Rms::of(table, source));
    let by_source: Map<String, Value> = by_source
        .map(|rms| {
            let both = json!({ "before": side(&rms, 0), "after": side(&rms, 1) });
            (rms.source.name().to_owned(), both)
        })
        .collect();
    let runs = table.iter().map(end_as_json);
    json!({
        "basis": calibration.basis(),
        "before": overall.as_ref().map(|rms| side(rms, 0)),
        "after": overall.as_ref().map(|rms| side(rms, 1)),
        "sources": by_source,
        "runs": runs.collect::<Vec<_>>(),
    })
}

fn drift_as_json(calibration: &Calibration) -> Value {
    let of = |drift: &Drifted| json!({ "position_percent": drift.percent, "heading_rad_per_m": drift.heading });
    let row = |run: &RunDrift, counts: bool| {
        json!({
            "run": run.run, "counts": counts, "window_m": run.window,
            "before": of(&run.before), "after": of(&run.after), "floor": of(&run.floor),
        })
    };
    let counting = calibration.drifts.iter().map(|run| row(run, true));
    let outliers = calibration.outlier_drifts.iter().map(|run| row(run, false));
    let medians = Medians::of(&calibration.drifts).map(|medians| {
        json!({
            "runs": medians.runs, "before": of(&medians.before), "after": of(&medians.after),
            "floor": of(&medians.floor), "position_reached": medians.position_reached(),
            "heading_reached": medians.heading_reached(),
        })
    });
    json!({
        "basis": calibration.basis(), "medians": medians,
        "runs": counting.chain(outliers).collect::<Vec<_>>(),
    })
}

fn end_as_json(row: &LeftOut) -> Value {
    json!({
        "run": row.run, "manoeuvre": row.manoeuvre, "source": row.source.name(),
        "before": error_as_json(&row.before), "after": error_as_json(&row.after),
    })
}

fn error_as_json(error: &EndError) -> Value {
    json!({ "x": error.x, "y": error.y, "yaw": error.yaw })
}

fn finding_as_json(finding: &Finding) -> Value {
    json!({
        "run": finding.run, "problem": finding.problem.to_string(), "evidence": finding.evidence,
        "forbids": finding.forbids,
    })
}

fn steering_as_json(calibration: &Calibration) -> Value {
    calibration.found.steering.map_or(Value::Null, |check| {
        json!({
            "windows": check.windows, "refused": check.refused, "offset": check.zero,
            "offset_deviation": check.zero_deviation, "gain": check.gain, "residual": check.residual,
        })
    })
}

fn print(calibration: &Calibration) {
    let (case, found) = (&calibration.case, &calibration.found);
    let runs = format!("{} of {} runs", found.runs.len(), case.runs.len());
    match calibration.problem() {
        None => println!(
            "{}: calibrated from {runs}, {}",
            case.vehicle().name,
            calibration.method.name()
        ),
        Some(problem) => println!("{}: calibrated from {runs}: {problem}", case.vehicle().name),
    }
    print_parameters(calibration);
    print_left_out(calibration);
    print_drift(calibration);
    for missing in &found.missing {
        println!("missing    {}: {}", key(missing.parameter), missing.manoeuvre);
    }
    for run in &found.rejected {
        println!("rejected   {}: {}", run.run, run.why);
    }
    gyro_in_words(calibration).iter().for_each(|words| println!("gyro       {words}"));
    steering_in_words(calibration).iter().for_each(|words| println!("steering   {words}"));
    for (what, runs) in grouped(&found.findings) {
        println!("found      {runs}: {what}");
    }
    case.notices.iter().for_each(|note| println!("note       {note}"));
    if let Some(vehicle) = &calibration.vehicle {
        println!("vehicle    {}", vehicle.display());
    }
    println!("report     {}", calibration.report.display());
    println!("repeat     {}", calibration.command_line);
}

fn print_parameters(calibration: &Calibration) {
    let header = ["parameter", "", "nominal", "found, 95 % interval", "identified"];
    let mut table = tables::figures(&header, &[0, 2, 3]);
    if let Some(names) = table.column_mut(0) {
        names.set_cell_alignment(comfy_table::CellAlignment::Left);
    }
    for estimate in &calibration.found.estimates {
        let decimals = decimals_of(estimate);
        let half = estimate.spread.map_or(String::new(), |(_, [low, high])| {
            format!(" ± {:.decimals$}", 0.5 * (high - low))
        });
        table.add_row([
            key(estimate.parameter).to_owned(),
            estimate.parameter.unit().to_owned(),
            format!("{:.decimals$}", estimate.nominal),
            format!("{:.decimals$}{half}", estimate.value),
            if estimate.identified { "yes" } else { "no, held" }.to_owned(),
        ]);
    }
    println!("{table}");
}

/// Decimals that show two digits of the deviation.
pub fn decimals_of(estimate: &Estimate) -> usize {
    let deviation = estimate.spread.map_or(0.0, |(deviation, _)| deviation);
    if !(deviation > 0.0 && deviation.is_finite()) {
        return 5;
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
    let decimals = (1.0 - deviation.log10().floor()).clamp(1.0, 7.0) as usize;
    decimals
}

fn print_left_out(calibration: &Calibration) {
    let table = &calibration.left_out;
    let Some(overall) = calibration.overall() else {
        println!("no run is left out whose end is known: the result is not judged");
        return;
    };
    println!("end errors, {}", calibration.basis());
    let header = ["run", "by", "before m", "after m", "before °", "after °"];
    let mut shown = tables::figures(&header, &[2, 3, 4, 5]);
    let by = |row: &&LeftOut| row.source == overall.source;
    let mut add = |row: &LeftOut, name: &str| {
        let position = [row.before.distance(), row.after.distance()];
        let yaw = [row.before.yaw, row.after.yaw].map(|yaw| yaw.unwrap_or(f64::NAN));
        shown.add_row(error_cells(name, row.source, position, yaw, true));
    };
    table.iter().filter(by).for_each(|row| add(row, &row.run));
    let outliers = calibration.outliers.iter().filter(by);
    outliers.for_each(|row| add(row, &format!("{} *", row.run)));
    for rms in SOURCES.into_iter().filter_map(|source| Rms::of(table, source)) {
        let name = format!("rms of {}", rms.runs);
        shown.add_row(error_cells(&name, rms.source, rms.position, rms.yaw, false));
    }
    println!("{shown}");
    if !calibration.outliers.is_empty() {
        println!("* rejected by the fit: it does not count");
    }
}

fn print_drift(calibration: &Calibration) {
    let Some(medians) = Medians::of(&calibration.drifts) else { return };
    println!(
        "drift of the estimator's odometry, before and after, and by the reference's noise alone"
    );
    let header = ["run", "before %", "after %", "floor %", "before", "after rad/m", "floor"];
    let mut shown = tables::figures(&header, &[1, 2, 3, 4, 5, 6]);
    let mut add = |name: &str, [before, after, floor]: [&Drifted; 3]| {
        let all = [before, after, floor];
        let percent = all.map(|drift| format!("{:.2}", drift.percent));
        let heading = all.map(|drift| format!("{:.5}", drift.heading));
        shown.add_row(core::iter::once(name.to_owned()).chain(percent).chain(heading));
    };
    let row = |run: &RunDrift| [run.before, run.after, run.floor];
    for run in &calibration.drifts {
        add(&run.run, row(run).each_ref());
    }
    for run in &calibration.outlier_drifts {
        add(&format!("{} *", run.run), row(run).each_ref());
    }
    let name = format!("median of {}", medians.runs);
    add(&name, [&medians.before, &medians.after, &medians.floor]);
    println!("{shown}");
    let words = |reached| if reached { "reached" } else { "not reached" };
    println!(
        "half of before, or 1.5 times the floor: position {}, heading {}",
        words(medians.position_reached()),
        words(medians.heading_reached())
    );
}

fn error_cells(
    name: &str,
    source: Source,
    position: [f64; 2],
    yaw: [f64; 2],
    signed: bool,
) -> Vec<String> {
    let degrees = |yaw: f64| match angle::degrees(yaw) {
        unknown if unknown.is_nan() => "-".to_owned(),
        degrees if signed => format!("{degrees:+.2}"),
        degrees => format!("{degrees:.2}"),
    };
    let metres = position.map(|metres| format!("{metres:.4}"));
    let [before, after] = yaw.map(degrees);
    let [from, to] = metres;
    vec![name.to_owned(), source.name().to_owned(), from, to, before, after]
}

/// The steering sensor against the front wheels, a sentence.
pub fn steering_in_words(calibration: &Calibration) -> Option<String> {
    let check = calibration.found.steering?;
    let degrees = angle::degrees;
    let gain = check.gain.map_or_else(
        || "gain not to be told: the angles do not differ".to_owned(),
        |gain| format!("gain {gain:.4}"),
    );
    Some(format!(
        "against the front wheels' own travel: offset {:+.3}° ± {:.3}°, {gain}; {} windows, {} refused",
        degrees(check.zero),
        degrees(check.zero_deviation),
        check.windows,
        check.refused
    ))
}

/// What the gyro reads at rest, a sentence.
pub fn gyro_in_words(calibration: &Calibration) -> Option<String> {
    let bias = calibration.found.gyro_bias?;
    let next = match bias.deviation {
        Some(deviation) => format!("± {deviation:.5} rad/s from run to run"),
        None => "of one run: how far the next one's is off is not known".to_owned(),
    };
    Some(format!("reads {:+.5} rad/s at rest, {next}", bias.value))
}

/// Findings that do not forbid, each once, with the runs it is of.
pub fn grouped(findings: &[Finding]) -> Vec<(String, String)> {
    let mut grouped: Vec<(String, Vec<&str>, String)> = Vec::new();
    for found in findings.iter().filter(|found| !found.forbids) {
        let run = found.run.as_deref().unwrap_or("all runs");
        let problem = found.problem.to_string();
        match grouped.iter_mut().find(|(known, _, _)| *known == problem) {
            Some((_, runs, _)) => runs.push(run),
            None => grouped.push((problem, vec![run], found.evidence.clone())),
        }
    }
    let words = |(problem, runs, evidence): (String, Vec<&str>, String)| {
        (format!("{problem}: {evidence}"), runs.join(", "))
    };
    grouped.into_iter().map(words).collect()
}
