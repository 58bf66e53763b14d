//! What the supervisor knows of pose and motion.

use kerbside_messages::{Actuator, EstimatorState, Nanos, Odometry, ResetReason};

use crate::fresh;

/// An odometry kept for a restarted estimator; compared by what identifies it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kept(pub(crate) Odometry);

impl core::hash::Hash for Kept {
    fn hash<H: core::hash::Hasher>(&self, state: &mut H) {
        (self.0.header.epoch, self.0.header.sequence, self.0.header.sent).hash(state);
    }
}

/// The newest estimate, as far as decisions need it.
#[derive(Clone, Copy, Debug, Hash)]
struct Seen {
    epoch: u64,
    stamp: Nanos,
    sent: Nanos,
    standstill: bool,
    pose: PoseTrust,
}

/// Whether a plan may be driven on the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum PoseTrust {
    /// It may.
    Valid,
    /// There never was one, or a restarted estimator has not got it back.
    Unset,
    /// It was lost.
    Lost,
}

/// The gate's newest output.
#[derive(Clone, Copy, Debug, Hash)]
struct Output {
    sent: Nanos,
    zero_since: Option<Nanos>,
}

/// Pose and motion.
#[derive(Clone, Debug, Default, Hash)]
pub(crate) struct Motion {
    seen: Option<Seen>,
    first_epoch: Option<u64>,
    output: Option<Output>,
    kept: Option<Kept>,
    restoring: bool,
}

impl Motion {
    /// Takes up an estimate; returns whether it is of another life of the estimator.
    pub(crate) fn see(&mut self, odometry: &Odometry) -> bool {
        let epoch = odometry.header.epoch;
        let first = *self.first_epoch.get_or_insert(epoch);
        let new_life = self.seen.is_some_and(|seen| seen.epoch != epoch);
        let pose = trust(odometry, epoch == first);
        self.seen = Some(Seen {
            epoch,
            stamp: odometry.header.stamp,
            sent: odometry.header.sent,
            standstill: odometry.standstill == 1,
            pose,
        });
        self.keep(odometry, pose);
        new_life
    }

    /// Keeps the newest valid estimate, and forgets it with the pose: what was lost must not come
    /// back through a restart.
    fn keep(&mut self, odometry: &Odometry, pose: PoseTrust) {
        let same_life = self.kept.is_some_and(|kept| kept.0.header.epoch == odometry.header.epoch);
        match pose {
            PoseTrust::Valid => {
                // A sample that an ended life sent last does not end the restore.
                self.restoring &= same_life;
                self.kept = Some(Kept(*odometry));
            }
            PoseTrust::Unset if !same_life => self.restoring = self.kept.is_some(),
            PoseTrust::Unset | PoseTrust::Lost => self.forget(),
        }
    }

    fn forget(&mut self) {
        self.kept = None;
        self.restoring = false;
    }

    /// The estimator died.
    pub(crate) fn estimator_died(&mut self) {
        self.restoring = self.kept.is_some();
    }

    /// What a restarted estimator is to take up, until it did.
    pub(crate) fn restore(&self) -> Option<&Odometry> {
        self.kept.as_ref().filter(|_| self.restoring).map(|kept| &kept.0)
    }

    /// Takes up an output of the gate.
    pub(crate) fn output(&mut self, actuator: &Actuator) {
        let before = self.output.and_then(|output| output.zero_since);
        let sent = actuator.header.sent;
        let zero_since = (actuator.speed == 0.0).then_some(before.unwrap_or(sent));
        self.output = Some(Output { sent, zero_since });
    }

    /// Whether a plan may be driven on the newest pose; none without a fresh estimate.
    pub(crate) fn pose(&self, now: Nanos, freshness: Nanos) -> Option<PoseTrust> {
        let seen = self.seen.filter(|_| self.sees(now, freshness))?;
        Some(if self.restoring { PoseTrust::Unset } else { seen.pose })
    }

    /// Whether the newest estimate says that the pose is one to drive on, however old it is.
    pub(crate) fn newest_pose(&self) -> Option<PoseTrust> {
        self.seen.map(|seen| seen.pose)
    }

    /// The life of the estimator that the newest estimate is of.
    #[cfg(test)]
    pub(crate) fn epoch(&self) -> Option<u64> {
        self.seen.map(|seen| seen.epoch)
    }

    /// Whether there is a fresh estimate.
    pub(crate) fn sees(&self, now: Nanos, freshness: Nanos) -> bool {
        self.seen.is_some_and(|seen| {
            fresh(now, seen.sent, freshness) && fresh(now, seen.stamp, freshness)
        })
    }

    /// Whether a fresh estimate shows the vehicle standing, and the gate asks for no motion.
    pub(crate) fn stands(&self, now: Nanos, freshness: Nanos) -> bool {
        let asked = self.output.is_some_and(|output| {
            output.zero_since.is_none() && fresh(now, output.sent, freshness)
        });
        !asked && self.sees(now, freshness) && self.seen.is_some_and(|seen| seen.standstill)
    }

    /// Whether the gate has asked for zero speed for `settle`, and still does.
    pub(crate) fn settled(&self, now: Nanos, freshness: Nanos, settle: Nanos) -> bool {
        self.output.is_some_and(|output| {
            fresh(now, output.sent, freshness)
                && output.zero_since.is_some_and(|since| now.saturating_sub(since) >= settle)
        })
    }
}

/// A configured initial pose is where the first life of the estimator began. A later life that
/// claims it has not noticed that the vehicle moved in between.
fn trust(odometry: &Odometry, first_life: bool) -> PoseTrust {
    match EstimatorState::from_code(odometry.state) {
        Some(EstimatorState::Valid) => {
            let initial = odometry.reset_reason == ResetReason::Initial.code();
            if initial && !first_life { PoseTrust::Unset } else { PoseTrust::Valid }
        }
        Some(EstimatorState::Unset) => PoseTrust::Unset,
        Some(EstimatorState::Lost) | None => PoseTrust::Lost,
    }
}
