//! gyro_bias: added to what the gyro reads.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "gyro_bias",
    link: Link::Sensing,
    parameters: &[ParameterDefinition {
        name: "bias",
        neutral: 0.0,
        range: (-0.05, 0.05),
        allowed: (-10.0, 10.0),
        unit: "rad/s",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Added to what the gyro reads.",
    source: "IEEE Std 952-1997: bias of a rate gyro.",
    excited_by: "Any run with a gyro, standing best.",
    apply: |values, plant| {
        plant.sensors.gyro_bias += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Seen, Trial, steps, tests};

    tests!(Trial {
        mirrored: &[0.02],
        seen: Seen::NoGyro,
        ..Trial::of("gyro_bias", &[-0.02], steps, steps)
    });
}
