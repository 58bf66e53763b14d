//! steering_backlash: play of full width between actuator and rack, centred at the start.

use super::{Definition, Link, ParameterDefinition, Scaling};

/// The effect.
pub(super) const DEFINITION: Definition = Definition {
    id: "steering_backlash",
    link: Link::SteeringActuation,
    parameters: &[ParameterDefinition {
        name: "width",
        neutral: 0.0,
        range: (0.0, 0.1),
        allowed: (0.0, 3.0),
        unit: "rad",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "Play of full width between actuator and rack, centred at the start.",
    source: "M. Nordin, P.-O. Gutman, \"Controlling mechanical systems with backlash: a survey\", \
        Automatica 38 (2002); the play operator of M. Krasnoselskii, A. Pokrovskii, Systems \
        with Hysteresis (1989).",
    excited_by: "Steering that turns back: slaloms, steps to both sides.",
    apply: |values, plant| {
        plant.backlash = values[0];
    },
};

#[cfg(test)]
mod tests {
    use crate::effects::testing::{Trial, steps, straight, tests};

    tests!(Trial::of("steering_backlash", &[0.06], steps, straight));
}
