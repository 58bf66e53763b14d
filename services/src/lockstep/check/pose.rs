//! The estimate never jumps without an announced reset, and a valid one stays near the truth through everything that
//! claims to keep it.

use std::collections::VecDeque;

use kerbside_geometry::{Vehicle, math};
use kerbside_messages::{EstimatorState, Nanos, Odometry, ResetReason, Truth, seconds};

use crate::lockstep::World;

/// Truths that are kept to compare with: those of the newest seconds.
const KEPT: usize = 1024;
/// What a filter's correction may move the estimate at once, in wheelbases.
const CORRECTION: f64 = 0.02;
/// What the estimate's error may grow at once through a reset that claims to keep the pose, in wheelbases.
const RESTORED: f64 = 0.1;

/// An estimate that was compared with the truth.
#[derive(Clone, Copy, Debug)]
struct Compared {
    stamp: Nanos,
    resets: u32,
    epoch: u64,
    valid: bool,
    x: f64,
    y: f64,
    /// Estimate minus truth, of the time it is stamped with and of the time it came \[m\]: a clock that jumped makes the
    /// one wrong for a while, a sample that came late the other.
    errors: [(f64, f64); 2],
}

#[derive(Debug)]
pub(super) struct PoseWatch {
    wheelbase: f64,
    speed: f64,
    truths: VecDeque<Truth>,
    before: Option<Compared>,
    /// The newest valid one.
    valid: Option<Compared>,
}

impl PoseWatch {
    pub(super) fn new(vehicle: &Vehicle) -> Self {
        Self {
            wheelbase: vehicle.wheelbase,
            speed: vehicle.limits.speed,
            truths: VecDeque::with_capacity(KEPT),
            before: None,
            valid: None,
        }
    }

    pub(super) fn look(&mut self, world: &World) -> Result<(), String> {
        if let Some(truth) = &world.fresh.truth {
            if self.truths.len() == KEPT {
                self.truths.pop_front();
            }
            self.truths.push_back(*truth);
        }
        let Some(odometry) = &world.fresh.odometry else { return Ok(()) };
        let Some(now) = self.compare(odometry) else { return Ok(()) };
        if let Some(before) = self.before.replace(now)
            && now.resets == before.resets
        {
            self.steady(&before, &now)?;
        }
        if !now.valid {
            return Ok(());
        }
        let Some(before) = self.valid.replace(now) else { return Ok(()) };
        let kept = odometry.reset_reason == ResetReason::Restored.code();
        if now.resets == before.resets || kept {
            self.near(&before, &now)?;
        }
        Ok(())
    }

    /// A pose that claims to be kept is about as wrong as before.
    fn near(&self, before: &Compared, now: &Compared) -> Result<(), String> {
        let apart = |(a, b): (&(f64, f64), &(f64, f64))| math::hypot(a.0 - b.0, a.1 - b.1);
        let grown = now.errors.iter().zip(&before.errors).map(apart).fold(f64::INFINITY, f64::min);
        if grown <= RESTORED * self.wheelbase {
            return Ok(());
        }
        let life = if now.epoch == before.epoch { "the same" } else { "another" };
        Err(format!(
            "the estimate's error changes by {:.1} cm at once, and the pose claims to be kept (resets {} to {}, life {life})",
            100.0 * grown,
            before.resets,
            now.resets,
        ))
    }

    /// Without a reset it goes no faster than a vehicle can.
    fn steady(&self, before: &Compared, now: &Compared) -> Result<(), String> {
        let moved = math::hypot(now.x - before.x, now.y - before.y);
        let passed = seconds(now.stamp.saturating_sub(before.stamp)).max(0.005);
        let allowed = 1.5 * self.speed * passed + CORRECTION * self.wheelbase;
        if moved <= allowed {
            return Ok(());
        }
        Err(format!(
            "the estimate moves by {:.1} cm within {passed:.3} s, and announces no reset",
            100.0 * moved
        ))
    }

    /// None where no truth of that time is known.
    fn compare(&self, odometry: &Odometry) -> Option<Compared> {
        let stamp = odometry.header.stamp;
        let newest = self.truths.back()?;
        // The first that is no older; most estimates are of the newest.
        let no_older = |truth: &&Truth| truth.header.stamp >= stamp;
        let then = self.truths.iter().rev().take_while(no_older).last().unwrap_or(newest);
        let error = |truth: &Truth| (odometry.x - truth.x, odometry.y - truth.y);
        Some(Compared {
            stamp,
            resets: odometry.resets,
            epoch: odometry.header.epoch,
            valid: odometry.state == EstimatorState::Valid.code(),
            x: odometry.x,
            y: odometry.y,
            errors: [error(then), error(newest)],
        })
    }
}
