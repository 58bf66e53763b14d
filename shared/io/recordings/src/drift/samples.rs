//! Estimate and reference at the same instants.

use kerbside_geometry::{Pose, angle};

use super::{EstimatedPose, ReferencePose};

/// One reference with the estimate of the same instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Distance the estimate has rolled \[m\].
    pub(super) distance: f64,
    /// The marker's pose as estimated, in the estimate's frame.
    pub(super) marker: Pose,
    /// The marker's position as the reference states it \[m\].
    pub(super) reference: (f64, f64),
    /// The marker's heading as the reference states it \[rad\].
    pub(super) reference_yaw: Option<f64>,
}

/// A sample for each reference within the time of the estimate.
pub(super) fn samples_of(
    estimates: &[EstimatedPose],
    references: &[ReferencePose],
    body_from_marker: &Pose,
) -> Vec<Sample> {
    let mut after = 0;
    let mut samples = Vec::with_capacity(references.len());
    for reference in references {
        after += estimates[after..].partition_point(|pose| pose.stamp < reference.stamp);
        let Some(estimate) = at(estimates, after, reference.stamp) else { continue };
        samples.push(Sample {
            distance: estimate.distance,
            marker: estimate.pose.compose(body_from_marker),
            reference: (reference.x, reference.y),
            reference_yaw: reference.yaw,
        });
    }
    samples
}

/// The estimate at `stamp`, `after` being the first that is not before it.
fn at(estimates: &[EstimatedPose], after: usize, stamp: u64) -> Option<EstimatedPose> {
    let next = estimates.get(after)?;
    if next.stamp == stamp {
        return Some(*next);
    }
    let before = estimates.get(after.checked_sub(1)?)?;
    #[allow(clippy::cast_precision_loss)] // Differences of neighbouring stamps are small.
    let share = (stamp - before.stamp) as f64 / (next.stamp - before.stamp) as f64;
    let between = |from: f64, to: f64| from + share * (to - from);
    let (from, to) = (before.pose, next.pose);
    let yaw = between(from.yaw, angle::unwrap(from.yaw, to.yaw));
    Some(EstimatedPose {
        stamp,
        pose: Pose::new(between(from.x, to.x), between(from.y, to.y), yaw),
        distance: between(before.distance, next.distance),
    })
}
