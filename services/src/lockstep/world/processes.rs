//! Processes in a simulated world: their starts, their heartbeats, and what their supervisor does about them.

use kerbside_messages::{Heartbeat, Nanos, Process, seal};
use kerbside_safety::{Action, Event, Gate, LoopMonitor};
use kerbside_tracking::Tracker;

use super::{EPOCH, START, World};
use crate::interface::LineStage;

impl World {
    pub(super) fn supervise(&mut self) {
        self.event(Event::Tick);
        let now = self.now;
        let supervisor = &self.supervisor;
        self.channels.permit.send(now, |permit| {
            supervisor.fill_permit(permit);
            true
        });
        let sent = self.channels.state.send(now, |state| {
            supervisor.fill_state(state);
            true
        });
        self.fresh.state = sent.map(|(state, _)| state);
    }

    pub(super) fn event(&mut self, event: Event<'_>) {
        self.supervisor.step(self.now, event, &mut self.actions);
        let actions = self.actions.clone();
        for action in actions.iter() {
            self.act(action);
        }
    }

    fn act(&mut self, action: &Action) {
        match action {
            Action::Spawn(process) => {
                let pid = self.next_pid;
                self.next_pid += 1;
                self.starting.push_back((self.now + START, *process));
                self.event(Event::Spawned { process: *process, pid });
                if let Some((_, monitor)) =
                    self.monitors.iter_mut().find(|(known, _)| known == process)
                {
                    let timeouts = &self.service.safety().timeouts;
                    let mut made =
                        LoopMonitor::new(*process, pid, timeouts, checkpoints_of(*process));
                    made.set_ready(false, "its start");
                    *monitor = Some(made);
                }
            }
            Action::Kill(process) | Action::Terminate(process) => self.kill(*process),
            Action::PublishRestore => {
                let (now, restored) = (self.now, self.supervisor.restore().copied());
                self.channels.restore.send(now, |restore| {
                    restored.is_some_and(|odometry| {
                        restore.header.stamp = odometry.header.stamp;
                        restore.odometry = odometry;
                        true
                    })
                });
            }
            Action::Answer(answer) => self.answers.push(answer.message()),
            Action::CleanUp
            | Action::Entered { .. }
            | Action::Failed { .. }
            | Action::Finished { .. } => {}
        }
    }

    pub(super) fn start_processes(&mut self) {
        while self.starting.front().is_some_and(|(due, _)| *due <= self.now) {
            let Some((_, process)) = self.starting.pop_front() else { return };
            if self.is_running(process) {
                self.start(process);
            }
        }
    }

    fn start(&mut self, process: Process) {
        let now = self.now;
        match process {
            Process::Interface => {
                self.stages.interface = Some(LineStage::new(self.service.vehicle.response()));
                self.channels.raw.restart(now);
            }
            Process::Ingest => {
                self.stages.ingest = self.ingest().ok();
                self.channels.travel.restart(now);
            }
            Process::Estimator => {
                self.stages.estimator = self.service.estimator().ok();
                self.channels.odometry.restart(now);
            }
            Process::Tracker => {
                self.stages.tracker =
                    Some(Tracker::new(&self.service.vehicle, &self.service.stack.tracker));
                self.channels.command.restart(now);
            }
            Process::Actuation => {
                self.stages.gate =
                    Some(Gate::new(&self.service.vehicle.limits, self.service.safety()));
                self.channels.actuator.restart(now);
            }
            _ => {}
        }
        if process != Process::Interface {
            self.ready(process, None);
        }
    }

    pub(super) fn beat(&mut self) {
        for index in 0..self.monitors.len() {
            let mut beat = Heartbeat::default();
            let Some(monitor) = &mut self.monitors[index].1 else { continue };
            if monitor.beat(self.now, &mut beat) {
                seal(&mut beat, &[], EPOCH, self.now, self.now);
                self.event(Event::Heartbeat(&beat));
            }
        }
    }

    fn monitor(&mut self, process: Process) -> Option<&mut LoopMonitor> {
        self.monitors.iter_mut().find(|(known, _)| *known == process)?.1.as_mut()
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

    /// A step of a process took no time.
    pub(super) fn stepped(&mut self, process: Process, arrival: Nanos) {
        self.begin(process, arrival);
        self.checkpoints(process, 1);
    }
}

fn checkpoints_of(process: Process) -> u32 {
    match process {
        Process::Interface => 2,
        Process::Planner | Process::Recorder | Process::Gateway => 0,
        _ => 1,
    }
}
