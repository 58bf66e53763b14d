//! `soak`: the stack under faults, again and again, held against the invariants that no fault may break.

pub mod live;
pub mod lockstep;
mod quantile;

use std::path::PathBuf;

use crate::exit::{Exit, Failure};
use crate::life::stop_flag;
use crate::output;
use lockstep::Amount;

/// For the end of the help.
pub const EXAMPLES: &str = "Examples: kerbside soak --minutes 10 --load cpu,peer
          kerbside soak --matrix
          kerbside soak --lockstep --minutes 1000
          kerbside soak --lockstep --seed 4711";

/// What `soak` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct SoakArgs {
    /// Scenario that is parked in and left, again and again, with real processes.
    #[arg(long, default_value = "garage")]
    pub scenario: String,
    /// On simulated time, a thread per core: random faults by seed, the same for the same seed.
    #[arg(long, conflicts_with_all = ["faults", "load", "matrix", "instance", "config"])]
    pub lockstep: bool,
    /// First seed. In lockstep, without --minutes and --manoeuvres: this manoeuvre alone, once more.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Minutes to soak, on the stack's own time.
    #[arg(long, conflicts_with = "manoeuvres", value_parser = minutes)]
    pub minutes: Option<f64>,
    /// Manoeuvres to drive.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    pub manoeuvres: Option<u64>,
    /// What happens to the processes: they are killed, stopped for a while, or both.
    #[arg(long, value_enum, default_value_t = Faults::All)]
    pub faults: Faults,
    /// What the machine and the instance have to bear meanwhile.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "LOAD")]
    pub load: Vec<Burden>,
    /// Kill and stop every process in every mode, once each.
    #[arg(long, conflicts_with_all = ["minutes", "manoeuvres"])]
    pub matrix: bool,
    /// Threads in lockstep; one per core where not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Configuration: a stack's file, or a folder like config/.
    #[arg(long, value_name = "PATH")]
    pub config: Option<PathBuf>,
    /// Name of the instance; a fresh one where not given.
    #[arg(long, value_name = "NAME")]
    pub instance: Option<String>,
    /// Folder for the report; a new one in the state folder where not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
    /// Be one of the loads.
    #[command(flatten)]
    pub burden: BurdenArgs,
}

/// What one of the loads is started with.
#[derive(Clone, Debug, clap::Args)]
pub struct BurdenArgs {
    /// Which.
    #[arg(long, value_enum, hide = true)]
    pub burden: Option<Burden>,
    /// The instance that a peer annoys.
    #[arg(skip)]
    pub instance: Option<String>,
    /// End together with the process that started this one.
    #[arg(long, value_name = "PID", hide = true)]
    pub with_parent: Option<u32>,
}

/// Faults of real processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Faults {
    /// None.
    None,
    /// SIGKILL.
    Kill,
    /// SIGSTOP, and SIGCONT later.
    Stall,
    /// Both.
    All,
}

/// What machine and instance have to bear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Burden {
    /// A busy thread on each core.
    Cpu,
    /// Half of the memory that is available, touched again and again.
    Memory,
    /// A recording that may not grow.
    Disk,
    /// A peer that holds samples, publishes rubbish and is killed anywhere.
    Peer,
}

impl Burden {
    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Memory => "memory",
            Self::Disk => "disk",
            Self::Peer => "peer",
        }
    }
}

fn minutes(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(minutes) if minutes.is_finite() && minutes > 0.0 => Ok(minutes),
        _ => Err("allowed is a number of minutes above 0".to_owned()),
    }
}

/// Minutes of a soak in lockstep where nothing is said.
const SIMULATED: f64 = 100.0;
/// Minutes of a soak with processes where nothing is said.
const REAL: f64 = 5.0;

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the configuration is refused or the stack cannot run.
pub fn run(args: &SoakArgs) -> Result<Exit, Failure> {
    if args.burden.burden.is_some() {
        return live::burden::run(&BurdenArgs {
            instance: args.instance.clone(),
            ..args.burden.clone()
        });
    }
    if args.lockstep { in_lockstep(args) } else { with_processes(args) }
}

fn in_lockstep(args: &SoakArgs) -> Result<Exit, Failure> {
    let stop = stop_flag()?;
    let amount = match (args.minutes, args.manoeuvres, args.seed) {
        (Some(minutes), _, _) => Amount::Minutes(minutes),
        (None, Some(manoeuvres), _) => Amount::Manoeuvres(manoeuvres),
        (None, None, Some(_)) => Amount::Manoeuvres(1),
        (None, None, None) => Amount::Minutes(SIMULATED),
    };
    let cores = std::thread::available_parallelism().map_or(1, core::num::NonZero::get);
    let threads = args.threads.map_or(cores, usize::from);
    let totals = lockstep::soak(args.seed.unwrap_or(1), amount, threads, &stop)?;
    Ok(lockstep::tell(args, &totals))
}

fn with_processes(args: &SoakArgs) -> Result<Exit, Failure> {
    let stop = stop_flag()?;
    let folder = output::folder(args.out.as_deref(), "soak")?;
    let endless = args.minutes.is_none() && args.manoeuvres.is_none() && !args.matrix;
    let minutes = if endless { Some(REAL) } else { args.minutes };
    let args = SoakArgs { minutes, ..args.clone() };
    let totals = live::soak(&args, &folder, &stop)?;
    live::tell(&args, &totals, &folder)
}
