//! What a soak in lockstep says at the end: tables for people, or one JSON object.

use comfy_table::Cell;
use kerbside_messages::{Process, seconds};
use serde_json::{Map, Value, json};

use super::super::SoakArgs;
use super::super::quantile::quantile;
use super::{Failed, Totals};
use crate::exit::Exit;
use crate::figures::Figure;
use crate::lockstep::{Invariant, Stop};
use crate::tables;

/// Tells what came out; the exit code.
pub fn tell(args: &SoakArgs, totals: &Totals) -> Exit {
    kerbside_runtime::end_on_broken_pipe();
    let figures = figures(totals);
    let passed = totals.manoeuvres() > 0 && figures.iter().all(Figure::passed);
    if args.json {
        println!("{}", as_json(totals, &figures, passed));
    } else {
        print(totals, &figures);
    }
    if passed { Exit::Good } else { Exit::Bad }
}

fn figures(totals: &Totals) -> Vec<Figure> {
    #[allow(clippy::cast_precision_loss)] // failing seeds
    let broken = |invariant: Invariant| totals.broken(invariant) as f64;
    let name = |invariant: Invariant| format!("broken: {invariant}");
    Invariant::ALL
        .into_iter()
        .map(|invariant| Figure::at_most(&name(invariant), broken(invariant), 0.0))
        .collect()
}

/// The stop that used most of what it was allowed.
fn worst(stops: &[Stop]) -> Option<&Stop> {
    let used = |stop: &Stop| stop.rolled / stop.bound;
    stops.iter().filter(|stop| stop.single).max_by(|a, b| used(a).total_cmp(&used(b)))
}

fn as_json(totals: &Totals, figures: &[Figure], passed: bool) -> Value {
    let worst = worst(&totals.stops);
    let single = || totals.stops.iter().filter(|stop| stop.single);
    let recovery = |share| quantile(totals.recoveries.iter().copied(), share);
    let (per_thread, per_core) = totals.speed();
    json!({
        "schema": "kerbside.soak.v1",
        "version": env!("CARGO_PKG_VERSION"),
        "seed": totals.first,
        "passed": passed,
        "figures": figures.iter().map(Figure::as_json).collect::<Vec<_>>(),
        "mode": "lockstep",
        "minutes": totals.minutes(),
        "manoeuvres": totals.manoeuvres(),
        "last_seed": totals.first.wrapping_add(totals.manoeuvres().saturating_sub(1)),
        "ends": totals.ends,
        "faults": faults_as_json(totals),
        "stop": {
            "count": totals.stops.len(),
            "bound_m": worst.map(|stop| stop.bound),
            "worst_m": worst.map(|stop| stop.rolled),
            "p99_m": quantile(single().map(|stop| stop.rolled), 0.99),
            "worst_share": worst.map(|stop| stop.rolled / stop.bound),
            "p99_share": quantile(single().map(|stop| stop.rolled / stop.bound), 0.99),
        },
        "recovery_s": { "p50": recovery(0.5), "p99": recovery(0.99), "max": recovery(1.0) },
        "min_clearance_m": Some(totals.clearance).filter(|clearance| clearance.is_finite()),
        "broken": totals.failed.iter().map(failed_as_json).collect::<Vec<_>>(),
        "wall_s": totals.wall_seconds,
        "threads": totals.threads,
        "processor_s": totals.processor_seconds,
        "search_s": totals.search_seconds,
        "speed_factor_per_thread": per_thread,
        "speed_factor_per_core": per_core,
    })
}

fn faults_as_json(totals: &Totals) -> Value {
    let of_kind = |counts: &std::collections::BTreeMap<Process, u64>| {
        let counted =
            counts.iter().map(|(process, count)| (process.name().to_owned(), json!(count)));
        Value::Object(counted.collect::<Map<_, _>>())
    };
    let kinds = totals.faults.iter().map(|(kind, counts)| ((*kind).to_owned(), of_kind(counts)));
    Value::Object(kinds.collect())
}

