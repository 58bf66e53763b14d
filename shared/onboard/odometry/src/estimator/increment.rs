//! A short piece of the path, and what it does to a pose and its covariance.

use kerbside_geometry::{Pose, math};
use nalgebra::{Matrix2, Matrix3, Matrix3x2};

/// A piece of path of constant curvature, rolled by the rear-axle centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increment {
    /// Distance, negative in reverse \[m\].
    pub distance: f64,
    /// Turn of the heading \[rad\].
    pub turn: f64,
    /// Covariance of (distance, turn).
    pub covariance: Matrix2<f64>,
}

/// sin(h)/h and its derivative, for the half turn h of a piece.
#[inline]
fn sinc_and_slope(half: f64) -> (f64, f64) {
    let square = half * half;
    if square < 2.5e-3 {
        let value = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0));
        let slope = -half / 3.0 * (1.0 - square / 10.0 * (1.0 - square / 28.0));
        return (value, slope);
    }
    let (sin, cos) = math::sin_cos(half);
    (sin / half, (cos - sin / half) / half)
}

/// The pose after the piece, and the derivatives of that pose: A by the pose before, B by
/// (distance, turn).
///
/// Lee, Chung, Chang, eqs. (1), (15) and (16), with the chord of the arc in place of its length:
/// exact for constant curvature, and A and B are the derivatives of that exact form.
#[inline]
pub(crate) fn advance(pose: &Pose, piece: &Increment) -> (Pose, Matrix3<f64>, Matrix3x2<f64>) {
    let (sinc, slope) = sinc_and_slope(0.5 * piece.turn);
    let (sin, cos) = math::sin_cos(pose.yaw + 0.5 * piece.turn);
    let (chord, change) = (piece.distance * sinc, 0.5 * piece.distance * slope);
    let end = Pose::new(pose.x + chord * cos, pose.y + chord * sin, pose.yaw + piece.turn);
    #[rustfmt::skip]
    let by_pose = Matrix3::new(
        1.0, 0.0, -chord * sin,
        0.0, 1.0, chord * cos,
        0.0, 0.0, 1.0,
    );
    #[rustfmt::skip]
    let by_piece = Matrix3x2::new(
        sinc * cos, change * cos - 0.5 * chord * sin,
        sinc * sin, change * sin + 0.5 * chord * cos,
        0.0, 1.0,
    );
    (end, by_pose, by_piece)
}

/// A pose with covariance of (x, y, yaw).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// The pose of the rear-axle centre.
    pub pose: Pose,
    /// Covariance of (x, y, yaw) \[m, m, rad\].
    pub covariance: Matrix3<f64>,
}

impl Estimate {
    /// Rolls along `piece`: P- = A P A' + B Q B' (Lee, Chung, Chang, eq. (14)).
    #[inline]
    pub fn roll(&mut self, piece: &Increment) {
        let (pose, by_pose, by_piece) = advance(&self.pose, piece);
        self.covariance = carried(&self.covariance, by_pose[(0, 2)], by_pose[(1, 2)])
            + added(&by_piece, &piece.covariance);
        self.pose = pose;
    }

    /// Adds what is unknown of the path between the ends of a gap: `along` and `across` the body's
    /// x axis, and of the heading, as standard deviations \[m, m, rad\].
    pub(crate) fn blur(&mut self, along: f64, across: f64, yaw: f64) {
        let (sin, cos) = math::sin_cos(self.pose.yaw);
        let (along, across) = (along * along, across * across);
        let covariance = &mut self.covariance;
        covariance[(0, 0)] += cos * cos * along + sin * sin * across;
        covariance[(1, 1)] += sin * sin * along + cos * cos * across;
        covariance[(0, 1)] += sin * cos * (along - across);
        covariance[(1, 0)] = covariance[(0, 1)];
        covariance[(2, 2)] += yaw * yaw;
    }
}

/// A P A' of a symmetric P, A being the identity but for `x` and `y` above its last diagonal entry.
#[inline]
fn carried(p: &Matrix3<f64>, x: f64, y: f64) -> Matrix3<f64> {
    let (xx, xy, yy) = (p[(0, 0)], p[(0, 1)], p[(1, 1)]);
    let (xt, yt, tt) = (p[(0, 2)], p[(1, 2)], p[(2, 2)]);
    let (x_turned, y_turned) = (xt + x * tt, yt + y * tt);
    let (along, across) = (xx + x * (xt + x_turned), yy + y * (yt + y_turned));
    let both = xy + x * yt + y * x_turned;
    Matrix3::new(along, both, x_turned, both, across, y_turned, x_turned, y_turned, tt)
}

/// M P M' of a symmetric P: each entry beside the diagonal is computed once, so that the result is symmetric to the bit.
#[inline]
pub(crate) fn sandwich(outer: &Matrix3<f64>, inner: &Matrix3<f64>) -> Matrix3<f64> {
    let left = outer * inner;
    let entry = |row: usize, column: usize| {
        left[(row, 0)] * outer[(column, 0)]
            + left[(row, 1)] * outer[(column, 1)]
            + left[(row, 2)] * outer[(column, 2)]
    };
    let (xy, xt, yt) = (entry(0, 1), entry(0, 2), entry(1, 2));
    Matrix3::new(entry(0, 0), xy, xt, xy, entry(1, 1), yt, xt, yt, entry(2, 2))
}

