//! The command line: a file per verb.

mod completions;
mod config;
mod fix;
mod go;
mod man;
mod operator;
mod recording;
mod status;
mod up;

pub(crate) use status::object as status_object;

use clap::{Parser, Subcommand};
use kerbside_messages::Process;
use kerbside_runtime::Instance;

pub use status::instance_of;

use crate::bindings::BindingsVerb;
use crate::calibrate::CalibrateArgs;
use crate::compare::CompareVerb;
use crate::diagnose::DiagnoseArgs;
use crate::doctor::DoctorArgs;
use crate::exit::{Exit, Failure};
use crate::park::ParkArgs;
use crate::replay::ReplayArgs;
use crate::reproduce::ReproduceArgs;
use crate::service::{Service, ServiceArgs};
use crate::simulate::SimulateArgs;
use crate::soak::SoakArgs;
use crate::tools;
use crate::trial::TrialArgs;
use crate::vehicle::VehicleArgs;
use crate::{
    actuation, estimator, gateway, ingest, interface, logging, park, planner, recorder, tracker,
    vehicle,
};

/// Name of the instance of `up`, and of services started by hand.
pub const DEFAULT_INSTANCE: &str = "kerbside";

/// Parks a car-like vehicle from its own wheel encoders, as real-time processes on shared memory.
#[derive(Debug, Parser)]
#[command(
    name = "kerbside",
    version,
    max_term_width = 100,
    after_help = "Example: kerbside park garage"
)]
pub struct Cli {
    /// Least severity that is logged on standard error; RUST_LOG goes before it.
    #[arg(long, global = true, value_name = "LEVEL", value_parser = log_levels())]
    log: Option<String>,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Park the simulated vehicle in a scenario and judge the result.
    #[command(after_help = "Example: kerbside park parallel --seed 3 --out /tmp/parallel")]
    Park(ParkArgs),
    /// Run the stack until Ctrl-C.
    #[command(after_help = "Example: kerbside up --config config/stack.toml --simulate")]
    Up(up::UpArgs),
    /// Arm: permit motion for the next plan.
    #[command(after_help = "Example: kerbside arm")]
    Arm(operator::OperatorArgs),
    /// Stop the vehicle; the stack stays up.
    #[command(after_help = "Example: kerbside stop")]
    Stop(operator::OperatorArgs),
    /// Stop the vehicle and end the stack.
    #[command(after_help = "Example: kerbside down --instance bay2")]
    Down(operator::OperatorArgs),
    /// Tell the estimator where the standing vehicle is.
    #[command(after_help = "Example: kerbside fix -- -1.0 0.65 0")]
    Fix(fix::FixArgs),
    /// Arm, drive to a goal, and say when the vehicle is there; Ctrl-C stops it.
    #[command(after_help = go::EXAMPLES)]
    Go(go::GoArgs),
    /// Show each process and the mode, live from shared memory.
    #[command(after_help = "Example: kerbside status --json")]
    Status(status::StatusArgs),
    /// List every topic with who takes part in it and how often it comes.
    #[command(after_help = "Example: kerbside topics")]
    Topics(tools::TopicsArgs),
    /// Print the samples of a topic as they come.
    #[command(after_help = "Example: kerbside echo odometry --fields x,y,yaw,state --count 5")]
    Echo(tools::EchoArgs),
    /// Measure how often topics come, how evenly, how old, and what of them is lost.
    #[command(after_help = "Example: kerbside hz raw odometry command --window 5")]
    Hz(tools::HzArgs),
    /// Watch processes and topics; q quits. In a pipe: one table.
    #[command(after_help = "Example: kerbside top --interval 0.5")]
    Top(tools::TopArgs),
    /// Feed recorded readings through ingest and estimator, and say how far the odometry drifts.
    #[command(after_help = "Example: kerbside replay tests/data/cases/paper-1-6 --speed 10")]
    Replay(ReplayArgs),
    /// Identify radii, tracks, wheelbase and steering offset from recorded runs, and write them down.
    #[command(after_help = "Example: kerbside calibrate CASE --leave-out straight-5,circle-5")]
    Calibrate(CalibrateArgs),
    /// Predict from commands what every sensor of recorded runs shows, with effects added to the vehicle or without.
    #[command(
        after_help = "Example: kerbside simulate CASE --runs CASE/holdout --model overlay.toml --out /tmp/after"
    )]
    Simulate(SimulateArgs),
    /// Say where simulator and vehicle part, which effect causes it, and how far the gap shrinks.
    #[command(after_help = "Example: kerbside diagnose CASE --out /tmp/diagnosis")]
    Diagnose(DiagnoseArgs),
    /// Repeat the paper's experiments on the proving ground, and hold them against what they are to show.
    #[command(after_help = "Example: kerbside reproduce --trials 400 --out /tmp/paper")]
    Reproduce(ReproduceArgs),
    /// Diagnose cases with secret causes, then open them and say how often that was right.
    #[command(after_help = "Example: kerbside trial --cases 60 --seed 1 --out /tmp/trial")]
    Trial(TrialArgs),
    /// Compare ways of doing the same, side by side.
    #[command(subcommand, after_help = "Example: kerbside compare filters --trials 100")]
    Compare(CompareVerb),
    /// Check, show or explain the configuration.
    #[command(subcommand, after_help = "Example: kerbside config check")]
    Config(config::ConfigVerb),
    /// Check or recover a recording.
    #[command(subcommand, after_help = "Example: kerbside recording check recording.mcap")]
    Recording(recording::RecordingVerb),
    /// Measure hops, the pipeline and the start, and hold them against limits.
    #[command(subcommand, after_help = "Example: kerbside bench transport --json")]
    Bench(crate::bench::BenchVerb),
    /// Print the layouts of all messages for another language.
    #[command(
        subcommand,
        after_help = "Example: kerbside bindings python --out kerbside_messages.py"
    )]
    Bindings(BindingsVerb),
    /// Drive again and again under faults, and hold the stack against what no fault may break.
    #[command(after_help = crate::soak::EXAMPLES)]
    Soak(SoakArgs),
    /// Say what this machine has and lacks for kerbside, and what to do about it.
    #[command(after_help = "Example: kerbside doctor --config /etc/kerbside/stack.toml")]
    Doctor(DoctorArgs),
    /// Print a shell's completions of every verb and option.
    #[command(after_help = "Example: kerbside completions bash > ~/.bash_completion.d/kerbside")]
    Completions(completions::CompletionsArgs),
    /// Print the manual page, or write one per verb.
    #[command(after_help = "Example: kerbside man --out ~/.local/share/man/man1")]
    Man(man::ManArgs),
    /// Run one process of a stack; the supervisor starts them by itself.
    #[command(subcommand, after_help = "Example: kerbside service tracker --instance bay2")]
    Service(ServiceVerb),
}

