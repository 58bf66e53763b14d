//! The correction of a pose by a measured pose.

use kerbside_geometry::Pose;
use nalgebra::{Matrix3, Vector3};

use super::increment::{Estimate, sandwich};

impl Estimate {
    /// Corrects by a pose that was measured: `innovation` is measured minus estimated \[m, m, rad\], `noise` the
    /// measurement's covariance, H = I. What exceeds `gate` is refused; the gate, not the gain, allows for `slack`
    /// besides. Returns the test ratio, the innovation squared in units of its covariance; none where that is singular.
    ///
    /// Lee, Chung, Chang, eqs. (17) to (19); the covariance in Joseph's form (Bar-Shalom, Li, Kirubarajan, Estimation
    /// with Applications to Tracking and Navigation, 2001, section 5.2).
    #[inline]
    pub fn update(
        &mut self,
        innovation: &Vector3<f64>,
        noise: &Matrix3<f64>,
        slack: &Matrix3<f64>,
        gate: f64,
    ) -> Option<f64> {
        let spread = self.covariance + noise;
        let inverse = inverse_of(&spread)?;
        let allowed =
            if *slack == Matrix3::zeros() { inverse } else { inverse_of(&(spread + slack))? };
        let test_ratio = (innovation.transpose() * allowed * innovation).x.max(0.0);
        if test_ratio > gate {
            return Some(test_ratio);
        }
        let gain = self.covariance * inverse;
        let change = gain * innovation;
        let Pose { x, y, yaw, .. } = self.pose;
        self.pose = Pose::new(x + change.x, y + change.y, yaw + change.z);
        self.covariance = joseph(&gain, &self.covariance, noise);
        Some(test_ratio)
    }
}

/// The inverse of a symmetric matrix by its cofactors, symmetric to the bit; none where it is singular.
#[inline]
fn inverse_of(matrix: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let (xx, xy, yy) = (matrix[(0, 0)], matrix[(0, 1)], matrix[(1, 1)]);
    let (xt, yt, tt) = (matrix[(0, 2)], matrix[(1, 2)], matrix[(2, 2)]);
    let (cofactor_xx, cofactor_xy) = (yy * tt - yt * yt, xt * yt - xy * tt);
    let cofactor_xt = xy * yt - xt * yy;
    let determinant = xx * cofactor_xx + xy * cofactor_xy + xt * cofactor_xt;
    let scale = 1.0 / determinant;
    if !scale.is_finite() {
        return None;
    }
    let (yy_, tt_) = (xx * tt - xt * xt, xx * yy - xy * xy);
    let yt_ = xy * xt - xx * yt;
    let [a, b, c, d, e, f] =
        [cofactor_xx, cofactor_xy, cofactor_xt, yy_, yt_, tt_].map(|cofactor| cofactor * scale);
    Some(Matrix3::new(a, b, c, b, d, e, c, e, f))
}

/// (I - K) P (I - K)' + K R K'.
#[inline]
fn joseph(gain: &Matrix3<f64>, covariance: &Matrix3<f64>, noise: &Matrix3<f64>) -> Matrix3<f64> {
    let rest = Matrix3::identity() - gain;
    sandwich(&rest, covariance) + sandwich(gain, noise)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn equal_trust_meets_halfway() {
        let mut estimate = Estimate { pose: Pose::default(), covariance: Matrix3::identity() };
        let innovation = Vector3::new(0.2, -0.4, 0.1);
        let (noise, none) = (Matrix3::identity(), Matrix3::zeros());
        let ratio = estimate.update(&innovation, &noise, &none, 9.0).unwrap();
        assert!((ratio - 0.5 * innovation.norm_squared()).abs() < 1e-12);
        assert!((estimate.pose.x - 0.1).abs() < 1e-12 && (estimate.pose.yaw - 0.05).abs() < 1e-12);
        assert!((estimate.covariance - Matrix3::identity() * 0.5).norm() < 1e-12);
    }

    #[test]
    fn the_gate_refuses_and_slack_opens_it() {
        let before = Estimate { pose: Pose::default(), covariance: Matrix3::identity() * 1e-4 };
        let (noise, none) = (Matrix3::identity() * 1e-4, Matrix3::zeros());
        let far = Vector3::new(0.1, 0.0, 0.0);
        let mut estimate = before;
        assert!(estimate.update(&far, &noise, &none, 9.0).unwrap() > 9.0);
        assert_eq!(estimate, before);
        let slack = Matrix3::identity() * 1e-2;
        assert!(estimate.update(&far, &noise, &slack, 9.0).unwrap() < 9.0);
        assert!((estimate.pose.x - 0.05).abs() < 1e-12, "the gain knows no slack");
        let known = Matrix3::zeros();
        let mut certain = Estimate { covariance: known, ..before };
        assert_eq!(certain.update(&far, &known, &none, 9.0), None);
    }

    #[test]
    fn an_inverse_is_one() {
        let matrix = Matrix3::new(3.0, 0.4, -0.2, 0.4, 2.0, 0.7, -0.2, 0.7, 1.0);
        let inverse = inverse_of(&matrix).unwrap();
        assert!((matrix * inverse - Matrix3::identity()).abs().max() < 1e-14);
        assert_eq!(inverse, inverse.transpose());
        assert_eq!(inverse_of(&Matrix3::repeat(1.0)), None);
    }

    proptest! {
        #[test]
        fn the_covariance_stays_one(x in 0.01..2.0_f64, y in 0.01..2.0_f64, yaw in 0.01..2.0_f64, share in -0.9..0.9_f64) {
            let off = share * (x * y).sqrt();
            let covariance = Matrix3::new(x, off, 0.0, off, y, 0.0, 0.0, 0.0, yaw);
            let mut estimate = Estimate { pose: Pose::default(), covariance };
            let noise = Matrix3::from_diagonal(&Vector3::new(0.3, 0.1, 0.2));
            estimate.update(&Vector3::new(0.1, 0.1, 0.1), &noise, &Matrix3::zeros(), 1e9).unwrap();
            let after = estimate.covariance;
            prop_assert_eq!(after, after.transpose());
            prop_assert!(after.cholesky().is_some());
            prop_assert!((covariance - after).symmetric_eigenvalues().min() > 0.0);
        }
    }
}
