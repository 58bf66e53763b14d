//! Angles of the two front wheels, and what their travel says of the rear axle's.

use kerbside_geometry::math;

/// Angle of a front wheel against the body, and how it depends on what it is computed from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelAngle {
    /// Cosine of the angle.
    pub cos: f64,
    /// Sine of the angle.
    pub sin: f64,
    /// Change of the angle with the centre wheel's angle \[rad/rad\].
    pub by_steering: f64,
    /// Change of the angle with the front track \[rad/m\].
    pub by_track: f64,
    /// Change of the angle with the wheelbase \[rad/m\].
    pub by_wheelbase: f64,
}

/// The angle of the left (`side` 1) or right (`side` -1) front wheel of an exact Ackermann linkage, for the centre
/// wheel's angle `steering` \[rad\], front track \[m\] and wheelbase \[m\]; regular for any angle.
///
/// tan d = t/(1 -+ b t/(2L)), t = tan(steering): both wheels roll about the centre of rotation, which lies on the
/// rear axle's line (geometry of one centre of rotation).
#[must_use]
pub fn wheel_angle(steering: f64, side: f64, track: f64, wheelbase: f64) -> WheelAngle {
    let (s, c) = math::sin_cos(steering);
    let half = side * 0.5 * track / wheelbase;
    let u = c - half * s;
    let square = u * u + s * s;
    let length = square.sqrt();
    WheelAngle {
        cos: u / length,
        sin: s / length,
        by_steering: 1.0 / square,
        by_track: side * s * s / (2.0 * wheelbase * square),
        by_wheelbase: -half * s * s / (wheelbase * square),
    }
}

/// Distance \[m\] and turn \[rad\] of the rear axle from the travel of both front wheels \[m\]: the per-wheel form,
/// exact without slip (section 2a, form b; the paper's equations (3) to (6) are its centre form).
#[must_use]
pub fn rear_from_front(
    left: f64,
    right: f64,
    steering: f64,
    track: f64,
    wheelbase: f64,
) -> (f64, f64) {
    let along_left = left * wheel_angle(steering, 1.0, track, wheelbase).cos;
    let along_right = right * wheel_angle(steering, -1.0, track, wheelbase).cos;
    (0.5 * (along_left + along_right), (along_right - along_left) / track)
}

/// The paper's centre form of the distance, equation (6): the front axle's mean travel times cos(steering) \[m\].
///
/// Its relative error is b^2/(8 L^2) sin^4(steering).
#[must_use]
pub fn rear_distance_centre_form(left: f64, right: f64, steering: f64) -> f64 {
    0.5 * (left + right) * math::cos(steering)
}

/// Largest steering angle for which [`rear_from_front_travel`] answers \[rad\]: 40 degrees.
pub const LARGEST_STEERING_FREE: f64 = 40.0 / 180.0 * core::f64::consts::PI;

