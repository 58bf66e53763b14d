//! steering_gain: the commanded angle times a gain, before the limit: servo or linkage ratio;
//! the sensor sees it.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "steering_gain",
    link: Link::SteeringActuation,
    parameters: &[ParameterDefinition {
        name: "gain",
        neutral: 1.0,
        range: (0.7, 1.3),
        allowed: (0.1, 10.0),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "The commanded angle times a gain, before the limit: servo or linkage ratio; the \
        sensor sees it.",
    source: "R. Rajamani, Vehicle Dynamics and Control (2012), 2: steering ratio.",
    excited_by: "Any steering, beside a steering sensor or a turning body.",
    apply: |values, plant| {
        plant.steering.gain *= values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, steps, straight, tests};

    tests!(Trial::of("steering_gain", &[1.2], steps, straight));
}
