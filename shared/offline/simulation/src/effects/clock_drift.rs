//! clock_drift: the stamps of the reference run at 1 + rate of the vehicle's clock.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "clock_drift",
    link: Link::Reference,
    parameters: &[ParameterDefinition {
        name: "rate",
        neutral: 0.0,
        range: (-0.005, 0.005),
        allowed: (-0.5, 0.5),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "The stamps of the reference run at 1 + rate of the vehicle's clock.",
    source: "D. Mills, \"Internet time synchronization\", IEEE Trans. Communications 39 (1991): \
        frequency offset.",
    excited_by: "Long runs that still change speed at their end.",
    apply: |values, plant| {
        plant.sensors.clock_rate += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial::of("clock_drift", &[0.004], steps, standing));
}
