//! From what a file states to a vehicle.

use std::collections::BTreeMap;

use kerbside_geometry::{Encoders, Vehicle};

use super::{Uncertainty, VehicleDraft, VehicleFile};
use crate::declare::Reading;

/// Fills in what follows from other keys, and reports what would have to but does not.
pub(super) fn complete(reading: &mut Reading<'_, VehicleDraft>, draft: &mut VehicleDraft) {
    if !draft.limits.deceleration.is_finite() {
        draft.limits.deceleration = draft.limits.acceleration;
    }
    for (axle, path) in ["radius.fr", "radius.rr"].into_iter().enumerate() {
        let (left, right) = (2 * axle, 2 * axle + 1);
        if draft.radius[right].is_finite() {
            continue;
        }
        if draft.track[axle] == 0.0 {
            draft.radius[right] = draft.radius[left];
        } else if reading.is_sound() {
            reading.missing(path);
        }
    }
}

/// The vehicle of a complete draft.
pub(super) fn vehicle(reading: &Reading<'_, VehicleDraft>, draft: VehicleDraft) -> VehicleFile {
    let encoders = Encoders {
        counts_per_revolution: draft.counts,
        counter_bits: draft.counter_bits,
        noise_per_distance: draft.noise_per_distance,
        rate: draft.encoder_rate,
    };
    let vehicle = Vehicle {
        name: draft.name,
        wheelbase: draft.wheelbase,
        track_front: draft.track[0],
        track_rear: draft.track[1],
        radius: draft.radius,
        speed_radius: draft.speed_radius,
        drive: draft.drive,
        footprint: draft.footprint,
        limits: draft.limits,
        actuators: reading.has("actuators").then_some(draft.actuators),
        encoders: reading.has("encoders").then_some(encoders),
        steering_sensor: reading.has("steering_sensor").then_some(draft.steering_sensor),
        gyro: reading.has("gyro").then_some(draft.gyro),
        reference: reading.has("reference").then_some(draft.reference),
    };
    let uncertainty = Uncertainty { fields: stated(draft.fields), effects: stated(draft.effects) };
    let calibration = reading.has("calibration").then_some(draft.calibration);
    VehicleFile { vehicle, uncertainty, calibration }
}

fn stated<K: Ord>(map: BTreeMap<K, Option<f64>>) -> BTreeMap<K, f64> {
    map.into_iter().filter_map(|(key, value)| value.map(|value| (key, value))).collect()
}
