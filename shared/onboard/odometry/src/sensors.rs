//! What a vehicle measures, and which odometry model that allows.

use kerbside_geometry::{Vehicle, WHEELS, Wheel, math};
use kerbside_messages::OdometryModel;

/// How the wheels report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WheelSignal {
    /// Cumulative counts of encoders.
    Counts,
    /// Surface speeds that the vehicle computed itself \[m/s\].
    Speeds,
}

/// What a vehicle measures. Wheels are indexed as everywhere: fl, fr, rl, rr.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sensors {
    /// Which wheels report.
    pub wheels: [bool; 4],
    /// What they report.
    pub signal: WheelSignal,
    /// Whether there is a steering sensor.
    pub steering: bool,
    /// Whether there is a gyro.
    pub gyro: bool,
}

/// Why no pose can be computed, and what would help.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoModel {
    /// No wheel reports.
    #[error(
        "no wheel reports: nothing tells how far the vehicle rolls; counts_per_revolution of at \
         least one wheel, \
         or a recording with wheel speeds, would do"
    )]
    NoWheel,
    /// One wheel, or one a side, and nothing else.
    #[error(
        "only wheel {wheel} and neither steering sensor nor gyro: nothing tells how the vehicle \
         turns; \
         a second wheel on the rear axle, a steering sensor or a gyro would do"
    )]
    NoTurning {
        /// The wheel that would be used.
        wheel: &'static str,
    },
    /// Front wheels whose direction is unknown.
    #[error(
        "only front wheels and no steering sensor: nothing tells in which direction they roll; \
         a steering sensor or a wheel on the rear axle would do"
    )]
    NoDirection,
    /// A rear wheel that may stand still while the vehicle turns about it.
    #[error(
        "only rear wheel {wheel}, beside the centre line, and a steering limit of {steering} rad: \
         full lock turns \
         the vehicle about that wheel, which then tells nothing; a second wheel would do"
    )]
    TurnsAboutWheel {
        /// The wheel.
        wheel: &'static str,
        /// `limits.steering` \[rad\].
        steering: f64,
    },
    /// A number that no vehicle has.
    #[error("{field} is {value}: {allowed}")]
    Field {
        /// Name of the field in vehicle.toml.
        field: &'static str,
        /// What it says.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
}

impl Sensors {
    /// What the vehicle's own file says: a count from each wheel with counts per revolution;
    /// steering sensor and gyro where they are described.
    #[must_use]
    pub fn of(vehicle: &Vehicle) -> Self {
        let counted = |encoders: kerbside_geometry::Encoders| {
            encoders.counts_per_revolution.map(|counts| counts.is_some())
        };
        Self {
            wheels: vehicle.encoders.map_or([false; 4], counted),
            signal: if vehicle.encoders.is_some() {
                WheelSignal::Counts
            } else {
                WheelSignal::Speeds
            },
            steering: vehicle.steering_sensor.is_some(),
            gyro: vehicle.gyro.is_some(),
        }
    }

    /// The same, but these wheels report speeds: for vehicles without encoders, whose file cannot
    /// say which do.
    #[must_use]
    pub const fn with_speeds(self, wheels: [bool; 4]) -> Self {
        Self { wheels, signal: WheelSignal::Speeds, ..self }
    }

    /// The model that these sensors allow on `vehicle`. Two wheels of one axle are preferred for
    /// the yaw, the rear axle before the front; a single wheel needs the steering sensor, else the
    /// gyro.
    ///
    /// # Errors
    /// [`NoModel`] naming what is missing and what would do.
    pub fn model(&self, vehicle: &Vehicle) -> Result<OdometryModel, NoModel> {
        check_geometry(vehicle)?;
        let [fl, fr, rl, rr] = self.wheels;
        let rear_pair = rl && rr && vehicle.track_rear > 0.0;
        let front_pair = fl && fr && vehicle.track_front > 0.0;
        match (rear_pair, front_pair && self.steering) {
            (true, true) => Ok(OdometryModel::RearFront),
            (true, false) => Ok(OdometryModel::Rear),
            (false, true) => Ok(OdometryModel::Front),
            (false, false) => self.single(vehicle),
        }
    }

    /// The wheel that a model of one wheel uses: a rear wheel before a front one, left before
    /// right.
    pub(crate) fn single_wheel(&self) -> Option<Wheel> {
        let order = [Wheel::RearLeft, Wheel::RearRight, Wheel::FrontLeft, Wheel::FrontRight];
        order.into_iter().find(|wheel| self.wheels[wheel.index()])
    }

    fn single(&self, vehicle: &Vehicle) -> Result<OdometryModel, NoModel> {
        let wheel = self.single_wheel().ok_or(NoModel::NoWheel)?;
        if wheel.is_front() && !self.steering {
            return Err(NoModel::NoDirection);
        }
        if self.steering && regular(vehicle, wheel) {
            return Ok(OdometryModel::WheelSteering);
        }
        if self.gyro {
            return Ok(OdometryModel::WheelGyro);
        }
        if self.steering {
            let steering = vehicle.limits.steering;
            return Err(NoModel::TurnsAboutWheel { wheel: wheel.name(), steering });
        }
        Err(NoModel::NoTurning { wheel: wheel.name() })
    }
}

/// The model that the vehicle's own sensors allow, [`Sensors::of`].
///
/// # Errors
/// [`NoModel`] naming what is missing and what would do.
pub fn model_for(vehicle: &Vehicle) -> Result<OdometryModel, NoModel> {
    Sensors::of(vehicle).model(vehicle)
}