/// Distance \[m\] and turn \[rad\] of the rear axle from both front wheels' travel \[m\] alone, in one direction of
/// travel and at one steering angle: the steering-free form (section 2a, form d).
///
/// None where the wheels' travels contradict the geometry, and beyond [`LARGEST_STEERING_FREE`], where the form
/// nears its singularity and takes the wrong root beyond it.
#[must_use]
pub fn rear_from_front_travel(
    left: f64,
    right: f64,
    track: f64,
    wheelbase: f64,
) -> Option<(f64, f64)> {
    if left * right < 0.0 {
        return None;
    }
    let a = 0.5 * (left * left + right * right);
    let b = (right * right - left * left) / (2.0 * track);
    let c = wheelbase * wheelbase + 0.25 * track * track;
    let under_root = a * a - 4.0 * c * b * b;
    if under_root < 0.0 {
        return None;
    }
    let square = 0.5 * (a + under_root.sqrt());
    let distance = if left + right < 0.0 { -square.sqrt() } else { square.sqrt() };
    let turn = b / distance;
    let steering = math::atan(wheelbase * turn / distance);
    (steering.abs() <= LARGEST_STEERING_FREE).then_some((distance, turn))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TRACK: f64 = 0.285;
    const WHEELBASE: f64 = 0.5;

    /// Travel of both front wheels while the rear axle goes `distance` at a constant angle.
    fn front_travel(distance: f64, steering: f64) -> (f64, f64, f64) {
        let turn = distance * steering.tan() / WHEELBASE;
        let travel = |side: f64| {
            let along = distance - side * 0.5 * TRACK * turn;
            along.hypot(WHEELBASE * turn).copysign(distance)
        };
        (travel(1.0), travel(-1.0), turn)
    }

    proptest! {
        #[test]
        fn the_per_wheel_form_is_exact(degrees in -35.0..35.0_f64, distance in 0.01..2.0_f64, back: bool) {
            let distance = if back { -distance } else { distance };
            let (left, right, turn) = front_travel(distance, degrees.to_radians());
            let found = rear_from_front(left, right, degrees.to_radians(), TRACK, WHEELBASE);
            prop_assert!((found.0 - distance).abs() < 1e-9 * distance.abs());
            prop_assert!((found.1 - turn).abs() < 1e-9 * (turn.abs() + distance.abs()));
        }

        #[test]
        fn the_steering_free_form_is_exact_where_it_answers(degrees in -39.9..39.9_f64, back: bool) {
            let distance = if back { -0.4 } else { 0.4 };
            let (left, right, turn) = front_travel(distance, degrees.to_radians());
            let found = rear_from_front_travel(left, right, TRACK, WHEELBASE);
            let (d, t) = found.expect("an answer below 40 degrees");
            prop_assert!((d - distance).abs() < 1e-8 && (t - turn).abs() < 1e-8);
        }

        #[test]
        fn derivatives_are_those_of_the_angle(degrees in -80.0..80.0_f64, left: bool) {
            let (phi, side, h) = (degrees.to_radians(), if left { 1.0 } else { -1.0 }, 1e-6);
            let angle = |phi: f64, track: f64, wheelbase: f64| {
                let angle = wheel_angle(phi, side, track, wheelbase);
                angle.sin.atan2(angle.cos)
            };
            let at = wheel_angle(phi, side, TRACK, WHEELBASE);
            let by = |plus: f64, minus: f64| (plus - minus) / (2.0 * h);
            let steering = by(angle(phi + h, TRACK, WHEELBASE), angle(phi - h, TRACK, WHEELBASE));
            let track = by(angle(phi, TRACK + h, WHEELBASE), angle(phi, TRACK - h, WHEELBASE));
            let base = by(angle(phi, TRACK, WHEELBASE + h), angle(phi, TRACK, WHEELBASE - h));
            prop_assert!((at.by_steering - steering).abs() < 1e-7);
            prop_assert!((at.by_track - track).abs() < 1e-7);
            prop_assert!((at.by_wheelbase - base).abs() < 1e-7);
        }
    }

    #[test]
    fn the_centre_form_errs_as_predicted() {
        for degrees in [15.0_f64, 22.6, 30.0, 35.0] {
            let phi = degrees.to_radians();
            let (left, right, _) = front_travel(1.0, phi);
            let error = rear_distance_centre_form(left, right, phi) - 1.0;
            let predicted = TRACK * TRACK / (8.0 * WHEELBASE * WHEELBASE) * phi.sin().powi(4);
            assert!((error / predicted - 1.0).abs() < 0.02, "{degrees}: {error} {predicted}");
        }
    }

    #[test]
    fn scaling_both_wheels_by_the_centre_angle_gives_a_yaw_that_is_wrong_by_its_square() {
        let phi = 30.0_f64.to_radians();
        let (left, right, turn) = front_travel(1.0, phi);
        let naive = (right - left) * phi.cos() / TRACK;
        assert!((naive / turn - 1.0 + 0.252).abs() < 0.002, "{}", naive / turn - 1.0);
    }

    #[test]
    fn the_steering_free_form_is_refused_above_40_degrees() {
        for degrees in [40.5_f64, 42.0, 43.5, -41.0] {
            let (left, right, _) = front_travel(0.3, degrees.to_radians());
            assert_eq!(rear_from_front_travel(left, right, TRACK, WHEELBASE), None, "{degrees}");
        }
        assert_eq!(rear_from_front_travel(0.1, -0.1, TRACK, WHEELBASE), None);
    }
}
