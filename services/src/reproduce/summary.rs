//! What `reproduce` says at the end: a table of the rows and what was missed, or one JSON object.

use std::path::Path;

use comfy_table::Cell;
use kerbside_reports::{ReproductionReport, StackParking};
use kerbside_reproduction::{Accept, Figure, ROWS, Reproduction, Verdict};
use serde_json::{Value, json};

use super::ReproduceArgs;
use crate::exit::Exit;
use crate::tables;

/// What each row is about.
const ABOUT: [&str; ROWS as usize] = [
    "Table 1, Fig 6 a, b: straights",
    "Table 2, Fig 6 c, d: arcs",
    "the same, reference of 5 cm, 5 deg",
    "eqs (3) to (6): front to rear",
    "Fig 7, 8: along the path",
    "Fig 9: variance of the ends",
    "covariance (NEES)",
    "slip",
    "Fig 10, Table 3: parking",
];

/// Tells what came out; the exit code.
pub fn tell(args: &ReproduceArgs, report: &ReproductionReport, path: &Path) -> Exit {
    kerbside_runtime::end_on_broken_pipe();
    let parked = report.stack.iter().all(|line| line.parked == line.ends.len());
    let passed = report.reproduction.passed() && parked;
    if args.json {
        println!("{}", as_json(args, report, path, passed));
    } else {
        print(report, path);
    }
    if passed { Exit::Good } else { Exit::Bad }
}

fn as_json(args: &ReproduceArgs, report: &ReproductionReport, path: &Path, passed: bool) -> Value {
    let out = &report.reproduction;
    let held = out.figures.iter().filter(|figure| figure.is_held());
    json!({
        "schema": "kerbside.reproduce.v1",
        "version": env!("CARGO_PKG_VERSION"),
        "seed": args.seed,
        "trials": args.trials,
        "passed": passed,
        "figures": held.map(|figure| figure_as_json(out, figure)).collect::<Vec<_>>(),
        "rows": out.figures.iter().map(|figure| row_as_json(out, figure)).collect::<Vec<_>>(),
        "stack": report.stack.iter().map(stack_as_json).collect::<Vec<_>>(),
        "report": path,
    })
}

/// Numbers that JSON has not got are null.
fn row_as_json(out: &Reproduction, figure: &Figure) -> Value {
    let (low, high) = figure.interval;
    let accept = match figure.accept {
        Accept::AtMost(limit) => json!({ "at_most": limit }),
        Accept::AtLeast(limit) => json!({ "at_least": limit }),
        Accept::Within(low, high) => json!({ "low": low, "high": high }),
        Accept::Shown => Value::Null,
    };
    let paper = Some(figure.paper).filter(|paper| !paper.is_empty());
    json!({
        "row": figure.row, "name": figure.name, "unit": figure.unit, "paper": paper, "ours": figure.ours,
        "low": low, "high": high, "accept": accept, "passed": figure.is_held().then(|| figure.passed()),
        "verdict": figure.is_held().then(|| word(out, figure)),
    })
}

/// A held figure as every verb prints it with `--json`.
pub fn figure_as_json(out: &Reproduction, figure: &Figure) -> Value {
    let (low, high) = figure.interval;
    let limit = match figure.accept {
        Accept::AtMost(limit) | Accept::AtLeast(limit) => json!(limit),
        Accept::Within(low, high) => json!([low, high]),
        Accept::Shown => Value::Null,
    };
    json!({
        "name": named(figure), "value": figure.ours, "low": low, "high": high, "limit": limit,
        "passed": out.verdict(figure) != Verdict::Missed,
    })
}

fn stack_as_json(line: &StackParking) -> Value {
    let ends = line
        .ends
        .iter()
        .map(|end| end.map(|pose| json!({ "x": pose.x, "y": pose.y, "yaw": pose.yaw })));
    json!({
        "scene": line.scene, "mode": line.mode, "parked": line.parked, "of": line.ends.len(),
        "causes": line.causes,
        "ends": ends.collect::<Vec<_>>(),
    })
}

fn named(figure: &Figure) -> String {
    let unit = if figure.unit.is_empty() { String::new() } else { format!(" [{}]", figure.unit) };
    format!("row {}: {}{unit}", figure.row, figure.name)
}

fn word(out: &Reproduction, figure: &Figure) -> &'static str {
    match out.verdict(figure) {
        Verdict::Reached => "reached",
        Verdict::Open => "open",
        Verdict::Missed => "missed",
    }
}

fn print(report: &ReproductionReport, path: &Path) {
    let out = &report.reproduction;
    println!("{}", rows(out));
    let undecided =
        out.figures.iter().filter(|figure| out.verdict(figure) != Verdict::Reached).count();
    if undecided > 0 {
        println!("{}", not_reached(out));
    }
    for line in &report.stack {
        let (scene, mode, of) = (&line.scene, &line.mode, line.ends.len());
        println!("{scene}, the stack {mode}: {} of {of} parked", line.parked);
        line.causes.iter().for_each(|cause| println!("    {cause}"));
    }
    println!("{} trials per case, seed {}", out.asked.trials, out.asked.seed);
    println!("report  {}", path.display());
}

/// A line per row.
fn rows(out: &Reproduction) -> comfy_table::Table {
    let mut table =
        tables::figures(&["row", "in the paper", "reached", "open", "missed"], &[0, 2, 3, 4]);
    for (row, about) in (1..=ROWS).zip(ABOUT) {
        let held = |figure: &&Figure| figure.row == row && figure.is_held();
        let figures: Vec<&Figure> = out.figures.iter().filter(held).collect();
        if figures.is_empty() {
            continue;
        }
        let count = |verdict| figures.iter().filter(|f| out.verdict(f) == verdict).count();
        table.add_row([
            Cell::new(row),
            Cell::new(about),
            Cell::new(format!("{} of {}", count(Verdict::Reached), figures.len())),
            Cell::new(count(Verdict::Open)),
            Cell::new(count(Verdict::Missed)),
        ]);
    }
    table
}

/// What is not as accepted.
fn not_reached(out: &Reproduction) -> comfy_table::Table {
    let header = ["row", "not reached", "ours", "95 %", "accepted", ""];
    let mut table = tables::figures(&header, &[0, 2]);
    for figure in out.figures.iter().filter(|figure| out.verdict(figure) != Verdict::Reached) {
        let (low, high) = figure.interval;
        let unit = if figure.unit.is_empty() { String::new() } else { format!(" {}", figure.unit) };
        table.add_row([
            figure.row.to_string(),
            figure.name.clone(),
            format!("{}{unit}", short(figure.ours)),
            format!("{}..{}", short(low), short(high)),
            accepted(figure.accept),
            word(out, figure).to_owned(),
        ]);
    }
    table
}

fn accepted(accept: Accept) -> String {
    match accept {
        Accept::AtMost(limit) => format!("<= {}", short(limit)),
        Accept::AtLeast(limit) => format!(">= {}", short(limit)),
        Accept::Within(low, high) => format!("{}..{}", short(low), short(high)),
        Accept::Shown => String::new(),
    }
}

/// Three digits or so.
pub fn short(value: f64) -> String {
    let size = value.abs();
    if size >= 1e5 || (size > 0.0 && size < 1e-3) {
        format!("{value:.1e}")
    } else if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 10.0 {
        format!("{value:.1}")
    } else {
        format!("{value:.3}")
    }
}
