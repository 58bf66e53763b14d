//! How a car in good order may differ from its description where no effect of the library says it.
//!
//! They are written like effects and set like effects, but no overlay names them: they are no
//! cause of a gap, only what a fit has to allow for. Deviations of delays and lags are those of the
//! effects themselves, negative where a car is quicker than described.

use super::{Definition, Link, ParameterDefinition, Scaling};

const FACTOR: ParameterDefinition = ParameterDefinition {
    name: "factor",
    neutral: 1.0,
    range: (0.97, 1.03),
    allowed: (0.1, 10.0),
    unit: "1",
    scaling: Scaling::None,
};

/// True over nominal radius of each single wheel.
pub(super) const RADIUS: Definition = Definition {
    id: "radius",
    link: Link::Ground,
    parameters: &[FACTOR],
    per_wheel: true,
    meaning: "True over nominal radius of each single wheel.",
    source: "J. Borenstein, L. Feng (1996): wheels of one set differ.",
    excited_by: "Any travel.",
    apply: |values, plant| {
        (0..4).for_each(|wheel| plant.contact.radius[wheel] *= values[wheel]);
    },
};

/// True over described limits of the actuators.
pub(super) const LIMITS: Definition = Definition {
    id: "limits",
    link: Link::SpeedActuation,
    parameters: &[
        ParameterDefinition { name: "acceleration", ..FACTOR },
        ParameterDefinition { name: "steering_rate", ..FACTOR },
    ],
    per_wheel: false,
    meaning: "True over described limits of the acceleration and of the steering rate.",
    source: "R. Rajamani, Vehicle Dynamics and Control (2012), 2.",
    excited_by: "Large steps of speed and of steering.",
    apply: |values, plant| {
        plant.speed.rate_limit *= values[0];
        plant.steering.rate_limit *= values[1];
    },
};
