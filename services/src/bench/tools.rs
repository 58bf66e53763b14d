//! `bench tools`: what it costs the control path to be watched.
//!
//! One stack drives; every other second `top` runs beside it, subscribed to every topic. Latencies come from the
//! commands' stamps; work is what the kernel accounts to the processes of the control path, per reading.

use std::io::{BufRead, BufReader};
use std::process::{Child, Stdio};

use kerbside_runtime::{Instance, Ticker};
use serde_json::json;

use super::drive::Drive;
use super::pipeline::Scheduling;
use super::rows::{Told, tell};
use super::side::{Side, WINDOW, all_measured};
use crate::exit::{Exit, Failure};

/// Latency and work beside `top` may be so many times those without.
const LIMIT: f64 = 1.1;

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

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the stack or `top` cannot be started, or the manoeuvre is over too early.
pub fn run(args: &ToolsArgs) -> Result<Exit, Failure> {
    let mut drive = Drive::start(&args.scenario, &Scheduling::ordinary().stack())?;
    let (session, mut watch) = drive.join()?;
    let mut tick = Ticker::new(WINDOW);
    let mut sides = [Side::default(), Side::default()];
    let mut kept = 0;
    while kept < args.seconds && drive.goes_on(&mut watch, &mut tick)? {
        let beside = kept % 2 == 1;
        let top = beside.then(|| Top::start(&drive.instance)).transpose()?;
        kept += u32::from(sides[usize::from(beside)].measure(&mut watch, &mut tick, top));
    }
    drop((watch, session));
    all_measured(&sides)?;
    Ok(tell(&told(&sides), args.json))
}

fn told([alone, watched]: &[Side; 2]) -> Told {
    let rows = watched.against(alone, "with top", "without top");
    let figures = rows.iter().flat_map(|row| row.figures(LIMIT, None));
    Told {
        verb: "tools",
        figures: figures.collect(),
        rows: rows.to_vec(),
        notes: vec![],
        more: json!({}),
    }
}
