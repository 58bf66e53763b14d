//! What an effect declares of itself.

use kerbside_geometry::Vehicle;

use crate::plant::Plant;

/// An effect.
#[derive(Debug)]
pub struct Definition {
    /// Its name in files.
    pub id: &'static str,
    /// Where its gap arises.
    pub link: Link,
    /// Its parameters.
    pub parameters: &'static [ParameterDefinition],
    /// Whether each wheel has its own values; an overlay then names the wheel.
    pub per_wheel: bool,
    /// What it does.
    pub meaning: &'static str,
    /// Where the literature tells of it.
    pub source: &'static str,
    /// What a run must contain for it to show.
    pub excited_by: &'static str,
    /// Alters the plant. Values in the order of `parameters`; of an effect per wheel each
    /// parameter's four values in a row.
    pub(crate) apply: fn(&[f64], &mut Plant),
}

/// One number of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterDefinition {
    /// Its name in files.
    pub name: &'static str,
    /// The value that changes nothing; where only another parameter of the effect decides that
    /// (the place of a patch), some value to begin with.
    pub neutral: f64,
    /// What a sane search covers, for a car of the size 1:6; [`Self::range_for`] scales it.
    pub range: (f64, f64),
    /// What has a meaning at all.
    pub allowed: (f64, f64),
    /// Unit.
    pub unit: &'static str,
    /// How the range grows with the vehicle.
    pub scaling: Scaling,
}

impl ParameterDefinition {
    /// What a sane search covers for `vehicle`.
    #[must_use]
    pub fn range_for(&self, vehicle: &Vehicle) -> (f64, f64) {
        let factor = self.scaling.factor(vehicle);
        (self.range.0 * factor, self.range.1 * factor)
    }
}

/// How a range grows with the vehicle, against the car of the size 1:6.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scaling {
    /// Numbers, angles and times: not at all.
    None,
    /// With the wheelbase.
    Length,
    /// With the top speed.
    Speed,
    /// With the limit of the acceleration.
    Acceleration,
    /// Inversely with that.
    PerAcceleration,
    /// Inversely with the square of the top speed.
    PerSpeedSquared,
}

impl Scaling {
    /// The factor for `vehicle`.
    #[must_use]
    pub fn factor(self, vehicle: &Vehicle) -> f64 {
        let speed = vehicle.limits.speed / 0.5;
        let acceleration = vehicle.limits.acceleration / 0.3;
        match self {
            Self::None => 1.0,
            Self::Length => vehicle.wheelbase / 0.5,
            Self::Speed => speed,
            Self::Acceleration => acceleration,
            Self::PerAcceleration => 1.0 / acceleration,
            Self::PerSpeedSquared => 1.0 / (speed * speed),
        }
    }
}

/// A link of the chain from command to reading, in the order of cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Link {
    /// From the commanded speed to the motion of the driven wheels.
    SpeedActuation,
    /// From the commanded steering to the angle that the sensor measures.
    SteeringActuation,
    /// From the motion of wheels and body to counts, steering sensor and gyro.
    Sensing,
    /// From wheels and steering to the body, and from one wheel to the other.
    Ground,
    /// From the body to the reference's reading.
    Reference,
}

impl Link {
    /// Every link.
    pub const ALL: [Self; 5] = [
        Self::SpeedActuation,
        Self::SteeringActuation,
        Self::Sensing,
        Self::Ground,
        Self::Reference,
    ];

    /// Its name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SpeedActuation => "speed_actuation",
            Self::SteeringActuation => "steering_actuation",
            Self::Sensing => "sensing",
            Self::Ground => "ground",
            Self::Reference => "reference",
        }
    }
}
