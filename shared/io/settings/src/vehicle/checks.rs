//! What no single key can be wrong about: the geometry as a whole.

use kerbside_geometry::WHEELS;

use super::VehicleDraft;
use crate::declare::Reading;
use crate::problem::Cause;

/// Reports geometry that cannot be, and warns of geometry that hardly is.
pub(super) fn check(reading: &mut Reading<'_, VehicleDraft>, draft: &VehicleDraft) {
    check_overhang(reading, draft);
    check_encoders(reading, draft);
    if reading.is_sound() {
        check_outline(reading, draft);
    }
}

fn check_overhang(reading: &mut Reading<'_, VehicleDraft>, draft: &VehicleDraft) {
    let (length, overhang) = (draft.footprint.length, draft.footprint.rear_overhang);
    if overhang > length {
        let cause = "the rear axle lies in front of the footprint".to_owned();
        reading.refuse(
            "footprint.rear_overhang",
            &format!("{overhang:?}"),
            Cause::ImpossibleGeometry(cause),
            format!("0 to footprint.length = {length} m"),
        );
    }
}

/// A wheel that is not there cannot be counted, and encoders without a wheel say nothing.
fn check_encoders(reading: &mut Reading<'_, VehicleDraft>, draft: &VehicleDraft) {
    if !reading.has("encoders") {
        return;
    }
    if draft.counts.iter().all(Option::is_none) {
        reading.missing("encoders.counts_per_revolution.rl");
    }
    for wheel in WHEELS {
        let (track, key) = match wheel.is_front() {
            true => (draft.track[0], "track_front"),
            false => (draft.track[1], "track_rear"),
        };
        if let (Some(counts), false) = (draft.counts[wheel.index()], wheel.is_left() || track > 0.0)
        {
            let cause = format!("{key} = 0 leaves one wheel, the left one, on the centre line");
            reading.refuse(
                &format!("encoders.counts_per_revolution.{}", wheel.name()),
                &format!("{counts:?}"),
                Cause::ImpossibleGeometry(cause),
                format!("no encoder here, or {key} above 0"),
            );
        }
    }
}

fn check_outline(reading: &mut Reading<'_, VehicleDraft>, draft: &VehicleDraft) {
    let footprint = &draft.footprint;
    let track = draft.track[0].max(draft.track[1]);
    if track > footprint.width {
        reading.warn(
            "footprint.width",
            &format!("{:?}", footprint.width),
            Cause::SuspiciousGeometry("the wheels stand outside the footprint".to_owned()),
            format!(
                "at least the wider track, {track} m, if the footprint is to keep the wheels clear"
            ),
        );
    }
    if draft.wheelbase + footprint.rear_overhang > footprint.length {
        reading.warn(
            "footprint.length",
            &format!("{:?}", footprint.length),
            Cause::SuspiciousGeometry("the front axle lies in front of the footprint".to_owned()),
            format!(
                "at least wheelbase + rear_overhang, {} m",
                draft.wheelbase + footprint.rear_overhang
            ),
        );
    }
}
