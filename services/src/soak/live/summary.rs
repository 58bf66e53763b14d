//! What a soak with real processes says at the end: a report, and tables for people or one JSON object.

use std::collections::BTreeMap;
use std::path::Path;

use comfy_table::Cell as TableCell;
use kerbside_messages::Process;
use kerbside_reports::{Provenance, SoakFault, SoakFigure, SoakReport, SoakSlope};
use serde_json::{Map, Value, json};

use super::super::quantile::quantile;
use super::super::{Faults, SoakArgs};
use super::totals::{Cell, Totals};
use crate::exit::{Exit, Failure};
use crate::figures::{Figure, Limit};
use crate::{output, tables};

/// Recoveries are held against this, 99 of 100 of them \[s\].
const RECOVERY: f64 = 1.0;
/// Fewer recoveries tell no such thing.
const RECOVERIES: usize = 100;
/// Misses of the stack against those of a bare thread.
const MISSES: f64 = 2.0;

/// Writes the report, tells what came out; the exit code.
///
/// # Errors
/// [`Failure`] where the report cannot be rendered.
pub fn tell(args: &SoakArgs, totals: &Totals, folder: &Path) -> Result<Exit, Failure> {
    kerbside_runtime::end_on_broken_pipe();
    let figures = figures(totals);
    let seen = totals.manoeuvres > 0 || !totals.flights.is_empty();
    let passed = seen && figures.iter().all(Figure::passed);
    let page = report(args, totals, &figures).render().map_err(Failure::internal)?;
    let path = folder.join("report.html");
    let written = output::write(&path, &page);
    let failed = |failure: &Failure| tracing::error!("no report: {}", failure.report);
    let path = written.inspect_err(failed).ok().map(|()| path);
    if args.json {
        println!("{}", as_json(totals, &figures, passed, path.as_deref()));
    } else {
        print(totals, &figures, path.as_deref());
    }
    Ok(if passed { Exit::Good } else { Exit::Bad })
}

#[allow(clippy::cast_precision_loss)] // counts of a soak
fn figures(totals: &Totals) -> Vec<Figure> {
    let count = |wanted: fn(&&Cell) -> bool| totals.flights.iter().filter(wanted).count() as f64;
    let mut figures = vec![
        Figure::at_most("not stopped within the bound", count(|cell| cell.not_stopped), 0.0),
        Figure::at_most("not restarted", count(|cell| cell.not_back), 0.0),
        Figure::at_most("manoeuvres without a verdict", totals.hangs() as f64, 0.0),
        Figure::at_most("processes left", totals.orphans.len() as f64, 0.0),
        Figure::at_most("segments left", totals.segments_left.len() as f64, 0.0),
        Figure::at_most("leaks", totals.leaks().len() as f64, 0.0),
        Figure::at_most(
            "deadline misses outside of faults",
            totals.misses as f64,
            MISSES * totals.bare_misses as f64,
        ),
    ];
    let recoveries = totals.recoveries();
    if recoveries.len() >= RECOVERIES {
        let p99 = quantile(recoveries, 0.99).unwrap_or(f64::NAN);
        figures.push(Figure::at_most("recovery, p99 [s]", p99, RECOVERY));
    }
    figures
}

fn worst(totals: &Totals) -> Option<&Cell> {
    let used = |cell: &Cell| cell.rolled / cell.bound;
    totals.stops().into_iter().max_by(|a, b| used(a).total_cmp(&used(b)))
}

fn effect(cell: &Cell) -> &'static str {
    match cell {
        Cell { not_stopped: true, .. } => "did not stop within the bound",
        Cell { not_back: true, .. } => "did not come back",
        Cell { stopped: true, .. } => "stopped",
        _ => "went on",
    }
}

