//! `replay`: recorded readings through ingest and estimator, and how far the odometry drifts from a reference.

mod chain;
mod comparison;
mod filters;
mod input;
mod learning;
mod live;
mod order;
mod pure;
mod report;
pub mod sensing;
mod summary;
mod track;
mod uptake;

pub use filters::{FilterDrift, Filtered, by_filters, drift_within};
pub use input::{Described, Input, describe, find, only_source};
pub use order::{Order, Place};
pub use uptake::Uptaker;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kerbside_messages::{Process, Raw};
use kerbside_recordings::input::Source;
use kerbside_runtime::Instance;

use crate::exit::{Exit, Failure};
use crate::output;
use crate::service::{Service, ServiceArgs, check_speed};
use comparison::Comparison;
use learning::Lesson;
use track::Track;

/// What `replay` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct ReplayArgs {
    /// A run folder, a case folder with several runs, or an .mcap recording.
    pub path: PathBuf,
    /// Speed against real time; without it as fast as it goes.
    #[arg(long, value_name = "FACTOR", conflicts_with = "pure")]
    pub speed: Option<f64>,
    /// Run the stages in this process alone, without starting a stack: the same odometry, bit for bit.
    #[arg(long)]
    pub pure: bool,
    /// Give the reference up to this share of the drive's time to the estimator as fixes, and judge it on the rest.
    #[arg(long, value_name = "SHARE", requires = "pure", value_parser = learning::parse_share)]
    pub fixes: Option<f64>,
    /// Fixes per second.
    #[arg(long, value_name = "HZ", default_value_t = 2.0, requires = "fixes",
          value_parser = learning::parse_rate)]
    pub fix_rate: f64,
    /// Vehicle, in place of the input's own: a file, or the name of a shipped one.
    #[arg(long, value_name = "FILE")]
    pub vehicle: Option<String>,
    /// Configuration: a stack's file, or a folder like config/.
    #[arg(long, value_name = "PATH")]
    pub config: Option<PathBuf>,
    /// Name of the instance; a fresh one where not given.
    #[arg(long, value_name = "NAME", conflicts_with = "pure")]
    pub instance: Option<String>,
    /// Folder for report, picture and recording; a new one in the state folder where not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
    /// Level of the log.
    #[arg(skip)]
    pub log: Option<String>,
}

/// A drive to replay.
#[derive(Debug)]
struct Job {
    service: Service,
    input: Input,
    command_line: String,
    /// When its input began to be read.
    begun: Instant,
}

/// Drive time over processing time.
#[derive(Clone, Copy, Debug)]
pub struct Speeds {
    /// Everything from opening the files to the hash, in one process.
    pub files: f64,
    /// The stages and the checks between them, the readings being in memory.
    pub memory: f64,
    /// From the first estimate to the last, through processes; none in one process.
    pub live: Option<f64>,
}

/// How fast the drive at `path` goes through the stages in this process.
///
/// # Errors
/// [`Failure`] where the input is refused.
pub fn speeds_of(path: &Path) -> Result<Speeds, Failure> {
    let name = Instance::fresh_name("bench");
    let input = Some(path.to_owned());
    let service_args = ServiceArgs { input, ..ServiceArgs::default() };
    let service = Service::load(Process::Operator, &service_args, &name)?;
    let begun = Instant::now();
    let input = Input::open(&only_source(path)?, None)?;
    let pure = pure::run(&service, &input.raws)?;
    let hash = pure.track.sha256();
    let wall = begun.elapsed().as_secs_f64();
    tracing::info!(hash, "replayed");
    let duration = duration_of(&input.raws);
    Ok(Speeds { files: duration / wall, memory: duration / pure.seconds, live: None })
}

/// From the first reading to the last \[s\].
fn duration_of(raws: &[Raw]) -> f64 {
    match raws {
        [first, .., last] => kerbside_messages::seconds(last.arrival.saturating_sub(first.arrival)),
        _ => 0.0,
    }
}

