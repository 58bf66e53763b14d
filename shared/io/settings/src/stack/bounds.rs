//! What no single key can be wrong about: stopping in time, periods that can be told apart, and recordings that fit
//! where they are kept.

use core::time::Duration;

use kerbside_geometry::Vehicle;
use kerbside_safety::bounds::{self, BoundError};

use super::{RealtimeMode, StackDraft};
use crate::declare::{Reading, Value};
use crate::problem::Cause;

/// Reports what keeps the vehicle from stopping in time, or the supervisor from telling periods
/// apart.
///
/// `drafts` are without and with real-time rights; both must do, as far as both may come to be
/// used.
pub(super) fn check(
    reading: &mut Reading<'_, StackDraft>,
    drafts: &mut [StackDraft; 2],
    vehicle: &Vehicle,
) {
    let used: &[usize] = match drafts[0].realtime.enabled {
        RealtimeMode::Off => &[0],
        RealtimeMode::On => &[1],
        RealtimeMode::Auto => &[0, 1],
    };
    let mut reported = Vec::new();
    for rights in used {
        let draft = &mut drafts[*rights];
        for error in bounds::check(vehicle, &draft.safety) {
            if !reported.contains(&error.key()) {
                reported.push(error.key());
                report(reading, draft, vehicle, &error);
            }
        }
    }
    check_recordings(reading, &drafts[0]);
}

/// While one recording is written to its full size, another one is kept.
fn check_recordings(reading: &mut Reading<'_, StackDraft>, draft: &StackDraft) {
    let (file, Some(keep)) = (draft.recorder.file_bytes, draft.recorder.keep_bytes) else { return };
    let least = file.saturating_mul(2);
    if keep < least {
        let allowed = format!("at least {least}, twice recorder.file_bytes");
        reading.refuse("recorder.keep_bytes", &keep.to_string(), Cause::OutOfRange, allowed);
    }
}

fn report(
    reading: &mut Reading<'_, StackDraft>,
    draft: &mut StackDraft,
    vehicle: &Vehicle,
    error: &BoundError,
) {
    let (cause, allowed) = words(error, vehicle);
    let ending = format!(".{}", error.key());
    let mut keys = reading.schema().keys.iter();
    let key = keys.find(|key| key.path == error.key() || key.path.ends_with(&ending));
    match key {
        Some(key) => {
            let value = key.show(draft).as_ref().map_or_else(String::new, Value::to_string);
            reading.refuse(&key.path, &value, cause, allowed);
        }
        // A limit of the vehicle: the file at hand chose the vehicle.
        None => reading.refuse("vehicle", &vehicle.name, cause, allowed),
    }
}

/// The error in seconds and metres, as the files state them.
fn words(error: &BoundError, vehicle: &Vehicle) -> (Cause, String) {
    let seconds = Duration::as_secs_f64;
    match error {
        BoundError::StopDistance {
            speed, needed, reaction, deceleration, largest_speed, ..
        } => {
            let allowed = format!(
                "at least {needed:.3} m for {} ({speed} m/s for {reaction:.3} s of time-out and \
                 response, then {deceleration} m/s2 of braking); or limits.speed at most \
                 {largest_speed:.3} m/s",
                vehicle.name
            );
            (Cause::StopDistance { needed: *needed }, allowed)
        }
        BoundError::TooShort { least, why, .. } => {
            (Cause::OutOfRange, format!("at least {} s ({why})", seconds(least)))
        }
        BoundError::TooLong { most, why, .. } => {
            (Cause::OutOfRange, format!("at most {} s ({why})", seconds(most)))
        }
        BoundError::Count { most, .. } => (Cause::OutOfRange, format!("1 to {most}")),
        BoundError::Limit { .. } => (Cause::Conflict(error.to_string()), String::new()),
    }
}
