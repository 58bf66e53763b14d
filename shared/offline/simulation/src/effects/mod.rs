//! The effects that can be added to the nominal vehicle: one file each.
//!
//! An effect's file says what it means and how it alters the plant, the description that every
//! station of the simulator works by. To add one: write its file and name it here, in `LIBRARY`;
//! its parameters, its overlay, its range in a search and its place in the simulation follow.
//!
//! Effects are applied in the order of this list, so the order in a file does not matter. One whose
//! parameters are all neutral is not applied at all: it changes no bit.

mod definition;
mod deviations;
mod overlay;
mod parameter;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod values;

mod acceleration_limit;
mod acceleration_slip;
mod clock_drift;
mod count_loss;
mod drive_slip;
mod encoder_delay;
mod floor_patch;
mod floor_slope;
mod gyro_bias;
mod gyro_gain;
mod lateral_drift;
mod lateral_slip;
mod radius_difference;
mod radius_scale;
mod reference_delay;
mod reference_marker;
mod reference_scale;
mod speed_dead_zone;
mod speed_delay;
mod speed_gain;
mod speed_lag;
mod steering_backlash;
mod steering_compliance;
mod steering_delay;
mod steering_gain;
mod steering_lag;
mod steering_offset;
mod steering_rate_limit;
mod steering_sensor_gain;
mod steering_sensor_offset;
mod track_scale;
mod understeer;
mod wheelbase_scale;

pub use definition::{Definition, Link, ParameterDefinition, Scaling};
pub use overlay::{Effect, Overlay, OverlayError};
pub use parameter::Parameter;
pub use values::Effects;

/// Every effect, in the order of cause: the one place to add the next.
const LIBRARY: &[&Definition] = &[
    &speed_gain::DEFINITION,
    &speed_delay::DEFINITION,
    &speed_lag::DEFINITION,
    &speed_dead_zone::DEFINITION,
    &acceleration_limit::DEFINITION,
    &steering_gain::DEFINITION,
    &steering_delay::DEFINITION,
    &steering_lag::DEFINITION,
    &steering_rate_limit::DEFINITION,
    &steering_backlash::DEFINITION,
    &steering_offset::DEFINITION,
    &steering_compliance::DEFINITION,
    &wheelbase_scale::DEFINITION,
    &track_scale::DEFINITION,
    &radius_scale::DEFINITION,
    &radius_difference::DEFINITION,
    &drive_slip::DEFINITION,
    &acceleration_slip::DEFINITION,
    &understeer::DEFINITION,
    &lateral_slip::DEFINITION,
    &lateral_drift::DEFINITION,
    &floor_slope::DEFINITION,
    &floor_patch::DEFINITION,
    &count_loss::DEFINITION,
    &encoder_delay::DEFINITION,
    &steering_sensor_offset::DEFINITION,
    &steering_sensor_gain::DEFINITION,
    &gyro_bias::DEFINITION,
    &gyro_gain::DEFINITION,
    &reference_delay::DEFINITION,
    &reference_scale::DEFINITION,
    &reference_marker::DEFINITION,
    &clock_drift::DEFINITION,
    // One that only the tests know, to show that this line is all it takes.
    #[cfg(test)]
    &tests::FRONT_WEAR,
];

/// What a car in good order may differ by besides.
const DEVIATIONS: &[&Definition] = &[&deviations::RADIUS, &deviations::LIMITS];

/// Every effect, in the order of cause.
#[must_use]
pub fn library() -> &'static [&'static Definition] {
    LIBRARY
}

/// The effect of that name.
#[must_use]
pub fn definition(id: &str) -> Option<&'static Definition> {
    LIBRARY.iter().copied().find(|definition| definition.id == id)
}
