//! reference_marker: added to the marker's place on the vehicle, in the body frame.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "reference_marker",
    link: Link::Reference,
    parameters: &[
        ParameterDefinition {
            name: "x",
            neutral: 0.0,
            range: (-0.1, 0.1),
            allowed: (-100.0, 100.0),
            unit: "m",
            scaling: Scaling::Length,
        },
        ParameterDefinition {
            name: "y",
            neutral: 0.0,
            range: (-0.1, 0.1),
            allowed: (-100.0, 100.0),
            unit: "m",
            scaling: Scaling::Length,
        },
        ParameterDefinition {
            name: "yaw",
            neutral: 0.0,
            range: (-0.1, 0.1),
            allowed: (-10.0, 10.0),
            unit: "rad",
            scaling: Scaling::None,
        },
    ],
    per_wheel: false,
    meaning: "Added to the marker's place on the vehicle, in the body frame.",
    source: "K. Daniilidis, \"Hand-eye calibration using dual quaternions\", Int. J. Robotics \
        Research 18 (1999): lever arm and mounting angle.",
    excited_by: "x and y: turning; yaw: any travel.",
    apply: |values, plant| {
        let marker = &mut plant.sensors.marker;
        marker.x += values[0];
        marker.y += values[1];
        marker.yaw += values[2];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Seen, Trial, steps, tests};

    tests!(Trial {
        mirrored: &[0.05, 0.04, -0.06],
        seen: Seen::NoReference,
        ..Trial::of("reference_marker", &[0.05, -0.04, 0.06], steps, steps)
    });
}
