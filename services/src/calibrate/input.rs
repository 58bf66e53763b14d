//! A case as calibration takes it: the vehicle, and its run folders as runs of readings.

use std::path::Path;

use kerbside_calibration::{ReferencePose, Run, Series};
use kerbside_geometry::{Vehicle, WHEELS, Wheel};
use kerbside_recordings::run_folder;
use kerbside_settings::VehicleFile;

use super::drift::Recorded;
use crate::case_folder::CaseFolder;
use crate::exit::{Exit, Failure};

/// A case, read.
#[derive(Debug)]
pub struct Case {
    /// vehicle.toml, in full.
    pub origin: String,
    /// Its text.
    pub text: String,
    /// What it says.
    pub file: VehicleFile,
    /// The runs by name.
    pub runs: Vec<Run>,
    /// Where they were recorded.
    pub recorded: Recorded,
    /// What a person should know of the input, a sentence each.
    pub notices: Vec<String>,
}

impl Case {
    /// Reads vehicle.toml and runs/ of `folder`, and nothing else there.
    ///
    /// # Errors
    /// [`Failure`]: the vehicle is refused, there is no run, or a run is not as the format says.
    pub fn read(folder: &Path) -> Result<Self, Failure> {
        let read = CaseFolder::read(folder, Exit::Configuration)?;
        let mut case = Self {
            origin: read.origin,
            text: read.text,
            file: read.vehicle,
            runs: Vec::new(),
            recorded: Recorded::new(),
            notices: Vec::new(),
        };
        for (folder, recorded) in read.runs {
            case.recorded.insert(recorded.about.info.name.clone(), (folder, None));
            case.take(&recorded);
        }
        case.notices.sort();
        case.notices.dedup();
        Ok(case)
    }

    /// The vehicle as its file states it.
    pub fn vehicle(&self) -> &Vehicle {
        &self.file.vehicle
    }

    fn take(&mut self, recorded: &run_folder::Run) {
        let vehicle = &self.file.vehicle;
        let info = &recorded.about.info;
        self.notices.extend(recorded.notices());
        let steering = recorded.steering.as_ref().map(|table| {
            series(table.rows.iter().filter_map(|row| row.angle.map(|angle| (row.t, angle))))
        });
        let yaw_rate = recorded.gyro.as_ref().map(|table| {
            series(table.rows.iter().filter_map(|row| row.yaw_rate.map(|rate| (row.t, rate))))
        });
        if steering.is_some() && vehicle.steering_sensor.is_none() {
            let why = "vehicle.toml has no [steering_sensor]";
            self.notices.push(format!("steering.csv is not used: {why}"));
        }
        if recorded.reference.is_some() && vehicle.reference.is_none() {
            let why = "vehicle.toml has no [reference]: the marker is taken to be at the rear axle";
            self.notices.push(why.to_owned());
        }
        let run = Run {
            name: info.name.clone(),
            manoeuvre: info.manoeuvre.clone(),
            rotation: rotations(recorded, vehicle, &mut self.notices),
            steering: steering.filter(|_| vehicle.steering_sensor.is_some()),
            yaw_rate: yaw_rate.filter(|_| vehicle.gyro.is_some()),
            reference: reference(recorded),
            start: info.start,
            end_pose: info.end_pose,
            distance: info.distance,
            net_turn: None,
        };
        self.runs.push(run);
    }
}

/// Whether the vehicle has that wheel: an axle without a track has its left one alone.
fn exists(vehicle: &Vehicle, wheel: Wheel) -> bool {
    wheel.is_left() || vehicle.wheel_position(wheel).1 != 0.0
}

/// Rotation of fl, fr, rl, rr: from counts where they were recorded, else from speeds.
fn rotations(
    recorded: &run_folder::Run,
    vehicle: &Vehicle,
    notices: &mut Vec<String>,
) -> [Option<Series>; 4] {
    WHEELS.map(|wheel| {
        let index = wheel.index();
        let read = |mask: u8| mask & (1 << index) != 0;
        if let Some(table) = &recorded.encoders {
            let rows = table.rows.iter().filter(|row| read(row.mask));
            let (t, counts): (Vec<f64>, Vec<i64>) =
                rows.map(|row| (row.t, row.counts[index])).unzip();
            let encoders = vehicle.encoders.as_ref();
            let described = encoders.and_then(|encoders| {
                Some((encoders.counts_per_revolution[index]?, encoders.counter_bits))
            });
            if !t.is_empty() && described.is_none() {
                notices.push(format!(
                    "counts of {} are not used: vehicle.toml has no counts_per_revolution of it",
                    wheel.name()
                ));
            }
            let (per_revolution, bits) = described.filter(|_| !t.is_empty())?;
            return Some(Series::from_wrapping_counts(t, &counts, bits, per_revolution));
        }
        let rows = recorded.wheels.iter().flat_map(|table| &table.rows);
        let rows = rows.filter(|row| read(row.mask));
        let (t, speeds): (Vec<f64>, Vec<f64>) = rows.map(|row| (row.t, row.speeds[index])).unzip();
        let there = !t.is_empty() && exists(vehicle, wheel);
        let radius = vehicle.speed_radius[index].unwrap_or(vehicle.radius[index]);
        there.then(|| Series::from_speeds(t, &speeds, radius))
    })
}

fn reference(recorded: &run_folder::Run) -> Vec<ReferencePose> {
    let rows = recorded.reference.iter().flat_map(|table| &table.rows);
    rows.filter_map(|row| Some(ReferencePose { t: row.t, x: row.x?, y: row.y?, yaw: row.yaw }))
        .collect()
}

fn series(readings: impl Iterator<Item = (f64, f64)>) -> Series {
    let (t, value) = readings.unzip();
    Series { t, value }
}
