//! Where a recorded run begins.

use kerbside_geometry::{Pose, Vehicle};

use crate::effects::Effects;
use crate::plant::Plant;

/// Pose of the body while it stands and the reference shows `shown`: the marker and the reference's
/// effects undone. Its delay and its clock do not matter at standstill.
#[must_use]
pub fn body_from_reference(vehicle: &Vehicle, effects: &Effects, shown: &Pose) -> Pose {
    Plant::new(vehicle, effects).sensors.body(shown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Parameter;
    use kerbside_geometry::Reference;

    #[test]
    fn what_the_reference_shows_leads_back_to_the_body() {
        let mut vehicle = Vehicle::paper_car();
        let marker = Pose::new(0.11, -0.04, 0.3);
        vehicle.reference =
            Some(Reference { position_noise: 0.0, yaw_noise: 0.0, rate: 25.0, marker });
        let parameter = |id, name| Parameter::find(id, name).unwrap();
        let effects = Effects::NEUTRAL
            .with(parameter("reference_scale", "scale"), 0.97)
            .with(parameter("reference_marker", "x"), 0.05)
            .with(parameter("reference_marker", "yaw"), -0.06);
        let body = Pose::new(1.0, -2.0, 2.5);
        let shown = Plant::new(&vehicle, &effects).sensors.reference(&body);
        assert!((shown.yaw - (2.5 + 0.3 - 0.06)).abs() < 1e-12);
        let error = body_from_reference(&vehicle, &effects, &shown).seen_from(&body);
        assert!(error.x.abs() + error.y.abs() + error.yaw.abs() < 1e-12, "{error:?}");
    }
}
