//! `park`: the main job. Runs a scenario, live or in lockstep, judges it, and tells.

pub mod judge;
pub mod live;
mod progress;
mod report;
pub mod scene;
pub mod simulated;
mod summary;
pub mod trace;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use kerbside_messages::{Nanos, Plan, Process, TrajectoryPoint};
use kerbside_runtime::Instance;
use kerbside_settings::Scenario;

use crate::exit::{Exit, Failure};
use crate::lockstep::Schedule;
use crate::manoeuvre::End;
use crate::service::{Service, ServiceArgs};
use crate::vehicle::{Plant, PlantArgs};
use crate::{configuration, output};
use judge::{Verdict, judge};
use progress::Progress;
use trace::{Followed, HappeningKind, Trace};

/// What `park` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct ParkArgs {
    /// Scenario: garage, parallel, garage-full-size, parallel-full-size, or a file.
    pub scenario: String,
    /// Run the same stages in one thread on simulated time: deterministic per seed.
    #[arg(long)]
    pub lockstep: bool,
    /// Seed of the disturbed start and of the sensors' noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Run so many seeds, from --seed on, and hold their means against the figures.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: u32,
    /// After a fault, arm again, plan anew and complete the manoeuvre.
    #[arg(long)]
    pub rearm: bool,
    /// Vehicle, in place of the scenario's: a file, or the name of a shipped one.
    #[arg(long, value_name = "FILE")]
    pub vehicle: Option<String>,
    /// What is simulated.
    #[command(flatten)]
    pub plant: PlantArgs,
    /// Configuration: a stack's file, or a folder like config/.
    #[arg(long, value_name = "PATH")]
    pub config: Option<PathBuf>,
    /// Name of the instance; a fresh one where not given.
    #[arg(long, value_name = "NAME")]
    pub instance: Option<String>,
    /// Folder for report, picture and recording; a new one in the state folder where not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Show no live progress.
    #[arg(long)]
    pub headless: bool,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
    /// Level of the processes' log.
    #[arg(skip)]
    pub log: Option<String>,
}

impl ParkArgs {
    /// One run of a scenario that another verb asks for, as processes, without a word on the terminal.
    #[must_use]
    pub fn of(scenario: &str) -> Self {
        Self {
            scenario: scenario.to_owned(),
            lockstep: false,
            seed: 1,
            runs: 1,
            rearm: false,
            vehicle: None,
            plant: PlantArgs::default(),
            config: None,
            instance: None,
            out: None,
            headless: true,
            json: false,
            log: None,
        }
    }
}

/// A manoeuvre to run.
#[derive(Clone, Debug)]
pub struct Job {
    /// Instance and configuration.
    pub service: Service,
    /// The scenario.
    pub scenario: Scenario,
    /// The seed.
    pub seed: u64,
    /// Arm again after a fault.
    pub rearm: bool,
    /// What is simulated.
    pub plant: Plant,
    /// The same, as a child is told.
    pub plant_arguments: Vec<OsString>,
    /// In one thread.
    pub lockstep: bool,
    /// Where to record; none in lockstep.
    pub recording: Option<PathBuf>,
    /// How to repeat it.
    pub command_line: String,
    /// The files it was configured by.
    pub configuration: Vec<String>,
}

impl Job {
    /// How it runs, for people.
    #[must_use]
    pub fn run_in_words(&self) -> &'static str {
        if self.lockstep { "in lockstep" } else { "as processes" }
    }
}

/// What was seen of a manoeuvre.
#[derive(Clone, Debug)]
pub struct Run {
    /// Everything seen.
    pub trace: Trace,
    /// How it ended.
    pub end: End,
    /// The recording.
    pub recording: Option<PathBuf>,
    /// The instance; none in lockstep.
    pub instance: Option<String>,
    /// Wall time \[s\].
    pub wall_seconds: f64,
    /// Wall time of searches in it \[s\], where they ran in this thread.
    pub search_seconds: f64,
    /// Simulated time \[s\]; 0 live.
    pub simulated_seconds: f64,
}

