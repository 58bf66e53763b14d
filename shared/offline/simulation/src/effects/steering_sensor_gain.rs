//! steering_sensor_gain: the steering sensor reads the rack's angle times a gain.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "steering_sensor_gain",
    link: Link::Sensing,
    parameters: &[ParameterDefinition {
        name: "gain",
        neutral: 1.0,
        range: (0.8, 1.2),
        allowed: (0.1, 10.0),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "The steering sensor reads the rack's angle times a gain.",
    source: "Any sensor model: scale factor.",
    excited_by: "Steering, with a steering sensor; the path tells it from a gain of the actuator.",
    apply: |values, plant| {
        plant.sensors.steering_gain *= values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, steps, straight, tests};

    tests!(Trial::of("steering_sensor_gain", &[0.9], steps, straight));
}
