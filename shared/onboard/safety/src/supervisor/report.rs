//! What the supervisor publishes each cycle.

use kerbside_messages::{Header, Permit, State};

use super::Supervisor;
use crate::ns;

impl Supervisor {
    /// Fills the permit; the sender adds the rest of the header. It is republished each cycle, also
    /// where it grants nothing: a withdrawn permit ends motion sooner than one that runs out.
    pub fn fill_permit(&self, permit: &mut Permit) {
        let granted = self.permits();
        let life = if granted { ns(self.settings.timeouts.permit) } else { 0 };
        *permit = Permit {
            header: Header::stamped(self.now, 0),
            arm: self.arms,
            expiry: self.now.saturating_add(life),
            mode: self.mode.code(),
            granted: u8::from(granted),
            ..Permit::default()
        };
    }

    /// Fills the state; the sender adds the rest of the header.
    pub fn fill_state(&self, state: &mut State) {
        *state = State {
            header: Header::stamped(self.now, 0),
            arms: self.arms,
            since: self.since,
            pid: self.pid,
            mode: self.mode.code(),
            cause: self.why.cause.code(),
            culprit: self.why.culprit.map_or(u8::MAX, |process| process as u8),
            healthy: u8::from(self.is_healthy()),
            text: self.why.text,
            ..State::default()
        };
        for (row, watch) in state.processes.iter_mut().zip(&self.watches) {
            *row = watch.row(self.now);
            state.rows += 1;
        }
    }

    /// Whether every process is healthy and nothing but the pose can hinder an arm.
    #[must_use]
    pub fn is_healthy(&self) -> bool {
        self.unhealthy().is_none() && self.inhibits.in_force(self.now).is_none()
    }
}
