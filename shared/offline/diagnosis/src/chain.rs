//! The chain from command to reading.

/// What was asked of the actuators from one instant on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Stamp \[s\].
    pub t: f64,
    /// Speed of the rear-axle centre, negative in reverse \[m/s\].
    pub speed: f64,
    /// Road-wheel angle, left positive \[rad\].
    pub steering: f64,
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
