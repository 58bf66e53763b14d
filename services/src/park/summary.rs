//! What `park` says at the end: a table for people, or one JSON object.

use comfy_table::Cell;
use kerbside_geometry::{Pose, angle};
use kerbside_reports::JudgedOn;
use serde_json::{Value, json};

use super::{Finished, ParkArgs};
use crate::exit::Exit;
use crate::figures::Figure;
use crate::tables;

/// Mean end error that several runs are held against: each axis \[m\].
const MEAN_POSITION: f64 = 0.010;
/// The same of the heading \[rad\].
const MEAN_YAW: f64 = 0.6 * core::f64::consts::PI / 180.0;

/// Tells what came of the runs, and how well.
pub fn tell(args: &ParkArgs, finished: &[Finished]) -> Exit {
    kerbside_runtime::end_on_broken_pipe();
    let figures = figures(finished);
    let complete = finished.len() == args.runs as usize;
    let passed = complete
        && finished.iter().all(|one| one.verdict.parked)
        && figures.iter().all(|figure| figure.passed());
    if args.json {
        println!("{}", as_json(args, finished, &figures, passed));
    } else if let [one] = finished {
        print_one(one);
    } else {
        print_many(finished, &figures);
    }
    if passed { Exit::Good } else { Exit::Bad }
}

/// Several runs are held against the mean of their errors; one run against its tolerance, by being parked.
fn figures(finished: &[Finished]) -> Vec<Figure> {
    if finished.len() < 2 {
        return Vec::new();
    }
    #[allow(clippy::cast_precision_loss)] // runs are few
    let count = finished.len() as f64;
    let mean = |of: &dyn Fn(&Pose) -> f64| {
        finished
            .iter()
            .map(|one| one.verdict.end_error.map_or(f64::NAN, |error| of(&error)))
            .sum::<f64>()
            / count
    };
    let factor = finished.first().map_or(1.0, |one| one.job.scenario.tolerance.position / 0.03);
    #[allow(clippy::cast_precision_loss)] // runs are few
    let parked = finished.iter().filter(|one| one.verdict.parked).count() as f64;
    vec![
        Figure::at_most(
            "mean end position error [m]",
            mean(&|error| error.x.hypot(error.y)),
            MEAN_POSITION * factor,
        ),
        Figure::at_most("mean end heading error [rad]", mean(&|error| error.yaw.abs()), MEAN_YAW),
        Figure::at_least("parked", parked, count),
    ]
}

fn as_json(args: &ParkArgs, finished: &[Finished], figures: &[Figure], passed: bool) -> Value {
    let mut object = match finished {
        [one] => one_as_json(one),
        many => json!({ "runs": many.iter().map(one_as_json).collect::<Vec<_>>() }),
    };
    object["schema"] = json!("kerbside.park.v1");
    object["version"] = json!(env!("CARGO_PKG_VERSION"));
    object["seed"] = json!(args.seed);
    object["passed"] = json!(passed);
    object["figures"] = figures.iter().map(Figure::as_json).collect();
    object
}

fn one_as_json(one: &Finished) -> Value {
    let (verdict, run) = (&one.verdict, &one.run);
    let pose =
        |pose: &Option<Pose>| pose.map(|pose| json!({ "x": pose.x, "y": pose.y, "yaw": pose.yaw }));
    let latency = &run.trace.latency;
    let measured = !one.job.lockstep && !latency.is_empty();
    let latency_us = measured.then(|| {
        json!({
            "p50": latency.value_at_quantile(0.5),
            "p99": latency.value_at_quantile(0.99),
            "p999": latency.value_at_quantile(0.999),
            "max": latency.max(),
        })
    });
    json!({
        "scenario": one.job.scenario.name,
        "seed": one.job.seed,
        "lockstep": one.job.lockstep,
        "parked": verdict.parked,
        "collision": verdict.collision,
        "cause": verdict.cause,
        "end_error": pose(&verdict.end_error),
        "estimate_error": pose(&verdict.estimate_error),
        "judged_on": match verdict.judged_on { JudgedOn::Truth => "truth", JudgedOn::Estimate => "estimate" },
        "gear_changes": verdict.gear_changes,
        "duration_s": verdict.duration,
        "min_clearance_m": verdict.clearance,
        "latency_us": latency_us,
        "deadline_misses": run.trace.misses(),
        "restarts": run.trace.restarts(),
        "instance": run.instance,
        "recording": run.recording,
        "report": one.report,
        "wall_s": run.wall_seconds,
        "speed_factor": speed_factor(one),
    })
}

