//! steering_compliance: the linkage yields to the side force: the angle of the road wheels falls
//! by the rate times V^2 k0, k0 being the curvature of the unyielding angle.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "steering_compliance",
    link: Link::Ground,
    parameters: &[ParameterDefinition {
        name: "rate",
        neutral: 0.0,
        range: (0.0, 0.5),
        allowed: (-10.0, 10.0),
        unit: "rad s^2/m",
        scaling: Scaling::PerAcceleration,
    }],
    per_wheel: false,
    meaning: "The linkage yields to the side force: the angle of the road wheels falls by the rate \
        times V^2 k0, k0 being the curvature of the unyielding angle.",
    source: "T. Gillespie, Fundamentals of Vehicle Dynamics (1992), 8: steering system \
        compliance.",
    excited_by: "Turning at several speeds up to the fastest.",
    apply: |values, plant| {
        plant.contact.compliance += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, steps, straight, tests};

    tests!(Trial::of("steering_compliance", &[0.35], steps, straight));
}
