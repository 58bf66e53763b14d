//! A trial for people, and for programs.

use std::path::Path;

use comfy_table::{Cell, Table};
use serde_json::{Value, json};

use super::TrialArgs;
use super::judge::Row;
use super::score::{Score, Share, size_class};
use crate::figures::{Figure, Limit};
use crate::tables;

/// What is told besides the score.
#[derive(Clone, Debug)]
pub struct Facts<'a> {
    /// What was asked.
    pub args: &'a TrialArgs,
    /// Root of the commitments.
    pub root: &'a str,
    /// SHA-256 of the program that diagnosed.
    pub program: &'a str,
    /// Where everything lies.
    pub out: &'a Path,
    /// How often the manoeuvre that was suggested resolved an ambiguous answer.
    pub resolved: Share,
}

/// Prints everything.
pub fn tell(score: &Score, facts: &Facts<'_>) {
    let figures = score.figures();
    let passed = figures.iter().all(Figure::passed);
    if facts.args.json {
        println!("{}", document(score, facts, passed));
        return;
    }
    println!("{}", kinds(score));
    println!("{}", classes("single effects, by size d", &score.by(&["single"], size_class)));
    println!("{}", classes("pairs, by size d of the weaker", &score.by(&["pair"], size_class)));
    println!("{}", classes("single effects", &score.by(&["single"], effect)));
    println!("{}", classes("causes not listed", &score.by(&["unknown"], cause)));
    println!("{}", classes("causes not listed, by size d", &score.by(&["unknown"], size_class)));
    println!("{}", classes("single effects, by sensors", &score.by(&["single"], sensors)));
    println!("{}", calibration(score));
    println!("{}", against(score));
    println!("{}", held(&figures));
    if facts.resolved.of > 0 {
        let Share { right, of } = facts.resolved;
        println!("ambiguous answers that the suggested manoeuvre resolved: {right} of {of}");
    }
    let (cases, seed, plant) = (score.rows.len(), facts.args.seed, facts.args.plant.name());
    println!("{cases} cases, seed {seed}, plant {plant}\ncommitment  {}", facts.root);
    println!("answers     {}", facts.out.display());
}

fn percent(share: Share) -> String {
    if share.of == 0 { "-".to_owned() } else { format!("{:.0} %", 100.0 * share.value()) }
}

fn interval(share: Share) -> String {
    let (low, high) = share.interval();
    if share.of == 0 { "-".to_owned() } else { format!("{:.0}..{:.0}", 100.0 * low, 100.0 * high) }
}

fn cells(name: &str, share: Share) -> Vec<Cell> {
    vec![
        Cell::new(name),
        Cell::new(format!("{} of {}", share.right, share.of)),
        Cell::new(percent(share)),
        Cell::new(interval(share)),
    ]
}

fn kinds(score: &Score) -> Table {
    let mut table = tables::figures(&["", "right", "%", "95 %"], &[1, 2]);
    let share =
        |kind: &'static [&'static str], of: fn(&Row) -> bool| Share::count(score.of(kind).map(of));
    let [single, pair, null, unknown]: [&'static [&'static str]; 4] =
        [&["single"], &["pair"], &["null"], &["unknown"]];
    for (name, share) in [
        ("single: effect", share(single, |row| row.exact)),
        ("single: effect, named alone", share(single, |row| row.right)),
        ("single: effect, or among three", share(single, |row| row.set)),
        ("single: link", share(single, |row| row.link)),
        ("single: link among those that moved", share(single, |row| row.moved)),
        ("null: no link moved", share(null, |row| row.moved)),
        ("pair: both", share(pair, |row| row.exact)),
        ("pair: both, named alone", share(pair, |row| row.right)),
        ("pair: both, or among three", share(pair, |row| row.set)),
        ("null: false alarms", score.false_alarms()),
        ("unknown: flagged", score.unknown_flagged()),
        ("unknown: link", share(unknown, |row| row.link)),
        ("false unknowns", score.false_unknown()),
        ("90 % sets that hold the truth", score.coverage()),
        ("parameters within their interval", score.intervals()),
    ] {
        table.add_row(cells(name, share));
    }
    table
}

fn classes(name: &str, rows: &[(String, Share, Share)]) -> Table {
    let mut table = tables::figures(&[name, "right", "%", "95 %", "link"], &[1, 2, 4]);
    for (word, share, link) in rows {
        let mut cells = cells(word, *share);
        cells.push(Cell::new(percent(*link)));
        table.add_row(cells);
    }
    table
}

fn calibration(score: &Score) -> Table {
    let mut table = tables::figures(&["stated", "mean", "right", "%", "95 %"], &[1, 2, 3]);
    for bin in score.reliability() {
        let mut row = cells(&format!("{:.2} to {:.2}", bin.ends.0, bin.ends.1), bin.right);
        row.insert(1, Cell::new(format!("{:.2}", bin.stated)));
        table.add_row(row);
    }
    table
}

fn against(score: &Score) -> Table {
    let mut table = tables::figures(&["single effects, other ways", "right", "%", "95 %"], &[1, 2]);
    for (name, share) in score.rivals() {
        table.add_row(cells(name, share));
    }
    let chance = 100.0 * chance();
    table.add_row(vec![
        Cell::new("chance"),
        Cell::new(""),
        Cell::new(format!("{chance:.0} %")),
        Cell::new(""),
    ]);
    table
}

