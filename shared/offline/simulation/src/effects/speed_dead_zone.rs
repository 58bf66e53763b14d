//! speed_dead_zone: commanded speeds smaller than the width give no motion; larger ones are
//! unchanged.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "speed_dead_zone",
    link: Link::SpeedActuation,
    parameters: &[ParameterDefinition {
        name: "width",
        neutral: 0.0,
        range: (0.0, 0.15),
        allowed: (0.0, f64::INFINITY),
        unit: "m/s",
        scaling: Scaling::Speed,
    }],
    per_wheel: false,
    meaning: "Commanded speeds smaller than the width give no motion; larger ones are unchanged.",
    source: "C. Canudas de Wit et al., \"A new model for control of systems with friction\", IEEE \
        Trans. Automatic Control 40 (1995): break-away friction, seen through a speed \
        controller without integral action.",
    excited_by: "Creeping: commands on both sides of the width.",
    apply: |values, plant| {
        plant.speed.dead_zone = values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, creeping, straight, tests};

    tests!(Trial {
        begin: Some(&[0.1]),
        difference: 0.02,
        tolerance: 0.02,
        ..Trial::of("speed_dead_zone", &[0.13], creeping, straight)
    });
}
