//! Recorded drives, with the vehicle that drove and what it sensed.

use std::path::Path;

use kerbside_messages::Raw;
use kerbside_odometry::Sensors;
use kerbside_recordings::input::{InputError, RawInput, Source, VehicleText, sources};
use kerbside_settings::{FileKind, SettingsError, VehicleFile, parse_vehicle};

use super::sensing::Carried;
use crate::configuration::{self, Refused};
use crate::exit::{Exit, Failure};

/// A drive, opened.
#[derive(Debug)]
pub struct Input {
    /// Its file or folder.
    pub drive: RawInput,
    /// Its readings in order of arrival.
    pub raws: Vec<Raw>,
    /// The vehicle that drove.
    pub vehicle: VehicleFile,
    /// What of its sensors the readings carry.
    pub sensors: Sensors,
    /// What a person should know of the input, a sentence each.
    pub notices: Vec<String>,
}

/// A vehicle and its sensors.
#[derive(Debug)]
pub struct Described {
    /// The vehicle.
    pub file: VehicleFile,
    /// Where its description comes from.
    pub origin: String,
    /// The description.
    pub text: String,
    /// What it senses.
    pub sensors: Sensors,
}

impl Input {
    /// Opens `source`, its vehicle described by `vehicle` (a file, or the name of a shipped one) where one is given.
    ///
    /// # Errors
    /// [`Failure`] with the reason, and the place where there is one.
    pub fn open(source: &Source, vehicle: Option<&str>) -> Result<Self, Failure> {
        let drive =
            RawInput::open_as(source, vehicle.map(vehicle_text).transpose()?).map_err(refused)?;
        let text = drive.vehicle();
        let parsed =
            parse_vehicle(&text.origin.display().to_string(), &text.text).map_err(refused_text)?;
        let raws: Vec<Raw> = drive.raws().and_then(Iterator::collect).map_err(refused)?;
        let carried = Carried::by(&raws);
        let vehicle = parsed.value;
        let mut notices = drive.notices();
        notices.extend(parsed.warnings.iter().map(ToString::to_string));
        notices.extend(carried.disagreements(&vehicle.vehicle));
        let sensors = carried.sensors(&vehicle.vehicle);
        Ok(Self { drive, raws, vehicle, sensors, notices })
    }
}

/// The only drive at `path`.
///
/// # Errors
/// [`Failure`] where there is none, or several.
pub fn only_source(path: &Path) -> Result<Source, Failure> {
    let mut found = find(path)?;
    match (found.pop(), found.len()) {
        (Some(source), 0) => Ok(source),
        (_, others) => Err(Failure::new(
            Exit::Data,
            format!("{}: {} drives; one is allowed here", path.display(), others + 1),
        )),
    }
}

/// The drives at `path`: a run folder, a case folder with several, or a recording.
///
/// # Errors
/// [`Failure`] where there is none.
pub fn find(path: &Path) -> Result<Vec<Source>, Failure> {
    if !path.exists() {
        return Err(Failure::new(
            Exit::Data,
            format!("{}: no such file or folder", path.display()),
        ));
    }
    sources(path).map_err(refused)
}

/// Vehicle and sensors of the drive at `path`; the sensors as given, where whoever read the drive found them out.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn describe(
    path: &Path,
    vehicle: Option<&str>,
    sensors: Option<Sensors>,
) -> Result<Described, Failure> {
    if let (Some(vehicle), Some(sensors)) = (vehicle, sensors) {
        let text = vehicle_text(vehicle)?;
        let origin = text.origin.display().to_string();
        let file = parse_vehicle(&origin, &text.text).map_err(refused_text)?.value;
        return Ok(Described { file, origin, text: text.text, sensors });
    }
    let input = Input::open(&only_source(path)?, vehicle)?;
    let text = input.drive.vehicle();
    Ok(Described {
        origin: text.origin.display().to_string(),
        text: text.text.clone(),
        file: input.vehicle,
        sensors: input.sensors,
    })
}

/// The text of a vehicle's file, by path or by name.
fn vehicle_text(reference: &str) -> Result<VehicleText, Failure> {
    if reference.contains('/') || reference.ends_with(".toml") {
        let text = std::fs::read_to_string(reference)
            .map_err(|error| Failure::new(Exit::Data, format!("{reference}: {error}")))?;
        return Ok(VehicleText { origin: reference.into(), text });
    }
    let known = configuration::sources(None)?;
    let loaded = known.vehicle(reference).map_err(|error| match error {
        error @ SettingsError::Refused(_) => refused_text(error),
        error => Failure::with_help(
            Exit::Data,
            format!("--vehicle {reference}: {error}"),
            format!("a file, or one of {}", known.names(FileKind::Vehicle).join(", ")),
        ),
    })?;
    Ok(VehicleText { text: loaded.show(), origin: loaded.file.into() })
}

fn refused(error: InputError) -> Failure {
    match error {
        InputError::Run(kerbside_recordings::run_folder::RunError::About(error)) => {
            refused_text(error)
        }
        error => Failure::new(Exit::Data, error),
    }
}

/// A TOML file of the input that is not as it should be: shown like one of ours, but it is data.
fn refused_text(error: SettingsError) -> Failure {
    if error.problems().is_empty() {
        return Failure::new(Exit::Data, error);
    }
    Failure { exit: Exit::Data, report: miette::Report::new(Refused::new(error.problems())) }
}
