//! What the sensors of a recorded run would have read.

use core::f64::consts::TAU;
use core::fmt::Write;

use kerbside_geometry::{Pose, WHEELS};
use kerbside_recordings::run_folder::{
    CountRow, GyroRow, ReferenceRow, Row, Run, SpeedRow, SteeringRow, Table,
};
use kerbside_simulation::{Command, Drive, Follow, STEP, Trajectory};

use super::input::Case;
use super::start::{self, Start};
use super::{follow, wheels};

/// The files of a run as they are predicted.
pub(super) struct Prediction {
    /// The run.
    pub(super) run: String,
    /// Where the body stands at t = 0.
    pub(super) start: Pose,
    /// From commands; else from measured motion.
    pub(super) from_commands: bool,
    /// Names and texts.
    pub(super) files: Vec<(&'static str, String)>,
    /// What a person should know, a sentence each.
    pub(super) notes: Vec<String>,
}

/// Predicts `recorded`: from its commands, or where there are none from the motion of its wheels and its steering.
///
/// # Errors
/// Why it cannot be.
pub(super) fn predict(case: &Case, recorded: &Run) -> Result<Prediction, String> {
    let mut notes = recorded.notices();
    let rotations = wheels::rotations(recorded, &case.vehicle);
    let moved = wheels::first_motion(&rotations, &case.vehicle);
    let until = end_of(recorded);
    let from_commands = recorded.commands.is_some();
    let mut trajectory = Trajectory::new();
    let begun = if let Some(table) = &recorded.commands {
        let commands: Vec<Command> = held(table);
        let commanded = commands.iter().find(|command| command.speed != 0.0);
        let motion = commanded.map(|command| command.t).into_iter().chain(moved).reduce(f64::min);
        let mut drive = |start| {
            let (vehicle, effects) = (&case.vehicle, case.effects);
            let drive = Drive { vehicle, effects, commands: &commands, start, step: STEP };
            drive.trajectory(until, &mut trajectory);
            trajectory.clone()
        };
        let begun = start::start(case, recorded, motion, &mut drive);
        drive(begun.pose);
        begun
    } else {
        let motion = follow::motion(recorded, &rotations, &case.vehicle, &case.effects)?;
        notes.extend(motion.note);
        let (speeds, racks) = (&motion.speeds, &motion.racks);
        let mut drive = |start| {
            let (vehicle, effects) = (&case.vehicle, case.effects);
            let follow = Follow { vehicle, effects, speeds, racks, start, step: STEP };
            follow.trajectory(until, &mut trajectory);
            trajectory.clone()
        };
        let begun = start::start(case, recorded, moved, &mut drive);
        drive(begun.pose);
        begun
    };
    let Start { pose: start, note } = begun;
    notes.extend(note);
    let files = files(case, recorded, &trajectory, from_commands, &mut notes);
    let run = recorded.about.info.name.clone();
    Ok(Prediction { run, start, from_commands, files, notes })
}

/// Commands, a missing field as the one before.
fn held(table: &Table<kerbside_recordings::run_folder::CommandRow>) -> Vec<Command> {
    let mut last = Command::default();
    let row = |row: &kerbside_recordings::run_folder::CommandRow| {
        last = Command {
            t: row.t,
            speed: row.speed.unwrap_or(last.speed),
            steering: row.steering.unwrap_or(last.steering),
        };
        last
    };
    table.rows.iter().map(row).collect()
}

/// The last stamp of all files \[s\].
fn end_of(recorded: &Run) -> f64 {
    fn last<R: Row>(table: Option<&Table<R>>) -> f64 {
        table.and_then(|table| table.rows.last()).map_or(0.0, Row::t)
    }
    [
        last(recorded.encoders.as_ref()),
        last(recorded.wheels.as_ref()),
        last(recorded.steering.as_ref()),
        last(recorded.gyro.as_ref()),
        last(recorded.reference.as_ref()),
    ]
    .into_iter()
    // The reference's clock may be faster.
    .fold(0.0, f64::max)
        * 1.01
        + 1.0
}

fn files(
    case: &Case,
    recorded: &Run,
    trajectory: &Trajectory,
    from_commands: bool,
    notes: &mut Vec<String>,
) -> Vec<(&'static str, String)> {
    let mut files = Vec::new();
    if from_commands {
        if let Some(table) = &recorded.encoders {
            files.push((CountRow::FILE, counts(case, table, trajectory, notes)));
        } else if let Some(table) = &recorded.wheels {
            let speed = |row: &SpeedRow, column: usize| {
                (row.mask & (1 << column) != 0).then(|| trajectory.wheel_speed(row.t)[column])
            };
            files.push((SpeedRow::FILE, text(table, speed)));
        }
        if let Some(table) = &recorded.steering {
            let angle = |row: &SteeringRow, _| row.angle.map(|_| trajectory.steering(row.t));
            files.push((SteeringRow::FILE, text(table, angle)));
        }
    }
    if let Some(table) = &recorded.gyro {
        let rate = |row: &GyroRow, _| row.yaw_rate.map(|_| trajectory.yaw_rate(row.t));
        files.push((GyroRow::FILE, text(table, rate)));
    }
    if let Some(table) = &recorded.reference {
        let value = |row: &ReferenceRow, column: usize| {
            let shown = trajectory.reference(row.t);
            match column {
                0 => row.x.map(|_| shown.x),
                1 => row.y.map(|_| shown.y),
                _ => row.yaw.map(|_| shown.yaw),
            }
        };
        files.push((ReferenceRow::FILE, text(table, value)));
    }
    files
}

/// Counts with their fractions, from the first recorded one on.
fn counts(
    case: &Case,
    table: &Table<CountRow>,
    trajectory: &Trajectory,
    notes: &mut Vec<String>,
) -> String {
    let encoders = case.vehicle.encoders;
    let first = WHEELS.map(|wheel| {
        let index = wheel.index();
        let row = table.rows.iter().find(|row| row.mask & (1 << index) != 0)?;
        let per_revolution = encoders.and_then(|encoders| encoders.counts_per_revolution[index]);
        if per_revolution.is_none() {
            let name = wheel.name();
            notes.push(format!(
                "counts of {name} are left empty: vehicle.toml has no counts_per_revolution of it"
            ));
        }
        let begin = trajectory.rotation(row.t)[index];
        Some((row.counts[index] as f64, begin, per_revolution? / TAU))
    });
    text(table, |row, column| {
        let (count, begin, per_radian) = first[column].filter(|_| row.mask & (1 << column) != 0)?;
        Some(count + (trajectory.rotation(row.t)[column] - begin) * per_radian)
    })
}

/// A file with the stamps and the columns of `table`.
fn text<R: Row>(table: &Table<R>, value: impl Fn(&R, usize) -> Option<f64>) -> String {
    let columns = (0..R::COLUMNS.len()).filter(|column| table.columns & (1 << column) != 0);
    let mut text = String::from("t");
    for column in columns.clone() {
        let _ = write!(text, ",{}", R::COLUMNS[column]);
    }
    text.push('\n');
    for row in &table.rows {
        let _ = write!(text, "{}", row.t());
        for column in columns.clone() {
            text.push(',');
            if let Some(value) = value(row, column) {
                let _ = write!(text, "{value}");
            }
        }
        text.push('\n');
    }
    text
}
