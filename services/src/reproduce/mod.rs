//! `reproduce`: the paper's experiments, held against the rows of acceptance.

mod stack;
mod summary;

pub use summary::{figure_as_json, short};

use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kerbside_reports::{Provenance, ReproductionReport, StackParking};
use kerbside_reproduction::{Asked, ROWS, ReproductionError, Watcher, reproduce};

use crate::exit::{Exit, Failure};
use crate::output;

/// Parkings of the whole stack per scene, in lockstep.
const STACK_RUNS: u32 = 3;
/// The row of parking.
const PARKING: u8 = 9;

/// What `reproduce` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct ReproduceArgs {
    /// Trials per case; 400 are asked for, with fewer of them what an interval does not decide is left open.
    #[arg(long, default_value_t = 150, value_parser = clap::value_parser!(u32).range(2..))]
    pub trials: u32,
    /// Seed of everything.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Rows of acceptance, 1 to 9; all of them where not given.
    #[arg(long, value_delimiter = ',', value_name = "ROWS",
          value_parser = clap::value_parser!(u8).range(1..=i64::from(ROWS)))]
    pub rows: Vec<u8>,
    /// Park each scene once through the real processes as well.
    #[arg(long)]
    pub processes: bool,
    /// Folder for the report; a new one in the state folder where not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where an experiment or a parking cannot be run, or somebody interrupts it.
pub fn run(args: &ReproduceArgs) -> Result<Exit, Failure> {
    let asked = Asked { trials: args.trials as usize, seed: args.seed, rows: args.rows.clone() };
    let folder = output::place(args.out.as_deref(), "reproduce")?;
    let reproduction = watched(|watcher| reproduce(&asked, watcher))?;
    let stack: Vec<StackParking> = if asked.wants(PARKING) {
        stack::park(args.seed, STACK_RUNS, args.processes, &folder)?
    } else {
        Vec::new()
    };
    output::make(&folder)?;
    let report = ReproductionReport { reproduction, stack, provenance: provenance(args) };
    let path = folder.join("report.html");
    output::write(&path, &report.render().map_err(Failure::internal)?)?;
    Ok(summary::tell(args, &report, &path))
}

/// Runs an experiment under a progress bar; Ctrl-C ends it.
///
/// # Errors
/// [`Failure`] where it cannot be run or is ended.
pub fn watched<T>(
    experiment: impl FnOnce(Watcher<'_>) -> Result<T, ReproductionError>,
) -> Result<T, Failure> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let handler =
        signal_hook::flag::register(signal_hook::consts::SIGINT, Arc::clone(&interrupted))
            .map_err(Failure::internal)?;
    let bar = bar();
    let result = experiment(&mut |done, total, what| {
        bar.set_length(total);
        bar.set_position(done);
        bar.set_message(what.to_owned());
        !interrupted.load(Ordering::Relaxed)
    });
    bar.finish_and_clear();
    signal_hook::low_level::unregister(handler);
    result.map_err(|error| match error {
        ReproductionError::FewTrials(_) => Failure::new(Exit::Usage, error),
        ReproductionError::Interrupted => Failure::new(Exit::Bad, error),
        error => Failure::internal(error),
    })
}

/// A bar on a terminal, nothing in a pipe.
fn bar() -> ProgressBar {
    let bar = ProgressBar::new(1);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} {msg}, {elapsed}") {
        bar.set_style(style);
    }
    bar
}

fn provenance(args: &ReproduceArgs) -> Provenance {
    let mut words = vec![
        "kerbside reproduce".to_owned(),
        format!("--trials {}", args.trials),
        format!("--seed {}", args.seed),
    ];
    if !args.rows.is_empty() {
        let rows: Vec<String> = args.rows.iter().map(u8::to_string).collect();
        words.push(format!("--rows {}", rows.join(",")));
    }
    words.extend(args.processes.then(|| "--processes".to_owned()));
    Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: Some(args.seed),
        command_line: words.join(" "),
        machine: crate::machine::facts(),
        ..Provenance::default()
    }
}
