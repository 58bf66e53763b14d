//! lateral_drift: side velocity of rate |V| in the body frame, left positive: an axle askew
//! makes the car crab.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "lateral_drift",
    link: Link::Ground,
    parameters: &[ParameterDefinition {
        name: "rate",
        neutral: 0.0,
        range: (-0.05, 0.05),
        allowed: (-1.0, 1.0),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Side velocity of rate |V| in the body frame, left positive: an axle askew makes the \
        car crab.",
    source: "H. Pacejka (2012), 1: ply steer and conicity; axle misalignment.",
    excited_by: "Any travel beside a reference.",
    apply: |values, plant| {
        plant.contact.lateral_drift += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial { mirrored: &[0.03], ..Trial::of("lateral_drift", &[-0.03], steps, standing) });
}
