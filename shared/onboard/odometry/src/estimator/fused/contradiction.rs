//! Fixes that the gate refuses again and again: is it the fixes that are wrong, or the filter that is too sure?
//!
//! One wrong fix contradicts the pose by anything. Several in a row that contradict it by the same agree with one another,
//! and their one explanation is a pose that is off by more than its covariance says: the prior of the parameters was too
//! narrow, or something happened that no wheel told. The covariance of pose and parameters is then widened until the
//! newest of them is an ordinary one (the fading filter of Jazwinski, *Stochastic Processes and Filtering Theory*, section
//! 8.8, with its factor found by the innovation).

use nalgebra::{Matrix3, Vector3};

/// Refused fixes in a row that agree, the newest included, before the filter is held to be wrong.
const AGREEING: u32 = 5;

/// Share of a contradiction by which the next may differ from it, in standard deviations of the innovation.
const ALIKE: f64 = 0.5;

/// Factor of a step of the widening on all variances, and steps at most: standard deviations 4096 times as large.
pub(crate) const STEP: f64 = 4.0;
pub(crate) const STEPS: u32 = 12;

/// Squared Mahalanobis length of an ordinary fix: no more than that of three degrees of freedom in four of five.
pub(crate) const ORDINARY: f64 = 4.6;

/// The newest refused fixes that agree with one another.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Contradiction {
    count: u32,
    innovation: Vector3<f64>,
}

impl Contradiction {
    /// A fix was taken: nothing contradicts.
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// A fix was refused that lies `innovation` off the estimate, whose covariance is `spread`. Whether it and those before
    /// it say that the filter is wrong.
    pub(crate) fn refused(&mut self, innovation: Vector3<f64>, spread: &Matrix3<f64>) -> bool {
        let length = |v: &Vector3<f64>| {
            spread.try_inverse().map_or(f64::INFINITY, |inverse| (v.transpose() * inverse * v).x)
        };
        let change = length(&(innovation - self.innovation));
        let agrees = self.count > 0 && change <= ALIKE * ALIKE * length(&innovation);
        self.count = if agrees { self.count.saturating_add(1) } else { 1 };
        self.innovation = innovation;
        self.count >= AGREEING
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_agrees_contradicts_and_what_strays_does_not() {
        let spread = Matrix3::identity() * 1e-4;
        let off = |x: f64| Vector3::new(x, 0.0, 0.0);
        let mut contradiction = Contradiction::default();
        let said: Vec<bool> = (0..6).map(|_| contradiction.refused(off(0.5), &spread)).collect();
        assert_eq!(said, [false, false, false, false, true, true]);
        contradiction.clear();
        let strays = [0.5, -0.5, 0.4, -0.6, 0.5, -0.5, 0.5, -0.5];
        assert!(strays.iter().all(|x| !contradiction.refused(off(*x), &spread)));
        // A drift that grows is one contradiction.
        contradiction.clear();
        let grows = [0.2, 0.25, 0.3, 0.36, 0.42];
        assert!(grows.iter().filter(|x| contradiction.refused(off(**x), &spread)).count() == 1);
    }
}