fn as_json(totals: &Totals, figures: &[Figure], passed: bool, report: Option<&Path>) -> Value {
    let recovery = |share| quantile(totals.recoveries(), share);
    let of = |wanted: fn(&&Cell) -> bool| totals.flights.iter().filter(wanted).count();
    let (worst, latency) = (worst(totals), &totals.latency);
    let at = |quantile| latency.value_at_quantile(quantile);
    json!({
        "schema": "kerbside.soak.v1",
        "version": env!("CARGO_PKG_VERSION"),
        "seed": totals.seed,
        "passed": passed,
        "figures": figures.iter().map(Figure::as_json).collect::<Vec<_>>(),
        "mode": "processes",
        "instance": totals.instance,
        "minutes": totals.minutes,
        "manoeuvres": totals.manoeuvres,
        "ends": totals.ends,
        "faults": faults_as_json(totals),
        "load": totals.burdens,
        "stop": {
            "count": totals.stops().len(),
            "bound_m": worst.map(|cell| cell.bound),
            "worst_m": worst.map(|cell| cell.rolled),
            "p99_m": quantile(totals.stops().iter().map(|cell| cell.rolled), 0.99),
            "worst_s": quantile(totals.stops().iter().map(|cell| cell.seconds), 1.0),
        },
        "recovery_s": { "p50": recovery(0.5), "p99": recovery(0.99), "max": recovery(1.0) },
        "not_stopped": of(|cell| cell.not_stopped),
        "not_restarted": of(|cell| cell.not_back),
        "orphans": totals.orphans.len(),
        "segments_left": totals.segments_left.len(),
        "leaks": leaks_as_json(totals),
        "slopes": slopes_as_json(totals),
        "misses_unexplained": totals.misses,
        "misses_bare": totals.bare_misses,
        "bare_beats": totals.pulse_beats,
        "latency_us": { "p50": at(0.5), "p99": at(0.99), "p999": at(0.999), "max": latency.max() },
        "latency_by_minute": totals.latency_by_minute.iter().map(|(minute, latency)| json!({
            "minute": minute,
            "p50": latency.value_at_quantile(0.5),
            "p99": latency.value_at_quantile(0.99),
            "max": latency.max(),
        })).collect::<Vec<_>>(),
        "cells": totals.flights.iter().map(cell_as_json).collect::<Vec<_>>(),
        "missed": totals.missed.iter().map(|(process, blow, mode)| json!({
            "process": process.name(), "fault": blow.name(), "mode": mode.name(),
        })).collect::<Vec<_>>(),
        "report": report,
    })
}

fn cell_as_json(cell: &Cell) -> Value {
    json!({
        "process": cell.process.name(), "fault": cell.blow.name(), "mode": cell.mode.name(),
        "effect": effect(cell), "rolled_m": cell.rolled, "bound_m": cell.bound, "stood_s": cell.seconds,
        "recovery_s": cell.recovery,
    })
}

fn faults_as_json(totals: &Totals) -> Value {
    let mut kinds: BTreeMap<&str, BTreeMap<Process, u64>> = BTreeMap::new();
    for cell in &totals.flights {
        *kinds.entry(cell.blow.name()).or_default().entry(cell.process).or_default() += 1;
    }
    let mut object = Map::new();
    for (kind, counts) in kinds {
        let counts =
            counts.into_iter().map(|(process, count)| (process.name().to_owned(), json!(count)));
        object.insert(kind.to_owned(), Value::Object(counts.collect()));
    }
    if totals.peers > 0 {
        object.insert("hostile peer".to_owned(), json!({ "operator": totals.peers }));
    }
    if totals.full_disks > 0 {
        object.insert("full disk".to_owned(), json!({ "recorder": totals.full_disks }));
    }
    Value::Object(object)
}

fn leaks_as_json(totals: &Totals) -> Vec<Value> {
    let one = |(process, resource, slope): (&str, super::Resource, super::Slope)| {
        json!({
            "process": process, "resource": resource.name(),
            "slope": slope.value, "low": slope.low, "high": slope.high,
        })
    };
    totals.leaks().into_iter().map(one).collect()
}

fn slopes_as_json(totals: &Totals) -> Vec<Value> {
    let one = |(process, resource, slope): &(String, super::Resource, Option<super::Slope>)| {
        json!({
            "process": process, "resource": resource.name(), "slope": slope.map(|slope| slope.value),
            "low": slope.map(|slope| slope.low), "high": slope.map(|slope| slope.high),
        })
    };
    totals.slopes.iter().map(one).collect()
}

fn print(totals: &Totals, figures: &[Figure], report: Option<&Path>) {
    let mut table = tables::framed();
    let mut row = |name: &str, value: String| {
        table.add_row([TableCell::new(name), TableCell::new(value)]);
    };
    row("minutes", format!("{:.1}", totals.minutes));
    let ends: Vec<_> = totals.ends.iter().map(|(end, count)| format!("{count} {end}")).collect();
    row("manoeuvres", format!("{}: {}", totals.manoeuvres, ends.join(", ")));
    if let Some(cell) = worst(totals) {
        let words = format!(
            "{}, worst {:.1} of {:.1} cm, {:.2} s",
            totals.stops().len(),
            100.0 * cell.rolled,
            100.0 * cell.bound,
            cell.seconds
        );
        row("stops of a driving car", words);
    }
    let recovery = |share| quantile(totals.recoveries(), share);
    if let (Some(p50), Some(p99), Some(max)) = (recovery(0.5), recovery(0.99), recovery(1.0)) {
        row("back after", format!("p50 {p50:.2} s, p99 {p99:.2} s, max {max:.2} s"));
    }
    let at = |quantile| totals.latency.value_at_quantile(quantile);
    row(
        "reading to command",
        format!("p50 {} p99 {} max {} us", at(0.5), at(0.99), totals.latency.max()),
    );
    row(
        "load",
        if totals.burdens.is_empty() { "none".to_owned() } else { totals.burdens.join(", ") },
    );
    println!("{table}");
    if !totals.flights.is_empty() {
        println!("{}", faults(totals));
    }
    for figure in figures {
        println!("{figure}");
    }
    for (process, blow, mode) in &totals.missed {
        println!("not met: {} {process} in {mode}", blow.name());
    }
    if let Some(report) = report {
        println!("report  {}", report.display());
    }
}

