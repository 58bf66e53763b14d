//! understeer: the curvature falls by 1 + gradient V^2, as written in both directions.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "understeer",
    link: Link::Ground,
    parameters: &[ParameterDefinition {
        name: "gradient",
        neutral: 0.0,
        range: (0.0, 3.0),
        allowed: (-10.0, 1000.0),
        unit: "s^2/m^2",
        scaling: Scaling::PerSpeedSquared,
    }],
    per_wheel: false,
    meaning: "The curvature falls by 1 + gradient V^2, as written in both directions.",
    source: "T. Gillespie (1992), 6: understeer gradient; R. Rajamani (2012), 3. A real soft \
        front axle oversteers in reverse.",
    excited_by: "Turning at several speeds up to the fastest.",
    apply: |values, plant| {
        plant.contact.understeer += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, steps, straight, tests};

    tests!(Trial::of("understeer", &[1.6], steps, straight));
}
