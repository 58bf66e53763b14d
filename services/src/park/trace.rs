//! What was seen of a run: kept by whoever watches, live or in lockstep, and judged afterwards.

use hdrhistogram::Histogram;
use kerbside_messages::{
    Actuator, Cause, Command, Heartbeat, Mode, Nanos, Odometry, Plan, Process, State,
    TrajectoryPoint, Truth, seconds, text,
};

/// Longest latency that the histogram tells apart \[us\].
const LONGEST: u64 = 10_000_000;

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
pub struct Happening {
    /// When \[ns\].
    pub at: Nanos,
    /// What kind.
    pub kind: HappeningKind,
    /// In words.
    pub text: String,
}

/// Kinds of happenings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HappeningKind {
    /// The mode changed.
    Mode(Mode),
    /// The operator armed.
    Arm,
    /// A plan was taken up.
    Plan,
    /// A fault.
    Fault,
    /// A process was started again.
    Restart,
    /// Anything else.
    Note,
}

/// A plan as it was followed.
#[derive(Clone, Debug, PartialEq)]
pub struct Followed {
    /// Its head.
    pub head: Plan,
    /// Its points.
    pub points: Vec<TrajectoryPoint>,
    /// When the tracker began with it \[ns\]; none where it never did.
    pub begun: Option<Nanos>,
}

/// Loop figures of a process, as its heartbeats told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loop {
    /// Steps.
    pub steps: u64,
    /// Sum of the mean times of its heartbeats, weighed by steps \[s\].
    pub work: f64,
    /// Longest step \[s\].
    pub work_max: f64,
    /// Deadlines missed by lives that ended, and by the present one.
    pub misses: (u64, u64),
    /// Steps of the present life.
    life_steps: u64,
    /// Pid of the present life.
    pub pid: u32,
}

/// Everything seen of a run.
#[derive(Clone, Debug)]
pub struct Trace {
    /// When the run began \[ns\].
    pub began: Nanos,
    /// Estimates.
    pub odometry: Vec<Odometry>,
    /// Truths.
    pub truth: Vec<Truth>,
    /// Commands.
    pub commands: Vec<Command>,
    /// What passed the gate.
    pub actuators: Vec<Actuator>,
    /// Plans.
    pub plans: Vec<Followed>,
    /// What happened.
    pub happenings: Vec<Happening>,
    /// From encoder reading to command \[us\].
    pub latency: Histogram<u64>,
    /// Loop figures by process.
    pub loops: Vec<(Process, Loop)>,
    /// The newest state.
    pub state: Option<State>,
}

impl Trace {
    /// A run that begins at `now`.
    #[must_use]
    pub fn new(now: Nanos) -> Self {
        Self {
            began: now,
            odometry: Vec::new(),
            truth: Vec::new(),
            commands: Vec::new(),
            actuators: Vec::new(),
            plans: Vec::new(),
            happenings: Vec::new(),
            latency: histogram(),
            loops: Vec::new(),
            state: None,
        }
    }

    /// Time since the run began \[s\]; earlier stamps give 0.
    #[must_use]
    pub fn time(&self, stamp: Nanos) -> f64 {
        seconds(stamp.saturating_sub(self.began))
    }

    /// Notes something that happened.
    pub fn note(&mut self, at: Nanos, kind: HappeningKind, text: impl Into<String>) {
        self.happenings.push(Happening { at, kind, text: text.into() });
    }

    /// Takes in a command: the first under a plan begins it, and each tells how long its reading took to get here.
    pub fn command(&mut self, command: &Command) {
        if command.header.origin > 0 {
            let nanos = command.header.sent.saturating_sub(command.header.origin);
            self.latency.saturating_record(nanos / 1000);
        }
        let begins = |plan: &&mut Followed| plan.head.id == command.plan && plan.begun.is_none();
        if let Some(plan) = self.plans.iter_mut().rev().find(begins) {
            let passed = kerbside_messages::nanos(command.plan_time);
            plan.begun = Some(command.header.stamp.saturating_sub(passed));
        }
        self.commands.push(*command);
    }

