//! A case folder as the diagnosis takes it: the vehicle as believed, and its recorded runs as series of readings.

use std::f64::consts::TAU;
use std::path::Path;

use kerbside_diagnosis::{Allowance, Case, Run, Series, Wheels};
use kerbside_geometry::{Vehicle, WHEELS, Wheel, angle};
use kerbside_recordings::run_folder::{self, CommandRow, ReferenceRow, Table};
use kerbside_settings::Uncertainty;
use kerbside_simulation::Command;

use crate::case_folder::CaseFolder;
use crate::exit::{Exit, Failure};

/// A case, read.
#[derive(Clone, Debug)]
pub struct Input {
    /// vehicle.toml, in full.
    pub origin: String,
    /// The case.
    pub case: Case,
    /// What a person should know of the input, a sentence each.
    pub notices: Vec<String>,
}

impl Input {
    /// Reads vehicle.toml and runs/ of `folder`, and nothing else there.
    ///
    /// # Errors
    /// [`Failure`]: the vehicle is refused, there is no run, or a run is not as the format says.
    pub fn read(folder: &Path) -> Result<Self, Failure> {
        let read = CaseFolder::read(folder, Exit::Data)?;
        let (vehicle, allowance) = (read.vehicle.vehicle, allowance(&read.vehicle.uncertainty));
        let mut notices = Vec::new();
        let mut runs = Vec::new();
        for (folder, recorded) in read.runs {
            runs.push(run(&recorded, &vehicle, &mut notices).ok_or_else(|| no_wheel(&folder))?);
        }
        notices.sort();
        notices.dedup();
        let name = name_of(folder)?;
        Ok(Self { origin: read.origin, case: Case { name, vehicle, allowance, runs }, notices })
    }
}

/// The folder's own name, also where it is given as `.` or through a link.
///
/// # Errors
/// [`Failure`] where there is no such folder.
pub fn name_of(folder: &Path) -> Result<String, Failure> {
    let full = folder
        .canonicalize()
        .map_err(|error| Failure::new(Exit::Data, format!("{}: {error}", folder.display())))?;
    Ok(full.file_name().unwrap_or_default().to_string_lossy().into_owned())
}

fn no_wheel(folder: &Path) -> Failure {
    Failure::with_help(
        Exit::Data,
        format!("{}: no wheel can be used", folder.display()),
        "counts need counts_per_revolution of their wheel in vehicle.toml, speeds a wheel that the vehicle has",
    )
}

/// What a car in good order may differ by; none where nothing is stated.
fn allowance(stated: &Uncertainty) -> Option<Allowance> {
    let fields = stated.fields.iter().map(|(name, value)| ((*name).to_owned(), *value));
    let effects = stated
        .effects
        .iter()
        .map(|((id, parameter), value)| (((*id).to_owned(), (*parameter).to_owned()), *value));
    let allowance = Allowance { fields: fields.collect(), effects: effects.collect() };
    (!(allowance.fields.is_empty() && allowance.effects.is_empty())).then_some(allowance)
}

/// A recorded run as series; none where no wheel can be used.
fn run(recorded: &run_folder::Run, vehicle: &Vehicle, notices: &mut Vec<String>) -> Option<Run> {
    let info = &recorded.about.info;
    notices.extend(recorded.notices());
    let wheels = wheels(recorded, vehicle, notices)?;
    let steering = series(recorded.steering.as_ref(), |row| [value(row.angle)]);
    let gyro = series(recorded.gyro.as_ref(), |row| [value(row.yaw_rate)]);
    let mut note_unused = |file: &str, section: &str, unused: bool| {
        if unused {
            notices.push(format!("{file} is not used: vehicle.toml has no [{section}]"));
        }
    };
    let no_sensor = vehicle.steering_sensor.is_none();
    note_unused("steering.csv", "steering_sensor", no_sensor && !steering.is_empty());
    note_unused("imu.csv", "gyro", vehicle.gyro.is_none() && !gyro.is_empty());
    let reference = reference(recorded.reference.as_ref());
    if vehicle.reference.is_none() && !reference.is_empty() {
        let why = "vehicle.toml has no [reference]: the marker is taken to be at the rear axle";
        notices.push(why.to_owned());
    }
    Some(Run {
        name: info.name.clone(),
        repeat_of: info.repeat_of.clone(),
        start: info.start,
        commands: commands(recorded.commands.as_ref(), notices),
        wheels,
        steering: if no_sensor { Series::default() } else { steering },
        gyro: if vehicle.gyro.is_none() { Series::default() } else { gyro },
        reference,
    })
}

/// What is missing is not a number.
fn value(field: Option<f64>) -> f64 {
    field.unwrap_or(f64::NAN)
}

/// The rows of a table that hold a value.
fn series<R: run_folder::Row, const N: usize>(
    table: Option<&Table<R>>,
    mut values: impl FnMut(&R) -> [f64; N],
) -> Series<N> {
    let mut series = Series::default();
    for row in table.into_iter().flat_map(|table| &table.rows) {
        let values = values(row);
        if values.iter().any(|value| value.is_finite()) {
            series.t.push(row.t());
            series.value.push(values);
        }
    }
    series
}

