//! `calibrate`: the systematic errors of a vehicle's odometry, identified from its recorded runs, and judged on runs
//! that the fit has not seen.

mod drift;
mod fit;
mod input;
mod judge;
pub(crate) mod output;
mod report;
mod split;
mod summary;

use std::io::IsTerminal;
use std::path::PathBuf;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kerbside_calibration::{LeftOut, Parameters, Rejected, Run, Settings, diagnose_runs};

use crate::exit::{Exit, Failure};
use crate::figures::Figure;
use crate::output as folders;
use drift::RunDrift;
use fit::Found;
use input::Case;
use judge::Rms;
use output::Provenance;

/// What `calibrate` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct CalibrateArgs {
    /// A case folder: vehicle.toml, and runs/ with a folder per run.
    pub case: PathBuf,
    /// How the parameters are identified.
    #[arg(long, value_enum, default_value_t = Method::Joint)]
    pub method: Method,
    /// Fit these runs alone, and judge the result on the others.
    #[arg(long, value_name = "NAME", num_args = 1.., value_delimiter = ',', conflicts_with = "leave_out")]
    pub runs: Vec<String>,
    /// Leave these runs out of the fit, and judge the result on them; without it runs take turns.
    #[arg(long, value_name = "NAME", num_args = 1.., value_delimiter = ',')]
    pub leave_out: Vec<String>,
    /// Cut each run at this share of its time: fit the beginnings, and judge the result on the ends.
    #[arg(long, value_name = "SHARE", value_parser = split::parse_share, conflicts_with_all = ["runs", "leave_out"])]
    pub split: Option<f64>,
    /// Identify the steering sensor's gain, too: it takes circles of at least two radii.
    #[arg(long)]
    pub free_gain: bool,
    /// Identify the place of the reference's marker on the vehicle, too: it takes curves to both sides.
    #[arg(long)]
    pub free_marker: bool,
    /// The reference's stamps may be late or early by about so much, another time in every run.
    #[arg(long, value_name = "SECONDS", value_parser = parse_time, default_value_t = 0.0)]
    pub lag: f64,
    /// And by so much more after a second, growing with the square root of time: a clock that wanders.
    #[arg(long, value_name = "SECONDS", value_parser = parse_time, default_value_t = 0.0, requires = "lag")]
    pub wander: f64,
    /// Folder for vehicle.toml and report; a new one in the state folder where not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// How parameters are identified.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Method {
    /// The paper's: straights give the radii, arcs the tracks.
    ClosedForm,
    /// Least squares over all runs and samples.
    Joint,
}

impl Method {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::ClosedForm => "closed-form",
            Self::Joint => "joint",
        }
    }
}

