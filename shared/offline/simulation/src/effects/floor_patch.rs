//! floor_patch: as drive_slip while the rear-axle centre is inside a disc of the reference
//! frame, without memory.

use super::{Definition, Link, ParameterDefinition, Scaling};
use crate::plant::Patch;

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "floor_patch",
    link: Link::Ground,
    parameters: &[
        ParameterDefinition {
            name: "x",
            neutral: 0.0,
            range: (-5.0, 5.0),
            allowed: (-f64::INFINITY, f64::INFINITY),
            unit: "m",
            scaling: Scaling::Length,
        },
        ParameterDefinition {
            name: "y",
            neutral: 0.0,
            range: (-5.0, 5.0),
            allowed: (-f64::INFINITY, f64::INFINITY),
            unit: "m",
            scaling: Scaling::Length,
        },
        ParameterDefinition {
            name: "radius",
            neutral: 0.5,
            range: (0.1, 2.0),
            allowed: (0.0, f64::INFINITY),
            unit: "m",
            scaling: Scaling::Length,
        },
        ParameterDefinition {
            name: "ratio",
            neutral: 0.0,
            range: (0.0, 0.3),
            allowed: (-1.0, 0.95),
            unit: "1",
            scaling: Scaling::None,
        },
    ],
    per_wheel: false,
    meaning: "As drive_slip while the rear-axle centre is inside a disc of the reference frame, \
        without memory.",
    source: "D. Ward, K. Iagnemma (2008): slip on a patch of low friction.",
    excited_by: "Paths that enter and leave the disc on more than one side.",
    apply: |values, plant| {
        let [x, y, radius, ratio] = core::array::from_fn(|index| values[index]);
        plant.contact.patch = Patch { x, y, radius, kept: 1.0 - ratio };
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, shuttle, standing, tests};

    tests!(Trial {
        mirrored: &[0.6, -0.25, 0.35, 0.2],
        begin: Some(&[0.63, 0.22, 0.38, 0.1]),
        ..Trial::of("floor_patch", &[0.6, 0.25, 0.35, 0.2], shuttle, standing)
    });
}
