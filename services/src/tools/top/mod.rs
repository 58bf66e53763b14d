//! `top`: processes and topics of a running stack, renewed on a terminal until `q`; in a pipe one table.

mod screen;
mod tables;
mod usage;
mod watch;

use std::io::IsTerminal;

use kerbside_messages::{Nanos, nanos};
use kerbside_runtime::now;
use serde_json::{Value, json};

use super::{Out, Place};
use crate::exit::{Exit, Failure};
use screen::{Screen, Wish};
use watch::{ProcessLine, Snapshot, TopicLine, Watch};

/// What `top` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct TopArgs {
    /// Time between tables, over which rates and loop times are measured [s].
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = super::seconds)]
    interval: f64,
    /// Tables to print where standard output is no terminal.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    count: u64,
    /// Name of the instance; the only live one where not given.
    #[arg(long, value_name = "NAME")]
    instance: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Watches the stack.
///
/// # Errors
/// [`Failure`] where there is no stack, its places for guests are taken, or it ends while it is watched.
pub fn run(args: &TopArgs) -> Result<Exit, Failure> {
    let mut place = Place::open(args.instance.as_deref())?;
    let mut watch = Watch::open(&place.session)?;
    let seen = if std::io::stdout().is_terminal() && !args.json {
        on_screen(args, &mut place, &mut watch)
    } else {
        print(args, &mut place, &mut watch)
    };
    seen?;
    if place.lives { Ok(Exit::Good) } else { Err(place.ended()) }
}

/// Takes in what comes until `end`; whether the stack lives and nobody ended the tool.
fn watch_until(end: Nanos, place: &mut Place, watch: &mut Watch) -> bool {
    while now() < end {
        if !place.goes_on() {
            return false;
        }
        watch.take_in();
    }
    true
}

fn print(args: &TopArgs, place: &mut Place, watch: &mut Watch) -> Result<(), Failure> {
    let mut out = Out::new();
    let count = if args.json { 1 } else { args.count };
    for _ in 0..count {
        let end = now() + nanos(args.interval);
        if !watch_until(end, place, watch) {
            return Ok(());
        }
        let snapshot = watch.snapshot(&place.instance);
        let text = if args.json { object(&snapshot) } else { tables::text(&snapshot) };
        if !out.print(&text)? {
            return Ok(());
        }
    }
    Ok(())
}

fn on_screen(args: &TopArgs, place: &mut Place, watch: &mut Watch) -> Result<(), Failure> {
    let mut screen = Screen::open()?;
    let mut due = now() + nanos(args.interval.min(0.3));
    loop {
        match screen.wish()? {
            Wish::Quit => return Ok(()),
            Wish::Redraw => screen.draw_again()?,
            Wish::Nothing => {}
        }
        if !place.goes_on() {
            return Ok(());
        }
        watch.take_in();
        if now() >= due {
            due = now() + nanos(args.interval);
            screen.draw(watch.snapshot(&place.instance))?;
        }
    }
}

fn object(snapshot: &Snapshot) -> String {
    let process = |line: &ProcessLine| -> Value {
        let beat = line.beat;
        json!({
            "name": line.name, "pid": line.pid, "state": line.state, "restarts": line.restarts,
            "misses": line.misses, "memory_mib": line.usage.memory, "cpu_percent": line.usage.processor,
            "work_mean_ms": beat.map(|beat| 1e3 * beat.work_mean),
            "work_max_ms": beat.map(|beat| 1e3 * beat.work_max),
            "lateness_max_ms": beat.map(|beat| 1e3 * beat.lateness_max),
            "lost": beat.map(|beat| beat.lost), "refused": beat.map(|beat| beat.refused),
            "says": line.says,
        })
    };
    let topic = |line: &TopicLine| -> Value {
        json!({
            "name": line.topic.name, "rate_hz": line.rate, "nominal_hz": line.nominal(),
            "age_ms": line.age.map(|age| 1e3 * age), "skipped": line.skipped, "refused": line.refused,
            "refusal": line.refusal.map(|why| why.to_string()),
        })
    };
    json!({
        "schema": "kerbside.top.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null,
        "passed": true, "figures": [], "instance": snapshot.instance, "mode": snapshot.mode,
        "cause": snapshot.cause,
        "processes": snapshot.processes.iter().map(process).collect::<Vec<_>>(),
        "topics": snapshot.topics.iter().map(topic).collect::<Vec<_>>(),
    })
    .to_string()
}