/// Simulated over wall time, searches apart; none live.
fn speed_factor(one: &Finished) -> Option<f64> {
    let run = &one.run;
    one.job
        .lockstep
        .then(|| run.simulated_seconds / (run.wall_seconds - run.search_seconds).max(1e-9))
}

fn print_one(one: &Finished) {
    let (verdict, run, trace) = (&one.verdict, &one.run, &one.run.trace);
    println!("{}", sentence(one));
    let mut table = tables::framed();
    let mut row = |name: &str, value: String| {
        table.add_row([Cell::new(name), Cell::new(value)]);
    };
    let judged = match verdict.judged_on {
        JudgedOn::Truth => "end error, truth against goal",
        JudgedOn::Estimate => "end error, estimate against goal",
    };
    row(judged, pose_in_words(verdict.end_error));
    row("estimate against truth", pose_in_words(verdict.estimate_error));
    row("gear changes", verdict.gear_changes.to_string());
    row("time", format!("{:.1} s", verdict.duration));
    row("length", format!("{:.2} m", verdict.length));
    row(
        "least clearance",
        verdict
            .clearance
            .map_or("-".to_owned(), |clearance| format!("{:.1} cm", 100.0 * clearance)),
    );
    if !one.job.lockstep && !trace.latency.is_empty() {
        row("reading to command", latency_in_words(one));
    }
    if let Some(factor) = speed_factor(one) {
        row(
            "speed",
            format!(
                "{factor:.0} x real time, the search of {:.0} ms apart",
                1e3 * run.search_seconds
            ),
        );
    }
    row("deadline misses", trace.misses().to_string());
    row("restarts", trace.restarts().to_string());
    println!("{table}");
    if let Some(instance) = &run.instance {
        println!("instance   {instance}");
    }
    if let Some(report) = &one.report {
        println!("report     {}", report.display());
    }
    if let Some(recording) = &run.recording {
        println!("recording  {}", recording.display());
    }
    println!("repeat     {}", one.job.command_line);
}

fn sentence(one: &Finished) -> String {
    let (verdict, name) = (&one.verdict, &one.job.scenario.name);
    match (verdict.parked, verdict.cause.as_str()) {
        (true, "") => format!("{name}: parked"),
        (true, cause) => format!("{name}: parked; {cause}"),
        (false, "") => format!("{name}: not parked"),
        (false, cause) => format!("{name}: not parked: {cause}"),
    }
}

fn pose_in_words(pose: Option<Pose>) -> String {
    pose.map_or("-".to_owned(), |pose| {
        let (x, y) = (1e3 * pose.x, 1e3 * pose.y);
        format!("x {x:+.1} mm, y {y:+.1} mm, yaw {:+.2}°", angle::degrees(pose.yaw))
    })
}

fn latency_in_words(one: &Finished) -> String {
    let latency = &one.run.trace.latency;
    let at = |quantile| latency.value_at_quantile(quantile);
    format!("p50 {} p99 {} p99.9 {} max {} µs", at(0.5), at(0.99), at(0.999), latency.max())
}

fn print_many(finished: &[Finished], figures: &[Figure]) {
    let header = ["seed", "verdict", "x, y mm, yaw °", "gears", "time s", "clearance cm"];
    let mut table = tables::figures(&header, &[0, 3, 4, 5]);
    for one in finished {
        let verdict = &one.verdict;
        let words = if verdict.parked {
            "parked".to_owned()
        } else {
            format!("not parked: {}", verdict.cause)
        };
        table.add_row([
            one.job.seed.to_string(),
            words,
            verdict.end_error.map_or("-".to_owned(), |error| {
                let yaw = angle::degrees(error.yaw);
                format!("{:+6.1} {:+6.1} {yaw:+6.2}", 1e3 * error.x, 1e3 * error.y)
            }),
            verdict.gear_changes.to_string(),
            format!("{:.1}", verdict.duration),
            verdict
                .clearance
                .map_or("-".to_owned(), |clearance| format!("{:.1}", 100.0 * clearance)),
        ]);
    }
    println!("{table}");
    for figure in figures {
        println!("{figure}");
    }
    if let Some(folder) = finished.first().and_then(|one| one.report.as_ref()?.parent()?.parent()) {
        println!("reports    {}", folder.display());
    }
}
