//! The simulated world: processes as stages, time as a number.

mod processes;

use std::collections::VecDeque;

use kerbside_messages::{
    Actuator, Command, Fix, Inhibit, Nanos, Odometry, OperatorAnswer, Permit, Plan, PlanAnswer,
    PlanRequest, PlanVerdict, Process, Raw, Restore, State, TrajectoryPoint, Travel, Truth, Verb,
    seal, text,
};
use kerbside_odometry::{Estimator, EstimatorInputs, Ingest};
use kerbside_safety::{
    Actions, Event, Exit, Gate, GateInputs, LoopMonitor, Supervised, Supervisor, bounds,
};
use kerbside_tracking::{Tracker, TrackerInputs};

use super::channel::{ByteQueue, Channel};
use crate::exit::Failure;
use crate::interface::{LineStage, reading_to_raw};
use crate::life::nanos;
use crate::planner::{Answered, answer_request};
use crate::service::Service;
use crate::vehicle::{Making, VehicleStage};

/// The grid of simulated time \[ns\].
const TICK: Nanos = 1_000_000;
/// Time that bytes spend on the line.
const LINE_DELAY: Nanos = 1_000_000;
/// Time that a process takes to start.
const START: Nanos = 100_000_000;
/// Time that a plan takes.
const PLAN: Nanos = 500_000_000;
/// Where simulated time begins: stamps are never 0.
const EPOCH: Nanos = 1_000_000_000;

/// What happens to a world besides its own course. Times are simulated ones since the beginning \[ns\].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Script {
    /// What happens to the line from the vehicle.
    pub line: Vec<LineFault>,
    /// Processes that end as by `kill -9`.
    pub kills: Vec<(Nanos, Process)>,
    /// When somebody inhibits motion, and for how long.
    pub inhibits: Vec<(Nanos, Nanos)>,
}

/// What a script does to the line from the vehicle.
#[derive(Clone, Debug, PartialEq)]
pub enum LineFault {
    /// Bytes that arrive in this interval of simulated time are lost.
    Silence {
        /// From when \[ns since the beginning\].
        from: Nanos,
        /// Until when.
        to: Nanos,
    },
    /// These bytes come between two frames.
    Garbage {
        /// When.
        at: Nanos,
        /// What.
        bytes: Vec<u8>,
    },
}

/// The processes' stages; none where the process is not running.
struct Stages {
    interface: Option<LineStage>,
    ingest: Option<Ingest>,
    estimator: Option<Estimator>,
    tracker: Option<Tracker>,
    gate: Option<Gate>,
}

struct Channels {
    raw: Channel<Raw>,
    travel: Channel<Travel>,
    odometry: Channel<Odometry>,
    command: Channel<Command>,
    actuator: Channel<Actuator>,
    permit: Channel<Permit>,
    state: Channel<State>,
    restore: Channel<Restore>,
    fix: Channel<Fix>,
}

/// The stack, its vehicle, and their time.
pub struct World {
    service: Service,
    now: Nanos,
    vehicle: VehicleStage,
    vehicle_due: Nanos,
    to_host: ByteQueue,
    to_vehicle: ByteQueue,
    script: Script,
    buffer: Vec<u8>,
    stages: Stages,
    channels: Channels,
    monitors: Vec<(Process, Option<LoopMonitor>)>,
    starting: VecDeque<(Nanos, Process)>,
    pending_fix: Option<Fix>,
    pending_inhibit: Option<Inhibit>,
    supervisor: Supervisor,
    actions: Actions,
    cycle_due: Nanos,
    gate_due: Nanos,
    plan: Option<(Plan, Vec<TrajectoryPoint>)>,
    planning: Option<(Nanos, Answered)>,
    answers: Vec<OperatorAnswer>,
    planned: Option<PlanAnswer>,
    next_pid: u32,
    truth: Truth,
    /// Samples of the newest tick, for whoever watches.
    pub fresh: Fresh,
    /// Wall time spent in searches \[s\], reported apart.
    pub search_seconds: f64,
}

/// What the newest tick published.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fresh {
    /// Reading.
    pub raw: Option<Raw>,
    /// Estimate.
    pub odometry: Option<Odometry>,
    /// Command.
    pub command: Option<Command>,
    /// What passed the gate.
    pub actuator: Option<Actuator>,
    /// State.
    pub state: Option<State>,
    /// Truth.
    pub truth: Option<Truth>,
}

