//! What is identified: radii, tracks, wheelbase, the steering sensor's zero and gain, and the place of the reference's
//! marker.

use kerbside_geometry::{Pose, Reference, SteeringSensor, Vehicle, WHEELS, Wheel};
use nalgebra::SVector;

/// How many parameters there are.
pub const COUNT: usize = 12;

/// One number per parameter, in the order of [`PARAMETERS`].
pub type Vector = SVector<f64, COUNT>;

/// One identified quantity; its number is its place in every vector and matrix of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Parameter {
    /// Radius of the front left wheel \[m\].
    RadiusFrontLeft = 0,
    /// Radius of the front right wheel \[m\].
    RadiusFrontRight = 1,
    /// Radius of the rear left wheel \[m\].
    RadiusRearLeft = 2,
    /// Radius of the rear right wheel \[m\].
    RadiusRearRight = 3,
    /// Effective track of the front axle: left wheel to right wheel (the paper's b) \[m\].
    TrackFront = 4,
    /// Effective track of the rear axle \[m\].
    TrackRear = 5,
    /// Effective wheelbase: axle to axle \[m\].
    Wheelbase = 6,
    /// What the steering sensor reads while the wheels stand straight \[rad\].
    SteeringZero = 7,
    /// Sensor reading per road-wheel angle, beyond the zero \[-\].
    SteeringGain = 8,
    /// Place of the reference's marker ahead of the rear-axle centre \[m\].
    MarkerX = 9,
    /// And to its left \[m\].
    MarkerY = 10,
    /// Heading of the marker in the body's frame \[rad\].
    MarkerYaw = 11,
}

/// The parameters in index order.
pub const PARAMETERS: [Parameter; COUNT] = [
    Parameter::RadiusFrontLeft,
    Parameter::RadiusFrontRight,
    Parameter::RadiusRearLeft,
    Parameter::RadiusRearRight,
    Parameter::TrackFront,
    Parameter::TrackRear,
    Parameter::Wheelbase,
    Parameter::SteeringZero,
    Parameter::SteeringGain,
    Parameter::MarkerX,
    Parameter::MarkerY,
    Parameter::MarkerYaw,
];

impl Parameter {
    /// Place in vectors and matrices of parameters.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Name, as configuration and reports write it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        [
            "radius.fl",
            "radius.fr",
            "radius.rl",
            "radius.rr",
            "track_front",
            "track_rear",
            "wheelbase",
            "steering_zero",
            "steering_gain",
            "marker.x",
            "marker.y",
            "marker.yaw",
        ][self as usize]
    }

    /// Unit, as reports write it.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::SteeringZero | Self::MarkerYaw => "rad",
            Self::SteeringGain => "-",
            _ => "m",
        }
    }

    /// The radius of `wheel`.
    #[must_use]
    pub const fn radius(wheel: Wheel) -> Self {
        PARAMETERS[wheel.index()]
    }
}

/// Values of all parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// In the order of [`PARAMETERS`].
    pub values: Vector,
}

impl Parameters {
    /// What the vehicle's file says; without a steering sensor zero 0 and gain 1.
    #[must_use]
    pub fn nominal(vehicle: &Vehicle) -> Self {
        let [fl, fr, rl, rr] = vehicle.radius;
        let (front, rear) = (vehicle.track_front, vehicle.track_rear);
        let (zero, gain) =
            vehicle.steering_sensor.map_or((0.0, 1.0), |sensor| (sensor.offset, sensor.gain));
        let marker = vehicle.reference.map_or(Pose::default(), |reference| reference.marker);
        let base = vehicle.wheelbase;
        let values =
            [fl, fr, rl, rr, front, rear, base, zero, gain, marker.x, marker.y, marker.yaw];
        Self { values: Vector::from(values) }
    }

    /// The value of one parameter, in its unit.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> f64 {
        self.values[parameter.index()]
    }

    /// Gives one parameter another value, in its unit.
    pub fn set(&mut self, parameter: Parameter, value: f64) {
        self.values[parameter.index()] = value;
    }

    /// Radius of `wheel` \[m\].
    #[must_use]
    pub fn radius(&self, wheel: Wheel) -> f64 {
        self.values[wheel.index()]
    }

    /// The paper's epsilon of an axle: left minus right radius \[m\] (equations (8) to (10)).
    #[must_use]
    pub fn epsilon(&self, front: bool) -> f64 {
        let left = if front { 0 } else { 2 };
        self.values[left] - self.values[left + 1]
    }

    /// `body_from_marker`.
    #[must_use]
    pub fn marker(&self) -> Pose {
        let of = |parameter| self.get(parameter);
        Pose::new(of(Parameter::MarkerX), of(Parameter::MarkerY), of(Parameter::MarkerYaw))
    }

    /// `vehicle` with all these in place of its own.
    #[must_use]
    pub fn applied(&self, vehicle: &Vehicle) -> Vehicle {
        Vehicle {
            radius: WHEELS.map(|wheel| self.radius(wheel)),
            track_front: self.get(Parameter::TrackFront),
            track_rear: self.get(Parameter::TrackRear),
            wheelbase: self.get(Parameter::Wheelbase),
            steering_sensor: vehicle.steering_sensor.map(|sensor| SteeringSensor {
                offset: self.get(Parameter::SteeringZero),
                gain: self.get(Parameter::SteeringGain),
                ..sensor
            }),
            reference: vehicle
                .reference
                .map(|reference| Reference { marker: self.marker(), ..reference }),
            ..vehicle.clone()
        }
    }

    /// Road-wheel angle of the equivalent centre wheel \[rad\] for a sensor reading \[rad\].
    #[must_use]
    pub fn road_angle(&self, reading: f64) -> f64 {
        (reading - self.get(Parameter::SteeringZero)) / self.get(Parameter::SteeringGain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn epsilon_is_left_minus_right_as_in_table_1() {
        let mut parameters = Parameters::nominal(&Vehicle::paper_car());
        let diameters = [0.14194, 0.14228, 0.13903, 0.13921];
        for (wheel, diameter) in WHEELS.into_iter().zip(diameters) {
            parameters.set(Parameter::radius(wheel), 0.5 * diameter);
        }
        assert!((parameters.epsilon(true) + 0.17e-3).abs() < 1e-12);
        assert!((parameters.epsilon(false) + 0.09e-3).abs() < 1e-12);
    }

    #[test]
    fn the_papers_b_is_the_track() {
        let vehicle = Vehicle::paper_car();
        let mut parameters = Parameters::nominal(&vehicle);
        parameters.set(Parameter::TrackFront, 0.285);
        parameters.set(Parameter::TrackRear, 0.292);
        let calibrated = parameters.applied(&vehicle);
        assert_eq!((calibrated.track_front, calibrated.track_rear), (0.285, 0.292));
        assert_eq!(calibrated.wheelbase, vehicle.wheelbase);
    }
}