/// Share of the wheelbase that a rear wheel keeps from the turning centre, in the sense of
/// [`rear_leverage`].
pub(crate) const LEAST_LEVERAGE: f64 = 0.05;

/// L cos(phi) - y sin(phi) of a rear wheel at lateral place y, over L: zero where the vehicle turns
/// about it.
pub(crate) fn rear_leverage(vehicle: &Vehicle, wheel: Wheel, steering: f64) -> f64 {
    let (sin, cos) = math::sin_cos(steering);
    cos - vehicle.wheel_position(wheel).1 * sin / vehicle.wheelbase
}

/// Whether a single wheel tells the motion at every steering angle the vehicle has.
fn regular(vehicle: &Vehicle, wheel: Wheel) -> bool {
    let limit = vehicle.limits.steering;
    wheel.is_front()
        || [-limit, limit]
            .iter()
            .all(|angle| rear_leverage(vehicle, wheel, *angle) > LEAST_LEVERAGE)
}

/// Refuses numbers that would turn into poses which are none.
fn check_geometry(vehicle: &Vehicle) -> Result<(), NoModel> {
    let positive = |field, value: f64| {
        let fine = value.is_finite() && value > 0.0;
        fine.then_some(()).ok_or(NoModel::Field { field, value, allowed: "a length above 0 m" })
    };
    let track = |field, value: f64| {
        let fine = value.is_finite() && value >= 0.0;
        fine.then_some(()).ok_or(NoModel::Field {
            field,
            value,
            allowed: "a length of at least 0 m",
        })
    };
    positive("wheelbase", vehicle.wheelbase)?;
    positive("limits.speed", vehicle.limits.speed)?;
    positive("limits.steering", vehicle.limits.steering)?;
    track("track_front", vehicle.track_front)?;
    track("track_rear", vehicle.track_rear)?;
    WHEELS.iter().try_for_each(|wheel| positive("radius", vehicle.radius[wheel.index()]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wheels::tests::car;

    fn having(wheels: [bool; 4], steering: bool, gyro: bool) -> Sensors {
        Sensors { wheels, signal: WheelSignal::Counts, steering, gyro }
    }

    #[test]
    fn what_a_vehicle_has_picks_the_model() {
        use OdometryModel as Model;
        let all = [true; 4];
        let (front, rear) = ([true, true, false, false], [false, false, true, true]);
        let (rl, fl) = ([false, false, true, false], [true, false, false, false]);
        for (wheels, steering, gyro, model) in [
            (all, true, false, Model::RearFront),
            (all, false, true, Model::Rear),
            (rear, false, false, Model::Rear),
            (rear, true, true, Model::Rear),
            (front, true, false, Model::Front),
            (rl, true, true, Model::WheelSteering),
            (rl, false, true, Model::WheelGyro),
            (fl, true, false, Model::WheelSteering),
            ([true, false, true, true], true, false, Model::Rear),
        ] {
            assert_eq!(having(wheels, steering, gyro).model(&car()), Ok(model), "{wheels:?}");
        }
    }

    #[test]
    fn what_is_missing_is_named() {
        let none = having([false; 4], true, true).model(&car());
        assert_eq!(none, Err(NoModel::NoWheel));
        let alone = having([false, false, false, true], false, false).model(&car());
        assert_eq!(alone, Err(NoModel::NoTurning { wheel: "rr" }));
        let front = having([true, true, false, false], false, true).model(&car());
        assert_eq!(front, Err(NoModel::NoDirection));
        let text = NoModel::NoTurning { wheel: "rr" }.to_string();
        assert!(text.contains("rr") && text.contains("steering sensor or a gyro would do"));
    }

    #[test]
    fn two_wheels_at_one_place_are_one_wheel() {
        let mut vehicle = car();
        vehicle.track_rear = 0.0;
        let pair = having([false, false, true, true], false, true);
        assert_eq!(pair.model(&vehicle), Ok(OdometryModel::WheelGyro));
    }

    #[test]
    fn a_wheel_that_full_lock_turns_about_is_refused() {
        let mut vehicle = car();
        vehicle.limits.steering = 1.3;
        let sensors = having([false, false, true, false], true, false);
        assert!(matches!(sensors.model(&vehicle), Err(NoModel::TurnsAboutWheel { .. })));
        vehicle.track_rear = 0.0;
        assert_eq!(sensors.model(&vehicle), Ok(OdometryModel::WheelSteering));
    }

    #[test]
    fn impossible_geometry_is_refused_by_field() {
        let mut vehicle = car();
        vehicle.wheelbase = f64::NAN;
        assert!(matches!(model_for(&vehicle), Err(NoModel::Field { field: "wheelbase", .. })));
        vehicle = car();
        vehicle.radius[2] = 0.0;
        assert!(matches!(model_for(&vehicle), Err(NoModel::Field { field: "radius", .. })));
    }

    #[test]
    fn a_vehicle_without_encoders_says_its_speeds_by_hand() {
        let mut vehicle = car();
        vehicle.encoders = None;
        assert_eq!(model_for(&vehicle), Err(NoModel::NoWheel));
        let sensors = Sensors::of(&vehicle).with_speeds([true; 4]);
        assert_eq!(sensors.model(&vehicle), Ok(OdometryModel::RearFront));
    }
}
