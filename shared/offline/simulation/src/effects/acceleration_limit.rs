//! acceleration_limit: replaces the limit of the acceleration where it is lower.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "acceleration_limit",
    link: Link::SpeedActuation,
    parameters: &[ParameterDefinition {
        name: "limit",
        neutral: f64::INFINITY,
        range: (0.02, 0.3),
        allowed: (1e-6, f64::INFINITY),
        unit: "m/s^2",
        scaling: Scaling::Acceleration,
    }],
    per_wheel: false,
    meaning: "Replaces the limit of the acceleration where it is lower.",
    source: "J. Y. Wong, Theory of Ground Vehicles (2008), 3: power and torque limit of the \
        drive.",
    excited_by: "Large steps of speed.",
    apply: |values, plant| {
        plant.speed.rate_limit = plant.speed.rate_limit.min(values[0]);
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, gentle, steps, tests};

    tests!(Trial {
        begin: Some(&[0.25]),
        ..Trial::of("acceleration_limit", &[0.12], steps, gentle)
    });
}
