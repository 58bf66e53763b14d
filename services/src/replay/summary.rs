//! What `replay` says at the end: a table for people, or one JSON object.

use std::path::Path;

use comfy_table::Cell;
use kerbside_geometry::angle;
use kerbside_messages::EstimatorState;
use kerbside_recordings::drift::Drift;
use serde_json::{Map, Value, json};

use super::learning::Lesson;
use super::report::{filter_of, model_of};
use super::{Finished, Outcome, ReplayArgs, sensing};
use crate::exit::{Exit, Failure};
use crate::tables;

/// Tells what came of one drive.
pub fn tell_one(args: &ReplayArgs, one: &Finished) -> Exit {
    kerbside_runtime::end_on_broken_pipe();
    let passed = one.problem.is_none();
    if args.json {
        println!("{}", with_common(one_as_json(one), passed));
    } else {
        print_one(one);
    }
    if passed { Exit::Good } else { Exit::Bad }
}

/// Tells what came of `wanted` drives.
pub fn tell_many(args: &ReplayArgs, folder: &Path, outcomes: &[Outcome], wanted: usize) -> Exit {
    kerbside_runtime::end_on_broken_pipe();
    let exit = outcomes.iter().map(exit_of).find(|exit| *exit != Exit::Good);
    let exit = exit.unwrap_or(if outcomes.len() == wanted { Exit::Good } else { Exit::Bad });
    if args.json {
        let runs: Vec<_> = outcomes.iter().map(outcome_as_json).collect();
        let object = json!({ "input": args.path, "runs": runs });
        println!("{}", with_common(object, exit == Exit::Good));
    } else {
        print_many(folder, outcomes);
    }
    exit
}

fn exit_of(outcome: &Outcome) -> Exit {
    match &outcome.result {
        Ok(one) if one.problem.is_none() => Exit::Good,
        Ok(_) => Exit::Bad,
        Err(failure) => failure.exit,
    }
}

fn with_common(mut object: Value, passed: bool) -> Value {
    object["schema"] = json!("kerbside.replay.v1");
    object["version"] = json!(env!("CARGO_PKG_VERSION"));
    object["seed"] = Value::Null;
    object["passed"] = json!(passed);
    object["figures"] = json!([]);
    object
}

fn outcome_as_json(outcome: &Outcome) -> Value {
    match &outcome.result {
        Ok(one) => one_as_json(one),
        Err(failure) => json!({ "input": outcome.input, "refused": words(failure) }),
    }
}

fn one_as_json(one: &Finished) -> Value {
    let drift = one.comparison.drift.as_ref().ok().map(|drift| {
        let end = drift.end_error;
        json!({
            "position_percent": drift.position_percent,
            "position_percent_max": drift.position_percent_max,
            "heading_rad_per_m": drift.heading_rad_per_m,
            "heading_bias_rad_per_m": drift.heading_bias_rad_per_m,
            "end_error": { "x": end.x, "y": end.y, "yaw": end.yaw },
            "window_m": drift.window,
            "windows": drift.windows,
        })
    });
    let refused: Map<_, _> =
        one.refusals.iter().map(|(reason, count)| ((*reason).to_owned(), json!(count))).collect();
    let newest = one.track.newest.unwrap_or_default();
    let live = one.speeds.live.is_some();
    json!({
        "input": one.job.input.drive.path(),
        "name": one.job.input.drive.name(),
        "vehicle": one.job.service.vehicle.name,
        "mode": if live { "live" } else { "pure" },
        "speed": one.job.service.args.speed,
        "model": model_of(one).name(),
        "state": state_of(one),
        "duration_s": one.duration,
        "distance_m": one.track.distance(),
        "samples": one.job.input.raws.len(),
        "odometry_samples": one.track.len(),
        "gaps": one.track.gaps.len(),
        "refused": refused,
        "corrections": newest.corrections,
        "gated": newest.gated,
        "unusable": newest.unusable,
        "speed_factor": one.speed_factor(),
        "speed_factor_files": one.speeds.files,
        "speed_factor_memory": one.speeds.memory,
        "odometry_sha256": one.hash,
        "drift": drift,
        "fixes": one.lesson.as_ref().map(lesson_as_json),
        "cause": one.problem.clone().unwrap_or_default(),
        "notes": one.notes,
        "instance": live.then(|| one.job.service.instance.name()),
        "recording": one.recording,
        "report": one.report,
    })
}

fn state_of(one: &Finished) -> &'static str {
    let code = one.track.newest.map(|odometry| odometry.state);
    code.and_then(EstimatorState::from_code).map_or("no odometry", EstimatorState::name)
}

