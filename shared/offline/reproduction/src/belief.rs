//! What is believed of the paper's car: everything, or what an ordinary calibration leaves.

use kerbside_geometry::Pose;
use kerbside_odometry::{PARAMETERS, ParameterPrior};
use kerbside_proving_ground::{Chassis, Encoders, Residuals, Sensors};

use crate::follower::Belief;
use crate::scatter::Trial;

/// What is known of the vehicle's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knowledge {
    /// All of them, exactly.
    Known,
    /// With the residual errors of an ordinary calibration, whose size the filter knows.
    Residual,
    /// The same, and all radii wrong by one common factor of the same size besides.
    Common,
}

impl Knowledge {
    /// Name, for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Known => "known",
            Self::Residual => "residual errors",
            Self::Common => "residual and common errors",
        }
    }
}

/// Noise of each wheel as the sensors have it.
fn noise(sensors: &Sensors) -> Option<[f64; 4]> {
    sensors.encoders.as_ref().map(|encoders: &Encoders| encoders.noise)
}

/// Standard deviations of the residuals in the order of the filter's parameters.
pub(crate) fn deviations(residuals: &Residuals) -> [f64; PARAMETERS] {
    let [fl, fr, rl, rr] = residuals.radius;
    let (front, rear) = (residuals.track_front, residuals.track_rear);
    [fl, fr, rl, rr, front, rear, residuals.wheelbase, residuals.steering_zero, 0.0]
}

/// The prior of the filter that goes with `knowledge`.
pub(crate) fn prior(knowledge: Knowledge, sensors: &Sensors) -> ParameterPrior {
    let mut prior = match knowledge {
        Knowledge::Known => ParameterPrior::known(),
        _ => ParameterPrior::independent(deviations(&Residuals::paper())),
    };
    if knowledge == Knowledge::Common {
        let variance = COMMON * COMMON;
        (0..4).for_each(|i| (0..4).for_each(|j| prior.covariance[(i, j)] += variance));
    }
    prior.wheel_noise = noise(sensors);
    prior
}

/// Standard deviation of the factor that all radii have in common.
const COMMON: f64 = 2e-3;

/// A trial with the errors that `seed` draws. The car is true, the belief is wrong: so one drive serves all trials.
pub(crate) fn trial(knowledge: Knowledge, sensors: &Sensors, seed: u64) -> Trial {
    let mut drawn = match knowledge {
        Knowledge::Known => Residuals::default(),
        _ => Residuals::paper().draw(seed),
    };
    if knowledge == Knowledge::Common {
        // Of another seed: independent of the residuals.
        let common = COMMON * crate::random::Random::new(!seed).normal();
        drawn.radius = drawn.radius.map(|relative| relative + common);
    }
    let believed = drawn.reversed().chassis(&Chassis::paper());
    Trial {
        belief: Belief {
            vehicle: believed.believed(sensors),
            prior: prior(knowledge, sensors),
            start: Pose::default(),
        },
        steering_zero: drawn.steering_zero,
    }
}
