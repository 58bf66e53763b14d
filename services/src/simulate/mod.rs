//! `simulate`: what every sensor of recorded runs would have read, had the vehicle been the nominal one, or the nominal
//! one with effects.

mod follow;
mod input;
mod predict;
mod start;
mod wheels;

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::exit::{Exit, Failure};
use crate::output as folders;
use input::Case;
use predict::Prediction;

/// What `simulate` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct SimulateArgs {
    /// A case folder: vehicle.toml, and runs/ with a folder per run.
    pub case: PathBuf,
    /// Folder with the runs, a folder each; runs/ of the case where not given.
    #[arg(long, value_name = "DIR")]
    pub runs: Option<PathBuf>,
    /// Overlay: effects to be added to the nominal vehicle.
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Folder for the predictions, a folder per run; a new one in the state folder where not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// A run that was simulated.
struct Simulated {
    prediction: Prediction,
    folder: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the case or the overlay is refused, or no run can be simulated.
pub fn run(args: &SimulateArgs) -> Result<Exit, Failure> {
    let case = Case::read(&args.case, args.runs.as_deref(), args.model.as_deref())?;
    let mut predicted = Vec::new();
    let mut left_out = Vec::new();
    for recorded in &case.runs {
        match predict::predict(&case, recorded) {
            Ok(prediction) => predicted.push(prediction),
            Err(why) => left_out.push((recorded.about.info.name.clone(), why)),
        }
    }
    if predicted.is_empty() {
        let reasons: Vec<String> =
            left_out.iter().map(|(run, why)| format!("{run}: {why}")).collect();
        return Err(Failure::new(Exit::Data, reasons.join("; ")));
    }
    let out = folders::folder(args.out.as_deref(), "simulate")?;
    let simulated = predicted.into_iter().map(|prediction| write(&out, prediction));
    let simulated = simulated.collect::<Result<Vec<_>, _>>()?;
    kerbside_runtime::end_on_broken_pipe();
    if args.json {
        println!("{}", as_json(args, &case, &simulated, &left_out, &out));
    } else {
        print(&simulated, &out);
    }
    for (run, why) in &left_out {
        eprintln!("{run} is not simulated: {why}");
    }
    Ok(if left_out.is_empty() { Exit::Good } else { Exit::Bad })
}

fn write(out: &Path, prediction: Prediction) -> Result<Simulated, Failure> {
    let folder = out.join(&prediction.run);
    folders::make(&folder)?;
    for (file, text) in &prediction.files {
        folders::write(&folder.join(file), text)?;
    }
    Ok(Simulated { prediction, folder })
}

fn print(simulated: &[Simulated], out: &Path) {
    for Simulated { prediction, .. } in simulated {
        let files: Vec<&str> = prediction.files.iter().map(|(file, _)| *file).collect();
        println!("{}: {}", prediction.run, files.join(", "));
        prediction.notes.iter().for_each(|note| println!("  {note}"));
    }
    println!("predictions: {}", out.display());
}

fn as_json(
    args: &SimulateArgs,
    case: &Case,
    simulated: &[Simulated],
    left_out: &[(String, String)],
    out: &Path,
) -> Value {
    let files = |one: &Simulated| -> Vec<PathBuf> {
        one.prediction.files.iter().map(|(file, _)| one.folder.join(file)).collect()
    };
    let run = |one: &Simulated| {
        let Prediction { run, start, from_commands, notes, .. } = &one.prediction;
        json!({
            "run": run, "start": { "x": start.x, "y": start.y, "yaw": start.yaw },
            "driven_by": if *from_commands { "commands" } else { "measured motion" },
            "files": files(one), "notes": notes,
        })
    };
    let left_out = left_out.iter().map(|(run, why)| json!({ "run": run, "why": why }));
    json!({
        "schema": "kerbside.simulate.v1",
        "version": env!("CARGO_PKG_VERSION"),
        "seed": null,
        "passed": left_out.len() == 0,
        "figures": [],
        "case": case.origin,
        "model": args.model,
        "effects": case.overlay.effects().iter().map(|effect| effect.definition().id).collect::<Vec<_>>(),
        "runs": simulated.iter().map(run).collect::<Vec<_>>(),
        "files": simulated.iter().flat_map(files).collect::<Vec<_>>(),
        "left_out": left_out.collect::<Vec<_>>(),
        "out": out,
    })
}
