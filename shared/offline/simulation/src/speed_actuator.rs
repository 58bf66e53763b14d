//! From the commanded speed to the motor's.

use kerbside_geometry::Vehicle;

use crate::actuator::Actuator;

/// The drive: its value is the motor's speed, expressed through the mean nominal radius of the
/// driven wheels \[m/s\].
pub(crate) fn speed_actuator(vehicle: &Vehicle) -> Actuator {
    let (response, limits) = (vehicle.response(), &vehicle.limits);
    Actuator::new(response.speed_delay, limits.speed, response.speed_lag, limits.acceleration)
}
