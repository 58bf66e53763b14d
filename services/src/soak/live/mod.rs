//! `soak` with real processes: one instance parks and leaves the slot again and again under random faults.

pub mod burden;
mod flight;
mod resources;
mod stack;
mod strike;
mod summary;
mod totals;

pub use resources::{Resource, Sample, Slope};
pub use strike::{Blow, MODES};
pub use summary::tell;
pub use totals::{Cell, Totals};

use core::time::Duration;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kerbside_messages::{Mode, Nanos, Process, State, Truth, Verb, seconds};
use kerbside_runtime::{Ticker, now};

use super::{Burden, Faults, SoakArgs};
use crate::exit::Failure;
use crate::manoeuvre::{Act, End, Manoeuvre, Observation};
use crate::park::Job;
use crate::park::trace::Trace;
use burden::{Burdens, Pulse};
use flight::{Allowed, Course, Flight};
use resources::Resources;
use stack::{Place, Stack};
use strike::{Choice, Matrix, Random, Sight, Wish};

/// The operator looks every so often.
const LOOK: Duration = Duration::from_millis(5);
/// Resources are looked at every so often \[ns\].
const SAMPLE: Nanos = 1_000_000_000;
/// Misses count as a fault's consequence until so long after it is over \[ns\].
const CALM: Nanos = 1_000_000_000;
/// A recorder's files may grow by so much where the disk is to be full \[bytes\].
const DISK: u64 = 2 << 20;
/// Between two manoeuvres nothing is seen for no longer than this \[ns\].
const START: Nanos = 30_000_000_000;

/// Soaks until the time is over, the manoeuvres are driven, the matrix is through, or `stop` is set.
///
/// # Errors
/// [`Failure`] where the stack cannot be started.
pub fn soak(args: &SoakArgs, folder: &Path, stop: &AtomicBool) -> Result<Totals, Failure> {
    let job = stack::job(args, folder)?;
    let mut soak = Soak::new(args, job)?;
    let loads: Vec<Burden> =
        args.load.iter().copied().filter(|load| *load != Burden::Disk).collect();
    let mut stack = Some(Stack::start(&soak.job, Place::of(&soak.job.scenario.start), stop)?);
    let mut burdens = Burdens::start(&loads, &soak.job.service.instance)?;
    soak.totals.burdens = args.load.iter().map(|load| load.name()).collect();
    while soak.goes_on(stop) {
        let Some(present) = &mut stack else { break };
        let end = soak.manoeuvre(present, &mut burdens, stop)?;
        if end != Ended::Well && soak.goes_on(stop) {
            let start = Place::of(&soak.job.scenario.start);
            let place = if end == Ended::Stuck { start } else { present.place() };
            drop(stack.take());
            stack = Some(Stack::start(&soak.job, place, stop)?);
        }
    }
    let instance = soak.job.service.instance.clone();
    drop(burdens);
    drop(stack);
    soak.finish(&instance);
    Ok(soak.totals)
}

/// How a manoeuvre ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ended {
    /// The stack is still there.
    Well,
    /// It has to be started anew.
    Lost,
    /// No path leads from where the vehicle was stopped: somebody carries it to where it began.
    Stuck,
}

struct Soak {
    job: Job,
    allowed: Allowed,
    amount: (Option<Nanos>, Option<u64>),
    choice: Choice,
    disk: bool,
    began: Nanos,
    /// The newest time at which a fault was under way.
    disturbed: Nanos,
    flight: Option<Flight>,
    outward: bool,
    pulse: Pulse,
    pulse_misses: u64,
    misses: BTreeMap<u8, (u32, u32)>,
    resources: Resources,
    sampled: Nanos,
    limited: u32,
    bar: ProgressBar,
    totals: Totals,
}