/// A drive that was replayed.
#[derive(Debug)]
struct Finished {
    job: Job,
    track: Track,
    hash: String,
    /// Of the recorded drive \[s\].
    duration: f64,
    /// What each wheel had rolled with each sample \[m\].
    rolled: Vec<[f64; 4]>,
    refusals: Vec<(&'static str, u64)>,
    comparison: Comparison,
    /// The same drive with fixes, where they were asked for.
    lesson: Option<Lesson>,
    speeds: Speeds,
    problem: Option<String>,
    notes: Vec<String>,
    recording: Option<PathBuf>,
    report: PathBuf,
}

/// A drive of several, and what came of it.
#[derive(Debug)]
struct Outcome {
    input: PathBuf,
    result: Result<Box<Finished>, Failure>,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the input is refused or the stack cannot run.
pub fn run(args: &ReplayArgs) -> Result<Exit, Failure> {
    check_speed(args.speed)?;
    let sources = find(&args.path)?;
    let folder = output::folder(args.out.as_deref(), "replay")?;
    if let [source] = &sources[..] {
        let finished = run_one(args, source, &folder)?;
        return Ok(summary::tell_one(args, &finished));
    }
    let mut outcomes = Vec::new();
    for source in &sources {
        let input = path_of(source).to_owned();
        let name = input.file_name().unwrap_or_default();
        let folder = output::folder(Some(&folder.join(name)), "replay")?;
        let result = run_one(args, source, &folder).map(Box::new);
        let interrupted =
            result.as_ref().is_ok_and(|one| one.problem.as_deref() == Some(live::INTERRUPTED));
        outcomes.push(Outcome { input, result });
        if interrupted {
            break;
        }
    }
    Ok(summary::tell_many(args, &folder, &outcomes, sources.len()))
}

fn path_of(source: &Source) -> &Path {
    match source {
        Source::Run(path) | Source::Recording(path) => path,
    }
}

fn run_one(args: &ReplayArgs, source: &Source, folder: &Path) -> Result<Finished, Failure> {
    let mut job = job(args, source, folder)?;
    let raws = &job.input.raws;
    let duration = duration_of(raws);
    let pure = pure::run(&job.service, raws)?;
    let hash = pure.track.sha256();
    let files = duration / job.begun.elapsed().as_secs_f64();
    let mut speeds = Speeds { files, memory: duration / pure.seconds, live: None };
    let (mut track, mut problem, mut notes) = (pure.track, None, job.input.notices.clone());
    let mut recording = None;
    let mut heard = hash.clone();
    if !args.pure {
        let progress = progress(track.len());
        let live = live::run(&job.service, raws, track.len(), &progress);
        progress.finish_and_clear();
        let live = live?;
        heard = live.track.sha256();
        problem = live.problem.or_else(|| {
            (heard != hash).then(|| "the odometry is not what one process computes".to_owned())
        });
        speeds.live = Some(duration / live.seconds);
        notes.extend(live.notes);
        recording = job.service.args.recording.clone().filter(|path| path.is_file());
        track = live.track;
    }
    let comparison = Comparison::of(&job.input, &track)?;
    notes.extend(comparison.notes(&job.input, &track));
    let asked = args.fixes.map(|share| learning::Asked { share, rate: args.fix_rate });
    let lesson = match asked {
        Some(asked) => Some(learning::learn(&mut job, &comparison, &track, &asked)?),
        None => None,
    };
    let report = folder.join("report.html");
    let finished = Finished {
        job,
        track,
        hash: heard,
        duration,
        rolled: pure.rolled,
        refusals: pure.refusals,
        comparison,
        lesson,
        speeds,
        problem,
        notes,
        recording,
        report,
    };
    let told = report::of(&finished);
    output::write(&finished.report, &told.render().map_err(Failure::internal)?)?;
    output::write(&folder.join("picture.svg"), &told.picture())?;
    Ok(finished)
}

fn job(args: &ReplayArgs, source: &Source, folder: &Path) -> Result<Job, Failure> {
    let begun = Instant::now();
    let input = Input::open(source, args.vehicle.as_deref())?;
    // The children read the vehicle from here: they need not know where it came from.
    let vehicle = folder.join("vehicle.toml");
    output::write(&vehicle, &input.drive.vehicle().text)?;
    let name = args.instance.clone().unwrap_or_else(|| Instance::fresh_name("replay"));
    let service_args = ServiceArgs {
        instance: Some(name.clone()),
        config: args.config.clone(),
        vehicle: Some(vehicle.display().to_string()),
        recording: Some(folder.join("recording.mcap")),
        input: Some(path_of(source).to_owned()),
        sensors: Some(input.sensors),
        speed: args.speed,
        log: args.log.clone(),
        ..ServiceArgs::default()
    };
    let mut service = Service::load(Process::Operator, &service_args, &name)?;
    if !service.stack.recorder.enabled {
        service.args.recording = None;
    }
    Ok(Job { service, input, command_line: command_line(args, source), begun })
}

fn command_line(args: &ReplayArgs, source: &Source) -> String {
    let mut words = vec!["kerbside replay".to_owned(), output::quoted(path_of(source))];
    words.extend(args.pure.then(|| "--pure".to_owned()));
    words.extend(args.speed.map(|speed| format!("--speed {speed}")));
    let fixes = |share: f64| format!("--fixes {share} --fix-rate {}", args.fix_rate);
    words.extend(args.fixes.map(fixes));
    words.extend(args.vehicle.as_ref().map(|vehicle| format!("--vehicle {vehicle}")));
    words.extend(args.config.as_ref().map(|config| format!("--config {}", output::quoted(config))));
    words.join(" ")
}

/// A bar on a terminal, nothing in a pipe.
fn progress(estimates: usize) -> ProgressBar {
    let bar = ProgressBar::new(estimates as u64);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} estimates, {elapsed}") {
        bar.set_style(style);
    }
    bar
}

impl Finished {
    /// How it ran, for people.
    fn mode_in_words(&self) -> String {
        match (self.speeds.live, self.job.service.args.speed) {
            (None, _) => "in one process".to_owned(),
            (Some(_), None) => "through processes, as fast as it goes".to_owned(),
            (Some(_), Some(speed)) => format!("through processes, at {speed} times real time"),
        }
    }

    /// Its speed against real time.
    fn speed_factor(&self) -> f64 {
        self.speeds.live.unwrap_or(self.speeds.files)
    }
}