impl World {
    /// A world at rest: the vehicle stands as `making` says, and no process runs yet.
    ///
    /// # Errors
    /// [`Failure`] where the vehicle has nothing to compute motion from.
    pub fn new(service: &Service, making: &Making, script: Script) -> Result<Self, Failure> {
        let supervised: Vec<_> = service
            .supervised()
            .into_iter()
            .map(|process| Supervised { process, external: false })
            .collect();
        let stop = bounds::stop_times(&service.vehicle, service.safety());
        let vehicle = VehicleStage::new(making);
        let stages =
            Stages { interface: None, ingest: None, estimator: None, tracker: None, gate: None };
        let world = Self {
            service: service.clone(),
            now: EPOCH,
            vehicle_due: EPOCH + vehicle.period(),
            vehicle,
            to_host: ByteQueue::new(LINE_DELAY),
            to_vehicle: ByteQueue::new(LINE_DELAY),
            script,
            buffer: Vec::new(),
            stages,
            channels: Channels::new(),
            monitors: supervised.iter().map(|supervised| (supervised.process, None)).collect(),
            starting: VecDeque::new(),
            pending_fix: None,
            pending_inhibit: None,
            supervisor: Supervisor::new(service.safety(), &supervised, stop, 1),
            actions: Actions::default(),
            cycle_due: EPOCH,
            gate_due: EPOCH,
            plan: None,
            planning: None,
            answers: Vec::new(),
            planned: None,
            next_pid: 2,
            truth: Truth::default(),
            fresh: Fresh::default(),
            search_seconds: 0.0,
        };
        world.check_models()?;
        Ok(world)
    }

    fn check_models(&self) -> Result<(), Failure> {
        self.ingest()?;
        self.service.estimator()?;
        Ok(())
    }

    fn ingest(&self) -> Result<Ingest, Failure> {
        let service = &self.service;
        Ingest::with_sensors(&service.vehicle, &service.sensors, &service.stack.ingest)
            .map_err(crate::ingest::no_model)
    }

    /// Simulated time \[ns\].
    #[must_use]
    pub fn now(&self) -> Nanos {
        self.now
    }

    /// Simulated time since the beginning \[ns\].
    #[must_use]
    pub fn elapsed(&self) -> Nanos {
        self.now - EPOCH
    }

    /// The newest state.
    #[must_use]
    pub fn state(&self) -> Option<&State> {
        self.channels.state.newest()
    }

    /// The newest estimate.
    #[must_use]
    pub fn odometry(&self) -> Option<&Odometry> {
        self.channels.odometry.newest()
    }

    /// The standing plan.
    #[must_use]
    pub fn plan(&self) -> Option<(&Plan, &[TrajectoryPoint])> {
        self.plan.as_ref().map(|(head, points)| (head, points.as_slice()))
    }

    /// The answer to the newest request of the operator, once.
    pub fn take_answer(&mut self) -> Option<OperatorAnswer> {
        self.answers.pop()
    }

    /// The planner's answer, once.
    pub fn take_planned(&mut self) -> Option<PlanAnswer> {
        self.planned.take()
    }

    /// Publishes a fix.
    pub fn fix(&mut self, fix: &Fix) {
        let (now, content) = (self.now, *fix);
        let sent = self.channels.fix.send(now, |fix| {
            *fix = content;
            true
        });
        self.pending_fix = sent.map(|(fix, _)| fix);
    }

    /// Asks the supervisor.
    pub fn ask(&mut self, id: u64, verb: Verb) {
        self.event(Event::Operator { id, verb });
    }

    fn follow_script(&mut self) {
        let elapsed = self.elapsed();
        for index in 0..self.script.kills.len() {
            let (at, process) = self.script.kills[index];
            if at == elapsed {
                self.kill(process);
            }
        }
        let inhibit = self.script.inhibits.iter().find(|(at, _)| *at == elapsed);
        if let Some((_, span)) = inhibit {
            let (who, why) = (text::from_str("script"), text::from_str("scripted inhibit"));
            let mut sealed = Inhibit { expiry: self.now + span, who, why, ..Inhibit::default() };
            seal(&mut sealed, &[], EPOCH, self.now, self.now);
            self.pending_inhibit = Some(sealed);
        }
    }

