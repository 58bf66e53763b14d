//! acceleration_slip: as drive_slip with a ratio that grows with the motor's acceleration:
//! positive while speeding up, negative while slowing down.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "acceleration_slip",
    link: Link::Ground,
    parameters: &[ParameterDefinition {
        name: "rate",
        neutral: 0.0,
        range: (0.0, 0.5),
        allowed: (-10.0, 10.0),
        unit: "s^2/m",
        scaling: Scaling::PerAcceleration,
    }],
    per_wheel: false,
    meaning: "As drive_slip with a ratio that grows with the motor's acceleration: positive while \
        speeding up, negative while slowing down.",
    source: "H. Pacejka, Tire and Vehicle Dynamics (2012), 1: in the linear range slip is \
        proportional to the longitudinal force.",
    excited_by: "Hard changes of speed.",
    apply: |values, plant| {
        plant.contact.acceleration_slip += values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, standing, steps, tests};

    tests!(Trial::of("acceleration_slip", &[0.3], steps, standing));
}
