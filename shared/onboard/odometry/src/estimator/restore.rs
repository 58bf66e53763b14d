//! What an earlier life of the estimator knew, taken up.

use kerbside_geometry::Pose;
use kerbside_messages::{EstimatorState, FixVerdict, Odometry, ResetReason, Restore, Travel};
use nalgebra::Matrix3;

use super::Estimator;
use super::increment::Estimate;

/// Intervals are computed from stamps: they agree to within rounding \[s\].
const ROUNDING: f64 = 1e-6;

impl Estimator {
    /// Takes up what an earlier life knew; what rolled by since is the next increment, a gap unless
    /// `travel` is the next after the one that life saw last.
    pub(super) fn take_restore(&mut self, restore: &Restore, travel: &Travel, gap: bool) {
        let known = &restore.odometry;
        if !self.restorable || known.state != EstimatorState::Valid.code() {
            return;
        }
        self.restorable = false;
        self.inherit(known);
        let estimate = Estimate {
            pose: Pose::new(known.x, known.y, known.yaw),
            covariance: Matrix3::from_row_slice(&known.covariance),
        };
        if known.counter_epoch != travel.counter_epoch {
            self.jump(estimate, EstimatorState::Lost, ResetReason::CounterReset);
            self.wheels.apply();
            return;
        }
        self.jump(estimate, EstimatorState::Valid, ResetReason::Restored);
        if let Some(fused) = &mut self.fused {
            fused.inherit(&estimate, known);
            self.estimate = fused.estimate();
        }
        self.gyro.load(&known.filter_state);
        self.wheels.restore(known.travel, &known.filter_state);
        self.gap_pending = gap || !follows(travel, known);
        (self.rolled, self.seen) = (known.header.stamp, known.header.stamp);
    }

    /// Counts go on where the earlier life left them.
    fn inherit(&mut self, known: &Odometry) {
        self.resets = known.resets;
        self.distance = known.distance;
        self.unusable = self.unusable.wrapping_add(known.unusable);
        if self.verdict == FixVerdict::None {
            self.verdict = FixVerdict::from_code(known.fix_verdict).unwrap_or(FixVerdict::None);
            self.fix_sequence = known.fix_sequence;
        }
        if let Some(front) = &mut self.front {
            let record = front.record_mut();
            record.corrections = record.corrections.wrapping_add(known.corrections);
            record.gated = record.gated.wrapping_add(known.gated);
        }
        if let Some(fused) = &mut self.fused {
            let statistics = fused.statistics_mut();
            statistics.corrections = statistics.corrections.wrapping_add(known.corrections);
            statistics.gated = statistics.gated.wrapping_add(known.gated);
        }
    }
}

/// Whether no travel lies between `travel` and the one that `known` was computed from.
fn follows(travel: &Travel, known: &Odometry) -> bool {
    let since = crate::wheels::elapsed(travel.header.stamp, known.header.stamp);
    travel.gap == 0 && travel.interval > 0.0 && (since - travel.interval).abs() < ROUNDING
}
