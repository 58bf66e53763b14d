//! What the fused filter does not know of the vehicle when it begins.

use kerbside_odometry::{Parameter, ParameterPrior};

use super::Stack;

impl Stack {
    /// The fused filter's prior: what the vehicle's file states under `[uncertainty]`, and what an ordinary calibration
    /// leaves ([`ParameterPrior::calibrated`]) of the parameters that it does not state.
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
        prior
    }

    fn stated(&self, field: &str) -> Option<f64> {
        self.uncertainty.fields.get(field).copied()
    }
}

#[cfg(test)]
mod tests {
    use kerbside_geometry::Vehicle;

    use super::*;
    use crate::Sources;

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
}