    /// Takes in a state: notes changes of mode, arms and restarts.
    pub fn state(&mut self, state: &State) {
        let at = state.header.sent;
        let before = self.state.replace(*state);
        let mode = state.mode();
        if before.is_none_or(|before| before.mode() != mode) {
            let cause = crate::manoeuvre::cause_of(state);
            let kind = if mode == Mode::Faulted
                || (mode == Mode::Stopping && state.cause != Cause::Operator.code())
            {
                HappeningKind::Fault
            } else {
                HappeningKind::Mode(mode)
            };
            let words =
                if cause.is_empty() { mode.to_string() } else { format!("{mode}: {cause}") };
            self.happenings.push(Happening { at, kind, text: words });
        }
        let Some(before) = before else { return };
        if state.arms > before.arms {
            self.note(at, HappeningKind::Arm, format!("arm {}", state.arms));
        }
        for row in state.rows() {
            let restarts = before
                .rows()
                .iter()
                .find(|old| old.process == row.process)
                .map_or(0, |old| old.restarts);
            if row.restarts > restarts
                && let Some(process) = Process::from_id(row.process)
            {
                self.note(
                    at,
                    HappeningKind::Restart,
                    format!("{process} started again as process {}", row.pid),
                );
            }
        }
    }

    /// Takes in a heartbeat.
    pub fn heartbeat(&mut self, beat: &Heartbeat) {
        let Some(process) = Process::from_id(beat.process) else { return };
        if !self.loops.iter().any(|(known, _)| *known == process) {
            self.loops.push((process, Loop::default()));
        }
        let Some((_, figures)) = self.loops.iter_mut().find(|(known, _)| *known == process) else {
            return;
        };
        if figures.pid != beat.pid {
            figures.pid = beat.pid;
            figures.life_steps = 0;
            figures.misses = (figures.misses.0 + figures.misses.1, 0);
        }
        let steps = beat.steps.saturating_sub(figures.life_steps);
        figures.life_steps = beat.steps;
        figures.steps += steps;
        #[allow(clippy::cast_precision_loss)] // steps between two heartbeats are few
        let weight = steps as f64;
        figures.work += beat.work_mean * weight;
        figures.work_max = figures.work_max.max(beat.work_max);
        figures.misses.1 = beat.misses;
    }

    /// Deadlines missed, all processes.
    #[must_use]
    pub fn misses(&self) -> u64 {
        self.loops.iter().map(|(_, figures)| figures.misses.0 + figures.misses.1).sum()
    }

    /// Restarts, all processes.
    #[must_use]
    pub fn restarts(&self) -> u32 {
        self.state.map_or(0, |state| state.rows().iter().map(|row| row.restarts).sum())
    }

    /// What the recorder says of itself, where it says anything.
    #[must_use]
    pub fn recorder_says(&self) -> Option<String> {
        let state = self.state?;
        let row = *state.rows().iter().find(|row| row.process == Process::Recorder as u8)?;
        let said = text::as_str(&row.waiting_for);
        match (row.restarts, said) {
            (0, "") => None,
            (0, said) => Some(said.to_owned()),
            (_, "") => Some("recorder restarted: the recording is in parts".to_owned()),
            (_, said) => Some(format!("recorder restarted: the recording is in parts; {said}")),
        }
    }
}

/// An empty histogram of microseconds.
#[must_use]
pub fn histogram() -> Histogram<u64> {
    // The bounds are constants that the library accepts; an unbounded histogram is its own fall-back.
    Histogram::new_with_bounds(1, LONGEST, 3).unwrap_or_else(|_| unbounded())
}

#[allow(clippy::expect_used)] // 3 significant figures are within the library's 0 to 5
fn unbounded() -> Histogram<u64> {
    Histogram::new(3).expect("3 significant figures")
}