/// The figures that the trial holds itself against.
fn held(figures: &[Figure]) -> Table {
    let mut table = tables::figures(&["held against", "is", "95 %", "limit", ""], &[1, 3]);
    for figure in figures {
        let interval = figure.interval.map(|(low, high)| format!("{low:.2}..{high:.2}"));
        let limit = match figure.limit {
            Limit::AtMost(limit) => format!("<= {limit}"),
            Limit::AtLeast(limit) => format!(">= {limit}"),
        };
        table.add_row([
            figure.name.clone(),
            format!("{:.3}", figure.value),
            interval.unwrap_or_default(),
            limit,
            if figure.passed() { "ok" } else { "missed" }.to_owned(),
        ]);
    }
    table
}

/// How often one of the effects, picked blindly, is right.
#[allow(clippy::cast_precision_loss)] // A few dozen.
fn chance() -> f64 {
    1.0 / kerbside_simulation::effects::library().len() as f64
}

fn effect(row: &Row) -> String {
    row.label.ids().join(" + ")
}

fn cause(row: &Row) -> String {
    row.label.put_in.join(" + ")
}

/// What the vehicle has, in words.
fn sensors(row: &Row) -> String {
    let has = |letter: char| row.label.sensors.contains(letter);
    let wheels = match (has('c'), has('w')) {
        (true, true) => "counts",
        (true, false) => "counts of an axle",
        _ => "speeds",
    };
    let mut words = vec![wheels];
    words.extend(has('s').then_some("steering"));
    words.extend(has('g').then_some("gyro"));
    words.extend(has('r').then_some(if has('y') { "pose" } else { "position" }));
    words.join(", ")
}

fn as_json(share: Share) -> Value {
    let (low, high) = share.interval();
    json!({ "right": share.right, "of": share.of, "low": low, "high": high })
}

/// The object of `--json`. What could not be measured is null.
fn document(score: &Score, facts: &Facts<'_>, passed: bool) -> Value {
    let of = |kinds: &[&str], of: fn(&Row) -> bool| as_json(Share::count(score.of(kinds).map(of)));
    let by = |rows: Vec<(String, Share, Share)>| -> Value {
        let entry = |(name, share, link): (String, Share, Share)| {
            (name, json!({ "effect": as_json(share), "link": as_json(link) }))
        };
        Value::Object(rows.into_iter().map(entry).collect())
    };
    let mut baselines: serde_json::Map<String, Value> =
        score.rivals().into_iter().map(|(name, share)| (name.to_owned(), as_json(share))).collect();
    baselines.insert("chance".to_owned(), json!(chance()));
    let alarms = score.false_alarms();
    let case = |row: &Row| {
        json!({
            "case": row.case, "kind": row.label.kind, "truth": row.label.ids(), "put_in": row.label.put_in, "size": row.label.size,
            "verdict": row.verdict, "answer": row.named, "exact": row.exact, "right": row.right, "twins": row.label.twins, "set": row.set,
            "link": row.link, "moved": row.moved, "probability": row.stated, "on_truth": row.on_truth,
            "removed": row.removed, "seconds": row.seconds,
        })
    };
    json!({
        "schema": "kerbside.trial.v1",
        "version": env!("CARGO_PKG_VERSION"),
        "seed": facts.args.seed,
        "passed": passed,
        "figures": score.figures().iter().map(Figure::as_json).collect::<Vec<_>>(),
        "cases": score.rows.len(),
        "plant": facts.args.plant.name(),
        "commitment": facts.root,
        "program": facts.program,
        "link": of(&["single"], |row| row.link),
        "effect": of(&["single"], |row| row.exact),
        "effect_alone": of(&["single"], |row| row.right),
        "pair_alone": of(&["pair"], |row| row.right),
        "effect_or_set": of(&["single"], |row| row.set),
        "link_moved": of(&["single"], |row| row.moved),
        "null_unmoved": of(&["null"], |row| row.moved),
        "pair_both": of(&["pair"], |row| row.exact),
        "unknown_flagged": as_json(score.unknown_flagged()),
        "false_unknown": as_json(score.false_unknown()),
        "coverage": as_json(score.coverage()),
        "intervals": as_json(score.intervals()),
        "null": { "false_alarms": alarms.right, "of": alarms.of },
        "mean_set": score.mean_set(),
        "ece": score.ece(),
        "parameter_error_median": score.parameter_error(),
        "removed_median": score.removed(),
        "regret_median": score.regret(),
        "resolved_by_next": as_json(facts.resolved),
        "baselines": baselines,
        "by_effect": by(score.by(&["single"], effect)),
        "by_size": by(score.by(&["single"], size_class)),
        "by_size_pairs": by(score.by(&["pair"], size_class)),
        "by_cause": by(score.by(&["unknown"], cause)),
        "by_size_unknown": by(score.by(&["unknown"], size_class)),
        "by_sensors": by(score.by(&["single"], sensors)),
        "seconds_per_case": score.seconds(),
        "rows": score.rows.iter().map(case).collect::<Vec<_>>(),
        "out": facts.out,
    })
}
