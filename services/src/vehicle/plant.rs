//! What is simulated: a vehicle, and effects by which it differs from its description.

use std::ffi::OsString;
use std::path::PathBuf;

use kerbside_geometry::Vehicle;
use kerbside_settings::load_overlay;
use kerbside_simulation::Effects;

use crate::configuration;
use crate::exit::Failure;
use crate::service::Service;

/// What the simulated vehicle is, where it is not as the stack takes it to be.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct PlantArgs {
    /// Overlay: effects by which the simulated vehicle differs from its description.
    #[arg(long, value_name = "FILE")]
    pub effects: Option<PathBuf>,
    /// Description of the simulated vehicle, where the stack believes another: a file, or the name of a shipped one.
    #[arg(long, value_name = "FILE")]
    pub plant: Option<String>,
}

/// A vehicle to simulate.
#[derive(Clone, Debug)]
pub struct Plant {
    /// Its description.
    pub vehicle: Vehicle,
    /// What it differs by from that.
    pub effects: Effects,
    /// The files that say so.
    pub files: Vec<String>,
}

impl Plant {
    /// The vehicle as the stack of `service` takes it to be.
    #[must_use]
    pub fn as_described(service: &Service) -> Self {
        Self { vehicle: service.vehicle.clone(), effects: Effects::default(), files: Vec::new() }
    }
}

impl PlantArgs {
    /// Whether anything is asked for.
    #[must_use]
    pub fn is_given(&self) -> bool {
        self.effects.is_some() || self.plant.is_some()
    }

    /// The vehicle to simulate for the stack of `service`.
    ///
    /// # Errors
    /// [`Failure`] where overlay or vehicle are refused.
    pub fn load(&self, service: &Service) -> Result<Plant, Failure> {
        let overlay = self.effects.as_deref().map(load_overlay).transpose()?.unwrap_or_default();
        let mut files = Vec::new();
        let vehicle = match &self.plant {
            Some(name) => {
                let loaded =
                    configuration::sources(service.args.config.as_deref())?.vehicle(name)?;
                files.push(loaded.file);
                loaded.value.vehicle
            }
            None => service.vehicle.clone(),
        };
        files.extend(self.effects.as_ref().map(|effects| effects.display().to_string()));
        Ok(Plant { vehicle, effects: Effects::from(&overlay), files })
    }

    /// The same, for a child.
    #[must_use]
    pub fn arguments(&self) -> Vec<OsString> {
        let effects = self.effects.as_ref().map(|file| ["--effects".into(), file.into()]);
        let plant = self.plant.as_ref().map(|name| ["--plant".into(), name.into()]);
        effects.into_iter().chain(plant).flatten().collect()
    }
}
