//! The fused filter's way through the estimator.

use kerbside_messages::{EstimatorState, Fix, FixVerdict, Nanos, ResetReason, Travel};

use super::Estimator;
use super::fused::{Reading, Taken, Turned};
use crate::wheels::elapsed;

/// So long the fused filter awaits a wheel \[s\] before it goes on without.
const LONGEST_AWAITING: f64 = 0.3;

impl Estimator {
    /// A wheel was awaited for so long that the fused filter goes on with the others.
    pub(super) fn goes_without(&mut self, stamp: Nanos) -> bool {
        let since = *self.awaiting.get_or_insert(stamp);
        self.fused.is_some()
            && self.wheels.telling().contains(&true)
            && (elapsed(stamp, since) > LONGEST_AWAITING || self.wheels.ready_without_lost())
    }

    /// The same with the fused filter.
    pub(super) fn fuse(&mut self, travel: &Travel) {
        let stamp = travel.header.stamp;
        let reading = self.reading(stamp);
        let Some(fused) = &mut self.fused else { return };
        let Some(piece) = fused.step(&reading) else {
            self.unusable = self.unusable.wrapping_add(1);
            return;
        };
        self.estimate = fused.estimate();
        self.gap_pending = false;
        if reading.moves() {
            self.gyro.clear();
        }
        self.distance += piece.distance.abs();
        self.applied(stamp, piece.distance, piece.turn);
    }

    fn reading(&self, stamp: Nanos) -> Reading {
        let read = self.wheels.telling();
        let turned = self.gyro.turn().filter(|_| self.uses_gyro).map(|(turn, variance)| {
            let time = self.gyro.time();
            let held = self.gyro.rate_variance() * time * time;
            Turned { turn, variance: variance.max(held), time }
        });
        let start = if self.wheels.ready() { self.seen.max(self.rolled) } else { self.rolled };
        Reading {
            start: start.min(stamp),
            end: stamp,
            travel: core::array::from_fn(|wheel| {
                if read[wheel] { self.wheels.unapplied(wheel) } else { 0.0 }
            }),
            read,
            begun: self.wheels.beginning(),
            aligned: self.wheels.aligned(),
            turned,
            gap: self.gap_pending.then_some(self.curvature),
        }
    }

    /// A vehicle that stands does not turn: what the gyro reads is its bias.
    pub(super) fn rest(&mut self, travel: &Travel) {
        self.gyro.clear();
        let reads = self.uses_gyro && travel.yaw_rate_is_new == 1;
        if let Some(fused) = self.fused.as_mut().filter(|_| reads) {
            fused.rest(travel.yaw_rate, self.gyro.rate_variance());
        }
    }

    /// The fused filter corrects a valid pose by a fix, in motion as well; where it had to widen its covariance for that, the
    /// pose jumps, and the sample says so. A fix that contradicts
    /// it, and one without a pose to correct, sets the pose of a vehicle that stands.
    pub(super) fn corrected(&mut self, fix: &Fix, ruled: FixVerdict) -> FixVerdict {
        let judged = matches!(ruled, FixVerdict::Accepted | FixVerdict::Moving);
        let valid = self.state == EstimatorState::Valid;
        let taken = self.fused.as_mut().filter(|_| judged && valid).map(|fused| fused.fix(fix));
        if let (Some(Taken::Widened), Some(fused)) = (taken, &self.fused) {
            self.estimate = fused.estimate();
            self.restorable = false;
            self.reason = ResetReason::Contradicted;
            self.resets = self.resets.wrapping_add(1);
            return FixVerdict::Widened;
        }
        if let (Some(Taken::Corrected), Some(fused)) = (taken, &self.fused) {
            self.estimate = fused.estimate();
            self.restorable = false;
            // A configured pose that a fix agrees with is not a mere claim any more.
            if self.reason == ResetReason::Initial {
                self.reason = ResetReason::Fix;
            }
            return FixVerdict::Accepted;
        }
        if ruled == FixVerdict::Accepted {
            self.accept(fix);
        }
        ruled
    }
}