    /// Asks the planner; the answer comes half a simulated second later.
    pub fn request_plan(&mut self, request: &PlanRequest) {
        if self.is_running(Process::Planner) {
            let answered = answer_request(&self.service, request, self.odometry(), &mut |_| {});
            self.search_seconds += answered.search_seconds;
            self.planning = Some((self.now + PLAN, answered));
        }
    }

    /// Ends a process as `kill -9` does.
    pub fn kill(&mut self, process: Process) {
        if !self.is_running(process) {
            return;
        }
        match process {
            Process::Interface => self.stages.interface = None,
            Process::Ingest => self.stages.ingest = None,
            Process::Estimator => self.stages.estimator = None,
            Process::Tracker => self.stages.tracker = None,
            Process::Actuation => self.stages.gate = None,
            Process::Planner => self.planning = None,
            _ => {}
        }
        if let Some((_, monitor)) = self.monitors.iter_mut().find(|(known, _)| *known == process) {
            *monitor = None;
        }
        self.event(Event::Exited { process, exit: Exit::Signal(9) });
    }

    fn is_running(&self, process: Process) -> bool {
        self.monitors.iter().any(|(known, monitor)| *known == process && monitor.is_some())
    }

    /// One tick of simulated time.
    pub fn tick(&mut self) {
        self.now += TICK;
        self.fresh = Fresh::default();
        self.follow_script();
        self.start_processes();
        self.drive_vehicle();
        self.hear_line();
        self.pass_gate(false);
        self.finish_plan();
        self.beat();
        if self.now >= self.cycle_due {
            self.cycle_due = self.now + nanos(self.service.safety().cycle);
            self.supervise();
        }
    }

    fn drive_vehicle(&mut self) {
        let time = self.now - EPOCH;
        if self.to_vehicle.is_due(self.now) {
            self.to_vehicle.take(self.now, &mut self.buffer);
            self.vehicle.receive(time, &self.buffer);
        }
        if self.now < self.vehicle_due {
            return;
        }
        self.vehicle_due += self.vehicle.period();
        let (now, line) = (self.now, &mut self.to_host);
        self.vehicle.tick(time, |frame| line.put(now, frame));
        self.vehicle.truth(now, &mut self.truth);
        self.fresh.truth = Some(self.truth);
    }

    /// What the script lets through of what arrived.
    fn arrived(&mut self) -> bool {
        let elapsed = self.now - EPOCH;
        let came = self.to_host.is_due(self.now);
        self.to_host.take(self.now, &mut self.buffer);
        for fault in &self.script.line {
            match fault {
                LineFault::Silence { from, to } if (*from..*to).contains(&elapsed) => {
                    self.buffer.clear()
                }
                LineFault::Garbage { at, bytes } if *at == elapsed => {
                    self.buffer.splice(0..0, bytes.iter().copied());
                }
                _ => {}
            }
        }
        came || !self.buffer.is_empty()
    }

    /// The interface, and the chain behind it: each reading runs through to the gate at once.
    fn hear_line(&mut self) {
        let heard = self.arrived();
        let Some(mut interface) = self.stages.interface.take() else { return };
        if heard {
            let now = self.now;
            self.begin(Process::Interface, now);
            let bytes = core::mem::take(&mut self.buffer);
            interface.receive(
                now,
                &bytes,
                |reading, errors| self.chain(now, |raw| reading_to_raw(reading, errors, now, raw)),
                |_| {},
            );
            self.buffer = bytes;
            self.checkpoints(Process::Interface, 2);
        }
        let freshness = nanos(self.service.safety().timeouts.freshness);
        let handshake = interface.pending();
        let command = self
            .channels
            .actuator
            .newest()
            .and_then(|actuator| interface.command(self.now, actuator, freshness));
        for frame in [handshake, command].into_iter().flatten() {
            self.to_vehicle.put(self.now, &frame);
        }
        let silence = nanos(self.service.safety().timeouts.line_silence);
        let waits =
            if interface.is_up(self.now, silence) { None } else { Some("the vehicle's line") };
        self.ready(Process::Interface, waits);
        self.stages.interface = Some(interface);
    }

