//! Defaults that depend on the vehicle or on rights.

use core::time::Duration;

use kerbside_safety::Timeouts;
use kerbside_tracking::TrackerSettings;

/// Wheelbase of the vehicle that [`TrackerSettings::default`] is for \[m\].
const DEFAULT_WHEELBASE: f64 = 0.5;

/// The time-outs that are shorter by default for an instance with real-time rights: freshness,
/// permit, vehicle silence, heartbeat window and deadline.
pub const REAL_TIME_TIMEOUTS: [Duration; 5] = [
    Duration::from_millis(20),
    Duration::from_millis(40),
    Duration::from_millis(100),
    Duration::from_millis(50),
    Duration::from_millis(5),
];

/// Default time-outs with or without real-time rights.
pub(super) fn timeouts(realtime: bool) -> Timeouts {
    let without = Timeouts::default();
    if !realtime {
        return without;
    }
    let [freshness, permit, vehicle_silence, heartbeat_window, deadline] = REAL_TIME_TIMEOUTS;
    Timeouts { freshness, permit, vehicle_silence, heartbeat_window, deadline, ..without }
}

/// The tracker's defaults for a vehicle of that wheelbase \[m\].
///
/// Lengths grow and spatial gains shrink in proportion to the wheelbase: the same manoeuvre, seen
/// from a larger car, is tracked along the same curve. Times and angles stay.
#[must_use]
pub fn scaled_tracker(wheelbase: f64) -> TrackerSettings {
    let scale = wheelbase / DEFAULT_WHEELBASE;
    let one = TrackerSettings::default();
    TrackerSettings {
        gain_across: one.gain_across / scale,
        corridor: one.corridor * scale,
        position_noise: one.position_noise * scale,
        goal_distance: one.goal_distance * scale,
        ..one
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_1_6_car_has_the_trackers_own_defaults() {
        assert_eq!(scaled_tracker(0.5), TrackerSettings::default());
    }

    #[test]
    fn a_larger_car_is_tracked_along_the_same_curve() {
        let (small, large) = (scaled_tracker(0.5), scaled_tracker(3.0));
        assert!((large.gain_across * 3.0 - small.gain_across * 0.5).abs() < 1e-12);
        assert!((large.corridor / 3.0 - small.corridor / 0.5).abs() < 1e-12);
        assert_eq!(large.gain_along, small.gain_along);
    }
}
