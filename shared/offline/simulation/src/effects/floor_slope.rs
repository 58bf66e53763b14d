//! floor_slope: ground velocity of rate |V| along a fixed direction of the reference frame:
//! slope, nap of a carpet.

use core::f64::consts::PI;

use kerbside_geometry::math;

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "floor_slope",
    link: Link::Ground,
    parameters: &[
        ParameterDefinition {
            name: "direction",
            neutral: 0.0,
            range: (-PI, PI),
            allowed: (-f64::INFINITY, f64::INFINITY),
            unit: "rad",
            scaling: Scaling::None,
        },
        ParameterDefinition {
            name: "rate",
            neutral: 0.0,
            range: (0.0, 0.05),
            allowed: (-1.0, 1.0),
            unit: "1",
            scaling: Scaling::None,
        },
    ],
    per_wheel: false,
    meaning: "Ground velocity of rate |V| along a fixed direction of the reference frame: slope, \
        nap of a carpet.",
    source: "J. Borenstein, L. Feng (1996): non-systematic floor influences; D. Ward, K. \
        Iagnemma, \"A dynamic-model-based wheel slip detector\", IEEE Trans. Robotics 24 \
        (2008).",
    excited_by: "Travel in several directions of the reference frame.",
    apply: |values, plant| {
        let (sin, cos) = math::sin_cos(values[0]);
        plant.contact.floor = (values[1] * cos, values[1] * sin);
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial {
        mirrored: &[-2.1, 0.03],
        begin: Some(&[1.0, 0.001]),
        ..Trial::of("floor_slope", &[2.1, 0.03], steps, standing)
    });
}
