//! What the fused filter does not know of the vehicle when it begins.

use kerbside_odometry::{Parameter, ParameterPrior};

use super::Stack;

/// What a calibration identifies, and the filter's parameter for it. Gains have none.
const IDENTIFIED: [(&str, Parameter); 8] = [
    ("radius.fl", Parameter::RadiusFrontLeft),
    ("radius.fr", Parameter::RadiusFrontRight),
    ("radius.rl", Parameter::RadiusRearLeft),
    ("radius.rr", Parameter::RadiusRearRight),
    ("track_front", Parameter::TrackFront),
    ("track_rear", Parameter::TrackRear),
    ("wheelbase", Parameter::Wheelbase),
    ("steering_sensor.offset", Parameter::SteeringZero),
];

impl Stack {
    /// The fused filter's prior: of the parameters that a calibration identified its whole covariance, of others what
    /// the vehicle's file states under `[uncertainty]`, and of the rest what an ordinary calibration leaves
    /// ([`ParameterPrior::calibrated`]).
    #[must_use]
    pub fn prior(&self) -> ParameterPrior {
        let vehicle = &self.vehicle;
        let mut prior = ParameterPrior::calibrated(vehicle);
        let mut state = |parameter: Parameter, deviation: Option<f64>| {
            if let Some(deviation) = deviation {
                let index = parameter.index();
                prior.covariance[(index, index)] = deviation * deviation;
            }
        };
        let radii = [
            Parameter::RadiusFrontLeft,
            Parameter::RadiusFrontRight,
            Parameter::RadiusRearLeft,
            Parameter::RadiusRearRight,
        ];
        for (parameter, radius) in radii.into_iter().zip(vehicle.radius) {
            state(parameter, self.stated("radius").map(|deviation| deviation / radius));
        }
        state(Parameter::TrackFront, self.stated("track_front"));
        state(Parameter::TrackRear, self.stated("track_rear"));
        state(Parameter::Wheelbase, self.stated("wheelbase"));
        // The sensor's zero and the wheels' own are one to the filter: what it reads when the car rolls straight ahead.
        let zeros = [("steering_sensor_offset", "offset"), ("steering_offset", "offset")];
        let zeros = zeros.map(|key| self.uncertainty.effects.get(&key).copied());
        let both = zeros.iter().flatten().copied().reduce(f64::hypot);
        state(Parameter::SteeringZero, both);
        state(Parameter::GyroBias, self.uncertainty.effects.get(&("gyro_bias", "bias")).copied());
        self.take_calibration(&mut prior);
        prior
    }

    fn take_calibration(&self, prior: &mut ParameterPrior) {
        let Some(calibration) = &self.calibration else { return };
        // The filter counts radii relative to what the file states.
        let unit = |parameter: Parameter| self.vehicle.radius.get(parameter.index()).copied();
        for (row, one) in IDENTIFIED {
            for (column, other) in IDENTIFIED {
                if let Some(covariance) = calibration.covariance_in_use(row, column) {
                    let units = unit(one).unwrap_or(1.0) * unit(other).unwrap_or(1.0);
                    prior.covariance[(one.index(), other.index())] = covariance / units;
                }
            }
        }
    }

    fn stated(&self, field: &str) -> Option<f64> {
        self.uncertainty.fields.get(field).copied()
    }
}

#[cfg(test)]
mod tests {
    use kerbside_geometry::Vehicle;

    use super::*;
    use crate::{Calibration, Sources};

    fn stack() -> Stack {
        Sources::compiled_in().stack_for(None).unwrap().value
    }

    fn deviation(prior: &ParameterPrior, parameter: Parameter) -> f64 {
        prior.covariance[(parameter.index(), parameter.index())].sqrt()
    }

    #[test]
    fn what_is_stated_goes_before_what_is_ordinary() {
        let mut stack = stack();
        let vehicle: &Vehicle = &stack.vehicle;
        let ordinary = ParameterPrior::calibrated(vehicle);
        let radius = vehicle.radius[2];
        stack.uncertainty = Default::default();
        assert_eq!(stack.prior(), ordinary);
        stack.uncertainty.fields.insert("radius", 1e-3);
        stack.uncertainty.fields.insert("track_rear", 4e-3);
        stack.uncertainty.effects.insert(("steering_offset", "offset"), 3e-3);
        stack.uncertainty.effects.insert(("steering_sensor_offset", "offset"), 4e-3);
        let prior = stack.prior();
        let near = |parameter, expected: f64| {
            assert!((deviation(&prior, parameter) - expected).abs() < 1e-12, "{parameter:?}");
        };
        near(Parameter::RadiusRearLeft, 1e-3 / radius);
        near(Parameter::TrackRear, 4e-3);
        near(Parameter::SteeringZero, 5e-3);
        near(Parameter::Wheelbase, deviation(&ordinary, Parameter::Wheelbase));
    }

    #[test]
    fn a_calibration_hands_over_what_it_knows_together() {
        let mut stack = stack();
        let radius = stack.vehicle.radius[3];
        stack.calibration = Some(Calibration {
            parameters: vec!["track_rear".to_owned(), "radius.rr".to_owned()],
            covariance: vec![vec![4e-8, 1e-9], vec![1e-9, 9e-10]],
            ..Calibration::default()
        });
        let prior = stack.prior();
        let (track, wheel) = (Parameter::TrackRear, Parameter::RadiusRearRight);
        assert!((deviation(&prior, track) - 2e-4).abs() < 1e-15);
        assert!((deviation(&prior, wheel) - 3e-5 / radius).abs() < 1e-15);
        let both = prior.covariance[(track.index(), wheel.index())];
        assert!((both - 1e-9 / radius).abs() < 1e-15);
        assert_eq!(prior.covariance, prior.covariance.transpose());
    }
}