/// How the wheels turned: from counts where any can be used, else from speeds; none where neither can.
fn wheels(
    recorded: &run_folder::Run,
    vehicle: &Vehicle,
    notices: &mut Vec<String>,
) -> Option<Wheels> {
    let mut counters = WHEELS.map(|wheel| Counter::of(vehicle, wheel));
    let rotation = series(recorded.encoders.as_ref(), |row| {
        core::array::from_fn(|wheel| match &mut counters[wheel] {
            Some(counter) if row.mask & (1 << wheel) != 0 => counter.turned(row.counts[wheel]),
            _ => f64::NAN,
        })
    });
    for wheel in WHEELS {
        let read = |mask: u8| mask & (1 << wheel.index()) != 0;
        let mut rows = recorded.encoders.iter().flat_map(|table| &table.rows);
        if counters[wheel.index()].is_none() && rows.any(|row| read(row.mask)) {
            notices.push(format!(
                "counts of {} are not used: {}",
                wheel.name(),
                why(vehicle, wheel)
            ));
        }
    }
    if !rotation.is_empty() {
        return Some(Wheels::Rotation(rotation));
    }
    let speeds = series(recorded.wheels.as_ref(), |row| {
        WHEELS.map(|wheel| {
            let read = row.mask & (1 << wheel.index()) != 0 && exists(vehicle, wheel);
            if read { row.speeds[wheel.index()] } else { f64::NAN }
        })
    });
    (!speeds.is_empty()).then_some(Wheels::Speed(speeds))
}

/// Whether the vehicle has that wheel: an axle without a track has its left one alone.
fn exists(vehicle: &Vehicle, wheel: Wheel) -> bool {
    wheel.is_left() || vehicle.wheel_position(wheel).1 != 0.0
}

fn why(vehicle: &Vehicle, wheel: Wheel) -> &'static str {
    if exists(vehicle, wheel) {
        "vehicle.toml has no counts_per_revolution of it"
    } else {
        "its axle has no track, and the left wheel stands for both"
    }
}

/// Follows a wheel's counter over its wraps, from one reading to the next however many rows lie between.
struct Counter {
    /// Bits of a count that the counter has not.
    unused: u32,
    radians_per_count: f64,
    before: Option<i64>,
    unwrapped: i64,
}

impl Counter {
    /// The counter of a wheel; none where vehicle.toml does not describe it.
    fn of(vehicle: &Vehicle, wheel: Wheel) -> Option<Self> {
        let encoders = vehicle.encoders.as_ref()?;
        let per_revolution = encoders.counts_per_revolution[wheel.index()]?;
        exists(vehicle, wheel).then(|| Self {
            unused: 64 - encoders.counter_bits.clamp(1, 64),
            radians_per_count: TAU / per_revolution,
            before: None,
            unwrapped: 0,
        })
    }

    /// Rotation since the first reading \[rad\].
    fn turned(&mut self, count: i64) -> f64 {
        let before = self.before.replace(count).unwrap_or(count);
        let step = count.wrapping_sub(before) << self.unused >> self.unused;
        self.unwrapped = self.unwrapped.wrapping_add(step);
        #[allow(clippy::cast_precision_loss)] // 53 bits of counts are exact
        let counts = self.unwrapped as f64;
        counts * self.radians_per_count
    }
}

/// Commands hold until the next one, and so does a field that is missing; before the first both are 0.
fn commands(table: Option<&Table<CommandRow>>, notices: &mut Vec<String>) -> Vec<Command> {
    let rows = table.map_or(&[][..], |table| &table.rows);
    if rows.iter().any(|row| row.speed.is_none() || row.steering.is_none()) {
        notices.push("commands.csv: a command that is missing is taken to hold on".to_owned());
    }
    let mut held = (0.0, 0.0);
    let mut command = |row: &CommandRow| {
        held = (row.speed.unwrap_or(held.0), row.steering.unwrap_or(held.1));
        Command { t: row.t, speed: held.0, steering: held.1 }
    };
    rows.iter().map(&mut command).collect()
}

/// The reference's rows with a position or a yaw; yaw turns on where it was wrapped.
fn reference(table: Option<&Table<ReferenceRow>>) -> Series<3> {
    let mut heading: Option<f64> = None;
    let unwrapped = |yaw: f64, heading: &mut Option<f64>| {
        let yaw = heading.map_or(yaw, |before| angle::unwrap(before, yaw));
        *heading = Some(yaw);
        yaw
    };
    let mut rows = Vec::new();
    for row in table.into_iter().flat_map(|table| &table.rows) {
        // Half a position is none.
        let (x, y) = row.x.zip(row.y).unwrap_or((f64::NAN, f64::NAN));
        let yaw = row.yaw.map_or(f64::NAN, |yaw| unwrapped(yaw, &mut heading));
        if x.is_finite() || yaw.is_finite() {
            rows.push((row.t, [x, y, yaw]));
        }
    }
    let (t, value) = rows.into_iter().unzip();
    Series { t, value }
}
