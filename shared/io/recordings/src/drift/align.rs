//! Laying an estimate on a reference.

use kerbside_geometry::{Pose, angle, math};

use super::AlignedBy;
use super::samples::Sample;

/// Positions closer together than this give no direction: sum of squares about their mean \[m^2\].
const SPREAD: f64 = 1e-6;

/// The rigid transform that lays the estimate on the reference at one place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Alignment {
    pub(super) reference_from_estimate: Pose,
    /// Distance at the middle of the place \[m\].
    pub(super) middle: f64,
}

impl Alignment {
    /// Over `samples`; none where they give no direction.
    pub(super) fn over(samples: &[Sample], by: AlignedBy) -> Option<Self> {
        let (first, last) = (samples.first()?, samples.last()?);
        let (yaw, anchored) = match by {
            AlignedBy::Pose => (mean_turn(samples)?, samples),
            AlignedBy::Path => (fitted_turn(samples)?, &samples[..1]),
        };
        let turned = Self {
            reference_from_estimate: Pose::new(0.0, 0.0, yaw),
            middle: 0.5 * (first.distance + last.distance),
        };
        let (x, y) = turned.error_of(anchored);
        Some(Self { reference_from_estimate: Pose::new(-x, -y, yaw), ..turned })
    }

    /// From the estimate's directions to the reference's \[rad\].
    pub(super) fn angle(&self) -> f64 {
        self.reference_from_estimate.yaw
    }

    /// Mean of the aligned estimate minus the reference \[m\].
    pub(super) fn error_of(&self, samples: &[Sample]) -> (f64, f64) {
        mean(samples.iter().map(|sample| {
            let marker = &sample.marker;
            let (x, y) = self.reference_from_estimate.transform(marker.x, marker.y);
            (x - sample.reference.0, y - sample.reference.1)
        }))
    }
}

#[allow(clippy::cast_precision_loss)] // Fewer than 2^53 samples.
fn mean(points: impl ExactSizeIterator<Item = (f64, f64)>) -> (f64, f64) {
    let share = 1.0 / points.len().max(1) as f64;
    points.fold((0.0, 0.0), |sum, point| (sum.0 + share * point.0, sum.1 + share * point.1))
}

/// Mean difference of the headings, reference minus estimate \[rad\].
fn mean_turn(samples: &[Sample]) -> Option<f64> {
    let turn = |sample: &Sample| Some(sample.reference_yaw? - sample.marker.yaw);
    let first = turn(samples.first()?)?;
    let turns: Option<Vec<f64>> = samples.iter().map(turn).collect();
    let about = turns?.into_iter().map(|turn| (angle::wrap(turn - first), 0.0));
    Some(first + mean(about.collect::<Vec<_>>().into_iter()).0)
}

/// The rotation that fits the estimated positions to the reference's by least squares \[rad\]
/// (Horn, Closed-form solution of absolute orientation, 1987, in the plane).
fn fitted_turn(samples: &[Sample]) -> Option<f64> {
    let estimates = samples.iter().map(|sample| (sample.marker.x, sample.marker.y));
    let (from, to) = (mean(estimates), mean(samples.iter().map(|sample| sample.reference)));
    let (mut cos, mut sin, mut spread) = (0.0, 0.0, 0.0);
    for sample in samples {
        let (ex, ey) = (sample.marker.x - from.0, sample.marker.y - from.1);
        let (rx, ry) = (sample.reference.0 - to.0, sample.reference.1 - to.1);
        cos += ex * rx + ey * ry;
        sin += ex * ry - ey * rx;
        spread += ex * ex + ey * ey;
    }
    (spread > SPREAD && math::hypot(cos, sin) > SPREAD).then(|| math::atan2(sin, cos))
}
