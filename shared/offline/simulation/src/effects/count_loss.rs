//! count_loss: one wheel's rotation is shown times 1 - fraction, in both directions.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "count_loss",
    link: Link::Sensing,
    parameters: &[ParameterDefinition {
        name: "fraction",
        neutral: 0.0,
        range: (0.0, 0.2),
        allowed: (-1.0, 1.0),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: true,
    meaning: "One wheel's rotation is shown times 1 - fraction, in both directions.",
    source: "J. Borenstein, L. Feng (1996); missed edges of an incremental encoder.",
    excited_by: "Any travel: one wheel's counts part from the three others.",
    apply: |values, plant| {
        (0..4).for_each(|wheel| plant.sensors.kept[wheel] *= 1.0 - values[wheel]);
    },
};

#[cfg(test)]
mod tests {
    use kerbside_geometry::Wheel;

    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial {
        wheel: Some(Wheel::RearLeft),
        ..Trial::of("count_loss", &[0.08], steps, standing)
    });
}
