//! Modes, signs of life, and the operator's door.

use super::{codes, finite, known};
use crate::layout::{Text, layout};
use crate::topics::Process;
use crate::{Header, Refusal};

codes! {
    /// Modes of the stack.
    pub enum Mode {
        /// Processes come up.
        Starting = 0 "starting",
        /// Healthy; nothing may move.
        Ready = 1 "ready",
        /// The operator armed; waits for a plan.
        Armed = 2 "armed",
        /// Follows a plan.
        Driving = 3 "driving",
        /// The plan is completed.
        Done = 4 "done",
        /// Comes to a halt.
        Stopping = 5 "stopping",
        /// Halted by a fault.
        Faulted = 6 "faulted",
        /// Going down.
        Down = 7 "down",
    }
}

codes! {
    /// Why the mode is what it is.
    pub enum Cause {
        /// Nothing to say.
        None = 0 "none",
        /// The operator asked.
        Operator = 1 "operator",
        /// The plan was completed.
        Completed = 2 "plan completed",
        /// Nobody gave a plan in time.
        NoPlan = 3 "no plan in time",
        /// A process died.
        Died = 4 "process died",
        /// A process's heartbeats stayed away.
        Silent = 5 "heartbeat missing",
        /// A process beats more often than it may.
        TooManyBeats = 6 "too many heartbeats",
        /// A process misses its deadline again and again.
        DeadlineMisses = 7 "deadline missed",
        /// A process passed its checkpoints out of order.
        Order = 8 "checkpoints out of order",
        /// A process failed its own check.
        SelfCheck = 9 "own check failed",
        /// Samples on the control path are too old.
        Stale = 10 "samples too old",
        /// The line to the vehicle is silent.
        LineLost = 11 "line lost",
        /// Somebody inhibited motion.
        Inhibited = 12 "inhibited",
        /// The tracker gave up.
        Tracker = 13 "tracker stopped",
        /// The pose is gone; a fix is needed.
        PoseLost = 14 "pose lost",
        /// A process died too often.
        GaveUp = 15 "process died too often",
        /// The gate latched by itself.
        Gate = 16 "gate stopped",
    }
}

codes! {
    /// What a process is doing, as the supervisor sees it.
    pub enum ProcessState {
        /// Not started, or waits for its back-off.
        Waiting = 0 "waiting",
        /// Started; no heartbeat yet.
        Starting = 1 "starting",
        /// Beats.
        Healthy = 2 "healthy",
        /// Does not beat.
        Silent = 3 "silent",
        /// Died.
        Dead = 4 "dead",
        /// Died too often; not started any more.
        GivenUp = 5 "given up",
        /// Started elsewhere; awaited.
        External = 6 "external",
    }
}

layout! {
    /// A process, as the supervisor sees it.
    pub struct ProcessRow {
        /// Its pid; 0 for none.
        pub pid: u32,
        /// How often it was restarted.
        pub restarts: u32,
        /// Deadlines it missed.
        pub misses: u32,
        /// Age of its newest heartbeat \[ms\].
        pub age_ms: u32,
        /// [`Process`].
        pub process: u8 as Process,
        /// [`ProcessState`].
        pub state: u8 as ProcessState,
        /// Unused.
        pub reserved: [u8; 6],
        /// What it waits for: UTF-8, filled up with zeros.
        pub waiting_for: [u8; 64] as Text,
    }
}

/// Rows of a state.
pub const MAX_ROWS: usize = 8;

layout! {
    /// The state of the stack.
    pub struct State {
        /// Header.
        pub header: Header,
        /// Count of arms since the supervisor's start.
        pub arms: u64,
        /// When the mode was entered \[ns\].
        pub since: u64,
        /// Pid of the supervisor.
        pub pid: u32,
        /// Number of rows.
        pub rows: u32,
        /// [`Mode`].
        pub mode: u8 as Mode,
        /// [`Cause`].
        pub cause: u8 as Cause,
        /// [`Process`] the cause names; 255 for none.
        pub culprit: u8 as Process,
        /// 1: every process beats and nothing hinders an arm but the pose.
        pub healthy: u8,
        /// Unused.
        pub reserved: [u8; 4],
        /// The cause in words: UTF-8, filled up with zeros.
        pub text: [u8; 128] as Text,
        /// A row per process.
        pub processes: [ProcessRow; MAX_ROWS],
    }
}

