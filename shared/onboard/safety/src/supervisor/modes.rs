//! How modes follow each other.

use kerbside_messages::{
    Actuator, AlterReason, Cause, Command, Inhibit, Mode, Odometry, Process, TrackingPhase,
    TrackingStop, text,
};

use super::motion::PoseTrust;
use super::{Action, Actions, OVERDUE, Supervisor, Why};
use crate::line::line;
use crate::ns;

impl Supervisor {
    /// Whether motion is permitted: from an arm until the vehicle stands after the plan.
    #[must_use]
    pub fn permits(&self) -> bool {
        matches!(self.mode, Mode::Armed | Mode::Driving | Mode::Done)
    }

    pub(super) fn enter(&mut self, mode: Mode, why: Why, actions: &mut Actions) {
        self.mode = mode;
        self.since = self.now;
        actions.push(Action::Entered { mode, cause: why.cause, culprit: why.culprit });
        self.why = why;
    }

    /// The transitions that wait for something to hold.
    pub(super) fn advance(&mut self, actions: &mut Actions) {
        let age = self.now - self.since;
        match self.mode {
            Mode::Starting if self.unhealthy().is_none() => {
                self.enter(Mode::Ready, Why::plain(Cause::None), actions);
            }
            Mode::Armed if age >= ns(self.settings.timeouts.arm) => {
                self.enter(Mode::Ready, Why::plain(Cause::NoPlan), actions);
            }
            Mode::Done if self.halted() => {
                self.enter(Mode::Ready, Why::plain(Cause::Completed), actions);
            }
            Mode::Stopping if self.halted() => {
                self.enter(self.after, self.why.clone(), actions);
            }
            Mode::Done | Mode::Stopping if age >= ns(self.stop.stop).saturating_add(OVERDUE) => {
                let text =
                    line(format_args!("the vehicle does not come to rest ({})", self.why.cause));
                let why = Why { cause: Cause::Gate, culprit: Some(Process::Actuation), text };
                self.enter(Mode::Faulted, why, actions);
            }
            _ => {}
        }
    }

    /// Whether the vehicle stands: it is seen standing; or the gate has asked for standing long
    /// enough and the line carries it; or, blind, for as long as a stop takes at most.
    pub(super) fn halted(&self) -> bool {
        let freshness = self.freshness();
        if self.motion.sees(self.now, freshness) {
            return self.motion.stands(self.now, freshness);
        }
        let line = self.watches.iter().find(|watch| watch.process == Process::Interface);
        let carried = line.is_none_or(|line| line.healthy(self.now));
        let settled = self.motion.settled(self.now, freshness, ns(self.stop.settle));
        (carried && settled) || self.now - self.since >= ns(self.stop.stop)
    }

    /// Ends motion without a fault: `ready` follows.
    pub(super) fn stop(&mut self, why: Why, actions: &mut Actions) {
        if self.permits() {
            self.after = Mode::Ready;
            self.enter(Mode::Stopping, why, actions);
        }
    }

    pub(super) fn odometry(&mut self, odometry: &Odometry, actions: &mut Actions) {
        let new_life = self.motion.see(odometry);
        if !self.permits() {
            return;
        }
        let culprit = Some(Process::Estimator);
        if new_life {
            let text = line(format_args!("estimator was restarted"));
            self.fault(Why { cause: Cause::Died, culprit, text }, actions);
        } else if self.mode != Mode::Done && self.motion.newest_pose() != Some(PoseTrust::Valid) {
            let text = line(format_args!("pose lost: a fix is needed"));
            self.fault(Why { cause: Cause::PoseLost, culprit, text }, actions);
        }
    }

    /// The tracker's commands of this arm show where the plan is; others say nothing.
    pub(super) fn command(&mut self, command: &Command, actions: &mut Actions) {
        if command.arm != self.arms || !self.permits() {
            return;
        }
        match TrackingPhase::from_code(command.phase) {
            Some(TrackingPhase::Stopped) | None => self.tracker_stopped(command, actions),
            Some(TrackingPhase::Tracking) if self.mode == Mode::Armed => {
                self.enter(Mode::Driving, Why::plain(Cause::None), actions);
            }
            Some(TrackingPhase::Finished) if self.mode == Mode::Armed => {
                // A plan that was over with its first command was driven nevertheless.
                self.enter(Mode::Driving, Why::plain(Cause::None), actions);
                self.enter(Mode::Done, Why::plain(Cause::Completed), actions);
            }
            Some(TrackingPhase::Finished) if self.mode == Mode::Driving => {
                self.enter(Mode::Done, Why::plain(Cause::Completed), actions);
            }
            Some(TrackingPhase::Tracking | TrackingPhase::Finished) => {}
        }
    }

    fn tracker_stopped(&mut self, command: &Command, actions: &mut Actions) {
        let reason = TrackingStop::from_code(command.stop).unwrap_or(TrackingStop::None);
        let text = line(format_args!("tracker stopped: {reason}"));
        self.fault(Why { cause: Cause::Tracker, culprit: Some(Process::Tracker), text }, actions);
    }

    /// A gate that latched under this arm stopped the vehicle by itself.
    pub(super) fn actuator(&mut self, actuator: &Actuator, actions: &mut Actions) {
        self.motion.output(actuator);
        let latch = AlterReason::from_code(actuator.latch).unwrap_or(AlterReason::Latched);
        if latch == AlterReason::None || actuator.arm != self.arms || !self.permits() {
            return;
        }
        let (cause, culprit) = match latch {
            AlterReason::Inhibited => {
                return self.stop(self.inhibited(), actions);
            }
            AlterReason::TrackerStop => (Cause::Tracker, Process::Tracker),
            AlterReason::CommandStale => (Cause::Stale, Process::Tracker),
            _ => (Cause::Gate, Process::Actuation),
        };
        let text = line(format_args!("the gate stopped: {latch}"));
        self.fault(Why { cause, culprit: Some(culprit), text }, actions);
    }

    pub(super) fn inhibit(&mut self, inhibit: &Inhibit, actions: &mut Actions) {
        self.inhibits.note(inhibit);
        if self.inhibits.in_force(self.now).is_none() {
            return;
        }
        if self.mode == Mode::Stopping && self.why.cause == Cause::Inhibited {
            // The gate was faster with the fact than the inhibit with its reason.
            self.why = self.inhibited();
        }
        self.stop(self.inhibited(), actions);
    }

    /// Who inhibits motion, and why, as far as that is known.
    fn inhibited(&self) -> Why {
        let Some(inhibit) = self.inhibits.in_force(self.now) else {
            return Why::plain(Cause::Inhibited);
        };
        let (who, why) = (text::as_str(&inhibit.who), text::as_str(&inhibit.why));
        let text = line(format_args!("inhibited by {who}: {why}"));
        Why { cause: Cause::Inhibited, culprit: None, text }
    }
}
