//! steering_sensor_offset: added to what the steering sensor reads.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "steering_sensor_offset",
    link: Link::Sensing,
    parameters: &[ParameterDefinition {
        name: "offset",
        neutral: 0.0,
        range: (-0.08, 0.08),
        allowed: (-1.0, 1.0),
        unit: "rad",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Added to what the steering sensor reads.",
    source: "Any sensor model: bias.",
    excited_by: "Any run with a steering sensor; the path tells it from an angle of the wheels.",
    apply: |values, plant| {
        plant.sensors.steering_offset += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Seen, Trial, steps, tests};

    tests!(Trial {
        mirrored: &[-0.03],
        seen: Seen::NoSteeringSensor,
        ..Trial::of("steering_sensor_offset", &[0.03], steps, steps)
    });
}
