//! drive_slip: the driven wheels turn 1 / (1 - ratio) times what rolling needs, in both
//! directions.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "drive_slip",
    link: Link::Ground,
    parameters: &[ParameterDefinition {
        name: "ratio",
        neutral: 0.0,
        range: (0.0, 0.15),
        allowed: (-1.0, 0.95),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "The driven wheels turn 1 / (1 - ratio) times what rolling needs, in both directions.",
    source: "J. Y. Wong (2008), 1.3: longitudinal slip.",
    excited_by: "Any travel, beside free wheels or a reference.",
    apply: |values, plant| {
        plant.contact.kept *= 1.0 - values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial::of("drive_slip", &[0.08], steps, standing));
}
