//! Angles on the circle.

use core::f64::consts::{PI, TAU};

/// The same direction in -pi..=pi \[rad\].
#[must_use]
pub fn wrap(angle: f64) -> f64 {
    if (-PI..=PI).contains(&angle) {
        return angle;
    }
    let turned = libm::fmod(angle + PI, TAU);
    if turned < 0.0 { turned + PI } else { turned - PI }
}

/// `angle` plus the multiple of a full turn that brings it within half a turn of `previous` \[rad\].
#[must_use]
pub fn unwrap(previous: f64, angle: f64) -> f64 {
    previous + wrap(angle - previous)
}

/// Degrees from radians, for people.
#[must_use]
pub fn degrees(radians: f64) -> f64 {
    radians * (180.0 / PI)
}

/// Radians from degrees, for configuration written by people.
#[must_use]
pub fn radians(degrees: f64) -> f64 {
    degrees * (PI / 180.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrap_keeps_the_direction_and_the_range() {
        for turn in -50..=50 {
            for step in -31..=31 {
                let angle = f64::from(step) * 0.1;
                let wrapped = wrap(angle + f64::from(turn) * TAU);
                assert!((-PI..=PI).contains(&wrapped));
                assert!((wrapped - angle).abs() < 1e-9, "{wrapped} against {angle}");
            }
        }
    }

    #[test]
    fn unwrap_follows_a_spin() {
        let mut heading = 0.0;
        for step in 1..=1000 {
            heading = unwrap(heading, wrap(f64::from(step) * 0.1));
        }
        assert!((heading - 100.0).abs() < 1e-9);
    }
}
