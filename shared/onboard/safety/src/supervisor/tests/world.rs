//! The world: seven processes, a gate, a car, five milliseconds at a time.

use kerbside_geometry::Limits;
use kerbside_messages::{
    Actuator, Command, EstimatorState, Header, Heartbeat, Inhibit, Odometry, Permit, ResetReason,
    State, TrackingPhase, TrackingStop, Verb, text,
};

use super::*;
use crate::{Gate, GateInputs};

pub(super) const MS: Nanos = 1_000_000;
const STEP: Nanos = 5 * MS;
const DT: f64 = 0.005;
/// Time from a start to the first heartbeat.
const START: Nanos = 100 * MS;
pub(super) const LIMITS: Limits =
    Limits { speed: 0.5, acceleration: 0.3, deceleration: 0.3, steering: 0.5, steering_rate: 1.0 };

pub(super) fn settings() -> SafetySettings {
    SafetySettings::default()
}

pub(super) fn stop_times() -> StopTimes {
    StopTimes { stop: Duration::from_millis(2100), settle: Duration::from_millis(200) }
}

/// A process of the world. Its counters are what its heartbeats say.
#[derive(Clone, Default)]
pub(super) struct Actor {
    pub(super) pid: u32,
    pub(super) started: Option<Nanos>,
    /// As by SIGSTOP.
    pub(super) stopped: bool,
    pub(super) unready: bool,
    pub(super) waiting_for: &'static str,
    pub(super) beat: Heartbeat,
    /// Beats per 20 ms.
    pub(super) rate: u32,
    next_beat: Nanos,
}

impl Actor {
    pub(super) fn runs(&self, now: Nanos) -> bool {
        !self.stopped && self.started.is_some_and(|at| now >= at + START)
    }
}

/// A process's place among the supervised, which is that of its row too.
pub(super) fn place(process: Process) -> usize {
    Process::SUPERVISED.iter().position(|supervised| *supervised == process).unwrap()
}

pub(super) struct World {
    pub(super) supervisor: Supervisor,
    pub(super) now: Nanos,
    pub(super) actors: [Actor; Process::SUPERVISED.len()],
    external: Option<Process>,
    /// As by SIGSTOP or SIGKILL of the supervisor.
    pub(super) unsupervised: bool,
    pub(super) line_lost: bool,
    pub(super) commands_lost: bool,
    pub(super) odometry_lost: bool,
    pub(super) give_up: bool,
    pub(super) spawns_fail: bool,
    pub(super) log: Vec<Action>,
    pub(super) speed: f64,
    pub(super) distance: f64,
    pub(super) pose: EstimatorState,
    pub(super) reset: ResetReason,
    gate: Gate,
    pub(super) permit: Option<Permit>,
    command: Option<Command>,
    pub(super) out: Actuator,
    heard: Nanos,
    stood_since: Nanos,
    plan: Option<(u64, Nanos)>,
    sequence: u64,
    pids: u32,
}

impl World {
    pub(super) fn new(external: Option<Process>) -> Self {
        let supervised = Process::SUPERVISED
            .map(|process| Supervised { process, external: external == Some(process) });
        let mut world = Self {
            supervisor: Supervisor::new(&settings(), &supervised, stop_times(), 42),
            now: 1_000 * MS,
            actors: Default::default(),
            external,
            unsupervised: false,
            line_lost: false,
            commands_lost: false,
            odometry_lost: false,
            give_up: false,
            spawns_fail: false,
            log: Vec::new(),
            speed: 0.0,
            distance: 0.0,
            pose: EstimatorState::Valid,
            reset: ResetReason::Fix,
            gate: Gate::new(&LIMITS, &settings()),
            permit: None,
            command: None,
            out: Actuator::default(),
            heard: 0,
            stood_since: 0,
            plan: None,
            sequence: 0,
            pids: 100,
        };
        if let Some(process) = external {
            world.start(process);
        }
        world
    }

    /// Up, healthy, `ready`.
    pub(super) fn ready() -> Self {
        let mut world = Self::new(None);
        world.run_until(2_000, |world| world.mode() == Mode::Ready);
        world.run(100);
        world
    }

    pub(super) fn armed() -> Self {
        let mut world = Self::ready();
        assert_eq!(world.ask(Verb::Arm), Ok(()));
        world.run(50);
        world
    }

    /// In the middle of a plan, at 0.4 m/s.
    pub(super) fn driving() -> Self {
        let mut world = Self::armed();
        world.plan();
        world.run(2_000);
        assert_eq!(world.mode(), Mode::Driving);
        assert!(world.speed > 0.39, "{}", world.speed);
        world
    }

    /// In `stopping` after a fault, still moving.
    pub(super) fn stopping() -> Self {
        let mut world = Self::driving();
        world.kill(Process::Tracker);
        world.run(100);
        assert_eq!(world.mode(), Mode::Stopping);
        world
    }

