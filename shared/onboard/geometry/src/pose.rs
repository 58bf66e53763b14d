//! Planar rigid transforms.

use crate::{angle, math};

/// A pose in the plane, or, the same thing, a rigid transform: `a_from_b` is the pose of frame b seen from frame a.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Position along x \[m\].
    pub x: f64,
    /// Position along y \[m\].
    pub y: f64,
    /// Heading, counter-clockwise \[rad\].
    pub yaw: f64,
}

impl Pose {
    /// The pose at (x, y) \[m\] with heading `yaw` \[rad\].
    #[must_use]
    pub const fn new(x: f64, y: f64, yaw: f64) -> Self {
        Self { x, y, yaw }
    }

    /// `a_from_c` of `self` = `a_from_b` and `b_from_c`. The yaw is summed, not wrapped.
    #[must_use]
    pub fn compose(&self, b_from_c: &Self) -> Self {
        let (x, y) = self.transform(b_from_c.x, b_from_c.y);
        Self { x, y, yaw: self.yaw + b_from_c.yaw }
    }

    /// `b_from_a` of `self` = `a_from_b`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let (sin, cos) = math::sin_cos(self.yaw);
        Self { x: -cos * self.x - sin * self.y, y: sin * self.x - cos * self.y, yaw: -self.yaw }
    }

    /// This pose seen from `base`, yaw wrapped to -pi..=pi.
    #[must_use]
    pub fn seen_from(&self, base: &Self) -> Self {
        let relative = base.inverse().compose(self);
        Self { yaw: angle::wrap(relative.yaw), ..relative }
    }

    /// The point (x, y) \[m\] of frame b in frame a, `self` being `a_from_b`.
    #[must_use]
    pub fn transform(&self, x: f64, y: f64) -> (f64, f64) {
        let (sin, cos) = math::sin_cos(self.yaw);
        (self.x + cos * x - sin * y, self.y + sin * x + cos * y)
    }

    /// The pose after rolling `distance` \[m\] (signed) along a circle on which the heading turns by `turn` \[rad\].
    ///
    /// Exact for constant curvature (Lee, Chung and Chang, equation (1), with the chord instead of the arc).
    #[must_use]
    pub fn advance(&self, distance: f64, turn: f64) -> Self {
        let chord = distance * math::sinc(0.5 * turn);
        let (sin, cos) = math::sin_cos(self.yaw + 0.5 * turn);
        Self { x: self.x + chord * cos, y: self.y + chord * sin, yaw: self.yaw + turn }
    }

    /// Distance between the two positions \[m\].
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        math::hypot(self.x - other.x, self.y - other.y)
    }

    /// Whether all three numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.yaw.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_PI_2;

    #[test]
    fn inverse_undoes_compose() {
        let a_from_b = Pose::new(1.0, -2.0, 0.7);
        let b_from_c = Pose::new(-0.3, 0.4, -2.0);
        let back = a_from_b.inverse().compose(&a_from_b.compose(&b_from_c));
        assert!((back.x - b_from_c.x).abs() < 1e-14 && (back.y - b_from_c.y).abs() < 1e-14);
        assert!((back.yaw - b_from_c.yaw).abs() < 1e-14);
    }

    #[test]
    fn a_quarter_circle_ends_beside_and_turned() {
        let end = Pose::default().advance(FRAC_PI_2 * 2.0, FRAC_PI_2);
        assert!((end.x - 2.0).abs() < 1e-14 && (end.y - 2.0).abs() < 1e-14);
        let reversed = end.advance(-FRAC_PI_2 * 2.0, -FRAC_PI_2);
        assert!(reversed.x.abs() < 1e-14 && reversed.y.abs() < 1e-14 && reversed.yaw == 0.0);
    }
}
