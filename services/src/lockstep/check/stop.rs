//! A stop within the bound: the distance and the time of the stop-distance inequality, from the fastest that the vehicle
//! went since.
//!
//! A stop begins where motion is no longer permitted, or where a fault begins that no stack can drive on with. After a
//! single fault the longest single time-out counts; where several come together their layers may have to wait for one
//! another, and the sum of the time-outs does.

use kerbside_messages::{Nanos, Process, Truth, seconds};
use kerbside_safety::bounds;

use super::Invariant;
use super::permit::Grant;
use crate::lockstep::{Fault, Kind, LineMishap, Wire, World};
use crate::service::Service;

/// A vehicle stands below this speed \[m/s\].
const REST: f64 = 1e-3;
/// Rounding, and the motion of one tick of truth \[m\].
const ROUNDING: f64 = 1e-3;
/// Faults count as together where one begins within so long of the other's end \[ns\].
const TOGETHER: Nanos = 2_000_000_000;
/// A fault that lasts so long starves what it concerns beyond every time-out \[ns\].
const LONG: Nanos = 350_000_000;

/// How a vehicle stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// The fastest it went \[m/s\].
    pub speed: f64,
    /// Rolled until it stood \[m\].
    pub rolled: f64,
    /// What the inequality allows \[m\].
    pub bound: f64,
    /// Time until it stood \[s\].
    pub seconds: f64,
    /// Whether a single fault led to it.
    pub single: bool,
}

/// A stop under way.
#[derive(Clone, Debug)]
struct Pending {
    since: Nanos,
    distance: f64,
    fastest: f64,
    moved: Nanos,
    /// The arm it ends; a newer one ends it.
    arm: u64,
    cause: Cause,
    why: String,
}

/// What a stop is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cause {
    /// The permit ended: it is over when the vehicle stands.
    Permit,
    /// A fault while the vehicle drove: it is over when its time is, not when the vehicle stands for the first time.
    Driving,
    /// A fault while the vehicle, armed, had not moved yet: nothing forbids a first motion after its end.
    Standing {
        /// End of the fault.
        until: Nanos,
    },
}

/// The newest permit, and what the vehicle did since it was sent.
#[derive(Clone, Copy, Debug)]
struct Granted {
    grant: Grant,
    distance: f64,
    fastest: f64,
}

#[derive(Debug)]
pub(super) struct StopWatch {
    timeout: f64,
    timeouts: f64,
    response: f64,
    settle: f64,
    deceleration: f64,
    cycle: Nanos,
    truth: Truth,
    granted: Option<Granted>,
    ended: u64,
    /// The newest arm that the vehicle moved in.
    driven: u64,
    faults: usize,
    pending: Vec<Pending>,
    done: Vec<Stop>,
}

impl StopWatch {
    pub(super) fn new(service: &Service) -> Self {
        let (vehicle, safety) = (&service.vehicle, service.safety());
        let response = vehicle.response();
        let timeouts = &safety.timeouts;
        let sum = timeouts.freshness + timeouts.permit + timeouts.vehicle_silence;
        Self {
            timeout: bounds::longest_timeout(safety),
            timeouts: (sum + 3 * safety.actuation_period + safety.cycle).as_secs_f64(),
            response: response.speed_delay + response.speed_lag,
            settle: bounds::stop_times(vehicle, safety).settle.as_secs_f64(),
            deceleration: vehicle.limits.deceleration,
            cycle: crate::life::nanos(safety.cycle),
            truth: Truth::default(),
            granted: None,
            ended: 0,
            driven: 0,
            faults: 0,
            pending: Vec::new(),
            done: Vec::new(),
        }
    }

    pub(super) fn done(&self) -> &[Stop] {
        &self.done
    }

    pub(super) fn is_pending(&self) -> bool {
        !self.pending.is_empty()
    }

    pub(super) fn look(
        &mut self,
        world: &World,
        grant: Option<Grant>,
    ) -> Result<(), (Invariant, String)> {
        if let Some(truth) = &world.fresh.truth {
            self.truth = *truth;
        }
        self.note_faults(world, grant);
        if let Some(grant) = grant.filter(|_| self.truth.speed.abs() >= REST) {
            self.driven = grant.arm;
        }
        self.note_end(world.now(), grant);
        if self.pending.is_empty() {
            return Ok(());
        }
        let arm = grant.map_or(0, |grant| grant.arm);
        self.pending.retain(|pending| pending.arm == arm);
        let mut pending = core::mem::take(&mut self.pending);
        for one in &mut pending {
            self.follow(one, world)?;
        }
        pending.retain(|one| !self.is_over(one, world));
        self.pending = pending;
        Ok(())
    }

    /// Faults that no stack can drive on with.
    fn note_faults(&mut self, world: &World, grant: Option<Grant>) {
        let begun = world.begun();
        let permitted = grant.is_some_and(|grant| grant.withdrawn.is_none());
        for fault in &begun[self.faults..] {
            if permitted && stops(fault) {
                let (since, now) = (World::time_of(fault), self.now());
                let cause = if grant.is_some_and(|grant| grant.arm == self.driven) {
                    Cause::Driving
                } else {
                    Cause::Standing { until: since + fault.kind.span() }
                };
                self.begin(since, now, grant, cause, fault.to_string());
            }
        }
        self.faults = begun.len();
    }

