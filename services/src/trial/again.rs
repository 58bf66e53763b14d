//! What an ambiguous answer suggests to drive next, driven: the same vehicle, the commands of next.csv, and a second
//! diagnosis of everything.

use std::path::Path;

use kerbside_proving_ground::cases::{Case, Drives, Plan};
use kerbside_proving_ground::library::Asked;
use kerbside_recordings::run_folder::{CommandRow, Table};

use super::folder;
use crate::configuration::refused_run;
use crate::exit::Failure;

/// Name of the drive.
const NAME: &str = "suggested-1";
/// It is driven on beyond its last command \[s\].
const BEYOND: f64 = 0.5;

/// The drive that the file `next` in `answer` asks for; none where there is none.
fn plan(case: &Case, answer: &Path) -> Option<Plan> {
    let path = answer.join("next.csv");
    let bytes = std::fs::read(&path).ok()?;
    let table: Table<CommandRow> = Table::parse(&path, &bytes).ok()?;
    let asked = |row: &CommandRow| Asked {
        time: row.t,
        speed: row.speed.unwrap_or_default(),
        steering: row.steering.unwrap_or_default(),
    };
    let commands: Vec<Asked> = table.rows.iter().map(asked).collect();
    let duration = commands.last()?.time + BEYOND;
    let mut plan = case.further(1, duration).into_iter().next()?;
    plan.stamps.commands = commands.iter().map(|asked| asked.time).collect();
    (plan.name, plan.manoeuvre, plan.commands) = (NAME.to_owned(), "steps", commands);
    (plan.repeat_of, plan.states_distance) = (None, false);
    Some(plan)
}

/// Writes the case with that drive besides; whether there is one.
///
/// # Errors
/// [`Failure`] where the folder cannot be written to.
pub fn write(
    folder: &Path,
    case: &Case,
    plant: &dyn Drives,
    answer: &Path,
) -> Result<bool, Failure> {
    let Some(plan) = plan(case, answer) else { return Ok(false) };
    folder::write(folder, case, plant)?;
    let run = folder::recorded(case, &plan, plant)?;
    run.write(&folder.join("runs").join(NAME)).map_err(refused_run)?;
    Ok(true)
}