/// B Q B' of a 2x2 Q, symmetric to the bit; B's last row being (0, 1): the heading turns with the piece.
#[inline]
fn added(by_piece: &Matrix3x2<f64>, noise: &Matrix2<f64>) -> Matrix3<f64> {
    let (dd, dt, tt) = (noise[(0, 0)], noise[(0, 1)], noise[(1, 1)]);
    let [xd, yd, xt, yt] =
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(row, column)| by_piece[(row, column)]);
    let (x_by_d, x_by_t) = (xd * dd + xt * dt, xd * dt + xt * tt);
    let (y_by_d, y_by_t) = (yd * dd + yt * dt, yd * dt + yt * tt);
    let (xx, yy) = (x_by_d * xd + x_by_t * xt, y_by_d * yd + y_by_t * yt);
    let xy = x_by_d * yd + x_by_t * yt;
    Matrix3::new(xx, xy, x_by_t, xy, yy, y_by_t, x_by_t, y_by_t, tt)
}

/// The matrix with the rounding between its two halves taken out.
pub(crate) fn symmetric(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    0.5 * (matrix + matrix.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn piece(distance: f64, turn: f64) -> Increment {
        Increment { distance, turn, covariance: Matrix2::zeros() }
    }

    fn column(end: Pose, other: Pose, step: f64) -> [f64; 3] {
        [end.x - other.x, end.y - other.y, end.yaw - other.yaw].map(|change| change / (2.0 * step))
    }

    proptest! {
        #[test]
        fn derivatives_are_those_of_the_motion(
            yaw in -4.0..4.0_f64, distance in -1.0..1.0_f64, turn in -1.5..1.5_f64, scale in 0..6
        ) {
            let turn = turn * 0.1_f64.powi(scale);
            let pose = Pose::new(0.3, -0.7, yaw);
            let (_, by_pose, by_piece) = advance(&pose, &piece(distance, turn));
            let step = 1e-5;
            let moved = |dx: f64, dy: f64, dyaw: f64, dd: f64, dt: f64| {
                let start = Pose::new(pose.x + dx, pose.y + dy, pose.yaw + dyaw);
                advance(&start, &piece(distance + dd, turn + dt)).0
            };
            let numeric = [
                column(moved(step, 0., 0., 0., 0.), moved(-step, 0., 0., 0., 0.), step),
                column(moved(0., step, 0., 0., 0.), moved(0., -step, 0., 0., 0.), step),
                column(moved(0., 0., step, 0., 0.), moved(0., 0., -step, 0., 0.), step),
                column(moved(0., 0., 0., step, 0.), moved(0., 0., 0., -step, 0.), step),
                column(moved(0., 0., 0., 0., step), moved(0., 0., 0., 0., -step), step),
            ];
            for row in 0..3 {
                for (index, expected) in numeric.iter().enumerate() {
                    let found =
                        if index < 3 { by_pose[(row, index)] } else { by_piece[(row, index - 3)] };
                    let error = (found - expected[row]).abs();
                    prop_assert!(error < 1e-8, "{row} {index}: {found} {expected:?}");
                }
            }
        }

        #[test]
        fn the_motion_is_the_arc(
            yaw in -4.0..4.0_f64, distance in -1.0..1.0_f64, turn in -1.5..1.5_f64
        ) {
            let pose = Pose::new(0.3, -0.7, yaw);
            let (end, ..) = advance(&pose, &piece(distance, turn));
            let arc = pose.advance(distance, turn);
            prop_assert!((end.x - arc.x).abs() < 1e-14 && (end.y - arc.y).abs() < 1e-14);
            prop_assert_eq!(end.yaw, arc.yaw);
        }
    }

    proptest! {
        #[test]
        fn the_covariance_is_carried_by_the_derivatives(
            entries in proptest::array::uniform6(-1.0..1.0_f64), distance in -1.0..1.0_f64, turn in -1.5..1.5_f64
        ) {
            let [a, b, c, d, e, f] = entries;
            let half = Matrix3::new(1.0 + a, b, c, 0.0, 1.0 + d, e, 0.0, 0.0, 1.0 + f);
            let before = Estimate { pose: Pose::new(0.1, 0.2, a), covariance: half * half.transpose() };
            let noise = Matrix2::new(0.2, 0.05, 0.05, 0.1);
            let piece = Increment { covariance: noise, ..piece(distance, turn) };
            let (_, by_pose, by_piece) = advance(&before.pose, &piece);
            let expected = by_pose * before.covariance * by_pose.transpose()
                + by_piece * noise * by_piece.transpose();
            let mut after = before;
            after.roll(&piece);
            prop_assert!((after.covariance - expected).abs().max() < 1e-12);
            prop_assert_eq!(after.covariance, after.covariance.transpose());
        }
    }

    #[test]
    fn the_series_meets_the_function() {
        for half in [0.049_999_f64, 0.050_001, -0.05] {
            let (value, slope) = sinc_and_slope(half);
            let exact = math::sin(half) / half;
            assert!((value - exact).abs() < 1e-15);
            assert!((slope - (math::cos(half) - exact) / half).abs() < 1e-12);
        }
    }

    #[test]
    fn blur_lies_along_and_across_the_body() {
        let mut estimate = Estimate {
            pose: Pose::new(0.0, 0.0, core::f64::consts::FRAC_PI_2),
            ..Estimate::default()
        };
        estimate.blur(0.1, 0.3, 0.2);
        let covariance = estimate.covariance;
        assert!((covariance[(0, 0)] - 0.09).abs() < 1e-15);
        assert!((covariance[(1, 1)] - 0.01).abs() < 1e-15);
        assert!((covariance[(2, 2)] - 0.04).abs() < 1e-15);
        assert_eq!(covariance, covariance.transpose());
    }
}
