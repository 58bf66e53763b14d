//! gyro_gain: the gyro reads the yaw rate times a gain.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "gyro_gain",
    link: Link::Sensing,
    parameters: &[ParameterDefinition {
        name: "gain",
        neutral: 1.0,
        range: (0.9, 1.1),
        allowed: (0.1, 10.0),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "The gyro reads the yaw rate times a gain.",
    source: "IEEE Std 952-1997: scale factor of a rate gyro.",
    excited_by: "Turning with a gyro.",
    apply: |values, plant| {
        plant.sensors.gyro_gain *= values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, steps, straight, tests};

    tests!(Trial::of("gyro_gain", &[1.06], steps, straight));
}
