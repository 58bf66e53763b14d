//! The simulated world: processes as stages, time as a number.

mod chain;
mod faults;
mod processes;

use std::collections::VecDeque;
use std::sync::Arc;

use kerbside_messages::{
    Actuator, Command, Fix, Heartbeat, Inhibit, Nanos, Odometry, OperatorAnswer, Permit, Plan,
    PlanAnswer, PlanRequest, PlanVerdict, Process, Raw, Restore, State, TrajectoryPoint, Travel,
    Truth, Verb, seal, text,
};
use kerbside_odometry::{Estimator, Ingest};
use kerbside_safety::{Actions, Event, Exit, Gate, Supervised, Supervisor, bounds};
use kerbside_tracking::Tracker;

use super::channel::{ByteQueue, Topic};
use super::schedule::{Fault, Schedule};
use crate::exit::Failure;
use crate::interface::LineStage;
use crate::life::nanos;
use crate::planner::Answered;
use crate::service::Service;
use crate::vehicle::{Making, VehicleStage};
use faults::LineTrouble;
use processes::Slot;

/// The grid of simulated time \[ns\].
const TICK: Nanos = 1_000_000;
/// Time that bytes spend on the line.
const LINE_DELAY: Nanos = 1_000_000;
/// Bytes that wait on the line for somebody to read them: what a terminal holds.
const LINE_ROOM: usize = 4096;
/// Time that a process takes to start.
const START: Nanos = 100_000_000;
/// Time that a plan takes.
const PLAN: Nanos = 500_000_000;
/// Where simulated time begins: stamps are never 0.
const EPOCH: Nanos = 1_000_000_000;

/// The processes' stages; none where the process is not running.
#[derive(Default)]
struct Stages {
    interface: Option<LineStage>,
    ingest: Option<Ingest>,
    estimator: Option<Estimator>,
    tracker: Option<Tracker>,
    gate: Option<Gate>,
}

struct Topics {
    raw: Topic<Raw>,
    travel: Topic<Travel>,
    odometry: Topic<Odometry>,
    command: Topic<Command>,
    actuator: Topic<Actuator>,
    permit: Topic<Permit>,
    state: Topic<State>,
    restore: Topic<Restore>,
    fix: Topic<Fix>,
    heartbeats: Vec<(Process, Topic<Heartbeat>)>,
}

/// Answers of an earlier search for the same start and goal, so that it need not be repeated: the same bits as without.
pub trait Plans {
    /// The planner's answer to `request` from the newest estimate.
    fn answer(
        &mut self,
        service: &Service,
        request: &PlanRequest,
        odometry: Option<&Odometry>,
    ) -> Answered;
}

