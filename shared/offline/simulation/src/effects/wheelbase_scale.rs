//! wheelbase_scale: effective wheelbase over the nominal one, in the path's curvature and in the
//! front wheels' place.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "wheelbase_scale",
    link: Link::Ground,
    parameters: &[ParameterDefinition {
        name: "scale",
        neutral: 1.0,
        range: (0.85, 1.15),
        allowed: (0.1, 10.0),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Effective wheelbase over the nominal one, in the path's curvature and in the front \
        wheels' place.",
    source: "R. Rajamani, Vehicle Dynamics and Control (2012), 2.2: kinematic model.",
    excited_by: "Turning; the shorter wheelbase shows in the counts of the front wheels as well.",
    apply: |values, plant| {
        plant.contact.wheelbase *= values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, steps, straight, tests};

    tests!(Trial::of("wheelbase_scale", &[0.92], steps, straight));
}
