//! The ways in: by name, by path, by text.

use std::path::Path;

use crate::declare::{Loaded, SourceFile};
use crate::sources::{FileKind, Sources, read};
use crate::{RunInfo, Scenario, SettingsError, Stack, VehicleFile, run, scenario, stack, vehicle};

/// What a parking manoeuvre needs: the task, and the stack with the task's vehicle.
#[derive(Clone, Debug)]
pub struct Parking {
    /// The task.
    pub scenario: Loaded<Scenario>,
    /// The stack, with the vehicle of the task.
    pub stack: Loaded<Stack>,
}

impl Sources {
    /// The stack: the file that was given, else the one named `stack`.
    ///
    /// # Errors
    /// [`SettingsError`]: not there, not readable, or refused with every problem.
    pub fn stack(&self) -> Result<Loaded<Stack>, SettingsError> {
        self.stack_for(None)
    }

    /// The stack as [`Sources::stack`] finds it, with `vehicle` (a name or path) in place of its own where one is given.
    ///
    /// # Errors
    /// [`SettingsError`]: not there, not readable, or refused with every problem.
    pub fn stack_for(&self, vehicle: Option<&str>) -> Result<Loaded<Stack>, SettingsError> {
        let given = self.given_stack();
        let file = given.unwrap_or_else(|| self.find(FileKind::Stack, "stack", None))?;
        stack::load(self, &file, vehicle)
    }

    /// The stack of a name or path, even if another file was given.
    ///
    /// # Errors
    /// [`SettingsError`]: not there, not readable, or refused with every problem.
    pub fn stack_named(&self, name: &str) -> Result<Loaded<Stack>, SettingsError> {
        stack::load(self, &self.find(FileKind::Stack, name, None)?, None)
    }

    /// The vehicle of a name or path.
    ///
    /// # Errors
    /// [`SettingsError`]: not there, not readable, or refused with every problem.
    pub fn vehicle(&self, name: &str) -> Result<Loaded<VehicleFile>, SettingsError> {
        vehicle::load(&self.find(FileKind::Vehicle, name, None)?)
    }

    /// The scenario of a name or path, checked with its vehicle.
    ///
    /// # Errors
    /// [`SettingsError`]: not there, not readable, or refused with every problem.
    pub fn scenario(&self, name: &str) -> Result<Loaded<Scenario>, SettingsError> {
        scenario::load(self, &self.find(FileKind::Scenario, name, None)?, None)
    }

    /// A scenario and the stack for it: the stack's file that was given, else the one the scenario
    /// names; with the scenario's vehicle, or with `vehicle` (a name or path) instead.
    ///
    /// # Errors
    /// [`SettingsError`]: not there, not readable, or refused with every problem of the scenario
    /// and its vehicle, or, if there is none, of the stack with that vehicle.
    pub fn parking(&self, name: &str, vehicle: Option<&str>) -> Result<Parking, SettingsError> {
        self.parking_with(name, vehicle, self.given_stack())
    }

    /// The same, whatever file was given.
    pub(crate) fn parking_as_stated(&self, name: &str) -> Result<Parking, SettingsError> {
        self.parking_with(name, None, None)
    }

    fn parking_with(
        &self,
        name: &str,
        vehicle: Option<&str>,
        stack: Option<Result<SourceFile, SettingsError>>,
    ) -> Result<Parking, SettingsError> {
        let file = self.find(FileKind::Scenario, name, None)?;
        let scenario = scenario::load(self, &file, vehicle)?;
        // A path in the scenario's file is relative to that file, not to the stack's.
        let vehicle = match vehicle {
            Some(vehicle) => self.find(FileKind::Vehicle, vehicle, None),
            None => self.find(FileKind::Vehicle, &scenario.value.vehicle, Some(&file)),
        }?;
        let stated = || self.find(FileKind::Stack, &scenario.value.stack, Some(&file));
        let stack = stack::load(self, &stack.unwrap_or_else(stated)?, Some(&vehicle.name))?;
        Ok(Parking { scenario, stack })
    }
}

/// The vehicle of a file.
///
/// # Errors
/// [`SettingsError`]: not readable, or refused with every problem.
pub fn load_vehicle(path: &Path) -> Result<Loaded<VehicleFile>, SettingsError> {
    vehicle::load(&read(path)?)
}

/// What a run's file says.
///
/// # Errors
/// [`SettingsError`]: not readable, or refused with every problem.
pub fn load_run(path: &Path) -> Result<Loaded<RunInfo>, SettingsError> {
    run::load(&read(path)?)
}

/// The vehicle of a text that is a file's of that name.
///
/// # Errors
/// [`SettingsError::Refused`] with every problem.
pub fn parse_vehicle(name: &str, text: &str) -> Result<Loaded<VehicleFile>, SettingsError> {
    vehicle::load(&source(name, text))
}

/// What a text says that is a run's file of that name.
///
/// # Errors
/// [`SettingsError::Refused`] with every problem.
pub fn parse_run(name: &str, text: &str) -> Result<Loaded<RunInfo>, SettingsError> {
    run::load(&source(name, text))
}

fn source(name: &str, text: &str) -> SourceFile {
    SourceFile { name: name.to_owned(), text: text.into(), folder: None }
}
