//! What a fault does to the mode.

use kerbside_messages::{Cause, Mode};

use super::{Actions, Supervisor, Why};

impl Supervisor {
    /// A fault: the vehicle stops, and only an arm leads on.
    pub(super) fn fault(&mut self, why: Why, actions: &mut Actions) {
        match self.mode {
            Mode::Starting if why.cause != Cause::GaveUp => self.why = why,
            Mode::Starting | Mode::Ready => self.enter(Mode::Faulted, why, actions),
            Mode::Armed | Mode::Driving | Mode::Done => {
                self.after = Mode::Faulted;
                self.enter(Mode::Stopping, why, actions);
            }
            Mode::Stopping => {
                self.after = Mode::Faulted;
                self.blame(why);
            }
            Mode::Faulted => self.blame(why),
            Mode::Down => {}
        }
    }

    /// One failure shows in many places, its consequences often before itself: a stopped estimator
    /// starves the tracker long before its own silence is certain. What explains more is shown.
    fn blame(&mut self, why: Why) {
        if rank(why.cause) > rank(self.why.cause) {
            self.why = why;
        }
    }
}

/// How much a cause explains.
fn rank(cause: Cause) -> u8 {
    match cause {
        Cause::GaveUp => 4,
        Cause::Died
        | Cause::Silent
        | Cause::TooManyBeats
        | Cause::Order
        | Cause::SelfCheck
        | Cause::LineLost
        | Cause::PoseLost => 3,
        Cause::DeadlineMisses | Cause::Tracker => 2,
        Cause::Stale | Cause::Gate => 1,
        Cause::None | Cause::Operator | Cause::Completed | Cause::NoPlan | Cause::Inhibited => 0,
    }
}