#[derive(Debug, Subcommand)]
enum ServiceVerb {
    /// The line to the vehicle.
    #[command(after_help = "Example: kerbside service interface --instance bay2")]
    Interface(ServiceArgs),
    /// Counts to travel.
    #[command(after_help = "Example: kerbside service ingest --instance bay2")]
    Ingest(ServiceArgs),
    /// Travel to pose.
    #[command(after_help = "Example: kerbside service estimator --instance bay2")]
    Estimator(ServiceArgs),
    /// Requests to plans.
    #[command(after_help = "Example: kerbside service planner --instance bay2")]
    Planner(ServiceArgs),
    /// Pose and plan to command.
    #[command(after_help = "Example: kerbside service tracker --instance bay2")]
    Tracker(ServiceArgs),
    /// The gate before the vehicle.
    #[command(after_help = "Example: kerbside service actuation --instance bay2")]
    Actuation(ServiceArgs),
    /// Samples to disk.
    #[command(after_help = "Example: kerbside service recorder --instance bay2")]
    Recorder(ServiceArgs),
    /// The door for processes of other users.
    #[command(after_help = "Example: kerbside service gateway --instance bay2")]
    Gateway(ServiceArgs),
    /// The simulated vehicle, outside the supervised set.
    #[command(after_help = "Example: kerbside service vehicle --instance bay2 --start=-1,0.65,0")]
    Vehicle(VehicleArgs),
}

/// Runs what the command line says.
///
/// # Errors
/// [`Failure`] with its exit code.
pub fn run(cli: &Cli) -> Result<Exit, Failure> {
    let level = cli.log.as_deref();
    outlive_file_limits()?;
    match &cli.verb {
        Verb::Park(args) => {
            let level = level.unwrap_or("warn");
            logging::start("park", level, false);
            park::run(&ParkArgs { log: Some(level.to_owned()), ..args.clone() })
        }
        Verb::Replay(args) => {
            let level = level.unwrap_or("warn");
            logging::start("replay", level, false);
            crate::replay::run(&ReplayArgs { log: Some(level.to_owned()), ..args.clone() })
        }
        Verb::Calibrate(args) => logged("calibrate", level, || crate::calibrate::run(args)),
        Verb::Simulate(args) => logged("simulate", level, || crate::simulate::run(args)),
        Verb::Diagnose(args) => logged("diagnose", level, || crate::diagnose::run(args)),
        Verb::Reproduce(args) => logged("reproduce", level, || crate::reproduce::run(args)),
        Verb::Trial(args) => logged("trial", level, || crate::trial::run(args)),
        Verb::Compare(verb) => logged("compare", level, || crate::compare::run(verb)),
        Verb::Up(args) => up::run(args, level),
        Verb::Service(verb) => serve(verb, level),
        Verb::Bench(verb) => logged("bench", level, || crate::bench::run(verb)),
        Verb::Soak(args) => logged("soak", level, || crate::soak::run(args)),
        Verb::Arm(_)
        | Verb::Stop(_)
        | Verb::Down(_)
        | Verb::Fix(_)
        | Verb::Go(_)
        | Verb::Status(_) => {
            logging::start("operator", level.unwrap_or("warn"), false);
            kerbside_runtime::end_on_broken_pipe();
            operate(&cli.verb)
        }
        Verb::Topics(_) | Verb::Echo(_) | Verb::Hz(_) | Verb::Top(_) => {
            logged("operator", level, || look(&cli.verb))
        }
        Verb::Config(_)
        | Verb::Recording(_)
        | Verb::Bindings(_)
        | Verb::Doctor(_)
        | Verb::Completions(_)
        | Verb::Man(_) => {
            logging::start("kerbside", level.unwrap_or("warn"), false);
            kerbside_runtime::end_on_broken_pipe();
            tell(&cli.verb)
        }
    }
}

