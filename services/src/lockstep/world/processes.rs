//! Processes in a simulated world: their starts, their heartbeats, and what their supervisor does about them.

use kerbside_messages::{Heartbeat, Nanos, Process};
use kerbside_safety::{Action, Event, Exit, Gate, LoopMonitor};
use kerbside_tracking::Tracker;

use super::{START, World};
use crate::interface::LineStage;
use crate::life::nanos;

/// The exit code of a service whose supervisor is silent.
const UNAVAILABLE: i32 = crate::exit::Exit::Unavailable as i32;

/// A process: supervised, the supervisor or the vehicle.
#[derive(Debug)]
pub(super) struct Slot {
    process: Process,
    pid: u32,
    /// Its loop; none while it does not exist.
    monitor: Option<LoopMonitor>,
    /// Whether it has started.
    up: bool,
    /// Since when it is stopped, and until when.
    stalled: Option<(Nanos, Nanos)>,
    /// When it was up.
    since: Nanos,
}

impl Slot {
    pub(super) fn new(process: Process) -> Self {
        Self { process, pid: 0, monitor: None, up: false, stalled: None, since: 0 }
    }
}

impl World {
    fn slot(&self, process: Process) -> &Slot {
        &self.slots[process as usize]
    }

    fn slot_mut(&mut self, process: Process) -> &mut Slot {
        &mut self.slots[process as usize]
    }

    fn exists(&self, process: Process) -> bool {
        self.slot(process).monitor.is_some()
    }

    /// Whether a supervised process has started and lives.
    pub(super) fn is_up(&self, process: Process) -> bool {
        self.slot(process).up
    }

    /// Whether a process does its work now.
    pub(super) fn works(&self, process: Process) -> bool {
        let lives = match process {
            Process::Supervisor => !self.supervisor_dead,
            other => self.is_up(other),
        };
        lives && !self.is_stalled(process)
    }

    pub(super) fn is_stalled(&self, process: Process) -> bool {
        self.slot(process).stalled.is_some_and(|(_, until)| self.now < until)
    }

    /// How long a stall lasted that is over; once.
    pub(super) fn stall_over(&mut self, process: Process) -> Option<Nanos> {
        let now = self.now;
        let (since, _) = self.slot_mut(process).stalled.take_if(|(_, until)| now >= *until)?;
        Some(now - since)
    }

    /// Stops a process as SIGSTOP does.
    pub(super) fn stall(&mut self, process: Process, until: Nanos) {
        let now = self.now;
        let outside = matches!(process, Process::Supervisor | Process::Vehicle);
        if outside || self.exists(process) {
            let slot = self.slot_mut(process);
            let (since, before) = slot.stalled.unwrap_or((now, until));
            slot.stalled = Some((since, until.max(before)));
        }
    }

    /// Ends a process as `kill -9` does.
    pub(super) fn kill(&mut self, process: Process) {
        if process == Process::Supervisor {
            self.supervisor_dead = true;
            return;
        }
        self.end(process, Exit::Signal(9));
    }

    fn end(&mut self, process: Process, exit: Exit) {
        if !self.exists(process) {
            return;
        }
        match process {
            Process::Interface => self.stages.interface = None,
            Process::Ingest => self.stages.ingest = None,
            Process::Estimator => (self.stages.estimator, self.pending_fix) = (None, None),
            Process::Tracker => self.stages.tracker = None,
            Process::Actuation => (self.stages.gate, self.pending_inhibit) = (None, None),
            Process::Planner => (self.planning, self.requested) = (None, None),
            _ => {}
        }
        *self.slot_mut(process) = Slot::new(process);
        self.deaths.push_back((process, exit));
    }

    /// A service whose supervisor is silent for too long ends itself.
    pub(super) fn end_abandoned(&mut self) {
        if self.works(Process::Supervisor) {
            return;
        }
        let (now, heard) = (self.now, self.state_sent);
        let limit = nanos(self.service.safety().timeouts.supervisor_silence);
        let silent = |slot: &Slot| slot.up && now.saturating_sub(heard.max(slot.since)) > limit;
        for process in Process::SUPERVISED {
            if silent(self.slot(process)) && !self.is_stalled(process) {
                self.end(process, Exit::Code(UNAVAILABLE));
            }
        }
    }

    /// What reached the supervisor: deaths first, as its children's ends wake it.
    pub(super) fn take_in_events(&mut self) {
        let now = self.now;
        while let Some((process, exit)) = self.deaths.pop_front() {
            self.event(Event::Exited { process, exit });
        }
        while let Some((odometry, _)) = self.topics.odometry.take(Process::Supervisor, now) {
            self.event(Event::Odometry(&odometry));
        }
        while let Some((command, _)) = self.topics.command.take(Process::Supervisor, now) {
            self.event(Event::Command(&command));
        }
        while let Some(inhibit) = self.told_inhibits.pop_front() {
            self.event(Event::Inhibit(&inhibit));
        }
        while let Some((actuator, _)) = self.topics.actuator.take(Process::Supervisor, now) {
            self.event(Event::Actuator(&actuator));
        }
        for index in 0..self.topics.heartbeats.len() {
            while let Some((beat, _)) =
                self.topics.heartbeats[index].1.take(Process::Supervisor, now)
            {
                self.event(Event::Heartbeat(&beat));
            }
        }
    }

    pub(super) fn supervise(&mut self) {
        self.event(Event::Tick);
        let now = self.now;
        let supervisor = &self.supervisor;
        self.fresh.permit = self.topics.permit.send(now, |permit| {
            supervisor.fill_permit(permit);
            true
        });
        self.fresh.state = self.topics.state.send(now, |state| {
            supervisor.fill_state(state);
            true
        });
        self.state_sent = now;
    }