impl Soak {
    fn new(args: &SoakArgs, job: Job) -> Result<Self, Failure> {
        let began = now();
        let seed = args.seed.unwrap_or(1);
        let choice = match (args.matrix, args.faults) {
            (true, _) => Choice::Matrix(Matrix::whole()),
            (false, Faults::None) => Choice::Nothing,
            (false, faults) => Choice::Random(Box::new(Random::new(faults, seed))),
        };
        let minutes = args.minutes.map(|minutes| kerbside_messages::nanos(60.0 * minutes));
        Ok(Self {
            allowed: Allowed::of(&job.service),
            amount: (minutes, args.manoeuvres),
            choice,
            disk: args.load.contains(&Burden::Disk),
            began,
            disturbed: began,
            flight: None,
            outward: false,
            pulse: Pulse::start(job.service.safety().timeouts.deadline)?,
            pulse_misses: 0,
            misses: BTreeMap::new(),
            resources: Resources::new(began),
            sampled: 0,
            limited: 0,
            bar: bar(args),
            totals: Totals::new(seed, job.service.instance.name()),
            job,
        })
    }

    fn goes_on(&self, stop: &AtomicBool) -> bool {
        let (minutes, manoeuvres) = self.amount;
        let over = minutes.is_some_and(|span| now() - self.began >= span)
            || manoeuvres.is_some_and(|enough| self.totals.manoeuvres >= enough)
            || self.choice.is_done() && self.flight.is_none();
        !over && !stop.load(Ordering::Relaxed) && !self.totals.is_hopeless()
    }

    /// One way into the slot or out of it, with as many arms as it takes.
    fn manoeuvre(
        &mut self,
        stack: &mut Stack,
        burdens: &mut Burdens,
        stop: &AtomicBool,
    ) -> Result<Ended, Failure> {
        let began = now();
        let mut manoeuvre = Manoeuvre::new(began, &self.job.service.vehicle, true);
        let mut trace = Trace::new(began);
        let mut look = Ticker::new(LOOK);
        let end = loop {
            look.wait();
            stack.desk().take_in(&mut trace);
            self.watch(stack, &trace, burdens)?;
            let (armed, planned) = stack.desk().answers(&mut trace);
            let lost = stack.lost();
            let desk = stack.desk();
            let seen = Observation {
                state: desk.state(),
                odometry: desk.odometry(),
                armed: armed.as_ref(),
                planned: planned.as_ref(),
                vehicle_lost: lost.1,
                supervisor_lost: lost.0,
                interrupted: stop.load(Ordering::Relaxed) || self.is_over(),
            };
            match manoeuvre.step(now(), &seen) {
                Act::End(end) => break end,
                act => self.act(stack, act, &trace),
            }
            self.inject(stack, &trace);
            if self.anew(stack) {
                break End::SupervisorLost;
            }
        };
        self.ended(stack, end, &mut trace, burdens)
    }

    /// The time is over in the middle of a manoeuvre: a fault under way is still seen to its end.
    fn is_over(&self) -> bool {
        let (minutes, _) = self.amount;
        minutes.is_some_and(|span| now() - self.began >= span) && self.flight.is_none()
    }

    fn act(&self, stack: &mut Stack, act: Act, trace: &Trace) {
        let Some(truth) = trace.truth.last().copied() else { return };
        let (scenario, vehicle) = (&self.job.scenario, &self.job.service.vehicle);
        let (disturbance, outward) = (&scenario.disturbance, self.outward);
        let fix = || Place::of_truth(&truth).fix(disturbance, now());
        let request = || {
            let mut request = scenario.plan_request(vehicle);
            if outward {
                let start = scenario.start;
                (request.x, request.y, request.yaw) = (start.x, start.y, start.yaw);
                request.gear = 0;
            }
            request
        };
        if let Err(error) = stack.desk().act(act, fix, request) {
            tracing::warn!(%error, "operator's message lost; it will be sent again");
        }
    }

