//! A case folder as every verb reads it: vehicle.toml, and runs/ with a folder per run; nothing else in it is looked at.

use std::path::{Path, PathBuf};

use kerbside_recordings::run_folder::{self, Run};
use kerbside_settings::{VehicleFile, parse_vehicle};

use crate::configuration::{self, refused_run as refused};
use crate::exit::{Exit, Failure};

/// A case folder, read.
#[derive(Debug)]
pub struct CaseFolder {
    /// vehicle.toml, in full.
    pub origin: String,
    /// Its text.
    pub text: String,
    /// What it says.
    pub vehicle: VehicleFile,
    /// The runs and their folders.
    pub runs: Vec<(PathBuf, Run)>,
}

impl CaseFolder {
    /// Reads `folder`; a vehicle that is refused ends the verb with `exit`.
    ///
    /// # Errors
    /// [`Failure`]: the vehicle is refused, there is no run, or a run is not as the format says.
    pub fn read(folder: &Path, exit: Exit) -> Result<Self, Failure> {
        let folders = run_folder::runs_of(folder).map_err(refused)?;
        if folders.is_empty() {
            return Err(Failure::with_help(
                Exit::Data,
                format!("{}: no case: there is no run in runs/", folder.display()),
                "a case is a folder with vehicle.toml and a folder runs/NAME per run",
            ));
        }
        let path = folder.join("vehicle.toml");
        let origin = path.display().to_string();
        let text = std::fs::read_to_string(&path)
            .map_err(|error| Failure::new(Exit::Data, format!("{origin}: {error}")))?;
        let parsed = parse_vehicle(&origin, &text)
            .map_err(|error| Failure { exit, ..Failure::from(error) })?;
        configuration::warn(&parsed.warnings);
        let read = |folder: PathBuf| Ok((folder.clone(), Run::read(&folder).map_err(refused)?));
        let runs: Result<Vec<_>, Failure> = folders.into_iter().map(read).collect();
        Ok(Self { origin, text, vehicle: parsed.value, runs: runs? })
    }
}