    /// The end of a permit: withdrawn, or run out because no further one came.
    fn note_end(&mut self, now: Nanos, grant: Option<Grant>) {
        let Some(newest) = grant else { return };
        let (distance, speed) = self.now();
        let known = match self.granted {
            Some(known) if known.grant.sent == newest.sent => {
                Granted { fastest: known.fastest.max(speed), ..known }
            }
            _ => Granted { grant: newest, distance, fastest: speed },
        };
        self.granted = Some(known);
        if self.ended == newest.arm {
            return;
        }
        if let Some(at) = newest.withdrawn {
            self.ended = newest.arm;
            self.begin(
                at,
                (distance, speed),
                grant,
                Cause::Permit,
                "the permit was withdrawn".to_owned(),
            );
        } else if now > known.grant.sent + 3 * self.cycle && now >= known.grant.expiry {
            self.ended = newest.arm;
            let (since, then) = (known.grant.sent, (known.distance, known.fastest));
            self.begin(since, then, grant, Cause::Permit, "the permit ran out".to_owned());
        }
    }

    /// The vehicle's distance and speed \[m, m/s\].
    fn now(&self) -> (f64, f64) {
        (self.truth.distance, self.truth.speed.abs())
    }

    fn begin(
        &mut self,
        since: Nanos,
        (distance, fastest): (f64, f64),
        grant: Option<Grant>,
        cause: Cause,
        why: String,
    ) {
        let arm = grant.map_or(0, |grant| grant.arm);
        self.pending.push(Pending { since, distance, fastest, moved: since, arm, cause, why });
    }

    fn follow(&self, one: &mut Pending, world: &World) -> Result<(), (Invariant, String)> {
        let speed = self.truth.speed.abs();
        one.fastest = one.fastest.max(speed);
        if speed >= REST {
            one.moved = world.now();
        }
        let (distance, time) = self.bounds(one, world);
        let rolled = self.truth.distance - one.distance;
        let taken = seconds(one.moved - one.since);
        if rolled <= distance && taken <= time {
            return Ok(());
        }
        let words = format!(
            "rolled {:.1} cm of {:.1} in {taken:.3} s of {time:.3} from {:.3} m/s since: {}",
            100.0 * rolled,
            100.0 * distance,
            one.fastest,
            one.why
        );
        Err((Invariant::Stop, words))
    }

    /// What is allowed from its fastest speed \[m, s\].
    fn bounds(&self, one: &Pending, world: &World) -> (f64, f64) {
        let single = is_single(world, one.since);
        let timeout = if single { self.timeout } else { self.timeouts };
        let (v, a) = (one.fastest, self.deceleration);
        let distance = v * (timeout + self.response) + v * v / (2.0 * a) + ROUNDING;
        // A stopped simulated vehicle's time stands still.
        let stood = world.begun().iter().filter_map(|fault| match fault.kind {
            Kind::Stall { process: Process::Vehicle, span } => Some(seconds(span)),
            _ => None,
        });
        (distance, timeout + self.settle + v / a + stood.sum::<f64>())
    }

    fn is_over(&mut self, one: &Pending, world: &World) -> bool {
        let stands = self.truth.speed.abs() < REST;
        let (bound, time) = self.bounds(one, world);
        let passed = seconds(world.now() - one.since) > time;
        let over = stands
            && match one.cause {
                Cause::Permit => true,
                Cause::Driving => passed,
                Cause::Standing { until } => passed || world.now() >= until,
            };
        if over && one.fastest > 0.01 {
            self.done.push(Stop {
                speed: one.fastest,
                rolled: self.truth.distance - one.distance,
                bound,
                seconds: seconds(one.moved - one.since),
                single: is_single(world, one.since),
            });
        }
        over
    }
}

/// Whether at most one fault was under way since a while before `since`.
fn is_single(world: &World, since: Nanos) -> bool {
    let together = |fault: &&Fault| World::time_of(fault) + fault.kind.span() + TOGETHER >= since;
    world.begun().iter().filter(together).count() <= 1
}

/// Whether the vehicle has to stop for such a fault, whoever notices it.
fn stops(fault: &Fault) -> bool {
    let long = fault.kind.span() >= LONG;
    match &fault.kind {
        Kind::Kill(process) => process.on_control_path() || *process == Process::Supervisor,
        Kind::Stall { process, .. } => {
            long && (process.on_control_path() || *process == Process::Supervisor)
        }
        Kind::Samples { wire, reader, mishap, .. } => {
            long && mishap.starves(LONG) && concerns_the_path(*wire, *reader)
        }
        Kind::Line { mishap: LineMishap::Silence, .. } => long,
        Kind::Reboot => true,
        _ => false,
    }
}

fn concerns_the_path(wire: Wire, reader: Option<Process>) -> bool {
    !matches!(wire, Wire::Heartbeat(_)) && reader.is_none_or(Process::on_control_path)
}
