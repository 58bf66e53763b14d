//! A drawn case as a folder: what a diagnosis is given, and nothing else.

use std::path::Path;

use kerbside_proving_ground::cases::{self, Case, Drives, Errors, Plan, Rows};
use kerbside_recordings::run_folder::{
    CommandRow, CountRow, GyroRow, ReferenceRow, Row, Run, RunFile, SpeedRow, SteeringRow, Table,
};

use crate::configuration::refused_run;
use crate::exit::Failure;
use crate::output;

/// Writes vehicle.toml and the runs that may be read, as `plant` drove them with what is put in.
///
/// # Errors
/// [`Failure`] where the folder cannot be written to.
pub fn write(folder: &Path, case: &Case, plant: &dyn Drives) -> Result<(), Failure> {
    let runs = folder.join("runs");
    output::make(&runs)?;
    output::write(&folder.join("vehicle.toml"), &cases::vehicle_text(&case.specification))?;
    for plan in &case.specification.runs {
        let run = recorded(case, plan, plant)?;
        run.write(&runs.join(&plan.name)).map_err(refused_run)?;
    }
    Ok(())
}

/// One drive as a recorded run.
///
/// # Errors
/// [`Failure`] where its description is refused.
pub fn recorded(case: &Case, plan: &Plan, plant: &dyn Drives) -> Result<Run, Failure> {
    run(&case.record_by(plant, plan, true, Errors::Drawn(0)))
}

/// Rows as a run in memory; values keep the digits that a file shows.
///
/// # Errors
/// [`Failure`] where its description is refused.
pub fn run(rows: &Rows) -> Result<Run, Failure> {
    let text = cases::run_text(rows);
    let about = RunFile::parse(Path::new(&rows.name), text)?;
    let commands = rows.commands.iter().map(|asked| CommandRow {
        t: asked.time,
        speed: Some(asked.speed),
        steering: Some(asked.steering),
    });
    let counts = rows.counts.iter().map(|row| {
        let mut out = CountRow { t: row.time, ..CountRow::default() };
        for (wheel, count) in row.value.iter().enumerate() {
            if let Some(count) = count {
                out.counts[wheel] = whole(*count);
                out.mask |= 1 << wheel;
            }
        }
        out
    });
    let speeds = rows.speeds.iter().map(|row| SpeedRow {
        t: row.time,
        speeds: row.value.map(digits),
        mask: 0b1111,
    });
    let steering =
        rows.steering.iter().map(|row| SteeringRow { t: row.time, angle: Some(digits(row.value)) });
    let gyro =
        rows.yaw_rate.iter().map(|row| GyroRow { t: row.time, yaw_rate: Some(digits(row.value)) });
    let reference = rows.reference.iter().map(|row| {
        let (x, y, yaw) = row.value;
        ReferenceRow { t: row.time, x: Some(digits(x)), y: Some(digits(y)), yaw: yaw.map(digits) }
    });
    let read = rows.counts.iter().flat_map(|row| row.value.iter().enumerate());
    let wheels = read.fold(0, |mask, (wheel, count)| mask | u8::from(count.is_some()) << wheel);
    let yaw = rows.reference.iter().any(|row| row.value.2.is_some());
    Ok(Run {
        about,
        encoders: table(counts, wheels),
        wheels: table(speeds, 0b1111),
        steering: table(steering, 1),
        gyro: table(gyro, 1),
        commands: table(commands, 0b11),
        reference: table(reference, if yaw { 0b111 } else { 0b11 }),
    })
}

/// A file without rows is none.
fn table<R: Row>(rows: impl Iterator<Item = R>, columns: u8) -> Option<Table<R>> {
    let rows: Vec<R> = rows.collect();
    (!rows.is_empty()).then(|| Table::new(rows, columns))
}

/// To a millionth: no sensor of a case shows more.
fn digits(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

#[allow(clippy::cast_possible_truncation)] // Counts of at most 32 bits.
fn whole(count: f64) -> i64 {
    count.round() as i64
}
