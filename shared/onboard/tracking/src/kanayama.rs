//! The control law.
//!
//! After Kanayama, Kimura, Miyazaki, Noguchi, "A stable tracking control method for an autonomous
//! mobile robot" (ICRA 1990), with spatial gains and the sign of the heading term taken from the
//! direction of travel: the law as printed turns the wrong way in reverse.
//!
//! With s the distance covered in either direction, small errors obey e_y'' + 2 a e_y' + a^2 e_y =
//! 0 forward and in reverse alike: both decay like exp(-a s) without overshoot, at any speed.

use kerbside_geometry::{Pose, math};

/// Reference minus estimate, in the estimate's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Errors {
    /// Ahead \[m\].
    pub(crate) along: f64,
    /// To the left \[m\].
    pub(crate) across: f64,
    /// Counter-clockwise, within half a turn \[rad\].
    pub(crate) yaw: f64,
}

impl Errors {
    /// Of `estimate` against `reference`.
    pub(crate) fn new(reference: &Pose, estimate: &Pose) -> Self {
        let seen = reference.seen_from(estimate);
        Self { along: seen.x, across: seen.y, yaw: seen.yaw }
    }

    /// Distance of the two positions \[m\].
    pub(crate) fn distance(&self) -> f64 {
        math::hypot(self.along, self.across)
    }
}

/// The gains.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kanayama {
    /// Of the error along \[1/s\].
    pub(crate) along: f64,
    /// Of the errors across and of heading \[1/m\].
    pub(crate) across: f64,
}

impl Kanayama {
    /// The speed to drive \[m/s\]: v = v_ref cos(e_th) + kx e_x, never against the reference's
    /// direction.
    pub(crate) fn speed(&self, reference: f64, errors: &Errors) -> f64 {
        let speed = reference * math::cos(errors.yaw) + self.along * errors.along;
        if reference > 0.0 { speed.max(0.0) } else { speed.min(0.0) }
    }

    /// The curvature to drive \[1/m\]: k = k_ref + a^2 e_y + sgn(v_ref) 2 a sin(e_th), where
    /// `direction` is the sign.
    pub(crate) fn curvature(&self, reference: f64, direction: f64, errors: &Errors) -> f64 {
        let a = self.across;
        reference + a * a * errors.across + direction * 2.0 * a * math::sin(errors.yaw)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Drives an ideal car along the x axis; the error across after each 0.1 m.
    fn drive(direction: f64, across: f64, yaw: f64) -> Vec<f64> {
        let law = Kanayama { along: 1.0, across: 2.5 };
        let mut pose = Pose::new(0.0, across, yaw);
        let mut errors = Vec::new();
        for step in 0..30_000 {
            let reference = Pose::new(pose.x, 0.0, 0.0);
            let error = Errors::new(&reference, &pose);
            if step % 1000 == 0 {
                errors.push(error.across);
            }
            let distance = direction * 1e-4;
            pose = pose.advance(distance, distance * law.curvature(0.0, direction, &error));
        }
        errors
    }

    #[test]
    fn the_error_across_decays_like_a_critically_damped_spring_in_both_directions() {
        for direction in [1.0, -1.0] {
            for (index, error) in drive(direction, 0.03, 0.0).iter().enumerate() {
                let path = 2.5 * 0.1 * index as f64;
                let expected = -0.03 * (1.0 + path) * (-path).exp();
                assert!((error - expected).abs() < 3e-4, "{direction}: {error} {expected}");
            }
            let end = drive(direction, -0.02, 0.1).pop().expect("driven");
            assert!(end.abs() < 4e-4, "{end}");
        }
    }

    #[test]
    fn the_speed_closes_the_error_along_but_never_turns_around() {
        let law = Kanayama { along: 2.0, across: 2.5 };
        let ahead = |along| Errors { along, ..Errors::default() };
        assert_eq!(law.speed(0.1, &ahead(0.02)), 0.1 + 0.04);
        assert_eq!(law.speed(-0.1, &ahead(0.02)), -0.1 + 0.04);
        assert_eq!(law.speed(0.01, &ahead(-0.02)), 0.0);
        assert_eq!(law.speed(-0.01, &ahead(0.02)), 0.0);
    }
}
