//! Modes, supervision, permits and the actuation gate as pure decisions.
//!
//! Nothing here knows a clock, a process or a file: `now` comes in, decisions go out. The same code
//! decides live, in lockstep and in its own exhaustive tests.
//!
//! - [`Gate`] is the last door before the vehicle: no motion without a live permit and a fresh
//!   command of the same arm, and a stop that stays a stop until somebody arms anew.
//! - [`Supervisor`] is one state machine: it starts, watches, permits and restarts.
//! - [`bounds`] refuses configurations with which the vehicle could not stop in time, or whose
//!   periods the supervisor cannot tell apart.
//! - [`LoopMonitor`] sits inside each process and fills its heartbeats.

pub mod bounds;
mod gate;
mod inhibits;
mod line;
mod monitor;
mod recent;
mod settings;
mod supervisor;

pub use gate::{Gate, GateInputs};
pub use inhibits::{Inhibits, Standing};
pub use monitor::LoopMonitor;
pub use settings::{RestartSettings, SafetySettings, Timeouts};
pub use supervisor::{
    Action, Actions, Answer, Event, Exit, START_TIMEOUT, Supervised, Supervisor, TERMINATE_GRACE,
};

use core::time::Duration;
use kerbside_messages::Nanos;

/// Nanoseconds of a configured duration; one that does not fit is forever.
pub(crate) fn ns(duration: Duration) -> Nanos {
    Nanos::try_from(duration.as_nanos()).unwrap_or(Nanos::MAX)
}

/// Whether `stamp` is at most `limit` away from `now`, on either side: a stamp far in the future
/// would otherwise stay fresh for ever.
pub(crate) fn fresh(now: Nanos, stamp: Nanos, limit: Nanos) -> bool {
    now.abs_diff(stamp) <= limit
}
