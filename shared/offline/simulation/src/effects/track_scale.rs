//! track_scale: effective track over the nominal one, per axle.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "track_scale",
    link: Link::Ground,
    parameters: &[
        ParameterDefinition {
            name: "front",
            neutral: 1.0,
            range: (0.85, 1.15),
            allowed: (0.1, 10.0),
            unit: "1",
            scaling: Scaling::None,
        },
        ParameterDefinition {
            name: "rear",
            neutral: 1.0,
            range: (0.85, 1.15),
            allowed: (0.1, 10.0),
            unit: "1",
            scaling: Scaling::None,
        },
    ],
    per_wheel: false,
    meaning: "Effective track over the nominal one, per axle.",
    source: "J. Borenstein, L. Feng (1996): the effective wheelbase of a differential drive, E_b.",
    excited_by: "Turning, beside a yaw from elsewhere; a front axle that is not driven shows in its \
        counts alone.",
    apply: |values, plant| {
        plant.contact.track_front *= values[0];
        plant.contact.track_rear *= values[1];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, steps, straight, tests};

    tests!(Trial::of("track_scale", &[1.09, 0.93], steps, straight));
}