impl State {
    /// The mode; `Faulted` for a number that stands for none.
    #[must_use]
    pub fn mode(&self) -> Mode {
        Mode::from_code(self.mode).unwrap_or(Mode::Faulted)
    }

    /// The rows in use.
    #[must_use]
    pub fn rows(&self) -> &[ProcessRow] {
        &self.processes[..(self.rows as usize).min(MAX_ROWS)]
    }

    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        known("mode", Mode::from_code(self.mode))?;
        known("cause", Cause::from_code(self.cause))?;
        if self.rows as usize > MAX_ROWS {
            return Err(Refusal::OutOfRange { field: "rows" });
        }
        Ok(())
    }
}

layout! {
    /// A sign of life. Figures of time are of the loop since the previous heartbeat.
    pub struct Heartbeat {
        /// Header.
        pub header: Header,
        /// Steps since the start.
        pub steps: u64,
        /// Deadlines missed since the start.
        pub misses: u64,
        /// Samples refused since the start, all reasons.
        pub refused: u64,
        /// Samples lost on the way since the start: sequence gaps.
        pub lost: u64,
        /// Mean time spent in a step \[s\].
        pub work_mean: f64,
        /// Longest time spent in a step \[s\].
        pub work_max: f64,
        /// Longest time from the input's arrival to the end of its step \[s\].
        pub lateness_max: f64,
        /// Pid.
        pub pid: u32,
        /// Checkpoints passed out of order since the start.
        pub disorders: u32,
        /// [`Process`].
        pub process: u8 as Process,
        /// 1: all inputs are there, the loop runs.
        pub ready: u8,
        /// 1: failed its own check; `text` says which.
        pub failed: u8,
        /// 1: runs with real-time rights.
        pub realtime: u8,
        /// Unused.
        pub reserved: [u8; 4],
        /// What it waits for, or what failed: UTF-8, filled up with zeros.
        pub text: [u8; 64] as Text,
    }
}

impl Heartbeat {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        finite("times", &[self.work_mean, self.work_max, self.lateness_max])?;
        known("process", Process::from_id(self.process))
    }
}

codes! {
    /// What an operator may ask.
    pub enum Verb {
        /// Permit motion for the next plan.
        Arm = 1 "arm",
        /// Stop the vehicle.
        Stop = 2 "stop",
        /// Stop the vehicle and the stack.
        Down = 3 "down",
    }
}

layout! {
    /// An operator's request.
    pub struct OperatorRequest {
        /// Header.
        pub header: Header,
        /// Chosen by the client; the answer repeats it.
        pub id: u64,
        /// Pid of the client.
        pub pid: u32,
        /// [`Verb`].
        pub verb: u8 as Verb,
        /// Unused.
        pub reserved: [u8; 3],
    }
}

impl OperatorRequest {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        known("verb", Verb::from_code(self.verb))
    }
}

layout! {
    /// The supervisor's answer.
    pub struct OperatorAnswer {
        /// Header.
        pub header: Header,
        /// The request's id.
        pub id: u64,
        /// Count of arms after the request.
        pub arms: u64,
        /// [`Mode`] after the request.
        pub mode: u8 as Mode,
        /// 1: done.
        pub accepted: u8,
        /// Unused.
        pub reserved: [u8; 6],
        /// Why not: UTF-8, filled up with zeros.
        pub text: [u8; 160] as Text,
    }
}

impl OperatorAnswer {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        known("mode", Mode::from_code(self.mode))
    }
}