    pub(super) fn event(&mut self, event: Event<'_>) {
        self.supervisor.step(self.now, event, &mut self.actions);
        if self.actions.as_slice().is_empty() {
            return;
        }
        let actions = self.actions.clone();
        for action in actions.iter() {
            self.act(action);
        }
    }

    fn act(&mut self, action: &Action) {
        match action {
            Action::Spawn(process) => self.spawn(*process),
            Action::Kill(process) | Action::Terminate(process) => self.kill(*process),
            Action::PublishRestore => {
                let (now, restored) = (self.now, self.supervisor.restore().copied());
                self.topics.restore.send(now, |restore| {
                    restored.is_some_and(|odometry| {
                        restore.header.stamp = odometry.header.stamp;
                        restore.odometry = odometry;
                        true
                    })
                });
            }
            Action::Answer(answer) => {
                let message = answer.message();
                if message.accepted == 1 {
                    self.arms_granted = self.arms_granted.max(message.arms);
                }
                self.answers.push(message);
            }
            Action::CleanUp
            | Action::Entered { .. }
            | Action::Failed { .. }
            | Action::Finished { .. } => {}
        }
    }

    fn spawn(&mut self, process: Process) {
        let pid = self.next_pid;
        self.next_pid += 1;
        self.starting.push_back((self.now + START, process, pid));
        self.event(Event::Spawned { process, pid });
        let timeouts = self.service.safety().timeouts.clone();
        let mut made = LoopMonitor::new(process, pid, &timeouts, checkpoints_of(process));
        made.set_ready(false, "its start");
        *self.slot_mut(process) = Slot { pid, monitor: Some(made), ..Slot::new(process) };
    }

    pub(super) fn start_processes(&mut self) {
        let now = self.now;
        for _ in 0..self.starting.len() {
            let Some((due, process, pid)) = self.starting.pop_front() else { return };
            if due > now || self.is_stalled(process) {
                self.starting.push_back((due, process, pid));
            } else if self.slot(process).pid == pid {
                self.start(process);
            }
        }
    }

    fn start(&mut self, process: Process) {
        let now = self.now;
        self.topics.reopen(process);
        match process {
            Process::Interface => {
                self.stages.interface = Some(LineStage::new(self.service.vehicle.response()));
                self.line_opened = now;
                self.topics.raw.restart(now);
            }
            Process::Ingest => {
                self.stages.ingest = self.ingest().ok();
                self.topics.travel.restart(now);
            }
            Process::Estimator => {
                self.stages.estimator = self.service.estimator().ok();
                self.topics.odometry.restart(now);
            }
            Process::Tracker => {
                self.stages.tracker =
                    Some(Tracker::new(&self.service.vehicle, &self.service.stack.tracker));
                self.topics.command.restart(now);
            }
            Process::Actuation => {
                self.stages.gate =
                    Some(Gate::new(&self.service.vehicle.limits, self.service.safety()));
                self.refused_commands = 0;
                self.topics.actuator.restart(now);
            }
            _ => {}
        }
        if let Some((_, heartbeats)) =
            self.topics.heartbeats.iter_mut().find(|(known, _)| *known == process)
        {
            heartbeats.restart(now);
        }
        let slot = self.slot_mut(process);
        (slot.up, slot.since) = (true, now);
        if process != Process::Interface {
            self.ready(process, None);
        }
    }

    pub(super) fn beat(&mut self) {
        let now = self.now;
        let mut beat = Heartbeat::default();
        for slot in &mut self.slots {
            if slot.stalled.is_some_and(|(_, until)| now < until) {
                continue;
            }
            slot.stalled = slot.stalled.filter(|_| slot.process == Process::Vehicle);
            let Some(monitor) = slot.monitor.as_mut().filter(|_| slot.up) else { continue };
            if !monitor.beat(now, &mut beat) {
                continue;
            }
            let found = self.topics.heartbeats.iter_mut().find(|(known, _)| *known == slot.process);
            let Some((_, heartbeats)) = found else { continue };
            heartbeats.send(now, |out| {
                *out = beat;
                true
            });
        }
    }

    fn monitor(&mut self, process: Process) -> Option<&mut LoopMonitor> {
        self.slot_mut(process).monitor.as_mut()
    }

    pub(super) fn ready(&mut self, process: Process, waits_for: Option<&str>) {
        if let Some(monitor) = self.monitor(process) {
            monitor.set_ready(waits_for.is_none(), waits_for.unwrap_or_default());
        }
    }

    pub(super) fn begin(&mut self, process: Process, arrival: Nanos) {
        let now = self.now;
        if let Some(monitor) = self.monitor(process) {
            monitor.begin(now, arrival);
        }
    }

    pub(super) fn checkpoints(&mut self, process: Process, count: u32) {
        let now = self.now;
        if let Some(monitor) = self.monitor(process) {
            (0..count).for_each(|index| monitor.checkpoint(index));
            monitor.end(now);
        }
    }

    /// A step of a process, whose newest input arrived then, took no time; a backlog is one step.
    pub(super) fn stepped(&mut self, process: Process, arrival: Option<Nanos>) {
        if let Some(arrival) = arrival {
            self.begin(process, arrival);
            self.checkpoints(process, 1);
        }
    }
}

fn checkpoints_of(process: Process) -> u32 {
    match process {
        Process::Interface => 2,
        Process::Planner | Process::Recorder | Process::Gateway => 0,
        _ => 1,
    }
}
