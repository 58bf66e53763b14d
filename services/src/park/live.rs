//! A run as processes: the supervisor and the simulated vehicle are started, watched, and ended in order.

use core::time::Duration;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use kerbside_messages::{
    Actuator, Command, Fix, Heartbeat, Message, Odometry, OperatorAnswer, OperatorRequest,
    PlanAnswer, PlanRequest, State, Truth, Verb,
};
use kerbside_runtime::{
    Client, Newest, Pending, PlanSubscriber, Publisher, Session, SessionError, Subscriber, Ticker,
    now,
};

use super::progress::Progress;
use super::scene::Start;
use super::trace::Trace;
use super::{Job, Run};
use crate::children::Children;
use crate::exit::Failure;
use crate::life::stop_flag;
use crate::manoeuvre::{Act, End, Manoeuvre, Observation};
use crate::vehicle::format_pose;

/// The operator looks every so often.
const LOOK: Duration = Duration::from_millis(20);
/// Longest wait for a vehicle without supervisor to stand.
const STOP: Duration = Duration::from_secs(2);
/// Speed below which it only rolls out \[m/s\].
const REST: f64 = 1e-2;

/// Runs `job` as processes.
///
/// # Errors
/// [`Failure`] where the stack cannot be started.
pub fn run(job: &Job, progress: &Progress) -> Result<Run, Failure> {
    let begun = now();
    let stop = stop_flag()?;
    let start = Start::draw(&job.scenario, job.seed);
    let pose = format_pose(&start.truth);
    let mut vehicle =
        ["--start", &pose, "--seed", &job.seed.to_string()].map(OsString::from).to_vec();
    vehicle.extend(job.plant_arguments.iter().cloned());
    let mut stack = Children::start(&job.service, Some(&vehicle))?;
    let session = stack.join(&stop)?;
    let mut desk = Desk::open(&session, job)?;
    let mut trace = Trace::new(now());
    let end = operate(job, &start, &mut stack, &mut desk, &mut trace, progress, &stop);
    if end == End::SupervisorLost {
        watch_stop(&mut desk, &mut trace);
    }
    drop((desk, session));
    stack.end(end == End::SupervisorLost);
    Ok(Run {
        trace,
        end,
        recording: job.recording.clone(),
        instance: Some(job.service.instance.name().to_owned()),
        wall_seconds: kerbside_messages::seconds(now() - begun),
        search_seconds: 0.0,
        simulated_seconds: 0.0,
    })
}

fn operate(
    job: &Job,
    start: &Start,
    stack: &mut Children,
    desk: &mut Desk,
    trace: &mut Trace,
    progress: &Progress,
    stop: &AtomicBool,
) -> End {
    let mut manoeuvre = Manoeuvre::new(now(), &job.service.vehicle, job.rearm);
    let mut look = Ticker::new(LOOK);
    loop {
        desk.take_in(trace);
        let (armed, planned) = desk.answers(trace);
        let seen = Observation {
            state: desk.state(),
            odometry: desk.odometry(),
            armed: armed.as_ref(),
            planned: planned.as_ref(),
            vehicle_lost: stack.vehicle_ended(),
            supervisor_lost: stack.supervisor_ended(),
            interrupted: stop.load(Ordering::Relaxed),
        };
        let act = manoeuvre.step(now(), &seen);
        if let Act::End(end) = act {
            return end;
        }
        let fix = || start.fix(now());
        let request = || job.scenario.plan_request(&job.service.vehicle);
        if let Err(error) = desk.act(act, fix, request) {
            tracing::warn!(%error, "operator's message lost; it will be sent again");
        }
        progress.show(manoeuvre.phase(), trace);
        look.wait();
    }
}

/// Without a supervisor the vehicle stops by itself: that belongs to the run.
fn watch_stop(desk: &mut Desk, trace: &mut Trace) {
    let deadline = now() + crate::life::nanos(STOP);
    let mut look = Ticker::new(LOOK);
    let moves = |trace: &Trace| trace.truth.last().is_some_and(|truth| truth.speed.abs() > REST);
    while moves(trace) && now() < deadline {
        look.wait();
        desk.take_in(trace);
    }
}

/// The operator's ports.
pub struct Desk {
    odometry: Subscriber<Odometry>,
    newest_odometry: Option<Odometry>,
    truth: Subscriber<Truth>,
    command: Subscriber<Command>,
    actuator: Subscriber<Actuator>,
    heartbeats: Vec<Subscriber<Heartbeat>>,
    state: Newest<State>,
    plan: PlanSubscriber,
    fix: Publisher<Fix>,
    operator: Client<OperatorRequest, OperatorAnswer>,
    planner: Client<PlanRequest, PlanAnswer>,
    armed: Option<Pending<OperatorRequest, OperatorAnswer>>,
    planned: Option<Pending<PlanRequest, PlanAnswer>>,
    requests: u64,
}