    /// In `faulted`, all processes back.
    pub(super) fn faulted() -> Self {
        let mut world = Self::driving();
        world.kill(Process::Ingest);
        world.run_until(6_000, |world| world.mode() == Mode::Faulted);
        world.run_until(2_000, |world| world.supervisor.is_healthy());
        world
    }

    pub(super) fn mode(&self) -> Mode {
        self.supervisor.mode()
    }

    pub(super) fn state(&self) -> State {
        let mut state = State::default();
        self.supervisor.fill_state(&mut state);
        state
    }

    pub(super) fn actor(&mut self, process: Process) -> &mut Actor {
        &mut self.actors[place(process)]
    }

    pub(super) fn runs(&self, process: Process) -> bool {
        self.actors[place(process)].runs(self.now)
    }

    pub(super) fn start(&mut self, process: Process) {
        self.pids += 1;
        let mut actor =
            Actor { pid: self.pids, started: Some(self.now), rate: 1, ..Actor::default() };
        actor.beat.header.epoch = u64::from(self.pids);
        actor.beat.process = process as u8;
        actor.beat.pid = self.pids;
        self.actors[place(process)] = actor;
        match process {
            Process::Actuation => self.gate = Gate::new(&LIMITS, &settings()),
            Process::Tracker => (self.plan, self.command) = (None, None),
            Process::Estimator if self.count(Action::Spawn(process)) > 1 => {
                (self.pose, self.reset) = (EstimatorState::Unset, ResetReason::None);
            }
            _ => {}
        }
    }

    pub(super) fn count(&self, action: Action) -> usize {
        self.log.iter().filter(|logged| **logged == action).count()
    }

    /// A plan for the present arm.
    pub(super) fn plan(&mut self) {
        self.plan = Some((self.supervisor.arms(), self.now));
    }

    /// SIGKILL by somebody else.
    pub(super) fn kill(&mut self, process: Process) {
        self.end(process, Exit::Signal(9));
    }

    pub(super) fn end(&mut self, process: Process, exit: Exit) {
        self.actors[place(process)] = Actor::default();
        if self.external != Some(process) {
            self.event(Event::Exited { process, exit });
        }
    }

    pub(super) fn inhibit(&mut self, for_ms: Nanos) {
        let inhibit = Inhibit {
            expiry: self.now + for_ms * MS,
            who: text::from_str("bumper"),
            why: text::from_str("touched"),
            ..Inhibit::default()
        };
        self.gate.inhibit(&inhibit);
        self.event(Event::Inhibit(&inhibit));
    }

    /// What an operator is answered.
    pub(super) fn ask(&mut self, verb: Verb) -> Result<(), String> {
        self.event(Event::Operator { id: 7, verb });
        let answer = self.log.iter().rev().find_map(|action| match action {
            Action::Answer(answer) => Some(*answer),
            _ => None,
        });
        let answer = answer.expect("each request is answered");
        assert_eq!((answer.id, answer.arms), (7, self.supervisor.arms()));
        assert_eq!(answer.mode, self.mode());
        if answer.accepted { Ok(()) } else { Err(text::as_str(&answer.text).to_owned()) }
    }

    pub(super) fn event(&mut self, event: Event<'_>) {
        if self.unsupervised {
            return;
        }
        let mut actions = Actions::default();
        let permitted = self.supervisor.permits();
        let arms = self.supervisor.arms();
        self.supervisor.step(self.now, event, &mut actions);
        let opened = self.supervisor.permits() && !permitted;
        assert_eq!(opened, self.supervisor.arms() != arms, "an arm and nothing else permits");
        for action in actions.iter() {
            self.log.push(*action);
            self.act(*action);
        }
    }

    fn act(&mut self, action: Action) {
        match action {
            Action::Spawn(process) if self.spawns_fail => {
                self.event(Event::SpawnFailed { process });
            }
            Action::Spawn(process) => {
                self.start(process);
                self.event(Event::Spawned { process, pid: self.pids });
            }
            Action::Kill(process) => self.end(process, Exit::Signal(9)),
            Action::Terminate(process) if !self.actor(process).stopped => {
                self.end(process, Exit::Code(0));
            }
            Action::PublishRestore
                if self.pose == EstimatorState::Unset && self.runs(Process::Estimator) =>
            {
                assert!(self.supervisor.restore().is_some());
                (self.pose, self.reset) = (EstimatorState::Valid, ResetReason::Restored);
            }
            _ => {}
        }
    }

    pub(super) fn run(&mut self, for_ms: Nanos) {
        for _ in 0..for_ms * MS / STEP {
            self.step();
        }
    }

