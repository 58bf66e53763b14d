//! speed_delay: dead time added to that of the speed.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "speed_delay",
    link: Link::SpeedActuation,
    parameters: &[ParameterDefinition {
        name: "delay",
        neutral: 0.0,
        range: (0.0, 0.4),
        allowed: (-10.0, 10.0),
        unit: "s",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Dead time added to that of the speed.",
    source: "L. Ljung, System Identification (1999), 4.2: transport delay of a process model.",
    excited_by: "Steps of speed; the delay shifts them, the lag rounds them.",
    apply: |values, plant| {
        plant.speed.delay += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial::of("speed_delay", &[0.17], steps, standing));
}
