//! lateral_slip: side velocity at the rear axle of -rate V yaw rate: outwards, also in reverse.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "lateral_slip",
    link: Link::Ground,
    parameters: &[ParameterDefinition {
        name: "rate",
        neutral: 0.0,
        range: (0.0, 0.5),
        allowed: (-10.0, 10.0),
        unit: "s",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Side velocity at the rear axle of -rate V yaw rate: outwards, also in reverse.",
    source: "R. Rajamani (2012), 2.3: the rear axle's slip angle is proportional to the side \
        force.",
    excited_by: "Turning beside a reference; its marker moves sideways.",
    apply: |values, plant| {
        plant.contact.lateral_slip += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, steps, straight, tests};

    tests!(Trial::of("lateral_slip", &[0.3], steps, straight));
}