    fn chain(&mut self, now: Nanos, fill: impl FnOnce(&mut Raw)) {
        let sent = self.channels.raw.send(now, |raw| {
            fill(raw);
            true
        });
        let Some((raw, admitted)) = sent else { return };
        self.fresh.raw = Some(raw);
        let Some(ingest) = &mut self.stages.ingest else { return };
        let sent = self.channels.travel.send(now, |travel| {
            ingest.step(&raw, admitted.missing, admitted.new_epoch, travel);
            true
        });
        self.stepped(Process::Ingest, raw.arrival);
        let Some((travel, admitted)) = sent else { return };
        let Some(estimator) = &mut self.stages.estimator else { return };
        let fix = self.pending_fix.take();
        let inputs = EstimatorInputs {
            travel: &travel,
            missing: admitted.missing,
            fix: fix.as_ref(),
            restore: self.channels.restore.newest(),
        };
        let sent = self.channels.odometry.send(now, |odometry| {
            estimator.step(inputs, odometry);
            true
        });
        self.stepped(Process::Estimator, raw.arrival);
        if let Some((odometry, _)) = sent {
            self.fresh.odometry = Some(odometry);
            self.event(Event::Odometry(&odometry));
            self.track(now, &odometry);
        }
    }

    fn track(&mut self, now: Nanos, odometry: &Odometry) {
        let Some(tracker) = &mut self.stages.tracker else { return };
        let inputs = TrackerInputs {
            now,
            odometry,
            plan: self.plan.as_ref().map(|(head, points)| (head, points.as_slice())),
            permit: self.channels.permit.newest(),
        };
        let sent = self.channels.command.send(now, |command| tracker.step(inputs, command));
        self.stepped(Process::Tracker, odometry.header.origin);
        if let Some((command, _)) = sent {
            self.fresh.command = Some(command);
            self.event(Event::Command(&command));
            self.pass_gate(true);
        }
    }

    /// The gate acts on each command, and at least every period without one.
    fn pass_gate(&mut self, fresh_command: bool) {
        let now = self.now;
        let due = now >= self.gate_due;
        if due {
            self.gate_due = now + nanos(self.service.safety().actuation_period);
        }
        if !due && !fresh_command {
            return;
        }
        let Some(gate) = &mut self.stages.gate else { return };
        let inhibit = self.pending_inhibit.take();
        let inputs = GateInputs {
            command: self.channels.command.newest(),
            permit: self.channels.permit.newest(),
            inhibit: inhibit.as_ref(),
            invalid_command: false,
        };
        let sent = self.channels.actuator.send(now, |actuator| {
            gate.step(now, inputs, actuator);
            true
        });
        self.stepped(Process::Actuation, now);
        if let Some(inhibit) = inhibit {
            self.event(Event::Inhibit(&inhibit));
        }
        if let Some((actuator, _)) = sent {
            self.fresh.actuator = Some(actuator);
            self.event(Event::Actuator(&actuator));
        }
    }

    fn finish_plan(&mut self) {
        let due = self.planning.as_ref().is_some_and(|(due, _)| *due <= self.now);
        let Some((_, answered)) = self.planning.take_if(|_| due) else { return };
        if let Some((mut head, points)) = answered.plan {
            let sequence = head.id;
            seal(&mut head, bytemuck::cast_slice(&points), EPOCH, sequence, self.now);
            self.plan = Some((head, points));
        }
        self.planned = Some(answered.answer);
    }
}

impl Channels {
    fn new() -> Self {
        Self {
            raw: Channel::new(EPOCH),
            travel: Channel::new(EPOCH),
            odometry: Channel::new(EPOCH),
            command: Channel::new(EPOCH),
            actuator: Channel::new(EPOCH),
            permit: Channel::new(EPOCH),
            state: Channel::new(EPOCH),
            restore: Channel::new(EPOCH),
            fix: Channel::new(EPOCH),
        }
    }
}

/// A verdict in words, for whoever asks.
#[must_use]
pub fn words_of(answer: &PlanAnswer) -> String {
    let verdict = PlanVerdict::from_code(answer.verdict).map_or("unknown", PlanVerdict::name);
    let details = text::as_str(&answer.text);
    if details.is_empty() { verdict.to_owned() } else { format!("{verdict}: {details}") }
}
