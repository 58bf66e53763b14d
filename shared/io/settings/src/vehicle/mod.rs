//! `vehicle.toml`: what the engineer believes the vehicle to be.

mod build;
mod calibration;
mod checks;
mod keys;

use std::collections::BTreeMap;

use kerbside_geometry::Vehicle;

use crate::SettingsError;
use crate::declare::{Loaded, Reading, SourceFile};
use crate::problem::Cause;
use crate::sources::{FileKind, Sources};

pub use calibration::{CALIBRATED, Calibration};
pub(crate) use keys::{VehicleDraft, schema};

/// A vehicle's file: the nominal vehicle, and how far a car in good order may differ from it.
#[derive(Clone, Debug, PartialEq)]
pub struct VehicleFile {
    /// The nominal vehicle.
    pub vehicle: Vehicle,
    /// How far a car in good order may differ.
    pub uncertainty: Uncertainty,
    /// Where its values come from; none where it was not calibrated.
    pub calibration: Option<Calibration>,
}

/// One standard deviation, per field, of what a car in good order may differ by.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Uncertainty {
    /// Of fields of the vehicle, by their name and in their unit; `radius` is of each wheel on its
    /// own.
    pub fields: BTreeMap<&'static str, f64>,
    /// Of effects' parameters about their neutral value, by effect and parameter and in the
    /// parameter's unit.
    pub effects: BTreeMap<(&'static str, &'static str), f64>,
}

impl Uncertainty {
    /// Of a field; 0 where nothing is stated.
    #[must_use]
    pub fn field(&self, name: &str) -> f64 {
        self.fields.get(name).copied().unwrap_or(0.0)
    }

    /// Of an effect's parameter; 0 where nothing is stated.
    #[must_use]
    pub fn effect(&self, id: &str, parameter: &str) -> f64 {
        let stated = self.effects.iter().find(|((i, p), _)| *i == id && *p == parameter);
        stated.map_or(0.0, |(_, deviation)| *deviation)
    }
}

/// Reads a vehicle's file.
///
/// # Errors
/// [`SettingsError::Refused`] with every problem of the file.
pub(crate) fn load(file: &SourceFile) -> Result<Loaded<VehicleFile>, SettingsError> {
    let mut reading = Reading::new(schema(), file);
    let mut draft = schema().default();
    reading.apply(&mut draft);
    build::complete(&mut reading, &mut draft);
    if reading.is_sound() {
        checks::check(&mut reading, &draft);
        calibration::check(&mut reading, &draft.calibration);
    }
    let settings = reading.settings(&mut draft);
    let vehicle = build::vehicle(&reading, draft);
    reading.finish(Some(vehicle), settings)
}

/// The vehicle that another file names under its key `vehicle`, or `instead`; none where it cannot
/// be used, and then the other file's reading knows why.
pub(crate) fn named<T>(
    sources: &Sources,
    reading: &mut Reading<'_, T>,
    stated: &str,
    instead: Option<&str>,
) -> Option<Loaded<VehicleFile>> {
    let found = match instead {
        Some(name) => sources.find(FileKind::Vehicle, name, None),
        // Reported as missing already.
        None if stated.is_empty() => return None,
        None => sources.find(FileKind::Vehicle, stated, Some(&reading.file)),
    };
    match found.and_then(|file| load(&file)) {
        Ok(vehicle) => {
            reading.adopt(&vehicle.warnings);
            Some(vehicle)
        }
        Err(SettingsError::Refused(problems)) => {
            reading.adopt(&problems);
            None
        }
        Err(error) => {
            let name = format!("\"{}\"", instead.unwrap_or(stated));
            let allowed = sources.names(FileKind::Vehicle).join(", ");
            reading.refuse("vehicle", &name, Cause::NotFound(error.to_string()), allowed);
            None
        }
    }
}
