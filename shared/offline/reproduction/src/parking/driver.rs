//! Who parks, and what they believe.

use kerbside_geometry::{Limits, Pose, Vehicle, Wheel};
use kerbside_odometry::ParameterPrior;
use kerbside_proving_ground::{Actuators, Chassis, Physics, Residuals, Sensors, Slip};

use super::WAIT;
use super::plan::Given;
use crate::belief::{Knowledge, prior};
use crate::follower::{Belief, Contender};
use crate::random::Random;

/// Standard deviations of the start: each axis \[m\], heading \[rad\].
const START: [f64; 2] = [0.02, 2.0 / 180.0 * core::f64::consts::PI];

/// Who parks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driver {
    /// Believes the truth of the pose.
    Perfect,
    /// Rear wheels alone, with residual errors.
    Rear,
    /// The fused filter, with residual errors.
    Fused,
    /// Rear wheels alone, by what was measured by hand.
    Uncalibrated,
    /// As fused, its tracker not knowing the actuators' lag.
    Lagging,
    /// As fused, its steering's zero off by three times what the prior says.
    Crooked,
    /// As fused, one rear wheel spinning by 30 mm half-way.
    Slipping,
    /// As fused, with ordinary physics.
    Physical,
}

impl Driver {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Perfect,
        Self::Rear,
        Self::Fused,
        Self::Uncalibrated,
        Self::Lagging,
        Self::Crooked,
        Self::Slipping,
        Self::Physical,
    ];

    /// Name, for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Perfect => "perfect pose",
            Self::Rear => "rear",
            Self::Fused => "fused",
            Self::Uncalibrated => "rear, uncalibrated",
            Self::Lagging => "fused, lag not compensated",
            Self::Crooked => "fused, zero off by 0.9 deg",
            Self::Slipping => "fused, 30 mm spin",
            Self::Physical => "fused, with physics",
        }
    }

    const fn contender(self) -> Contender {
        match self {
            Self::Rear | Self::Uncalibrated => Contender::Rear,
            _ => Contender::Fused,
        }
    }
}

/// The vehicle, as `chassis` is believed.
fn vehicle(chassis: &Chassis, sensors: &Sensors, knows_lag: bool) -> Vehicle {
    let vehicle = chassis.believed(sensors);
    let steering = Actuators::paper_parking().steering_limit;
    let lag = if knows_lag { 0.1 } else { 0.0 };
    Vehicle {
        limits: Limits { steering, steering_rate: 1.0, ..vehicle.limits },
        actuators: Some(kerbside_geometry::Actuators {
            speed_lag: lag,
            steering_lag: lag,
            ..kerbside_geometry::Actuators::default()
        }),
        ..vehicle
    }
}

/// What is true and believed in one parking.
pub(super) struct Setting {
    pub(super) physics: Physics,
    pub(super) sensors: Sensors,
    pub(super) slips: Vec<Slip>,
    pub(super) belief: Belief,
    pub(super) vehicle: Vehicle,
    pub(super) contender: Contender,
    pub(super) perfect: bool,
}

/// What `driver` believes of the errors that `seed` draws, and what is true.
pub(super) fn setting(driver: Driver, given: &Given, seed: u64) -> Setting {
    let mut random = Random::new(seed);
    let [along, turned] = START;
    let mut drawn = |deviation: f64| deviation * random.normal();
    let start = Pose::new(drawn(along), drawn(along), drawn(turned));
    let mut sensors = Sensors::paper(1.0);
    let residuals = Residuals::paper().draw(seed);
    let zero = match driver {
        Driver::Crooked => 3.0 * Residuals::paper().steering_zero,
        Driver::Perfect | Driver::Uncalibrated => 0.0,
        _ => residuals.steering_zero,
    };
    let believed = match driver {
        Driver::Perfect => Chassis::paper(),
        Driver::Uncalibrated => Chassis {
            track_front: 0.310,
            track_rear: 0.310,
            radius: [0.5 * 0.145; 4],
            ..Chassis::paper()
        },
        _ => residuals.reversed().chassis(&Chassis::paper()),
    };
    let vehicle = vehicle(&believed, &sensors, driver != Driver::Lagging);
    let prior: ParameterPrior = prior(Knowledge::Residual, &sensors);
    if let Some(steering) = &mut sensors.steering {
        steering.offset = zero;
    }
    let half = WAIT + 0.5 * given.head.duration;
    let spins = driver == Driver::Slipping;
    let physics = match driver {
        Driver::Physical => Physics::ordinary(),
        _ => Physics { actuators: Actuators::paper_parking(), ..Physics::NEUTRAL },
    };
    Setting {
        physics,
        slips: spins.then(|| Slip::spin(Wheel::RearLeft, 0.03, half, 0.3)).into_iter().collect(),
        belief: Belief { vehicle: vehicle.clone(), prior, start },
        vehicle,
        sensors,
        contender: driver.contender(),
        perfect: driver == Driver::Perfect,
    }
}
