//! `bench start`: a whole stack from nothing to READY, again and again.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;

use kerbside_messages::seconds;
use kerbside_runtime::{Instance, now};
use serde_json::json;

use super::rows::{Told, tell};
use super::statistics::median;
use crate::exit::{Exit, Failure};
use crate::figures::Figure;
use crate::output;

/// A start may take so long \[s\].
const LIMIT: f64 = 2.0;

/// What `bench start` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct StartArgs {
    /// Starts that are measured.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where a stack does not start.
pub fn run(args: &StartArgs) -> Result<Exit, Failure> {
    let folder = std::env::temp_dir().join(format!("kerbside-bench-{}", output::stamp()));
    let folder = output::folder(Some(&folder), "bench")?;
    let times: Result<Vec<_>, _> =
        (0..args.repeats).map(|index| start_once(index, &folder)).collect();
    fs::remove_dir_all(&folder).map_err(Failure::internal)?;
    let times = times?;
    let longest = times.iter().copied().fold(f64::NAN, f64::max);
    let told = Told {
        verb: "start",
        rows: Vec::new(),
        figures: vec![Figure::at_most("longest start to READY [s]", longest, LIMIT)],
        notes: vec![format!(
            "{} starts to READY: median {:.3} s, longest {longest:.3} s",
            times.len(),
            median(times.clone())
        )],
        more: json!({ "start_s": { "median": median(times.clone()), "max": longest, "all": times } }),
    };
    Ok(tell(&told, args.json))
}

/// Seconds from the start of a fresh instance, with its simulated vehicle, until it says that it is ready.
fn start_once(index: u32, folder: &Path) -> Result<f64, Failure> {
    let name = format!("{}-{index}", Instance::fresh_name("start"));
    let mut command = super::own_executable();
    command.args(["--log", "error", "up", "--simulate", "--instance", &name]);
    command.arg("--recording").arg(folder.join(format!("{index}.mcap")));
    kerbside_runtime::close_inherited_on_exec();
    let begun = now();
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(Failure::internal)?;
    let lines = child.stderr.take().map(|from| BufReader::new(from).lines());
    let ready = lines
        .into_iter()
        .flatten()
        .map_while(Result::ok)
        .find(|line| line.contains("is ready"))
        .map(|_| now());
    kerbside_runtime::terminate(child.id());
    child.wait().map_err(Failure::internal)?;
    let ready = ready.ok_or_else(|| Failure::unavailable("the stack ended before it was ready"))?;
    Ok(seconds(ready - begun))
}