    /// Takes in what was seen since the last look.
    fn watch(
        &mut self,
        stack: &mut Stack,
        trace: &Trace,
        burdens: &mut Burdens,
    ) -> Result<(), Failure> {
        let now = now();
        stack.saw(trace.truth.last());
        let state = trace.state;
        if let Some(state) = &state {
            self.follow(now, state, trace);
            self.count_misses(now, state);
        }
        if now - self.sampled >= SAMPLE {
            self.sampled = now;
            let processes = stack.processes(state.as_ref());
            self.resources.look(now, &processes, &self.job.service.instance);
            if self.disk {
                self.limit_recorder(state.as_ref());
            }
            self.totals.peers += u64::from(burdens.renew()?);
            self.show(now, state.as_ref());
        }
        Ok(())
    }

    /// Sees a fault through.
    fn follow(&mut self, now: Nanos, state: &State, trace: &Trace) {
        let Some(flight) = &mut self.flight else { return };
        self.disturbed = now;
        if flight.resume_at().is_some_and(|at| now >= at) {
            kerbside_runtime::resume(flight.pid);
            flight.resumed = true;
        }
        for truth in trace.truth.iter().rev().take(64).rev() {
            flight.truth(truth, state.arms);
        }
        flight.state(state);
        match flight.course(now, state, &self.allowed) {
            Course::Flying => {}
            course => {
                let flight = self.flight.take();
                if let Some(flight) = flight {
                    self.totals.take(flight, course, &self.allowed);
                }
            }
        }
    }

    /// Deadline misses of the stack and of a bare thread, outside of faults.
    fn count_misses(&mut self, now: Nanos, state: &State) {
        let calm = self.flight.is_none() && now - self.disturbed > CALM;
        let bare = self.pulse.misses();
        let new_bare = bare - core::mem::replace(&mut self.pulse_misses, bare);
        if calm {
            self.totals.bare_misses += new_bare;
        }
        for row in state.rows() {
            let known = self.misses.insert(row.process, (row.pid, row.misses));
            let before = known.filter(|(pid, _)| *pid == row.pid).map_or(0, |(_, misses)| misses);
            if calm && known.is_some_and(|(pid, _)| pid == row.pid) {
                self.totals.misses += u64::from(row.misses.saturating_sub(before));
            }
        }
    }

    /// What is to be done to the stack now.
    fn inject(&mut self, stack: &mut Stack, trace: &Trace) {
        if self.flight.is_some() {
            return;
        }
        let Some(state) = trace.state else { return };
        // A vehicle that has not been seen yet stands where it began.
        let truth = trace.truth.last().copied().unwrap_or_default();
        let exists = |process: &Process| stack.pid(*process, &state) > 0;
        let alive = Process::ALL.iter().filter(|process| exists(process));
        let alive = alive.fold(0, |mask, process| mask | 1 << *process as u8);
        let sight = Sight {
            now: now(),
            mode: state.mode(),
            speed: truth.speed,
            healthy: state.healthy == 1,
            alive,
        };
        match self.choice.wish(&sight) {
            Some(Wish::Strike(process, blow)) => self.strike(stack, process, blow, &state, &truth),
            Some(Wish::First(process)) => {
                kerbside_runtime::kill(stack.pid(process, &state));
                self.disturbed = sight.now;
            }
            Some(Wish::Stop) => {
                if let Err(error) = stack.desk().ask(Verb::Stop) {
                    tracing::warn!(%error, "stop lost");
                }
                self.disturbed = sight.now;
            }
            Some(Wish::StartAnew) => stack.wants_anew = true,
            Some(Wish::Miss(process, blow, mode)) => self.totals.missed(process, blow, mode),
            None => {}
        }
    }