/// A calibration, and how good it is.
#[derive(Debug)]
pub struct Calibration {
    case: Case,
    method: Method,
    settings: Settings,
    found: Found,
    /// Runs that were left out by name; none: runs took turns.
    named: Option<Vec<String>>,
    /// End errors of runs that the fit which judges them has not seen.
    left_out: Vec<LeftOut>,
    /// The same of runs that the fit rejected though they can be used: they do not count, and are shown.
    outliers: Vec<LeftOut>,
    /// Drift of the runs left out, and of the outliers, by the estimator's odometry.
    drifts: Vec<RunDrift>,
    outlier_drifts: Vec<RunDrift>,
    /// Calibrated vehicle.toml; none where nothing was identified.
    vehicle: Option<PathBuf>,
    report: PathBuf,
    command_line: String,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the case is refused, by run and evidence.
pub fn run(args: &CalibrateArgs) -> Result<Exit, Failure> {
    let progress = progress();
    let calibration = calibrated(args, &progress);
    progress.finish_and_clear();
    let calibration = calibration?;
    let told = report::of(&calibration);
    folders::write(&calibration.report, &told.render().map_err(Failure::internal)?)?;
    Ok(summary::tell(args, &calibration))
}

fn calibrated(args: &CalibrateArgs, progress: &ProgressBar) -> Result<Calibration, Failure> {
    progress.set_message("reading the runs");
    let mut case = Case::read(&args.case)?;
    let named = match args.split {
        Some(share) => Some(split_runs(&mut case, share)),
        None => left_out_by_name(args, &case.runs)?,
    };
    let vehicle = case.vehicle();
    let is_out = |run: &&Run| named.as_ref().is_some_and(|named| named.contains(&run.name));
    let (out, fitted): (Vec<&Run>, Vec<&Run>) = case.runs.iter().partition(is_out);
    let fitted: Vec<Run> = fitted.into_iter().cloned().collect();
    let mut settings = Settings::of(vehicle);
    (settings.free_gain, settings.free_marker) = (args.free_gain, args.free_marker);
    (settings.noise.reference_lag, settings.noise.reference_wander) = (args.lag, args.wander);
    let folds = std::mem::take(&mut settings.folds);
    progress.set_message(format!("fitting {} runs", fitted.len()));
    let mut found = fit::fit(args.method, &fitted, vehicle, &settings)?;
    progress.set_message("judging");
    let folder = folders::folder(args.out.as_deref(), "calibrate")?;
    let provenance = Provenance { method: args.method, left_out: named.as_deref() };
    let drifts_of = |found: &Found, runs: &[&str], name: &str| {
        drift::drifts(&case, found, &provenance, runs, &folder.join("judged").join(name))
    };
    let (mut left_out, mut drifts) = (Vec::new(), Vec::new());
    if named.is_some() {
        left_out = judged(&out, &case, &settings, &mut found);
        drifts = drifts_of(&found, &names_of(&left_out), "left-out")?;
    } else {
        settings.folds = folds;
        let used = |run: &&Run| found.runs.contains(&run.name);
        let used: Vec<&Run> = fitted.iter().filter(used).collect();
        let nominal = Parameters::nominal(vehicle);
        for (number, fold) in fit::folds(args.method, &used, vehicle, &settings).iter().enumerate()
        {
            let pair = [&nominal, &fold.found.parameters];
            left_out.extend(
                fold.out.iter().flat_map(|run| judge::judge(run, vehicle, pair, &settings)),
            );
            let names: Vec<&str> = fold.out.iter().map(|run| run.name.as_str()).collect();
            drifts.extend(drifts_of(&fold.found, &names, &format!("part-{}", number + 1))?);
        }
        left_out.sort_by(|a, b| (&a.run, a.source).cmp(&(&b.run, b.source)));
        drifts.sort_by(|a, b| a.run.cmp(&b.run));
    }
    let outliers = outliers(&fitted, &case, &settings, &found);
    let outlier_drifts = drifts_of(&found, &names_of(&outliers), "outliers")?;
    let mut calibration = Calibration {
        method: args.method,
        settings,
        found,
        named,
        left_out,
        outliers,
        drifts,
        outlier_drifts,
        vehicle: None,
        report: folder.join("report.html"),
        command_line: command_line(args),
        case,
    };
    if calibration.identified() > 0 {
        let path = folder.join("vehicle.toml");
        folders::write(&path, &output::vehicle_text(&calibration)?)?;
        calibration.vehicle = Some(path);
    }
    Ok(calibration)
}

/// The runs of a table, each once.
fn names_of(table: &[LeftOut]) -> Vec<&str> {
    let mut names: Vec<&str> = table.iter().map(|row| row.run.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// A time, not negative and no longer than ten seconds.
fn parse_time(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(time) if (0.0..=10.0).contains(&time) => Ok(time),
        _ => Err(format!("found {text:?}, allowed is a time from 0 to 10 s")),
    }
}

/// Cuts each run in two; the names of the ends.
fn split_runs(case: &mut Case, share: f64) -> Vec<String> {
    let runs = std::mem::take(&mut case.runs);
    let mut ends = Vec::new();
    for run in runs {
        match split::split(&run, share) {
            Some([begin, end]) => {
                ends.push(end.name.clone());
                if let Some((folder, _)) = case.recorded.remove(&run.name) {
                    for part in [&begin, &end] {
                        let recorded = (folder.clone(), part.span());
                        case.recorded.insert(part.name.clone(), recorded);
                    }
                }
                case.runs.extend([begin, end]);
            }
            None => case.runs.push(run),
        }
    }
    ends
}

/// The runs that are not to be fitted; none where nobody named any.
fn left_out_by_name(args: &CalibrateArgs, runs: &[Run]) -> Result<Option<Vec<String>>, Failure> {
    for name in args.runs.iter().chain(&args.leave_out) {
        if runs.iter().all(|run| run.name != *name) {
            let known: Vec<&str> = runs.iter().map(|run| run.name.as_str()).collect();
            return Err(Failure::with_help(
                Exit::Usage,
                format!("no run is named {name}"),
                format!("runs of this case: {}", known.join(", ")),
            ));
        }
    }
    let names = runs.iter().map(|run| run.name.clone());
    let out: Vec<String> = match (&args.runs[..], &args.leave_out[..]) {
        ([], []) => return Ok(None),
        ([], out) => names.filter(|name| out.contains(name)).collect(),
        (fitted, _) => names.filter(|name| !fitted.contains(name)).collect(),
    };
    if out.len() == runs.len() {
        return Err(Failure::new(Exit::Usage, "no run is left to fit: all are left out"));
    }
    Ok(Some(out))
}

/// End errors of the runs left out by name; those with findings that forbid their use are rejected as others are.
fn judged(out: &[&Run], case: &Case, settings: &Settings, found: &mut Found) -> Vec<LeftOut> {
    let vehicle = case.vehicle();
    let nominal = Parameters::nominal(vehicle);
    let runs: Vec<Run> = out.iter().map(|run| (*run).clone()).collect();
    let findings = diagnose_runs(&runs, vehicle, &settings.noise);
    let mut table = Vec::new();
    for run in out {
        let against = fit::forbidding(&findings, &run.name);
        if against.is_empty() {
            table.extend(judge::judge(run, vehicle, [&nominal, &found.parameters], settings));
        } else {
            found.rejected.push(Rejected { run: run.name.clone(), why: against.join("; ") });
        }
    }
    table
}

/// End errors of runs that the fit rejected by what it found, not by what is wrong with them.
fn outliers(fitted: &[Run], case: &Case, settings: &Settings, found: &Found) -> Vec<LeftOut> {
    let vehicle = case.vehicle();
    let nominal = Parameters::nominal(vehicle);
    let rejected = |run: &&Run| {
        found.rejected.iter().any(|out| out.run == run.name)
            && fit::forbidding(&found.findings, &run.name).is_empty()
    };
    let rows = fitted
        .iter()
        .filter(rejected)
        .flat_map(|run| judge::judge(run, vehicle, [&nominal, &found.parameters], settings));
    rows.collect()
}

fn command_line(args: &CalibrateArgs) -> String {
    let mut words = vec!["kerbside calibrate".to_owned(), folders::quoted(&args.case)];
    words
        .extend((args.method != Method::Joint).then(|| format!("--method {}", args.method.name())));
    words.extend((!args.runs.is_empty()).then(|| format!("--runs {}", args.runs.join(","))));
    words.extend(
        (!args.leave_out.is_empty()).then(|| format!("--leave-out {}", args.leave_out.join(","))),
    );
    words.extend(args.split.map(|share| format!("--split {share}")));
    words.extend(args.free_gain.then(|| "--free-gain".to_owned()));
    words.extend(args.free_marker.then(|| "--free-marker".to_owned()));
    words.extend((args.lag > 0.0).then(|| format!("--lag {}", args.lag)));
    words.extend((args.wander > 0.0).then(|| format!("--wander {}", args.wander)));
    words.join(" ")
}

/// Something that turns on a terminal, nothing in a pipe.
fn progress() -> ProgressBar {
    let spinner = ProgressBar::new_spinner();
    if !std::io::stderr().is_terminal() {
        spinner.set_draw_target(ProgressDrawTarget::hidden());
        return spinner;
    }
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}, {elapsed}") {
        spinner.set_style(style);
    }
    spinner.enable_steady_tick(core::time::Duration::from_millis(100));
    spinner
}

