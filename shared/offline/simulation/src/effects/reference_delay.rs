//! reference_delay: the reference shows the pose of a while ago.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "reference_delay",
    link: Link::Reference,
    parameters: &[ParameterDefinition {
        name: "delay",
        neutral: 0.0,
        range: (0.0, 0.4),
        allowed: (0.0, 10.0),
        unit: "s",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "The reference shows the pose of a while ago.",
    source: "J. Kelly, G. Sukhatme (2014): temporal calibration.",
    excited_by: "Changes of speed beside encoders.",
    apply: |values, plant| {
        plant.sensors.reference_delay += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial::of("reference_delay", &[0.2], steps, standing));
}
