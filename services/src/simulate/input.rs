//! A case as `simulate` takes it: the vehicle, the effects, the runs.

use std::path::Path;

use kerbside_geometry::Vehicle;
use kerbside_recordings::run_folder::{self, Run};
use kerbside_settings::{load_overlay, load_vehicle};
use kerbside_simulation::{Effects, Overlay};

use crate::configuration::{self, refused_run};
use crate::exit::{Exit, Failure};

/// A case, read.
pub(super) struct Case {
    /// vehicle.toml.
    pub(super) origin: String,
    /// The nominal vehicle.
    pub(super) vehicle: Vehicle,
    /// What is added to it.
    pub(super) overlay: Overlay,
    /// The same, resolved.
    pub(super) effects: Effects,
    /// The runs by name.
    pub(super) runs: Vec<Run>,
}

impl Case {
    /// Reads vehicle.toml of `folder`, the runs in `runs` (runs/ of the case where none is given) and the overlay.
    ///
    /// # Errors
    /// [`Failure`]: something is refused, or there is no run.
    pub(super) fn read(
        folder: &Path,
        runs: Option<&Path>,
        model: Option<&Path>,
    ) -> Result<Self, Failure> {
        let overlay = model.map(load_overlay).transpose()?.unwrap_or_default();
        let runs = runs.map_or_else(|| folder.join("runs"), Path::to_owned);
        let folders = run_folder::runs_in(&runs).map_err(refused_run)?;
        if folders.is_empty() {
            return Err(Failure::with_help(
                Exit::Data,
                format!("{}: there is no run", runs.display()),
                "a case is a folder with vehicle.toml and a folder runs/NAME per run; --runs names another one",
            ));
        }
        let path = folder.join("vehicle.toml");
        let loaded = load_vehicle(&path).map_err(|error| {
            let failure = Failure::from(error);
            Failure { exit: Exit::Data, ..failure }
        })?;
        configuration::warn(&loaded.warnings);
        let runs = folders.iter().map(|folder| Run::read(folder)).collect::<Result<_, _>>();
        Ok(Self {
            origin: path.display().to_string(),
            vehicle: loaded.value.vehicle,
            effects: Effects::from(&overlay),
            overlay,
            runs: runs.map_err(refused_run)?,
        })
    }
}
