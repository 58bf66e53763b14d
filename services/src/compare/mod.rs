//! `compare`: ways of doing the same, side by side.

mod course;
mod runs;

use std::path::PathBuf;

use kerbside_odometry::Filter;

use crate::exit::{Exit, Failure};

/// What is compared.
#[derive(Debug, clap::Subcommand)]
pub enum CompareVerb {
    /// The estimator's filters: on the proving ground's S path, or on recorded runs.
    #[command(after_help = "Example: kerbside compare filters tests/data/cases/paper-1-6")]
    Filters(FiltersArgs),
}

/// What `compare filters` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct FiltersArgs {
    /// Run folders, case folders with several runs, or .mcap recordings; the proving ground where none is given.
    pub paths: Vec<PathBuf>,
    /// Trials per case on the proving ground.
    #[arg(long, default_value_t = 400, value_parser = clap::value_parser!(u32).range(2..))]
    pub trials: u32,
    /// Seed of the proving ground's trials.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Vehicle, in place of the runs' own: a file, or the name of a shipped one.
    #[arg(long, value_name = "FILE", requires = "paths")]
    pub vehicle: Option<String>,
    /// Configuration: a stack's file, or a folder like config/.
    #[arg(long, value_name = "PATH", requires = "paths")]
    pub config: Option<PathBuf>,
    /// Folder for the runs' vehicle files; a new one in the state folder where not given.
    #[arg(long, value_name = "DIR", requires = "paths")]
    pub out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// The filters in the order of the tables.
const FILTERS: [Filter; 4] = [Filter::Rear, Filter::PaperOwn, Filter::Paper, Filter::Fused];

/// Name of a filter, for people.
const fn name(filter: Filter) -> &'static str {
    match filter {
        Filter::Rear => "rear",
        Filter::PaperOwn => "paper (i)",
        Filter::Paper => "paper (ii)",
        Filter::Fused => "fused",
    }
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where an input is refused or somebody interrupts it.
pub fn run(verb: &CompareVerb) -> Result<Exit, Failure> {
    let CompareVerb::Filters(args) = verb;
    if args.paths.is_empty() { course::run(args) } else { runs::run(args) }
}
