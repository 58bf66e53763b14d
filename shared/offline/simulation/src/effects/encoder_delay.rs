//! encoder_delay: counts and wheel speeds show the rotation of a while ago.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "encoder_delay",
    link: Link::Sensing,
    parameters: &[ParameterDefinition {
        name: "delay",
        neutral: 0.0,
        range: (0.0, 0.3),
        allowed: (0.0, 10.0),
        unit: "s",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Counts and wheel speeds show the rotation of a while ago.",
    source: "L. Ljung (1999), 4.2; J. Kelly, G. Sukhatme, \"A general framework for temporal \
        calibration of multiple proprioceptive and exteroceptive sensors\" (2014).",
    excited_by: "Changes of speed, beside a gyro, a steering sensor or a reference.",
    apply: |values, plant| {
        plant.sensors.encoder_delay += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial::of("encoder_delay", &[0.15], steps, standing));
}
