//! What the supervisor wants done.

use kerbside_messages::{Cause, Mode, OperatorAnswer, Process};

/// Something to do, in the order given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(clippy::large_enum_variant)] // a few of them in one fixed buffer, nothing is moved often
pub enum Action {
    /// Start the process; to be answered by `Spawned` or `SpawnFailed`.
    Spawn(Process),
    /// Ask the child to end (SIGTERM).
    Terminate(Process),
    /// End the child (SIGKILL).
    Kill(Process),
    /// Sweep what dead nodes left in shared memory.
    CleanUp,
    /// Publish [`crate::Supervisor::restore`].
    PublishRestore,
    /// Answer an operator.
    Answer(Answer),
    /// Another mode was entered; for the log.
    Entered {
        /// Which.
        mode: Mode,
        /// Why.
        cause: Cause,
        /// Whose fault it is, if a process's.
        culprit: Option<Process>,
    },
    /// A process failed, whether or not the mode changes by it; for the log.
    Failed {
        /// Which.
        process: Process,
        /// How.
        cause: Cause,
    },
    /// All is down: end with this exit code. 0: all ended when asked; 1: one had to be killed.
    Finished {
        /// Exit code.
        exit: u8,
    },
}

/// The answer to an operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The request's id.
    pub id: u64,
    /// Done.
    pub accepted: bool,
    /// Count of arms after the request.
    pub arms: u64,
    /// Mode after the request.
    pub mode: Mode,
    /// Why not: UTF-8, filled up with zeros.
    pub text: [u8; 160],
}

impl Answer {
    /// As the message that carries it; the sender adds the header.
    #[must_use]
    pub fn message(&self) -> OperatorAnswer {
        OperatorAnswer {
            id: self.id,
            arms: self.arms,
            mode: self.mode.code(),
            accepted: u8::from(self.accepted),
            text: self.text,
            ..OperatorAnswer::default()
        }
    }
}

/// No event asks for more: at most three actions for each of eight processes, and the sweep, the
/// restore, two modes, an answer and the end.
const CAPACITY: usize = 32;

/// The actions of one event, in a fixed buffer.
#[derive(Clone, Debug)]
pub struct Actions {
    items: [Action; CAPACITY],
    used: usize,
}

impl Default for Actions {
    fn default() -> Self {
        Self { items: [Action::CleanUp; CAPACITY], used: 0 }
    }
}

impl Actions {
    /// The actions, in order.
    #[must_use]
    pub fn as_slice(&self) -> &[Action] {
        &self.items[..self.used]
    }

    /// The actions, in order.
    pub fn iter(&self) -> impl Iterator<Item = &Action> {
        self.as_slice().iter()
    }

    pub(crate) fn clear(&mut self) {
        self.used = 0;
    }

    pub(crate) fn push(&mut self, action: Action) {
        self.items[self.used] = action;
        self.used += 1;
    }
}
