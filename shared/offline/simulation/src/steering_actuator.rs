//! From the commanded steering angle to the rack's.

use kerbside_geometry::Vehicle;

use crate::actuator::Actuator;

/// The steering: its value is the angle of the rack, which the steering sensor reads \[rad\].
pub(crate) fn steering_actuator(vehicle: &Vehicle) -> Actuator {
    let (response, limits) = (vehicle.response(), &vehicle.limits);
    Actuator::new(
        response.steering_delay,
        limits.steering,
        response.steering_lag,
        limits.steering_rate,
    )
}
