//! The odometry models, behind one door.

use kerbside_geometry::{Vehicle, Wheel};
use kerbside_messages::OdometryModel;

use super::front::FrontCorrection;
use super::fused;
use super::gyro::GyroIntegral;
use super::increment::Increment;
use super::kinematics::{FrontPair, GyroWheel, RearPair, SteeredWheel};
use super::odometer::Odometer;
use crate::parameters::ParameterPrior;
use crate::sensors::{NoModel, Sensors};
use crate::settings::{EstimatorSettings, Filter};
use crate::wheels::WheelScale;

/// Which wheels give the pose, and how.
#[derive(Clone, Copy, Debug)]
enum Rolling {
    Rear(RearPair),
    Front(FrontPair),
    Steered(Wheel, SteeredWheel),
    Gyro(Wheel, GyroWheel),
}

/// What a model needs besides the wheels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aids<'a> {
    /// Newest steering angle \[rad\].
    pub(crate) steering: Option<f64>,
    /// The gyro.
    pub(crate) gyro: &'a GyroIntegral,
}

/// One of the models of [`OdometryModel`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Model {
    kind: OdometryModel,
    rolling: Rolling,
}

impl Model {
    /// The model that `sensors` allow, and the correction if it has one.
    pub(crate) fn new(
        vehicle: &Vehicle,
        sensors: &Sensors,
        settings: &EstimatorSettings,
        prior: &ParameterPrior,
        scales: &[WheelScale; 4],
    ) -> Result<(Self, Option<FrontCorrection>), NoModel> {
        let kind = sensors.model(vehicle)?;
        let wheel = sensors.single_wheel().ok_or(NoModel::NoWheel)?;
        let noises = fused::wheel_noise(vehicle, settings, prior);
        let noise = noises[wheel.index()];
        let steering =
            vehicle.steering_sensor.map_or(settings.steering_noise, |sensor| sensor.noise);
        let rear = RearPair { track: vehicle.track_rear, noise: noises[2] };
        let front = FrontPair::new(vehicle, noises[0], steering);
        let rolling = match kind {
            OdometryModel::RearFront | OdometryModel::Rear => Rolling::Rear(rear),
            OdometryModel::Front => Rolling::Front(front),
            OdometryModel::WheelSteering => {
                Rolling::Steered(wheel, SteeredWheel::new(vehicle, wheel, noise, steering))
            }
            OdometryModel::WheelGyro | OdometryModel::None => {
                Rolling::Gyro(wheel, GyroWheel { y: vehicle.wheel_position(wheel).1, noise })
            }
        };
        let counts = scales.map(|scale| scale.metres_per_count);
        let own = settings.filter == Filter::PaperOwn;
        let corrects = own || settings.filter == Filter::Paper;
        let correction = (corrects && kind == OdometryModel::RearFront)
            .then(|| FrontCorrection::new(vehicle, front, counts, settings.gate, own));
        Ok((Self { kind, rolling }, correction))
    }

    pub(crate) fn kind(&self) -> OdometryModel {
        self.kind
    }

    /// The wheels whose travel makes the pose.
    pub(crate) fn needed(&self) -> [bool; 4] {
        match self.rolling {
            Rolling::Rear(_) => [false, false, true, true],
            Rolling::Front(_) => [true, true, false, false],
            Rolling::Steered(wheel, _) | Rolling::Gyro(wheel, _) => {
                core::array::from_fn(|index| index == wheel.index())
            }
        }
    }

    /// Whether the wheels themselves tell the heading, whatever the path between two readings.
    pub(crate) fn heading_from_wheels(&self) -> bool {
        matches!(self.rolling, Rolling::Rear(_))
    }

    /// Whether a turn that the gyro saw goes into the next increment.
    pub(crate) fn uses_gyro(&self) -> bool {
        matches!(self.rolling, Rolling::Gyro(..))
    }

    /// The motion that `wheels` have not yet brought into the pose; none while an aid is missing.
    ///
    /// A car that does not roll does not turn: without a count the gyro's turn waits for the next
    /// one.
    pub(crate) fn increment(&mut self, wheels: &Odometer, aids: &Aids<'_>) -> Option<Increment> {
        let rolled = |wheel: Wheel| wheels.unapplied(wheel.index());
        match &mut self.rolling {
            Rolling::Rear(pair) => {
                Some(pair.increment(rolled(Wheel::RearLeft), rolled(Wheel::RearRight)))
            }
            Rolling::Front(pair) => {
                pair.steer(aids.steering?);
                Some(pair.increment(rolled(Wheel::FrontLeft), rolled(Wheel::FrontRight)))
            }
            Rolling::Steered(wheel, steered) => {
                Some(steered.increment(rolled(*wheel), aids.steering?))
            }
            Rolling::Gyro(wheel, gyro_wheel) => {
                let travel = rolled(*wheel);
                let (turn, variance) = aids.gyro.turn()?;
                let held = if travel == 0.0 { 0.0 } else { 1.0 };
                Some(gyro_wheel.increment(travel, held * turn, held * variance))
            }
        }
    }
}