/// A file that may not grow is an error to report, no reason to die.
fn outlive_file_limits() -> Result<(), Failure> {
    let ignored = std::sync::Arc::default();
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, ignored)
        .map(|_| ())
        .map_err(Failure::internal)
}

/// Runs a verb that logs as `name`, warnings and worse where no level is given.
fn logged(
    name: &'static str,
    level: Option<&str>,
    verb: impl FnOnce() -> Result<Exit, Failure>,
) -> Result<Exit, Failure> {
    logging::start(name, level.unwrap_or("warn"), false);
    verb()
}

/// Verbs that look at a running stack.
fn look(verb: &Verb) -> Result<Exit, Failure> {
    match verb {
        Verb::Topics(args) => tools::topics(args),
        Verb::Echo(args) => tools::echo(args),
        Verb::Hz(args) => tools::hz(args),
        Verb::Top(args) => tools::top(args),
        _ => Err(Failure::internal("not a tool")),
    }
}

/// Verbs that need no stack: they tell of files and of the machine.
fn tell(verb: &Verb) -> Result<Exit, Failure> {
    match verb {
        Verb::Config(verb) => config::run(verb),
        Verb::Recording(verb) => recording::run(verb),
        Verb::Bindings(verb) => crate::bindings::run(verb),
        Verb::Doctor(args) => crate::doctor::run(args),
        Verb::Completions(args) => completions::run(args),
        Verb::Man(args) => man::run(args),
        _ => Err(Failure::internal("not a verb that tells")),
    }
}

fn operate(verb: &Verb) -> Result<Exit, Failure> {
    use kerbside_messages::Verb as Ask;
    match verb {
        Verb::Arm(args) => operator::ask(args, Ask::Arm),
        Verb::Stop(args) => operator::ask(args, Ask::Stop),
        Verb::Down(args) => operator::ask(args, Ask::Down),
        Verb::Fix(args) => fix::run(args),
        Verb::Go(args) => go::run(args),
        Verb::Status(args) => status::run(args),
        _ => Err(Failure::internal("not an operator's verb")),
    }
}

/// What a supervised process does.
type Body = fn(&Service) -> Result<Exit, Failure>;

fn serve(verb: &ServiceVerb, level: Option<&str>) -> Result<Exit, Failure> {
    let (process, args, body): (_, _, Body) = match verb {
        ServiceVerb::Interface(args) => (Process::Interface, args, interface::run),
        ServiceVerb::Ingest(args) => (Process::Ingest, args, ingest::run),
        ServiceVerb::Estimator(args) => (Process::Estimator, args, estimator::run),
        ServiceVerb::Planner(args) => (Process::Planner, args, planner::run),
        ServiceVerb::Tracker(args) => (Process::Tracker, args, tracker::run),
        ServiceVerb::Actuation(args) => (Process::Actuation, args, actuation::run),
        ServiceVerb::Recorder(args) => (Process::Recorder, args, recorder::run),
        ServiceVerb::Gateway(args) => (Process::Gateway, args, gateway::run),
        ServiceVerb::Vehicle(args) => {
            let service = Service::load(Process::Vehicle, &args.service, DEFAULT_INSTANCE)?;
            start_log(&service, level);
            let instance = service.instance.clone();
            return leave(&instance, vehicle::run(args, service));
        }
    };
    let service = Service::load(process, args, DEFAULT_INSTANCE)?;
    start_log(&service, level);
    leave(&service.instance, body(&service))
}

/// Where a process ends that no supervisor survives, nothing of the instance is to stay.
fn leave(instance: &Instance, ended: Result<Exit, Failure>) -> Result<Exit, Failure> {
    if let Err(error) = instance.remove_if_deserted() {
        tracing::warn!(%error, "something of the instance is left");
    }
    ended
}

fn start_log(service: &Service, level: Option<&str>) {
    let log = &service.stack.log;
    let json = log.format == kerbside_settings::LogFormat::Json;
    logging::start(service.process.name(), level.unwrap_or(log.level.name()), json);
}

/// Whether the verb was given --json; for verbs that know it.
#[must_use]
pub fn asks_for_json(matches: &clap::ArgMatches) -> bool {
    match matches.subcommand() {
        Some((_, matches)) => asks_for_json(matches),
        None => matches.try_get_one("json").is_ok_and(|given| given == Some(&true)),
    }
}

fn log_levels() -> clap::builder::PossibleValuesParser {
    kerbside_settings::LogLevel::NAMES.iter().copied().into()
}
