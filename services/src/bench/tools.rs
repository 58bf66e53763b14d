//! `bench tools`: what it costs the control path to be watched.
//!
//! One stack drives; every other second `top` runs beside it, subscribed to every topic. Latencies come from the
//! commands' stamps; work is what the kernel accounts to the processes of the control path, per reading.

use core::time::Duration;
use std::io::{BufRead, BufReader};
use std::process::{Child, Stdio};

use kerbside_messages::Nanos;
use kerbside_runtime::{Instance, Ticker};
use serde_json::json;

use super::drive::{Account, Drive, Watch};
use super::pipeline::{Scheduling, ends};
use super::rows::{Row, Told, tell};
use super::statistics::{Blocks, ratio_of_medians};
use crate::exit::{Exit, Failure};

/// Latency and work beside `top` may be so many times those without.
const LIMIT: f64 = 1.1;
/// Windows of accounted work.
const WINDOW: Duration = Duration::from_millis(100);
/// Windows of a slice with or without `top`.
const SLICE: u32 = 10;

/// What `bench tools` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct ToolsArgs {
    /// Scenario that is driven.
    #[arg(default_value = "garage")]
    scenario: String,
    /// Seconds of driving that are measured, half of them beside `top`.
    #[arg(long, default_value_t = 14, value_parser = clap::value_parser!(u32).range(2..))]
    seconds: u32,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// `top` in a pipe, printing table after table.
struct Top(Child);

impl Top {
    /// Starts it, and waits until it has printed: its ports are connected by then.
    fn start(instance: &Instance) -> Result<Self, Failure> {
        let mut command = super::own_executable();
        command.args(["top", "--interval", "0.25", "--count", "1000000"]);
        command.args(["--instance", instance.name()]);
        kerbside_runtime::close_inherited_on_exec();
        let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn();
        let mut top = Self(child.map_err(Failure::internal)?);
        let mut line = String::new();
        // What it prints in a second or two fits the pipe.
        let read = top.0.stdout.as_mut().map(|out| BufReader::new(out).read_line(&mut line));
        if matches!(read, Some(Ok(length)) if length > 0) {
            Ok(top)
        } else {
            Err(Failure::internal("top did not start"))
        }
    }
}

impl Drop for Top {
    fn drop(&mut self) {
        kerbside_runtime::terminate(self.0.id());
        let _ = self.0.wait();
    }
}

/// What was measured with or without `top`.
#[derive(Debug, Default)]
struct Side {
    latencies: Blocks,
    /// Work per reading of each window \[us\].
    work: Vec<f64>,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the stack or `top` cannot be started, or the manoeuvre is over too early.
pub fn run(args: &ToolsArgs) -> Result<Exit, Failure> {
    let mut drive = Drive::start(&args.scenario, &Scheduling::ordinary().stack())?;
    let (session, mut watch) = drive.join()?;
    let mut tick = Ticker::new(WINDOW);
    let (mut alone, mut watched) = (Side::default(), Side::default());
    let mut kept = 0;
    while kept < args.seconds && drive.goes_on(&mut watch, &mut tick)? {
        let beside = kept % 2 == 1;
        let top = beside.then(|| Top::start(&drive.instance)).transpose()?;
        tick.wait();
        watch.take_in();
        let (latencies, work) = slice(&mut watch, &mut tick);
        drop(top);
        // What was measured while a fault stopped the car says nothing of a car that drives.
        if watch.drives() && !latencies.is_empty() {
            let side = if beside { &mut watched } else { &mut alone };
            side.latencies.0.push(latencies);
            side.work.extend(work);
            kept += 1;
        }
    }
    drop((watch, session));
    if watched.latencies.0.is_empty() {
        let words = "the manoeuvre was over before there was anything to compare";
        return Err(Failure::unavailable(words));
    }
    Ok(tell(&told(&alone, &watched), args.json))
}

/// Latencies, and work per reading of each window.
fn slice(watch: &mut Watch, tick: &mut Ticker) -> (Vec<Nanos>, Vec<f64>) {
    let pids = watch.pids();
    let (mut latencies, mut work) = (Vec::new(), Vec::new());
    let mut before = Account::of(&pids, watch.readings);
    for _ in 0..SLICE - 1 {
        tick.wait();
        latencies.extend(watch.take_in());
        let after = Account::of(&pids, watch.readings);
        work.extend(after.since(&before).map(|each| each.iter().sum::<f64>()));
        before = after;
    }
    (latencies, work)
}

fn told(alone: &Side, watched: &Side) -> Told {
    let rival = "without top";
    let name = "reading to command, with top";
    let latency = Row::of(name, 0, &watched.latencies, rival, &alone.latencies);
    let work = Row {
        name: "own work, with top".to_owned(),
        bytes: 0,
        ours: ends(&watched.work),
        rival: rival.to_owned(),
        rivals: ends(&alone.work),
        ratio: ratio_of_medians(&watched.work, &alone.work),
    };
    let figures = latency.figures(LIMIT, None).into_iter().chain(work.figures(LIMIT, None));
    Told {
        verb: "tools",
        figures: figures.collect(),
        rows: vec![latency, work],
        notes: vec![],
        more: json!({}),
    }
}