/// The stack, its vehicle, and their time.
pub struct World {
    service: Service,
    now: Nanos,
    vehicle: VehicleStage,
    vehicle_due: Nanos,
    /// Simulated time in which the vehicle's stood still.
    vehicle_lag: Nanos,
    boots: u32,
    to_host: ByteQueue,
    to_vehicle: ByteQueue,
    schedule: Schedule,
    /// Faults of the schedule that have begun.
    begun: usize,
    trouble: Vec<LineTrouble>,
    buffer: Vec<u8>,
    stages: Stages,
    topics: Topics,
    /// By the process's number.
    slots: [Slot; Process::ALL.len()],
    starting: VecDeque<(Nanos, Process, u32)>,
    /// Deaths that the supervisor has not been told of.
    deaths: VecDeque<(Process, Exit)>,
    pending_fix: Option<Fix>,
    pending_inhibit: Option<Inhibit>,
    told_inhibits: VecDeque<Inhibit>,
    asked: VecDeque<(u64, Verb)>,
    refused_commands: u64,
    line_opened: Nanos,
    supervisor: Supervisor,
    supervisor_dead: bool,
    state_sent: Nanos,
    arms_granted: u64,
    actions: Actions,
    cycle_due: Nanos,
    gate_due: Nanos,
    plan: Option<(Plan, Vec<TrajectoryPoint>)>,
    requested: Option<PlanRequest>,
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
#[derive(Clone, Debug, Default)]
pub struct Fresh {
    /// Reading.
    pub raw: Option<Arc<Raw>>,
    /// Estimate.
    pub odometry: Option<Arc<Odometry>>,
    /// Command.
    pub command: Option<Arc<Command>>,
    /// What passed the gate.
    pub actuator: Option<Arc<Actuator>>,
    /// What the interface wrote to the line.
    pub delivered: Option<Actuator>,
    /// Permit.
    pub permit: Option<Arc<Permit>>,
    /// State.
    pub state: Option<Arc<State>>,
    /// Truth.
    pub truth: Option<Truth>,
}

impl Fresh {
    /// Another tick begins.
    fn clear(&mut self) {
        (self.raw, self.odometry, self.command) = (None, None, None);
        (self.actuator, self.delivered, self.permit) = (None, None, None);
        (self.state, self.truth) = (None, None);
    }
}

impl World {
    /// A world at rest: the vehicle stands as `making` says, and no process runs yet.
    ///
    /// # Errors
    /// [`Failure`] where the vehicle has nothing to compute motion from.
    pub fn new(service: &Service, making: &Making, schedule: Schedule) -> Result<Self, Failure> {
        let supervised: Vec<_> = service
            .supervised()
            .into_iter()
            .map(|process| Supervised { process, external: false })
            .collect();
        let stop = bounds::stop_times(&service.vehicle, service.safety());
        let vehicle = VehicleStage::new(making);
        let world = Self {
            service: service.clone(),
            now: EPOCH,
            vehicle_due: EPOCH + vehicle.period(),
            vehicle_lag: 0,
            boots: making.boot,
            vehicle,
            to_host: ByteQueue::new(LINE_DELAY, LINE_ROOM),
            to_vehicle: ByteQueue::new(LINE_DELAY, LINE_ROOM),
            schedule,
            begun: 0,
            trouble: Vec::new(),
            buffer: Vec::new(),
            stages: Stages::default(),
            topics: Topics::new(&supervised),
            slots: Process::ALL.map(Slot::new),
            starting: VecDeque::new(),
            deaths: VecDeque::new(),
            pending_fix: None,
            pending_inhibit: None,
            told_inhibits: VecDeque::new(),
            asked: VecDeque::new(),
            refused_commands: 0,
            line_opened: 0,
            supervisor: Supervisor::new(service.safety(), &supervised, stop, 1),
            supervisor_dead: false,
            state_sent: EPOCH,
            arms_granted: 0,
            actions: Actions::default(),
            cycle_due: EPOCH,
            gate_due: EPOCH,
            plan: None,
            requested: None,
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

    /// When a fault of the schedule begins, on the clock of [`Self::now`] \[ns\].
    #[must_use]
    pub fn time_of(fault: &Fault) -> Nanos {
        EPOCH + fault.at
    }

    /// The newest state, as an operator has it.
    #[must_use]
    pub fn state(&self) -> Option<&State> {
        self.topics.state.newest(Process::Operator)
    }

    /// The newest estimate, as an operator has it.
    #[must_use]
    pub fn odometry(&self) -> Option<&Odometry> {
        self.topics.odometry.newest(Process::Operator)
    }

    /// The standing plan.
    #[must_use]
    pub fn plan(&self) -> Option<(&Plan, &[TrajectoryPoint])> {
        self.plan.as_ref().map(|(head, points)| (head, points.as_slice()))
    }

    /// Where the vehicle truly is.
    #[must_use]
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// Faults of the schedule that have begun.
    #[must_use]
    pub fn begun(&self) -> &[Fault] {
        &self.schedule.faults()[..self.begun]
    }

    /// Whether the supervisor's process ended.
    #[must_use]
    pub fn supervisor_is_dead(&self) -> bool {
        self.supervisor_dead
    }

    /// How often an operator's request to arm was granted.
    #[must_use]
    pub fn arms_granted(&self) -> u64 {
        self.arms_granted
    }

    /// The answer to the newest request of the operator, once.
    pub fn take_answer(&mut self) -> Option<OperatorAnswer> {
        self.answers.pop()
    }

    /// The planner's answer, once.
    pub fn take_planned(&mut self) -> Option<PlanAnswer> {
        self.planned.take()
    }

    /// Publishes a fix; it is lost where no estimator listens.
    pub fn fix(&mut self, fix: &Fix) {
        let (now, content) = (self.now, *fix);
        self.topics.fix.send(now, |fix| {
            *fix = content;
            true
        });
        let sent = self.topics.fix.take(Process::Estimator, now);
        let listening = self.stages.estimator.is_some();
        self.pending_fix = sent.map(|(fix, _)| *fix).filter(|_| listening);
    }

    /// Asks the supervisor.
    pub fn ask(&mut self, id: u64, verb: Verb) {
        self.asked.push_back((id, verb));
    }

    /// Asks the planner; the answer comes half a simulated second later.
    pub fn request_plan(&mut self, request: &PlanRequest) {
        if self.is_up(Process::Planner) {
            self.requested = Some(*request);
        }
    }

    /// One tick of simulated time.
    pub fn tick(&mut self, plans: &mut dyn Plans) {
        self.now += TICK;
        self.fresh.clear();
        self.follow_schedule();
        self.end_abandoned();
        self.start_processes();
        self.drive_vehicle();
        self.hear_line();
        self.step_ingest();
        self.step_estimator();
        self.step_tracker();
        self.pass_gate(true);
        self.tell_line();
        self.pass_gate(false);
        self.work_on_plan(plans);
        self.beat();
        self.lead();
        self.topics.odometry.update(Process::Operator, self.now);
        self.topics.state.update(Process::Operator, self.now);
    }

    /// The supervisor's part of a tick, unless it is stopped or dead.
    fn lead(&mut self) {
        if !self.works(Process::Supervisor) {
            return;
        }
        self.take_in_events();
        while let Some((id, verb)) = self.asked.pop_front() {
            self.event(Event::Operator { id, verb });
        }
        if self.now >= self.cycle_due {
            self.cycle_due = self.now + nanos(self.service.safety().cycle);
            self.supervise();
        }
    }

    /// Publishes a demand to stop for `span` \[ns\].
    fn inhibit(&mut self, span: Nanos) {
        let (who, why) = (text::from_str("script"), text::from_str("scripted inhibit"));
        let mut sealed = Inhibit { expiry: self.now + span, who, why, ..Inhibit::default() };
        seal(&mut sealed, &[], EPOCH, self.now, self.now);
        self.pending_inhibit = self.stages.gate.is_some().then_some(sealed);
        self.told_inhibits.push_back(sealed);
    }
}

/// What a test breaks on purpose, to see that it is noticed.
#[cfg(test)]
impl World {
    pub(crate) fn forge_permits(&mut self, forge: super::channel::Forge<Permit>) {
        self.topics.permit.forge(forge);
    }

    pub(crate) fn forge_actuators(&mut self, forge: super::channel::Forge<Actuator>) {
        self.topics.actuator.forge(forge);
    }

    pub(crate) fn forge_odometry(&mut self, forge: super::channel::Forge<Odometry>) {
        self.topics.odometry.forge(forge);
    }

    pub(crate) fn forge_states(&mut self, forge: super::channel::Forge<State>) {
        self.topics.state.forge(forge);
    }

    /// A vehicle that takes so long to notice silence \[ms\].
    pub(crate) fn slow_vehicle(&mut self, silence: u16) {
        self.vehicle.set_silence(silence);
    }
}

impl Topics {
    fn new(supervised: &[Supervised]) -> Self {
        use Process::{Actuation, Estimator, Ingest, Interface, Operator, Tracker};
        let supervisor = Process::Supervisor;
        Self {
            raw: Topic::new(EPOCH, &[Ingest]),
            travel: Topic::new(EPOCH, &[Estimator]),
            odometry: Topic::new(EPOCH, &[Tracker, supervisor, Operator]),
            command: Topic::new(EPOCH, &[Actuation, supervisor]),
            actuator: Topic::new(EPOCH, &[Interface, supervisor]),
            permit: Topic::new(EPOCH, &[Tracker, Actuation]),
            state: Topic::new(EPOCH, &[Operator]),
            restore: Topic::new(EPOCH, &[Estimator]),
            fix: Topic::new(EPOCH, &[Estimator]),
            heartbeats: supervised
                .iter()
                .map(|known| (known.process, Topic::new(EPOCH, &[supervisor])))
                .collect(),
        }
    }

    /// A process starts anew: what waited for its earlier life is gone.
    fn reopen(&mut self, process: Process) {
        self.raw.reopen(process);
        self.travel.reopen(process);
        self.odometry.reopen(process);
        self.command.reopen(process);
        self.actuator.reopen(process);
        self.permit.reopen(process);
        self.restore.reopen(process);
    }
}

/// A verdict in words, for whoever asks.
#[must_use]
pub fn words_of(answer: &PlanAnswer) -> String {
    let verdict = PlanVerdict::from_code(answer.verdict).map_or("unknown", PlanVerdict::name);
    let details = text::as_str(&answer.text);
    if details.is_empty() { verdict.to_owned() } else { format!("{verdict}: {details}") }
}
