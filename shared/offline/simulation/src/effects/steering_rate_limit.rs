//! steering_rate_limit: replaces the limit of the steering rate where it is lower.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "steering_rate_limit",
    link: Link::SteeringActuation,
    parameters: &[ParameterDefinition {
        name: "limit",
        neutral: f64::INFINITY,
        range: (0.05, 0.8),
        allowed: (1e-6, f64::INFINITY),
        unit: "rad/s",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Replaces the limit of the steering rate where it is lower.",
    source: "R. Rajamani, Vehicle Dynamics and Control (2012), 2; rate limits of servos in D. \
        Klyde, D. McRuer, T. Myers, \"Pilot-induced oscillation analysis with actuator rate \
        limiting\", J. Guidance 20 (1997).",
    excited_by: "Large steps of steering.",
    apply: |values, plant| {
        plant.steering.rate_limit = plant.steering.rate_limit.min(values[0]);
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, gentle, steps, tests};

    tests!(Trial {
        begin: Some(&[0.7]),
        ..Trial::of("steering_rate_limit", &[0.2], steps, gentle)
    });
}