/// A manoeuvre with its verdict.
#[derive(Debug)]
pub struct Finished {
    /// What was asked.
    pub job: Job,
    /// What was seen.
    pub run: Run,
    /// What came of it.
    pub verdict: Verdict,
    /// The report; none where it could not be written.
    pub report: Option<PathBuf>,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the configuration is refused or the stack cannot run.
pub fn run(args: &ParkArgs) -> Result<Exit, Failure> {
    let folder = output::place(args.out.as_deref(), "park")?;
    let mut finished = Vec::new();
    for index in 0..args.runs {
        let seed = args.seed + u64::from(index);
        let folder = if args.runs == 1 { folder.clone() } else { folder.join(seed.to_string()) };
        let one = run_one(args, seed, &folder)?;
        let interrupted = one.run.end == End::Interrupted;
        finished.push(one);
        if interrupted {
            break;
        }
    }
    Ok(summary::tell(args, &finished))
}

fn run_one(args: &ParkArgs, seed: u64, folder: &Path) -> Result<Finished, Failure> {
    let job = job(args, seed, folder)?;
    // Only now, so that what is refused leaves no folder behind.
    output::make(folder)?;
    let run = if job.lockstep {
        simulated::run(&job, Schedule::default())?
    } else {
        let progress = Progress::new(args.headless);
        progress.say(&format!("instance {}", job.service.instance.name()));
        let run = live::run(&job, &progress);
        progress.clear();
        run?
    };
    let verdict = judge(&run.trace, &job.scenario, &job.service.vehicle, run.end);
    let told = report::of(&job, &run, &verdict);
    let report = folder.join("report.html");
    let page = told.render().map_err(Failure::internal)?;
    let written = output::write(&report, &page)
        .and_then(|()| output::write(&folder.join("picture.svg"), &told.picture()));
    // A full disk costs what would be on it; the car has parked all the same.
    let failed = |failure: &Failure| tracing::error!("no report: {}", failure.report);
    let report = written.inspect_err(failed).ok().map(|()| report);
    Ok(Finished { job, run, verdict, report })
}

/// Runs `job` as processes, without showing how far it is.
///
/// # Errors
/// [`Failure`] where the stack cannot be started.
pub fn run_live(job: &Job) -> Result<Run, Failure> {
    live::run(job, &Progress::new(true))
}

/// The job that `args` describe for one seed.
///
/// # Errors
/// [`Failure`] where the configuration is refused.
pub fn job(args: &ParkArgs, seed: u64, folder: &Path) -> Result<Job, Failure> {
    let parking =
        configuration::parking(args.config.as_deref(), &args.scenario, args.vehicle.as_deref())?;
    let name = args.instance.clone().unwrap_or_else(|| Instance::fresh_name("park"));
    let recording = (!args.lockstep && parking.stack.value.recorder.enabled)
        .then(|| live::recording_in(folder));
    let service_args = ServiceArgs {
        instance: Some(name.clone()),
        config: args.config.clone(),
        scenario: Some(args.scenario.clone()),
        vehicle: args.vehicle.clone(),
        recording: recording.clone(),
        realtime: crate::realtime::wanted(&parking.stack.value)?,
        simulated: true,
        log: args.log.clone(),
        ..ServiceArgs::default()
    };
    let service = Service::load(Process::Operator, &service_args, &name)?;
    let plant = args.plant.load(&service)?;
    Ok(Job {
        service,
        scenario: parking.scenario.value,
        seed,
        rearm: args.rearm,
        plant_arguments: args.plant.arguments(),
        lockstep: args.lockstep,
        recording,
        command_line: command_line(args, seed),
        configuration: [
            parking.scenario.file,
            parking.stack.file,
            parking.stack.value.vehicle_file,
        ]
        .into_iter()
        .chain(plant.files.iter().cloned())
        .collect(),
        plant,
    })
}

fn command_line(args: &ParkArgs, seed: u64) -> String {
    let mut words =
        vec!["kerbside park".to_owned(), output::quoted(&args.scenario), format!("--seed {seed}")];
    words.extend(args.lockstep.then(|| "--lockstep".to_owned()));
    words.extend(args.rearm.then(|| "--rearm".to_owned()));
    words.extend(args.vehicle.as_ref().map(|vehicle| format!("--vehicle {vehicle}")));
    words.extend(args.plant.arguments().iter().map(output::quoted));
    words.extend(args.config.as_ref().map(|config| format!("--config {}", output::quoted(config))));
    words.join(" ")
}

/// Notes a plan that was published.
fn take_plan(trace: &mut Trace, at: Nanos, head: &Plan, points: &[TrajectoryPoint]) {
    if trace
        .plans
        .iter()
        .any(|plan| plan.head.header.epoch == head.header.epoch && plan.head.id == head.id)
    {
        return;
    }
    let (length, seconds, changes) = (head.length, head.duration, head.gear_changes);
    let words =
        format!("plan {}: {length:.2} m in {seconds:.1} s, gear changes: {changes}", head.id);
    trace.note(at, HappeningKind::Plan, words);
    trace.plans.push(Followed { head: *head, points: points.to_vec(), begun: None });
}
