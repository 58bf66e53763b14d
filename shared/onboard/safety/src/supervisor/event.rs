//! What the supervisor learns.

use kerbside_messages::{
    Actuator, Command, Heartbeat, Inhibit, Odometry, OperatorRequest, Process, Verb,
};

/// A process the supervisor answers for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Supervised {
    /// Which.
    pub process: Process,
    /// Started elsewhere: awaited, watched, faulted, never killed.
    pub external: bool,
}

/// How a process ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Exit {
    /// By itself, with this code.
    Code(i32),
    /// By a signal.
    Signal(i32),
}

impl core::fmt::Display for Exit {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Code(code) => write!(f, "exit code {code}"),
            Self::Signal(signal) => write!(f, "signal {signal}"),
        }
    }
}

/// Something that happened. Samples are admitted ones, sealed by their senders. Whatever has
/// arrived is handed over before a [`Event::Tick`], else lateness of the supervisor itself would
/// look like silence of the others.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// A process asked for by [`crate::Action::Spawn`] runs.
    Spawned {
        /// Which.
        process: Process,
        /// Its pid; only heartbeats of this pid count.
        pid: u32,
    },
    /// It could not be started.
    SpawnFailed {
        /// Which.
        process: Process,
    },
    /// A child was reaped.
    Exited {
        /// Which.
        process: Process,
        /// How.
        exit: Exit,
    },
    /// A sign of life.
    Heartbeat(&'a Heartbeat),
    /// An estimate.
    Odometry(&'a Odometry),
    /// A command of the tracker.
    Command(&'a Command),
    /// An output of the gate.
    Actuator(&'a Actuator),
    /// Somebody forbids motion.
    Inhibit(&'a Inhibit),
    /// An operator asks.
    Operator {
        /// The request's id, repeated by the answer.
        id: u64,
        /// What is asked.
        verb: Verb,
    },
    /// The supervisor was told to end (SIGINT, SIGTERM): as [`Verb::Down`], without an answer.
    Shutdown,
    /// A cycle is over.
    Tick,
}

impl Event<'_> {
    /// The event of an admitted request; none for a verb of no known number.
    #[must_use]
    pub fn of_request(request: &OperatorRequest) -> Option<Self> {
        Verb::from_code(request.verb).map(|verb| Self::Operator { id: request.id, verb })
    }
}