fn print_one(one: &Finished) {
    let name = one.job.input.drive.name();
    match &one.problem {
        None => println!("{name}: replayed {}", one.mode_in_words()),
        Some(problem) => println!("{name}: not replayed: {problem}"),
    }
    let mut table = tables::framed();
    let mut row = |name: &str, value: String| {
        table.add_row([Cell::new(name), Cell::new(value)]);
    };
    let filter = filter_of(&one.track);
    let uses = sensing::uses(model_of(one), filter, &one.job.input.sensors).join(", ");
    row("odometry model", format!("{} ({uses})", model_of(one)));
    row("distance", format!("{:.2} m in {:.1} s", one.track.distance(), one.duration));
    row("readings", format!("{}, {} gaps", one.job.input.raws.len(), one.track.gaps.len()));
    if !one.refusals.is_empty() {
        row("refused", refusals_in_words(one));
    }
    if let Ok(drift) = &one.comparison.drift {
        let percent = (drift.position_percent, drift.position_percent_max);
        row(
            "position drift",
            format!("{:.2} % of distance, at most {:.2} %", percent.0, percent.1),
        );
        row("heading drift", format!("{} rad/m", significant(drift.heading_rad_per_m)));
        row("windows", format!("{} of {:.2} m", drift.windows, drift.window));
        row("end error", end_in_words(one));
    }
    let newest = one.track.newest.unwrap_or_default();
    if newest.corrections + newest.gated > 0 {
        row(
            "corrections",
            format!("{} taken, {} refused by the gate", newest.corrections, newest.gated),
        );
    }
    row("pose", state_of(one).to_owned());
    row("speed", speeds_in_words(one));
    println!("{table}");
    if let Some(lesson) = &one.lesson {
        print_lesson(lesson);
    }
    one.notes.iter().for_each(|note| println!("note       {note}"));
    println!("sha-256    {}", one.hash);
    println!("report     {}", one.report.display());
    if let Some(recording) = &one.recording {
        println!("recording  {}", recording.display());
    }
    println!("repeat     {}", one.job.command_line);
}

/// What was learnt, per parameter, and what that does to the drift.
fn lesson_as_json(lesson: &Lesson) -> Value {
    let parameters: Map<_, _> = lesson
        .learnt
        .iter()
        .map(|learnt| {
            let (value, spread) = (learnt.value, 1.96 * learnt.deviation);
            let entry = json!({
                "value": value, "low": value - spread, "high": value + spread, "unit": learnt.parameter.unit(),
                "nominal": learnt.nominal, "deviation": learnt.deviation, "prior_deviation": learnt.prior,
            });
            (learnt.parameter.name().to_owned(), entry)
        })
        .collect();
    let rest = |drift: &Result<Drift, String>| {
        drift.as_ref().ok().map(|drift| {
            let end = drift.end_error;
            json!({
                "position_percent": drift.position_percent,
                "heading_rad_per_m": drift.heading_rad_per_m,
                "end_error": { "x": end.x, "y": end.y, "yaw": end.yaw },
            })
        })
    };
    json!({
        "share": lesson.share, "given": lesson.given, "taken": lesson.taken,
        "widened": lesson.widened, "parameters": parameters,
        "rest": { "without": rest(&lesson.without), "with": rest(&lesson.with) },
    })
}

fn print_lesson(lesson: &Lesson) {
    let percent = 100.0 * lesson.share;
    println!(
        "fixes over the first {percent:.0} % of the time: {} of {} taken",
        lesson.taken, lesson.given
    );
    if lesson.widened > 0 {
        let times = if lesson.widened == 1 {
            "once".to_owned()
        } else {
            format!("{} times", lesson.widened)
        };
        println!("the covariance was too small for the vehicle's true numbers: widened {times},");
        println!("after five fixes in a row that contradicted it alike");
    }
    if lesson.taken < lesson.given {
        println!("the others contradict the pose beyond what [calibration] or [uncertainty] of");
        println!("vehicle.toml leaves open");
    }
    let header = ["parameter", "vehicle.toml", "learnt", "95 %", "before"];
    let mut table = tables::figures(&header, &[1, 2, 3, 4]);
    for learnt in &lesson.learnt {
        table.add_row([
            format!("{} [{}]", learnt.parameter.name(), learnt.parameter.unit()),
            format!("{:.5}", learnt.nominal),
            format!("{:.5}", learnt.value),
            format!("\u{b1}{:.5}", 1.96 * learnt.deviation),
            format!("\u{b1}{:.5}", 1.96 * learnt.prior),
        ]);
    }
    println!("{table}");
    let words = |drift: &Result<Drift, String>| match drift {
        Ok(drift) => format!(
            "{:.2} %, {} rad/m, end off by {:.3} m",
            drift.position_percent,
            significant(drift.heading_rad_per_m),
            drift.end_error.distance()
        ),
        Err(why) => why.clone(),
    };
    println!("drift on the rest without   {}", words(&lesson.without));
    println!("drift on the rest with      {}", words(&lesson.with));
}

