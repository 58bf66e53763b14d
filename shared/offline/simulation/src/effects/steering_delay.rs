//! steering_delay: dead time added to that of the steering.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "steering_delay",
    link: Link::SteeringActuation,
    parameters: &[ParameterDefinition {
        name: "delay",
        neutral: 0.0,
        range: (0.0, 0.4),
        allowed: (-10.0, 10.0),
        unit: "s",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Dead time added to that of the steering.",
    source: "L. Ljung, System Identification (1999), 4.2: transport delay of a process model.",
    excited_by: "Steps of steering while the sensor is read, or while the car drives.",
    apply: |values, plant| {
        plant.steering.delay += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, steps, straight, tests};

    tests!(Trial::of("steering_delay", &[0.23], steps, straight));
}