fn failed_as_json(failed: &Failed) -> Value {
    let lines = |schedule: &crate::lockstep::Schedule| -> Vec<String> {
        schedule.faults().iter().map(ToString::to_string).collect()
    };
    json!({
        "seed": failed.seed,
        "scenario": failed.scene,
        "invariant": failed.broken.invariant.name(),
        "at_s": seconds(failed.broken.at),
        "words": failed.broken.words,
        "schedule": lines(&failed.schedule),
        "shrunk": failed.shrunk.as_ref().map(|(schedule, broken)| json!({
            "schedule": lines(schedule), "at_s": seconds(broken.at), "words": broken.words,
        })),
    })
}

fn print(totals: &Totals, figures: &[Figure]) {
    println!("{}", overview(totals));
    println!("{}", faults(totals));
    for figure in figures {
        println!("{figure}");
    }
    for failed in &totals.failed {
        print_failed(failed);
    }
}

fn overview(totals: &Totals) -> comfy_table::Table {
    let mut table = tables::framed();
    let mut row = |name: &str, value: String| {
        table.add_row([Cell::new(name), Cell::new(value)]);
    };
    let (per_thread, per_core) = totals.speed();
    let last = totals.first.wrapping_add(totals.manoeuvres().saturating_sub(1));
    row("manoeuvres", format!("{}, seeds {} to {last}", totals.manoeuvres(), totals.first));
    row("minutes of manoeuvres", format!("{:.1}", totals.minutes()));
    row("faults", totals.fault_count().to_string());
    let ends: Vec<_> = totals.ends.iter().map(|(end, count)| format!("{count} {end}")).collect();
    row("ends", ends.join(", "));
    if let Some(stop) = worst(&totals.stops) {
        let p99 = quantile(
            totals.stops.iter().filter(|stop| stop.single).map(|stop| stop.rolled / stop.bound),
            0.99,
        );
        let words = format!(
            "{}; after one fault at worst {:.1} of {:.1} cm allowed, p99 {:.0} %",
            totals.stops.len(),
            100.0 * stop.rolled,
            100.0 * stop.bound,
            100.0 * p99.unwrap_or(f64::NAN)
        );
        row("stops", words);
    }
    let recovery = |share| quantile(totals.recoveries.iter().copied(), share).unwrap_or(f64::NAN);
    if !totals.recoveries.is_empty() {
        let (p50, p99, max) = (recovery(0.5), recovery(0.99), recovery(1.0));
        row("whole again after", format!("p50 {p50:.2} s, p99 {p99:.2} s, max {max:.2} s"));
    }
    row("least clearance", format!("{:.1} cm", 100.0 * totals.clearance));
    let threads = totals.threads;
    let each = format!("{per_thread:.0} x real time on each of {threads} threads");
    row("speed", format!("{each}; {per_core:.0} x on a processor of its own"));
    table
}

fn faults(totals: &Totals) -> comfy_table::Table {
    let mut table = tables::figures(&["fault", "number", "of or befalling"], &[1]);
    for (kind, counts) in &totals.faults {
        let each: Vec<_> =
            counts.iter().map(|(process, count)| format!("{process} {count}")).collect();
        let number: u64 = counts.values().sum();
        table.add_row([(*kind).to_owned(), number.to_string(), each.join(", ")]);
    }
    table
}

fn print_failed(failed: &Failed) {
    println!("seed {}, {}: {}", failed.seed, failed.scene, failed.broken);
    let (schedule, shrunk) = match &failed.shrunk {
        Some((schedule, broken)) => (schedule, Some(broken)),
        None => (&failed.schedule, None),
    };
    if let Some(broken) = shrunk {
        let before = failed.schedule.faults().len();
        println!("  shrunk from {before} to {} faults: {broken}", schedule.faults().len());
    }
    for fault in schedule.faults() {
        println!("    {fault}");
    }
    println!("  repeat  kerbside soak --lockstep --seed {}", failed.seed);
}