    fn strike(
        &mut self,
        stack: &Stack,
        process: Process,
        blow: Blow,
        state: &State,
        truth: &Truth,
    ) {
        let pid = stack.pid(process, state);
        if pid == 0 {
            self.totals.missed(process, blow, state.mode());
            return;
        }
        let at = now();
        match blow {
            Blow::Kill => kerbside_runtime::kill(pid),
            Blow::Stall(_) => kerbside_runtime::suspend(pid),
        }
        self.flight = Some(Flight::new(process, blow, pid, at, state, truth));
    }

    fn anew(&self, stack: &mut Stack) -> bool {
        core::mem::take(&mut stack.wants_anew)
    }

    /// A recorder's file may not grow for ever.
    fn limit_recorder(&mut self, state: Option<&State>) {
        let row = state.and_then(|state| {
            state.rows().iter().find(|row| row.process == Process::Recorder as u8)
        });
        if let Some(row) = row
            && row.pid != self.limited
            && stack::limit_file_size(row.pid, DISK)
        {
            self.limited = row.pid;
            self.totals.full_disks += 1;
        }
    }

    /// A manoeuvre is over.
    fn ended(
        &mut self,
        stack: &mut Stack,
        end: End,
        trace: &mut Trace,
        burdens: &mut Burdens,
    ) -> Result<Ended, Failure> {
        let lost = matches!(end, End::SupervisorLost | End::VehicleLost);
        // What struck the supervisor is over when the vehicle stands.
        let deadline = now() + START;
        let mut look = Ticker::new(LOOK);
        while lost && self.flight.is_some() && now() < deadline {
            look.wait();
            stack.desk().take_in(trace);
            self.watch(stack, trace, burdens)?;
            let Some(flight) = &mut self.flight else { break };
            if let Some(course) = stack::without_supervisor(flight, now(), &self.allowed)
                && let Some(flight) = self.flight.take()
            {
                self.totals.take(flight, course, &self.allowed);
            }
        }
        self.disturbed = now();
        self.totals.saw(self.began, trace);
        if end != End::Interrupted {
            self.totals.ended(end, self.outward);
        }
        if end == End::Completed {
            self.outward = !self.outward;
        }
        if matches!(end, End::NoPlan(kerbside_messages::PlanVerdict::NoPath)) {
            self.outward = false;
            return Ok(Ended::Stuck);
        }
        Ok(if lost || matches!(end, End::Stopped(kerbside_messages::Cause::GaveUp)) {
            Ended::Lost
        } else {
            Ended::Well
        })
    }

    fn finish(&mut self, instance: &kerbside_runtime::Instance) {
        self.bar.finish_and_clear();
        let totals = &mut self.totals;
        totals.minutes = seconds(now() - self.began) / 60.0;
        totals.pulse_beats = self.pulse.beats();
        totals.slopes = self.resources.slopes();
        totals.samples = self.resources.samples().clone();
        totals.orphans = stack::processes_of(instance);
        totals.segments_left = resources::segments_of(instance);
    }

    fn show(&self, now: Nanos, state: Option<&State>) {
        if self.bar.is_hidden() {
            return;
        }
        let position = match self.amount {
            (Some(_), _) => (now - self.began) / 60_000_000_000,
            _ => self.totals.manoeuvres,
        };
        self.bar.set_position(position);
        let mode = state.map_or(Mode::Starting, State::mode);
        let (faults, broken) = (self.totals.flights.len(), self.totals.broken().len());
        self.bar.set_message(format!("{faults} faults, {broken} broken, {mode}"));
    }
}

fn bar(args: &SoakArgs) -> ProgressBar {
    use std::io::IsTerminal;
    let (length, unit) = match (args.minutes, args.manoeuvres) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // minutes of a soak
        (Some(minutes), _) => (minutes.ceil() as u64, "minutes"),
        (None, Some(manoeuvres)) => (manoeuvres, "manoeuvres"),
        (None, None) => (0, "manoeuvres"),
    };
    let bar = ProgressBar::new(length);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let template = format!("{{bar:20}} {{pos}}/{{len}} {unit}, {{msg}}, {{elapsed}}");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar
}
