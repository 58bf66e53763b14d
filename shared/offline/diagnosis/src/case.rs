//! What is diagnosed: a vehicle and its recorded runs.

use std::collections::BTreeMap;

use kerbside_geometry::{Pose, Vehicle};
use kerbside_simulation::Command;

/// Rows of one sensor: strictly increasing stamps \[s\] and their values; a value that is missing is NaN.
#[derive(Clone, Debug, PartialEq)]
pub struct Series<const N: usize> {
    /// Stamps \[s\].
    pub t: Vec<f64>,
    /// Values.
    pub value: Vec<[f64; N]>,
}

impl<const N: usize> Default for Series<N> {
    fn default() -> Self {
        Self { t: Vec::new(), value: Vec::new() }
    }
}

impl<const N: usize> Series<N> {
    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Whether some row holds a value in this column.
    #[must_use]
    pub fn has(&self, column: usize) -> bool {
        self.value.iter().any(|row| row[column].is_finite())
    }

    /// First and last stamp \[s\]; none without rows.
    #[must_use]
    pub fn span(&self) -> Option<(f64, f64)> {
        Some((*self.t.first()?, *self.t.last()?))
    }

    /// The rows stamped `begin <= t < end` \[s\], on the same clock.
    #[must_use]
    pub fn between(&self, begin: f64, end: f64) -> Self {
        let from = self.t.partition_point(|t| *t < begin);
        let to = self.t.partition_point(|t| *t < end);
        Self { t: self.t[from..to].to_vec(), value: self.value[from..to].to_vec() }
    }
}

/// How the wheels' motion was recorded. Arrays are in the order of `kerbside_geometry::WHEELS`.
#[derive(Clone, Debug, PartialEq)]
pub enum Wheels {
    /// Cumulative rotation of each wheel \[rad\], unwrapped.
    Rotation(Series<4>),
    /// Surface speed of each wheel through its nominal radius \[m/s\].
    Speed(Series<4>),
}

impl Wheels {
    /// The rows, whatever they hold.
    #[must_use]
    pub fn series(&self) -> &Series<4> {
        match self {
            Self::Rotation(series) | Self::Speed(series) => series,
        }
    }

    pub(crate) fn series_mut(&mut self) -> &mut Series<4> {
        match self {
            Self::Rotation(series) | Self::Speed(series) => series,
        }
    }
}

/// One uninterrupted drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Name.
    pub name: String,
    /// Name of the run with the same commands, where one is known.
    pub repeat_of: Option<String>,
    /// Pose of the body at t = 0 in the reference frame, where it was measured.
    pub start: Option<Pose>,
    /// What was asked of the actuators, in the order of time; empty where it was not recorded.
    pub commands: Vec<Command>,
    /// Wheels.
    pub wheels: Wheels,
    /// Road-wheel angle \[rad\]; empty without a sensor.
    pub steering: Series<1>,
    /// Yaw rate \[rad/s\]; empty without a gyro.
    pub gyro: Series<1>,
    /// The marker's x, y \[m\] and yaw \[rad\], unwrapped; empty without a reference.
    pub reference: Series<3>,
}

impl Run {
    /// Whether commands were recorded.
    #[must_use]
    pub fn has_commands(&self) -> bool {
        !self.commands.is_empty()
    }

    /// First and last stamp of any sensor \[s\].
    #[must_use]
    pub fn span(&self) -> (f64, f64) {
        let spans = [
            self.wheels.series().span(),
            self.steering.span(),
            self.gyro.span(),
            self.reference.span(),
        ];
        let first = spans.iter().flatten().map(|span| span.0).fold(f64::INFINITY, f64::min);
        let last = spans.iter().flatten().map(|span| span.1).fold(f64::NEG_INFINITY, f64::max);
        (first, last)
    }
}

/// One standard deviation of what a car in good order may differ by.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Allowance {
    /// Of fields of vehicle.toml, by name; `radius` is of each wheel on its own.
    pub fields: BTreeMap<String, f64>,
    /// Of parameters of effects about their neutral value, by effect and parameter.
    pub effects: BTreeMap<(String, String), f64>,
}

/// A vehicle as believed, and its recorded runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name of the folder.
    pub name: String,
    /// The nominal vehicle.
    pub vehicle: Vehicle,
    /// What a car in good order may differ by; none where the file states nothing.
    pub allowance: Option<Allowance>,
    /// Runs.
    pub runs: Vec<Run>,
}
