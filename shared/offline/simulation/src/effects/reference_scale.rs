//! reference_scale: the marker's position, not its yaw, times a scale about the frame's origin.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "reference_scale",
    link: Link::Reference,
    parameters: &[ParameterDefinition {
        name: "scale",
        neutral: 1.0,
        range: (0.95, 1.05),
        allowed: (0.1, 10.0),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "The marker's position, not its yaw, times a scale about the frame's origin.",
    source: "R. Hartley, A. Zisserman, Multiple View Geometry (2004), 10: scale of a \
        reconstruction.",
    excited_by: "Travel beside wheels whose radii are known.",
    apply: |values, plant| {
        plant.sensors.reference_scale *= values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Seen, Trial, steps, tests};

    tests!(Trial {
        seen: Seen::NoReference,
        ..Trial::of("reference_scale", &[0.97], steps, steps)
    });
}