impl Desk {
    /// Opens them.
    ///
    /// # Errors
    /// Where the middleware refuses.
    pub fn open(session: &Session, job: &Job) -> Result<Self, SessionError> {
        let beats = |process| session.subscriber::<Heartbeat>(Some(process), 16);
        Ok(Self {
            odometry: session.subscriber(None, 512)?,
            newest_odometry: None,
            truth: session.subscriber(None, 64)?,
            command: session.subscriber(None, 64)?,
            actuator: session.subscriber(None, 64)?,
            heartbeats: job
                .service
                .supervised()
                .into_iter()
                .map(beats)
                .collect::<Result<_, _>>()?,
            state: Newest::of(session.subscriber(None, 1)?),
            plan: session.plan_subscriber()?,
            fix: session.publisher(None)?,
            operator: session.client()?,
            planner: session.client()?,
            armed: None,
            planned: None,
            requests: 0,
        })
    }

    /// The newest state.
    #[must_use]
    pub fn state(&self) -> Option<&State> {
        self.state.get()
    }

    /// The newest estimate.
    #[must_use]
    pub fn odometry(&self) -> Option<&Odometry> {
        self.newest_odometry.as_ref()
    }

    /// Answers that came since the last look: to an arm, and to a plan request, whose plan `trace` takes in.
    pub fn answers(&mut self, trace: &mut Trace) -> (Option<OperatorAnswer>, Option<PlanAnswer>) {
        let armed = self.armed.as_mut().and_then(Pending::poll);
        let planned = self.planned.as_mut().and_then(Pending::poll);
        if planned.is_some() {
            // The plan was sent before its answer.
            self.take_plan(trace);
        }
        (armed, planned)
    }

    /// Asks the supervisor.
    ///
    /// # Errors
    /// Where the middleware refuses.
    pub fn ask(
        &mut self,
        verb: Verb,
    ) -> Result<Pending<OperatorRequest, OperatorAnswer>, kerbside_runtime::RuntimeError> {
        self.requests += 1;
        let request = OperatorRequest {
            id: self.requests,
            pid: std::process::id(),
            verb: verb.code(),
            ..OperatorRequest::default()
        };
        self.operator.send(request)
    }

    /// Takes in what came since the last look.
    pub fn take_in(&mut self, trace: &mut Trace) {
        while let Some(odometry) = self.odometry.receive() {
            trace.odometry.push(*odometry);
            self.newest_odometry = Some(*odometry);
        }
        while let Some(truth) = self.truth.receive() {
            trace.truth.push(*truth);
        }
        self.take_plan(trace);
        while let Some(command) = self.command.receive() {
            trace.command(&command);
        }
        while let Some(actuator) = self.actuator.receive() {
            trace.actuators.push(*actuator);
        }
        for heartbeats in &mut self.heartbeats {
            while let Some(beat) = heartbeats.receive() {
                trace.heartbeat(&beat);
            }
        }
        if self.state.update()
            && let Some(state) = self.state.get()
        {
            trace.state(state);
        }
    }

    fn take_plan(&mut self, trace: &mut Trace) {
        if self.plan.update()
            && let Some((head, points)) = self.plan.get()
        {
            super::take_plan(trace, head.header.sent, head, points);
        }
    }

    /// Does what the operator decided; `fix` says where the vehicle stands, `request` where it is to go.
    ///
    /// # Errors
    /// Where the middleware refuses.
    pub fn act(
        &mut self,
        act: Act,
        fix: impl FnOnce() -> Fix,
        request: impl FnOnce() -> PlanRequest,
    ) -> Result<(), kerbside_runtime::RuntimeError> {
        match act {
            Act::Watch | Act::End(_) => {}
            Act::Fix => {
                let content = fix();
                self.fix.send(|fix| {
                    *fix = content;
                    true
                })?;
            }
            Act::Arm => self.armed = Some(self.ask(Verb::Arm)?),
            Act::Plan { arm } => {
                self.requests += 1;
                let mut request = request();
                (request.id, request.arm) = (self.requests, arm);
                debug_assert!(request.header().version == 0, "sealed by the client");
                self.planned = Some(self.planner.send(request)?);
            }
        }
        Ok(())
    }
}

/// Where a run records.
#[must_use]
pub fn recording_in(folder: &std::path::Path) -> PathBuf {
    folder.join("recording.mcap")
}