impl Calibration {
    /// How many parameters were identified.
    fn identified(&self) -> usize {
        self.found.estimates.iter().filter(|estimate| estimate.identified).count()
    }

    /// Runs that were left out by name; none where runs took turns.
    fn judged_by_name(&self) -> Option<&[String]> {
        self.named.as_deref()
    }

    /// How the runs were judged, for people.
    fn basis(&self) -> &'static str {
        match (&self.named, self.left_out.is_empty()) {
            (_, true) => "no run was left out",
            (Some(_), false) => "runs left out by name",
            (None, false) => "runs taking turns: each judged by a fit of the others",
        }
    }

    /// Root mean squares over the runs left out by the sensors that count.
    fn overall(&self) -> Option<Rms> {
        Rms::overall(&self.left_out, self.method)
    }

    /// Runs left out may not end farther off than before by more than what is known of their ends can tell.
    fn figures(&self) -> Vec<Figure> {
        let Some(rms) = self.overall() else { return Vec::new() };
        let [before, after] = rms.position;
        let name = "end error of runs left out, position rms [m]";
        let position = Figure::at_most(name, after, before.hypot(rms.floor_position));
        let [before, after] = rms.yaw;
        let name = "end error of runs left out, heading rms [rad]";
        let heading = Figure::at_most(name, after, before.hypot(rms.floor_yaw));
        let known = after.is_finite();
        core::iter::once(position).chain(known.then_some(heading)).collect()
    }

    /// Why the result is bad; none where it is good.
    fn problem(&self) -> Option<String> {
        if self.identified() == 0 {
            return Some("these runs identify nothing".to_owned());
        }
        let missed = self.figures().into_iter().find(|figure| !figure.passed());
        missed.map(|_| "runs left out end farther off than by the nominal vehicle".to_owned())
    }
}
