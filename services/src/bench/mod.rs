//! `bench`: what a hop, the pipeline, a start and a filter step cost on this machine, held against limits.

mod chain;
mod drive;
mod filter;
mod hop;
mod hostile;
mod peer;
mod pipeline;
mod replay;
mod rows;
mod side;
mod start;
mod statistics;
mod tools;
mod transport;

use std::os::unix::process::CommandExt;
use std::process::Command;

use crate::exit::{Exit, Failure};

/// What to measure.
#[derive(Clone, Debug, clap::Subcommand)]
pub enum BenchVerb {
    /// One hop against the middleware alone and a Unix socket, and the ways to wait.
    #[command(after_help = "Example: kerbside bench transport --blocks 24 --json")]
    Transport(transport::TransportArgs),
    /// From encoder reading to command in a stack that drives, and its work against bare hops.
    #[command(after_help = "Example: kerbside bench pipeline garage --seconds 16")]
    Pipeline(pipeline::PipelineArgs),
    /// The control path of a stack that drives, with `top` beside it and without.
    #[command(after_help = "Example: kerbside bench tools garage --seconds 14")]
    Tools(tools::ToolsArgs),
    /// The control path of a stack that drives, alone, beside a rogue, and beside hostile clients of its gateway.
    #[command(after_help = "Example: kerbside bench hostile garage --seconds 18")]
    Hostile(hostile::HostileArgs),
    /// A whole stack from nothing to READY.
    #[command(after_help = "Example: kerbside bench start --repeats 10")]
    Start(start::StartArgs),
    /// Recorded readings through ingest and estimator in one process, against real time.
    #[command(after_help = "Example: kerbside bench replay --minutes 60")]
    Replay(replay::ReplayBenchArgs),
    /// A step of the pose filter, against the same arithmetic in C++.
    #[command(after_help = "Example: kerbside bench filter --blocks 40")]
    Filter(filter::FilterArgs),
    /// The other process of `transport`.
    #[command(hide = true)]
    Peer(peer::PeerArgs),
    /// The rogue of `hostile`.
    #[command(hide = true)]
    Rogue(hostile::RogueArgs),
    /// A process of the bare chain of `pipeline`.
    #[command(hide = true)]
    Link(chain::LinkArgs),
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the measurement cannot be set up.
pub fn run(verb: &BenchVerb) -> Result<Exit, Failure> {
    match verb {
        BenchVerb::Transport(args) => transport::run(args),
        BenchVerb::Pipeline(args) => pipeline::run(args),
        BenchVerb::Tools(args) => tools::run(args),
        BenchVerb::Hostile(args) => hostile::run(args),
        BenchVerb::Rogue(args) => hostile::run_rogue(args),
        BenchVerb::Start(args) => start::run(args),
        BenchVerb::Replay(args) => replay::run(args),
        BenchVerb::Filter(args) => filter::run(args),
        BenchVerb::Peer(args) => peer::run(args),
        BenchVerb::Link(args) => chain::run_link(args),
    }
}

/// A command that runs this very executable.
fn own_executable() -> Command {
    let mut command = Command::new("/proc/self/exe");
    command.arg0("kerbside");
    command
}
