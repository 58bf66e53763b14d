//! Errors over time.

use kerbside_geometry::math;

use super::data::{EstimateSample, ParkReport};
use crate::track::Interpolator;

/// An estimate's error and its standard deviations, in the true body frame: along, across \[m\],
/// heading \[rad\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EstimateError {
    pub(super) time: f64,
    pub(super) error: [f64; 3],
    pub(super) deviation: [f64; 3],
    /// Squared length of the error in units of its covariance; not a number where that is none.
    pub(super) normalised: f64,
}

/// Estimate minus truth, wherever both are known.
pub(super) fn estimate_errors(report: &ParkReport) -> Vec<EstimateError> {
    let mut truth = Interpolator::new(&report.truth);
    report.estimate.iter().filter_map(|sample| estimate_error(sample, &mut truth)).collect()
}

fn estimate_error(sample: &EstimateSample, truth: &mut Interpolator) -> Option<EstimateError> {
    let motion = &sample.motion;
    let truth = truth.at(motion.time)?;
    let error = motion.pose.seen_from(&truth);
    let deviation = deviations(&sample.covariance, truth.yaw);
    let in_scene = [motion.pose.x - truth.x, motion.pose.y - truth.y, error.yaw];
    let normalised = normalised_square(&sample.covariance, in_scene);
    let error = [error.x, error.y, error.yaw];
    Some(EstimateError { time: motion.time, error, deviation, normalised })
}

/// e' P^-1 e (Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and
/// Navigation", 5.4), by the Cholesky factor of P.
fn normalised_square(covariance: &[f64; 9], error: [f64; 3]) -> f64 {
    let [a, b, c, _, d, e, _, _, f] = *covariance;
    let l00 = a.sqrt();
    let (l10, l20) = (b / l00, c / l00);
    let l11 = (d - l10 * l10).sqrt();
    let l21 = (e - l20 * l10) / l11;
    let l22 = (f - l20 * l20 - l21 * l21).sqrt();
    let u = error[0] / l00;
    let v = (error[1] - l10 * u) / l11;
    let w = (error[2] - l20 * u - l21 * v) / l22;
    u * u + v * v + w * w
}

/// Standard deviations along and across a heading, and of the heading itself.
pub(super) fn deviations(covariance: &[f64; 9], yaw: f64) -> [f64; 3] {
    let [along, across, _] = turned(covariance, yaw);
    [along, across, covariance[8]].map(f64::sqrt)
}

/// The position's covariance in a frame turned by `yaw`: (along, across, their covariance).
fn turned(covariance: &[f64; 9], yaw: f64) -> [f64; 3] {
    let (sin, cos) = math::sin_cos(yaw);
    let (xx, xy, yy) = (covariance[0], 0.5 * (covariance[1] + covariance[3]), covariance[4]);
    let along = cos * cos * xx + 2.0 * cos * sin * xy + sin * sin * yy;
    let across = sin * sin * xx - 2.0 * cos * sin * xy + cos * cos * yy;
    [along, across, (yy - xx) * cos * sin + xy * (cos * cos - sin * sin)]
}

/// The ellipse of so many standard deviations about the origin of a frame turned by `yaw`, as
/// corners; empty where the covariance is none.
pub(super) fn ellipse(covariance: &[f64; 9], yaw: f64, deviations: f64) -> Vec<[f64; 2]> {
    const CORNERS: u32 = 48;
    let [along, across, both] = turned(covariance, yaw);
    // The lower Cholesky factor turns the unit circle into the ellipse.
    let a = along.sqrt();
    let b = if a > 0.0 { both / a } else { 0.0 };
    let c = (across - b * b).max(0.0).sqrt();
    if ![a, b, c].iter().all(|value| value.is_finite()) {
        return Vec::new();
    }
    let corner = |index: u32| {
        let turn = f64::from(index) / f64::from(CORNERS) * core::f64::consts::TAU;
        let (sin, cos) = math::sin_cos(turn);
        [deviations * a * cos, deviations * (b * cos + c * sin)]
    };
    (0..CORNERS).map(corner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    const LONG_IN_X: [f64; 9] = [4.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.25];

    #[test]
    fn deviations_turn_with_the_frame() {
        assert_eq!(deviations(&LONG_IN_X, 0.0), [2.0, 1.0, 0.5]);
        let [along, across, _] = deviations(&LONG_IN_X, FRAC_PI_2);
        assert!((along - 1.0).abs() < 1e-12 && (across - 2.0).abs() < 1e-12);
    }

    #[test]
    fn errors_are_measured_in_their_covariance() {
        assert!((normalised_square(&LONG_IN_X, [2.0, 1.0, 0.5]) - 3.0).abs() < 1e-12);
        // P = L L' with L = [2 0 0; 1 1 0; 1 2 3], so that L (1, 1, 1)' has the square 3.
        let coupled = [4.0, 2.0, 2.0, 2.0, 2.0, 3.0, 2.0, 3.0, 14.0];
        assert!((normalised_square(&coupled, [2.0, 2.0, 6.0]) - 3.0).abs() < 1e-12);
        assert!(!normalised_square(&[0.0; 9], [0.0; 3]).is_finite());
    }

    #[test]
    fn every_corner_of_the_ellipse_is_as_unlikely() {
        let corners = ellipse(&LONG_IN_X, FRAC_PI_4, 2.0);
        assert_eq!(corners.len(), 48);
        for [x, y] in corners {
            // Back to the frame of the covariance, in which it is diagonal.
            let half = core::f64::consts::FRAC_1_SQRT_2;
            let (u, v) = (half * (x - y), half * (x + y));
            assert!((u * u / 4.0 + v * v - 4.0).abs() < 1e-9);
        }
        assert!(ellipse(&[f64::NAN; 9], 0.0, 2.0).is_empty());
        assert!(ellipse(&[-1.0; 9], 0.0, 2.0).is_empty());
    }
}