fn faults(totals: &Totals) -> comfy_table::Table {
    let mut groups: BTreeMap<(&str, Process), Vec<&Cell>> = BTreeMap::new();
    for cell in &totals.flights {
        groups.entry((cell.blow.name(), cell.process)).or_default().push(cell);
    }
    let header = ["fault", "process", "number", "stopped", "worst of bound", "back s", "bad"];
    let mut table = tables::figures(&header, &[2, 3, 4, 5, 6]);
    for ((kind, process), cells) in groups {
        let count = |wanted: fn(&&&Cell) -> bool| cells.iter().filter(wanted).count().to_string();
        let held = cells.iter().filter(|cell| cell.held).map(|cell| cell.rolled / cell.bound);
        let worst =
            quantile(held, 1.0).map_or("-".to_owned(), |share| format!("{:.0} %", 100.0 * share));
        let back = quantile(cells.iter().filter_map(|cell| cell.recovery), 1.0);
        table.add_row([
            kind.to_owned(),
            process.name().to_owned(),
            cells.len().to_string(),
            count(|cell| cell.stopped),
            worst,
            back.map_or("-".to_owned(), |back| format!("{back:.2}")),
            count(|cell| cell.not_stopped || cell.not_back),
        ]);
    }
    table
}

fn report(args: &SoakArgs, totals: &Totals, figures: &[Figure]) -> SoakReport {
    let broken = totals.broken().into_iter().map(|cell| {
        let (kind, process, mode) = (cell.blow.name(), cell.process, cell.mode);
        format!("{kind} {process} in {mode}: {}.", effect(cell))
    });
    let fault = |cell: &Cell| SoakFault {
        kind: cell.blow.name().to_owned(),
        process: cell.process.name().to_owned(),
        mode: cell.mode.name().to_owned(),
        effect: effect(cell).to_owned(),
        stop: cell.held.then_some((cell.rolled, cell.bound)),
        recovery: cell.recovery,
        passed: !cell.not_stopped && !cell.not_back,
    };
    #[allow(clippy::cast_precision_loss)] // minutes and microseconds
    let latency = totals.latency_by_minute.iter().map(|(minute, latency)| {
        let at = |quantile| latency.value_at_quantile(quantile) as f64;
        [*minute as f64, at(0.5), at(0.99), latency.max() as f64]
    });
    let held = |figure: &Figure| SoakFigure {
        name: figure.name.clone(),
        value: figure.value,
        limit: match figure.limit {
            Limit::AtMost(limit) | Limit::AtLeast(limit) => limit,
        },
        passed: figure.passed(),
    };
    SoakReport {
        broken: broken.collect(),
        figures: figures.iter().map(held).collect(),
        minutes: totals.minutes,
        ends: totals.ends.clone().into_iter().collect(),
        faults: totals.flights.iter().map(fault).collect(),
        latency: latency.collect(),
        slopes: slopes(totals),
        circumstances: vec![("Load".to_owned(), totals.burdens.join(", "))],
        provenance: Provenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            seed: Some(totals.seed),
            command_line: command_line(args),
            instance: totals.instance.clone(),
            machine: crate::machine::facts(),
            ..Provenance::default()
        },
    }
}

fn slopes(totals: &Totals) -> Vec<SoakSlope> {
    let one = |(process, resource, slope): &(String, super::Resource, Option<super::Slope>)| {
        let samples = totals.samples.get(&(process.clone(), *resource));
        SoakSlope {
            process: process.clone(),
            resource: resource.name().to_owned(),
            slope: slope.map(|slope| [slope.value, slope.low, slope.high]),
            leaks: slope.is_some_and(|slope| slope.leaks(process, *resource)),
            points: samples
                .into_iter()
                .flatten()
                .map(|sample| [sample.at / 60.0, sample.value])
                .collect(),
        }
    };
    totals.slopes.iter().map(one).collect()
}

fn command_line(args: &SoakArgs) -> String {
    let mut words = vec!["kerbside soak".to_owned()];
    words.extend(args.seed.map(|seed| format!("--seed {seed}")));
    words.extend(args.minutes.map(|minutes| format!("--minutes {minutes}")));
    words.extend(args.manoeuvres.map(|manoeuvres| format!("--manoeuvres {manoeuvres}")));
    words.extend(args.matrix.then(|| "--matrix".to_owned()));
    let faults = match args.faults {
        Faults::All => None,
        Faults::None => Some("none"),
        Faults::Kill => Some("kill"),
        Faults::Stall => Some("stall"),
    };
    words.extend(faults.map(|faults| format!("--faults {faults}")));
    let loads: Vec<_> = args.load.iter().map(|load| load.name()).collect();
    words.extend((!loads.is_empty()).then(|| format!("--load {}", loads.join(","))));
    words.join(" ")
}