    /// Runs until it holds.
    pub(super) fn run_until(&mut self, within_ms: Nanos, holds: impl Fn(&Self) -> bool) {
        let end = self.now + within_ms * MS;
        while !holds(self) {
            assert!(
                self.now < end,
                "still {} ({:?}) after {within_ms} ms",
                self.mode(),
                self.supervisor
            );
            self.step();
        }
    }

    fn sealed(&mut self, stamp: Nanos, epoch: u64) -> Header {
        self.sequence += 1;
        Header { epoch, sequence: self.sequence, sent: self.now, ..Header::stamped(stamp, stamp) }
    }

    fn step(&mut self) {
        self.now += STEP;
        self.beats();
        self.odometry();
        if !self.unsupervised && self.now.is_multiple_of(2 * STEP) {
            self.event(Event::Tick);
            let mut permit = Permit::default();
            self.supervisor.fill_permit(&mut permit);
            permit.header = Header { sent: self.now, epoch: 1, ..permit.header };
            self.permit = Some(permit);
        }
        self.tracker();
        self.actuation();
        self.drive();
    }

    fn beats(&mut self) {
        for process in Process::SUPERVISED {
            let now = self.now;
            let line_lost = self.line_lost && process == Process::Interface;
            let actor = self.actor(process);
            if !actor.runs(now) || now < actor.next_beat || actor.rate == 0 {
                continue;
            }
            actor.next_beat = now + 20 * MS;
            actor.beat.ready = u8::from(!actor.unready && !line_lost);
            if actor.beat.failed == 0 {
                actor.beat.text = text::from_str(actor.waiting_for);
            }
            for _ in 0..actor.rate {
                let actor = self.actor(process);
                actor.beat.header.sent = now;
                let beat = actor.beat;
                self.event(Event::Heartbeat(&beat));
            }
            let actor = self.actor(process);
            if actor.beat.failed != 0 {
                actor.rate = 0;
            }
        }
    }

    fn odometry(&mut self) {
        let path = [Process::Interface, Process::Ingest, Process::Estimator];
        let flows = path.iter().all(|process| self.runs(*process));
        if !flows || self.line_lost || self.odometry_lost {
            return;
        }
        let epoch = u64::from(self.actor(Process::Estimator).pid);
        let odometry = Odometry {
            header: self.sealed(self.now, epoch),
            speed: self.speed,
            state: self.pose.code(),
            reset_reason: self.reset.code(),
            standstill: u8::from(self.now - self.stood_since >= 100 * MS),
            x: self.distance,
            ..Odometry::default()
        };
        self.event(Event::Odometry(&odometry));
    }

    /// Half a minute at most: up to 0.4 m/s, four seconds of it, and gently down.
    fn tracker(&mut self) {
        let Some((arm, begun)) = self.plan.filter(|_| self.runs(Process::Tracker)) else { return };
        let permitted = self.permit.is_some_and(|permit| permit.granted == 1 && permit.arm == arm);
        let sees = self.runs(Process::Estimator) && self.runs(Process::Ingest);
        if !permitted || !sees || !self.runs(Process::Interface) || self.line_lost {
            return;
        }
        let time = (self.now - begun) as f64 / 1e9;
        let speed = (0.28 * time).min(0.4).min(0.14 * (7.0 - time)).max(0.0);
        let (phase, stop) = if self.give_up {
            (TrackingPhase::Stopped, TrackingStop::Corridor)
        } else if time >= 7.0 {
            (TrackingPhase::Finished, TrackingStop::None)
        } else {
            (TrackingPhase::Tracking, TrackingStop::None)
        };
        let command = Command {
            header: self.sealed(self.now, 1),
            speed,
            arm,
            phase: phase.code(),
            stop: stop.code(),
            ..Command::default()
        };
        if !self.commands_lost {
            self.command = Some(command);
        }
        self.event(Event::Command(&command));
    }

    fn actuation(&mut self) {
        if !self.runs(Process::Actuation) {
            return;
        }
        let inputs = GateInputs {
            command: self.command.as_ref(),
            permit: self.permit.as_ref(),
            ..GateInputs::default()
        };
        self.gate.step(self.now, inputs, &mut self.out);
        self.out.header = Header { sent: self.now, ..self.out.header };
        let out = self.out;
        self.event(Event::Actuator(&out));
        if self.runs(Process::Interface) && !self.line_lost {
            self.heard = self.now;
        }
    }

    /// An ideal car with a silence time-out of its own.
    fn drive(&mut self) {
        let silent = self.now - self.heard > 300 * MS;
        let asked = if silent {
            0.0
        } else if self.heard == self.now {
            self.out.speed
        } else {
            self.speed
        };
        let change = (asked - self.speed).clamp(-0.3 * DT, 0.3 * DT);
        self.speed += change;
        self.distance += self.speed * DT;
        if self.speed != 0.0 {
            self.stood_since = self.now;
        }
    }
}
