//! speed_gain: the commanded speed times a gain, before dead zone and limit.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "speed_gain",
    link: Link::SpeedActuation,
    parameters: &[ParameterDefinition {
        name: "gain",
        neutral: 1.0,
        range: (0.7, 1.3),
        allowed: (0.1, 10.0),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "The commanded speed times a gain, before dead zone and limit.",
    source: "J. Borenstein, L. Feng, \"Measurement and correction of systematic odometry errors \
        in mobile robots\", IEEE Trans. Robotics and Automation 12 (1996), treats its \
        odometric twin; the actuator gain is the first parameter of any drive identification \
        (L. Ljung, System Identification, 1999).",
    excited_by: "Driving at any settled speed, beside a measured wheel speed.",
    apply: |values, plant| {
        plant.speed.gain *= values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial::of("speed_gain", &[0.88], steps, standing));
}
