//! radius_difference: true radius of the left wheel times 1 + d/2, of the right one times 1 -
//! d/2, per axle.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "radius_difference",
    link: Link::Ground,
    parameters: &[
        ParameterDefinition {
            name: "front",
            neutral: 0.0,
            range: (-0.03, 0.03),
            allowed: (-1.0, 1.0),
            unit: "1",
            scaling: Scaling::None,
        },
        ParameterDefinition {
            name: "rear",
            neutral: 0.0,
            range: (-0.03, 0.03),
            allowed: (-1.0, 1.0),
            unit: "1",
            scaling: Scaling::None,
        },
    ],
    per_wheel: false,
    meaning: "True radius of the left wheel times 1 + d/2, of the right one times 1 - d/2, per \
        axle.",
    source: "J. Borenstein, L. Feng (1996): unequal wheel diameters, E_d.",
    excited_by: "Straight travel: left and right counts part.",
    apply: |values, plant| {
        let [front, rear] = [values[0], values[1]].map(|difference| 0.5 * difference);
        let factors = [1.0 + front, 1.0 - front, 1.0 + rear, 1.0 - rear];
        (0..4).for_each(|wheel| plant.contact.radius[wheel] *= factors[wheel]);
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial {
        mirrored: &[0.02, -0.025],
        ..Trial::of("radius_difference", &[-0.02, 0.025], steps, standing)
    });
}