fn refusals_in_words(one: &Finished) -> String {
    let words = one.refusals.iter().map(|(reason, count)| format!("{count} ({reason})"));
    words.collect::<Vec<_>>().join(", ")
}

fn end_in_words(one: &Finished) -> String {
    one.comparison.drift.as_ref().map_or("-".to_owned(), |drift| {
        let end = drift.end_error;
        format!("x {:+.3} m, y {:+.3} m, yaw {:+.2}°", end.x, end.y, angle::degrees(end.yaw))
    })
}

fn speeds_in_words(one: &Finished) -> String {
    let pure = format!(
        "{:.0} x real time from files to hash, {:.0} x in memory, stages alone",
        one.speeds.files, one.speeds.memory
    );
    match one.speeds.live {
        Some(live) if !live.is_finite() => "nothing came through the processes".to_owned(),
        Some(live) => format!("{live:.1} x real time through processes"),
        None => pure,
    }
}

/// Three significant digits.
fn significant(value: f64) -> String {
    let digits = if value == 0.0 { 0.0 } else { value.abs().log10().floor() };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
    let decimals = (2.0 - digits).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

fn print_many(folder: &Path, outcomes: &[Outcome]) {
    let header = ["run", "m", "drift %", "rad/m", "end m", "end °", "x real"];
    let mut table = tables::figures(&header, &[1, 2, 3, 4, 5, 6]);
    for one in finished(outcomes) {
        table.add_row(row_of(one));
    }
    println!("{table}");
    for outcome in outcomes {
        if let Err(failure) = &outcome.result {
            println!("{}: refused: {}", name_of(outcome), words(failure));
        }
    }
    for one in finished(outcomes) {
        let name = one.job.input.drive.name();
        one.problem.iter().for_each(|problem| println!("{name}: not replayed: {problem}"));
    }
    for (note, names) in grouped_notes(outcomes) {
        let all = names.len() == finished(outcomes).count();
        println!("{}: {note}", if all { "all".to_owned() } else { names.join(", ") });
    }
    println!("reports    {}", folder.display());
}

fn finished(outcomes: &[Outcome]) -> impl Iterator<Item = &Finished> {
    outcomes.iter().filter_map(|outcome| outcome.result.as_deref().ok())
}

/// The model of the odometry and each note once, with the runs it is of.
fn grouped_notes(outcomes: &[Outcome]) -> Vec<(String, Vec<&str>)> {
    let mut grouped: Vec<(String, Vec<&str>)> = Vec::new();
    for one in finished(outcomes) {
        let name = one.job.input.drive.name();
        let model = format!("odometry from {}", model_of(one));
        for note in core::iter::once(&model).chain(&one.notes) {
            match grouped.iter_mut().find(|(known, _)| known == note) {
                Some((_, names)) => names.push(name),
                None => grouped.push((note.clone(), vec![name])),
            }
        }
    }
    grouped
}

/// A refusal in one line: what the report says, with the place of each problem.
fn words(failure: &Failure) -> String {
    let problems = failure.report.related().into_iter().flatten().map(ToString::to_string);
    core::iter::once(failure.report.to_string()).chain(problems).collect::<Vec<_>>().join("; ")
}

fn name_of(outcome: &Outcome) -> String {
    outcome.input.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn row_of(one: &Finished) -> Vec<String> {
    let drift = one.comparison.drift.as_ref().ok();
    let known = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
    vec![
        one.job.input.drive.name().to_owned(),
        format!("{:.1}", one.track.distance()),
        known(drift.map(|drift| format!("{:.2}", drift.position_percent))),
        known(drift.map(|drift| significant(drift.heading_rad_per_m))),
        known(drift.map(|drift| format!("{:.3}", drift.end_error.x.hypot(drift.end_error.y)))),
        known(drift.map(|drift| format!("{:+.2}", angle::degrees(drift.end_error.yaw)))),
        format!("{:.0}", one.speed_factor()),
    ]
}

#[cfg(test)]
mod tests {
    use super::significant;

    #[test]
    fn figures_have_three_digits() {
        let shown = [0.0123456, 1.23456, 0.000_012_345_6, 123.456, 0.0].map(significant);
        assert_eq!(shown, ["0.0123", "1.23", "0.0000123", "123", "0.00"]);
    }
}
