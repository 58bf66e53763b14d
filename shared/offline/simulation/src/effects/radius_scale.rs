//! radius_scale: true over nominal radius of all wheels: load, pressure.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "radius_scale",
    link: Link::Ground,
    parameters: &[ParameterDefinition {
        name: "scale",
        neutral: 1.0,
        range: (0.92, 1.08),
        allowed: (0.1, 10.0),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "True over nominal radius of all wheels: load, pressure.",
    source: "J. Borenstein, L. Feng (1996), the scale error E_s; J. Y. Wong (2008): effective \
        rolling radius.",
    excited_by: "Any travel, beside a reference or a taped distance.",
    apply: |values, plant| {
        plant.contact.radius = plant.contact.radius.map(|radius| radius * values[0]);
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial::of("radius_scale", &[1.05], steps, standing));
}
