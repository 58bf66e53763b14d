//! steering_offset: the road wheels stand askew of rack and sensor by an angle.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "steering_offset",
    link: Link::Ground,
    parameters: &[ParameterDefinition {
        name: "offset",
        neutral: 0.0,
        range: (-0.08, 0.08),
        allowed: (-1.0, 1.0),
        unit: "rad",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "The road wheels stand askew of rack and sensor by an angle.",
    source: "R. Rajamani, Vehicle Dynamics and Control (2012), 2.2: kinematic model; a zero error \
        is systematic in the sense of J. Borenstein, L. Feng (1996).",
    excited_by: "Driving, straight best: the path bends.",
    apply: |values, plant| {
        plant.contact.offset += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial { mirrored: &[0.05], ..Trial::of("steering_offset", &[-0.05], steps, standing) });
}
