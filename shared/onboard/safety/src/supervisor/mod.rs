//! The supervisor as one state machine: it starts, watches, permits and restarts.
//!
//! Which failure means what:
//!
//! | what fails | vehicle | process | afterwards |
//! |---|---|---|---|
//! | control path: death, silence, too many beats, order, own check | stops | restarted | faulted |
//! | control path: deadline missed again and again | stops | kept: late, not wrong | faulted |
//! | control path: ready no more (line lost, no input), while armed | stops | kept | faulted |
//! | tracker gives up, pose lost, gate latches by itself | stops | kept | faulted |
//! | planner, recorder: any of these | goes on | restarted | unchanged |
//! | any process: five deaths in 30 s | stops | given up | faulted, no arm |
//! | inhibit, operator's stop | stops | kept | ready |
//!
//! A silent child is killed once it was silent for a second (it may be stopped, and would else
//! never come back); a distrusted one a second after its fault. External processes are never
//! killed: they come back by beating as they should, or as a new life, and are never given up.
//!
//! A fault in `ready` leads to `faulted` at once: nothing moves that had to stop first. In
//! `starting` a death is a restart; only giving up is a fault.

mod action;
mod beats;
mod end;
mod event;
mod faults;
mod modes;
mod motion;
mod operator;
mod processes;
mod report;
#[cfg(test)]
mod tests;
mod watch;

pub use action::{Action, Actions, Answer};
pub use event::{Event, Exit, Supervised};

use core::time::Duration;
use kerbside_messages::{Cause, MAX_ROWS, Mode, Nanos, Odometry, Process};

use crate::bounds::StopTimes;
use crate::{Inhibits, SafetySettings, ns};
use end::Ending;
use motion::Motion;
use watch::Watch;

/// A started process that neither becomes ready nor says what it waits for is killed after this.
pub const START_TIMEOUT: Duration = Duration::from_secs(5);
/// A process that was asked to end is killed after this.
pub const TERMINATE_GRACE: Duration = Duration::from_secs(1);
/// Silence, or distrust, after which a child is killed.
const KILL_AFTER: Nanos = 1_000_000_000;
/// Beyond the time a stop takes, the longest wait for a vehicle that is seen not to stop.
const OVERDUE: Nanos = 10_000_000_000;

/// Why the mode is what it is.
#[derive(Clone, Debug, Hash)]
struct Why {
    cause: Cause,
    culprit: Option<Process>,
    text: [u8; 128],
}

impl Why {
    /// A cause that needs no more words than its own.
    fn plain(cause: Cause) -> Self {
        Self { cause, culprit: None, text: crate::line::line(format_args!("{cause}")) }
    }
}

/// The supervisor's decisions. See the module's table for what follows from what.
///
/// Events go in with the time at which they are handled, actions come out; the permit and the state
/// are filled each cycle after a [`Event::Tick`]. It allocates nothing after its making.
#[derive(Clone, Debug)]
pub struct Supervisor {
    settings: SafetySettings,
    stop: StopTimes,
    pid: u32,
    now: Nanos,
    watches: Vec<Watch>,
    mode: Mode,
    since: Nanos,
    why: Why,
    /// Where `stopping` leads.
    after: Mode,
    arms: u64,
    motion: Motion,
    inhibits: Inhibits,
    ending: Option<Ending>,
}

impl Supervisor {
    /// A supervisor of these processes, the first eight if there are more, each named once. `stop`
    /// says how long the vehicle takes to stop ([`crate::bounds::stop_times`]), `pid` is its own.
    #[must_use]
    pub fn new(
        settings: &SafetySettings,
        processes: &[Supervised],
        stop: StopTimes,
        pid: u32,
    ) -> Self {
        let watches = processes.iter().take(MAX_ROWS).map(|process| Watch::new(*process, settings));
        Self {
            settings: settings.clone(),
            stop,
            pid,
            now: 0,
            watches: watches.collect(),
            mode: Mode::Starting,
            since: 0,
            why: Why::plain(Cause::None),
            after: Mode::Ready,
            arms: 0,
            motion: Motion::default(),
            inhibits: Inhibits::default(),
            ending: None,
        }
    }

    /// Takes up an event at `now` \[ns\]; `actions` then holds what is to be done for it and
    /// nothing else. A `now` before that of an earlier event counts as that one.
    pub fn step(&mut self, now: Nanos, event: Event<'_>, actions: &mut Actions) {
        actions.clear();
        self.now = self.now.max(now);
        match event {
            Event::Spawned { process, pid } => self.spawned(process, pid, actions),
            Event::SpawnFailed { process } => self.spawn_failed(process, actions),
            Event::Exited { process, exit } => self.exited(process, exit, actions),
            Event::Heartbeat(beat) => self.heartbeat(beat, actions),
            Event::Odometry(odometry) => self.odometry(odometry, actions),
            Event::Command(command) => self.command(command, actions),
            Event::Actuator(actuator) => self.actuator(actuator, actions),
            Event::Inhibit(inhibit) => self.inhibit(inhibit, actions),
            Event::Operator { id, verb } => self.operator(id, verb, actions),
            Event::Shutdown => self.go_down(actions),
            Event::Tick => self.tick(actions),
        }
        self.advance(actions);
        self.continue_ending(actions);
    }

    /// The present mode.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Why the mode is what it is.
    #[must_use]
    pub fn cause(&self) -> Cause {
        self.why.cause
    }

    /// Whose fault it is, if a process's.
    #[must_use]
    pub fn culprit(&self) -> Option<Process> {
        self.why.culprit
    }

    /// Count of arms.
    #[must_use]
    pub fn arms(&self) -> u64 {
        self.arms
    }

    /// The pose a restarted estimator is to take up; none where there is nothing to restore.
    #[must_use]
    pub fn restore(&self) -> Option<&Odometry> {
        self.motion.restore()
    }

    fn freshness(&self) -> Nanos {
        ns(self.settings.timeouts.freshness)
    }

    fn tick(&mut self, actions: &mut Actions) {
        self.supervise(actions);
        if self.motion.restore().is_some() && self.mode != Mode::Down {
            actions.push(Action::PublishRestore);
        }
    }

    /// The first process that is not healthy.
    fn unhealthy(&self) -> Option<&Watch> {
        self.watches.iter().find(|watch| !watch.healthy(self.now))
    }

    fn watch(&mut self, process: Process) -> Option<&mut Watch> {
        self.watches.iter_mut().find(|watch| watch.process == process)
    }
}
