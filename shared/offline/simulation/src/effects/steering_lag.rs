//! steering_lag: time constant added to that of the steering.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "steering_lag",
    link: Link::SteeringActuation,
    parameters: &[ParameterDefinition {
        name: "lag",
        neutral: 0.0,
        range: (0.0, 0.5),
        allowed: (-10.0, 10.0),
        unit: "s",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Time constant added to that of the steering.",
    source: "L. Ljung, System Identification (1999), 4.2: first-order process model.",
    excited_by: "Small steps of steering, whose rate stays below the limit.",
    apply: |values, plant| {
        plant.steering.lag += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, steps, straight, tests};

    tests!(Trial::of("steering_lag", &[0.3], steps, straight));
}
