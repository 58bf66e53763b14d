//! `diagnose`: where the gap between simulator and vehicle lies, which effect causes it, how far it shrinks once that
//! effect is added, how sure that is, and what to drive next. Of one case, or of many.

mod absorbed;
mod batch;
mod document;
mod files;
mod input;
#[cfg(test)]
mod made_up;
mod menu;
mod report;
mod summary;
mod table;
#[cfg(test)]
mod tests;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kerbside_diagnosis::{Case, Diagnosis, Settings};
use kerbside_settings::load_overlay;
use serde_json::Value;

use absorbed::Absorbed;
pub use batch::Shard;
pub use input::Input;

use crate::exit::{Exit, Failure};
use crate::output;

/// What `diagnose` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct DiagnoseArgs {
    /// A case folder: vehicle.toml, and runs/ with a folder per run.
    #[arg(required_unless_present = "batch")]
    pub case: Option<PathBuf>,
    /// Diagnose every case folder in this one, on all cores; what is diagnosed already is kept.
    #[arg(long, value_name = "DIR", conflicts_with = "case", requires = "out")]
    pub batch: Option<PathBuf>,
    /// Of a batch the I-th of N parts: each of N machines takes its own.
    #[arg(long, value_name = "I/N", value_parser = batch::parse_shard, requires = "batch")]
    pub shard: Option<Shard>,
    /// Diagnose what is diagnosed already, too.
    #[arg(long, requires = "batch")]
    pub fresh: bool,
    /// Folder for diagnosis.json, diagnosis.overlay.toml, diagnosis.vehicle.toml, report.html and next.csv; of a batch
    /// one per case in it, and a table. A new one in the state folder where not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Overlay: show how far the gap shrinks with these effects in place of those that are found.
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

impl DiagnoseArgs {
    /// The overlay that was given by hand, as it was named.
    fn model(&self) -> Option<String> {
        self.model.as_ref().map(|path| path.display().to_string())
    }

    /// The command line that gives one case again.
    fn command_line(&self, case: &Path) -> String {
        let mut words = vec!["kerbside diagnose".to_owned(), case.display().to_string()];
        words.extend(self.model().map(|model| format!("--model {model}")));
        words.join(" ")
    }
}

/// What turns a case into a diagnosis; how far it is, is told in words and as a share of the work.
pub type Diagnoser<'a> =
    dyn Fn(&Case, &dyn Fn(&str, f64)) -> Result<Diagnosis, Failure> + Sync + 'a;

/// A case, diagnosed.
#[derive(Debug)]
pub struct Diagnosed {
    input: Input,
    found: Diagnosis,
    model: Option<String>,
    /// How long it took \[s\].
    seconds: f64,
}

impl Diagnosed {
    fn document(&self) -> Value {
        let (notices, model) = (&self.input.notices[..], self.model.as_deref());
        let facts = document::Facts { notices, model, seconds: self.seconds };
        let mut document = document::of(&self.found, &facts);
        document["vehicle"] = self.absorbed().as_json(document::VEHICLE);
        document
    }

    /// What of it the vehicle's file can absorb.
    fn absorbed(&self) -> Absorbed {
        Absorbed::of(&self.found, &self.input.case.vehicle)
    }
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where case or overlay are refused, by file and line.
pub fn run(args: &DiagnoseArgs) -> Result<Exit, Failure> {
    let model = args.model.as_deref().map(load_overlay).transpose()?;
    run_with(args, &|case, progress| {
        let settings = Settings { model: model.clone(), menu: menu::of(&case.vehicle) };
        kerbside_diagnosis::diagnose(case, &settings, progress)
            .map_err(|error| Failure::new(Exit::Data, format!("{}: {error}", case.name)))
    })
}

/// Runs the verb with `diagnoser`.
///
/// # Errors
/// [`Failure`] where the case is refused, by file and line.
pub fn run_with(args: &DiagnoseArgs, diagnoser: &Diagnoser<'_>) -> Result<Exit, Failure> {
    match (&args.batch, &args.case) {
        (Some(cases), _) => batch::run(args, cases, diagnoser),
        (None, Some(case)) => single(args, case, diagnoser),
        (None, None) => Err(Failure::new(Exit::Usage, "no case is given")),
    }
}

fn single(args: &DiagnoseArgs, case: &Path, diagnoser: &Diagnoser<'_>) -> Result<Exit, Failure> {
    let bar = bar(1000, "{bar:30} {msg}, {elapsed}");
    let diagnosed = diagnosed(case, args.model(), diagnoser, &|what, share| {
        bar.set_message(what.to_owned());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
        bar.set_position((1000.0 * share.clamp(0.0, 1.0)) as u64);
    });
    bar.finish_and_clear();
    let diagnosed = diagnosed?;
    let folder = output::place(args.out.as_deref(), "diagnose")?;
    let document = files::write(&folder, &diagnosed, &args.command_line(case))?;
    kerbside_runtime::end_on_broken_pipe();
    summary::tell(args, &diagnosed, document, &folder);
    Ok(Exit::Good)
}

/// Reads and diagnoses the case in `folder`.
fn diagnosed(
    folder: &Path,
    model: Option<String>,
    diagnoser: &Diagnoser<'_>,
    progress: &dyn Fn(&str, f64),
) -> Result<Diagnosed, Failure> {
    let begin = Instant::now();
    progress("reading the runs", 0.0);
    let input = Input::read(folder)?;
    let found = diagnoser(&input.case, progress)?;
    document::check(&found).map_err(Failure::internal)?;
    let seconds = begin.elapsed().as_secs_f64();
    Ok(Diagnosed { input, found, model, seconds })
}

/// A bar on a terminal, nothing in a pipe.
fn bar(length: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
        return bar;
    }
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.enable_steady_tick(core::time::Duration::from_millis(100));
    bar
}
