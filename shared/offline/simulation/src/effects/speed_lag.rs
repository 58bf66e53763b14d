//! speed_lag: time constant added to that of the speed.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "speed_lag",
    link: Link::SpeedActuation,
    parameters: &[ParameterDefinition {
        name: "lag",
        neutral: 0.0,
        range: (0.0, 0.6),
        allowed: (-10.0, 10.0),
        unit: "s",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Time constant added to that of the speed.",
    source: "L. Ljung, System Identification (1999), 4.2: first-order process model.",
    excited_by: "Small steps of speed, whose rate stays below the limit of the acceleration.",
    apply: |values, plant| {
        plant.speed.lag += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial::of("speed_lag", &[0.35], steps, standing));
}
