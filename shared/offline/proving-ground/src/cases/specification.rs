//! All that is fixed of a case before anything drives. Nothing here says by which physics the vehicle moves, so that
//! several plants can drive the same case.

use kerbside_geometry::{Pose, Vehicle};

use super::floor::Floor;
use crate::insertions::{Effect, Link, definition};
use crate::library::Asked;

/// What kind of cause was put in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// None: the car is in good order.
    Null,
    /// One listed effect.
    Single,
    /// Two listed effects.
    Pair,
    /// One effect that no list has.
    Unknown,
}

impl Kind {
    /// The name that labels use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Null => "null",
            Self::Single => "single",
            Self::Pair => "pair",
            Self::Unknown => "unknown",
        }
    }
}

/// One standard deviation of what a car in good order may differ by from its description.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Uncertainty {
    /// Of fields of the vehicle; `radius` is that of each wheel on its own.
    pub fields: Vec<(&'static str, f64)>,
    /// Of parameters of listed effects: id, parameter, deviation.
    pub effects: Vec<(&'static str, &'static str, f64)>,
}

/// Stamps at which something is sent or read \[s\].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stamps {
    /// Commands.
    pub commands: Vec<f64>,
    /// Encoders, or wheel speeds.
    pub encoders: Vec<f64>,
    /// Steering sensor; none without one.
    pub steering: Vec<f64>,
    /// Gyro; none without one.
    pub gyro: Vec<f64>,
    /// Reference, by its own clock; none without one.
    pub reference: Vec<f64>,
}

/// A drive as it is planned: the same whatever is put into the vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Name of the run.
    pub name: String,
    /// The word for its manoeuvre.
    pub manoeuvre: &'static str,
    /// Name of the run that it repeats.
    pub repeat_of: Option<String>,
    /// \[s\].
    pub duration: f64,
    /// What is asked, each row until the next.
    pub commands: Vec<Asked>,
    /// True pose of the body at the start, in the reference's frame.
    pub start: Pose,
    /// When what is read.
    pub stamps: Stamps,
    /// Small effects in which this run differs from others.
    pub variation: Vec<Effect>,
    /// Seed of its noise and disturbances.
    pub seed: u64,
    /// Whether the start pose is stated.
    pub states_start: bool,
    /// Whether the distance is stated.
    pub states_distance: bool,
}

/// Mass and its place: what a plant with forces needs beside the vehicle's measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Build {
    /// \[kg\].
    pub mass: f64,
    /// Radius of gyration over the wheelbase.
    pub gyration: f64,
    /// Centre of mass before the rear axle, over the wheelbase.
    pub centre_of_mass: f64,
    /// Side slip of front and rear tyres per force over load \[rad\].
    pub lateral_compliance: [f64; 2],
    /// Slip of the driven tyres per force over load.
    pub longitudinal_compliance: f64,
    /// Largest force over load.
    pub friction: f64,
    /// Force of rolling over load.
    pub rolling_resistance: f64,
    /// 1: each front wheel points along its own circle; 0: both are parallel.
    pub ackermann: f64,
    /// Angle by which the linkage yields to side acceleration \[rad per m/s^2\].
    pub linkage: f64,
    /// Toe of each front wheel, inwards \[rad\].
    pub toe: f64,
    /// By which the gyro is late: part of what every gyro is \[s\].
    pub gyro_latency: f64,
}

/// A case.
#[derive(Clone, Debug, PartialEq)]
pub struct Specification {
    /// That drew it.
    pub seed: u64,
    /// What kind of cause was put in.
    pub kind: Kind,
    /// What the description says.
    pub vehicle: Vehicle,
    /// What it may be wrong by.
    pub uncertainty: Uncertainty,
    /// True measures and responses, within that.
    pub truth: Vehicle,
    /// The same of what has no field.
    pub habits: Vec<Effect>,
    /// Mass and tyres.
    pub build: Build,
    /// Noise and disturbances.
    pub floor: Floor,
    /// Whether the reference reports a heading.
    pub reference_yaw: bool,
    /// What was put in.
    pub effects: Vec<Effect>,
    /// Drives that a diagnosis may read.
    pub runs: Vec<Plan>,
    /// Other drives.
    pub holdout: Vec<Plan>,
}

impl Specification {
    /// Links at which something was put in, each once, in the order of cause.
    #[must_use]
    pub fn links(&self) -> Vec<Link> {
        let known = self.effects.iter().filter_map(|effect| definition(effect.id));
        let mut links: Vec<_> = known.map(|definition| definition.link).collect();
        links.sort();
        links.dedup();
        links
    }
}
