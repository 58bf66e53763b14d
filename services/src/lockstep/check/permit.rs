//! Without a live permit of the current arm nothing but the stop ramp or zero; and no permit without an arm.

use kerbside_messages::{Actuator, Nanos, Permit, seconds};

use super::Invariant;
use crate::life::nanos;
use crate::lockstep::World;
use crate::service::Service;

/// Rounding: of the gate's ramp, and of single precision on the line \[m/s, rad\].
const ROUNDING: f64 = 1e-6;
/// A vehicle that stands does not go faster than this \[m/s\].
const REST: f64 = 1e-3;
/// What is on its way to a vehicle that stands has had its effect after so long \[ns\].
const EFFECT: Nanos = 700_000_000;
/// One that goes faster than this moves: what is between is the end of its lag \[m/s\].
const MOVES: f64 = 5e-3;

type Verdict = Result<(), (Invariant, String)>;

/// A permit as the supervisor issued it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grant {
    /// Its count of arms.
    pub(crate) arm: u64,
    /// When it was issued \[ns\].
    pub(crate) sent: Nanos,
    /// When it ends \[ns\].
    pub(crate) expiry: Nanos,
    /// Whether the supervisor has withdrawn it since.
    pub(crate) withdrawn: Option<Nanos>,
}

/// The newest output of the gate, or what the interface wrote of it.
#[derive(Clone, Copy, Debug)]
struct Output {
    at: Nanos,
    epoch: u64,
    speed: f64,
    steering: f64,
}

#[derive(Debug)]
pub(super) struct PermitWatch {
    deceleration: f64,
    freshness: Nanos,
    grant: Option<Grant>,
    output: Option<Output>,
    delivered: f64,
    /// Since when the vehicle stands \[ns\].
    stands: Option<Nanos>,
    /// Since when it is to stand \[ns\].
    stopped: Option<Nanos>,
    /// The arm under which the vehicle came to rest after its permit had ended, or after it had stopped by itself.
    rested: Option<u64>,
    /// The arm under which the vehicle stopped by itself, for silence.
    silenced: Option<u64>,
}

impl PermitWatch {
    pub(super) fn new(service: &Service) -> Self {
        Self {
            deceleration: service.vehicle.limits.deceleration,
            freshness: nanos(service.safety().timeouts.freshness),
            grant: None,
            output: None,
            delivered: 0.0,
            stands: None,
            stopped: None,
            rested: None,
            silenced: None,
        }
    }

    /// The newest permit that granted something.
    pub(super) fn grant(&self) -> Option<Grant> {
        self.grant
    }

    pub(super) fn look(&mut self, world: &World) -> Verdict {
        let fresh = &world.fresh;
        if let Some(actuator) = &fresh.actuator {
            self.gate(world.now(), actuator)?;
        }
        if let Some(actuator) = &fresh.delivered {
            self.line(world.now(), actuator)?;
        }
        if let Some(permit) = &fresh.permit {
            self.permit(permit, world.arms_granted())?;
        }
        self.motion(world)
    }

    fn permit(&mut self, permit: &Permit, arms: u64) -> Verdict {
        let now = permit.header.sent;
        if permit.granted == 0 {
            if let Some(grant) = &mut self.grant {
                grant.withdrawn.get_or_insert(now);
            }
            return Ok(());
        }
        if permit.arm > arms {
            let words =
                format!("a permit of arm {}, but the operator armed {arms} times", permit.arm);
            return Err((Invariant::Rearm, words));
        }
        let before = self.grant.filter(|grant| permit.arm <= grant.arm);
        if let Some(grant) = before
            && (permit.arm < grant.arm || grant.withdrawn.is_some())
        {
            let words = format!("a permit of arm {} after that arm was over", permit.arm);
            return Err((Invariant::Rearm, words));
        }
        self.grant =
            Some(Grant { arm: permit.arm, sent: now, expiry: permit.expiry, withdrawn: None });
        Ok(())
    }

    /// What leaves the gate.
    fn gate(&mut self, now: Nanos, actuator: &Actuator) -> Verdict {
        let output = Output {
            at: now,
            epoch: actuator.header.epoch,
            speed: actuator.speed,
            steering: actuator.steering,
        };
        let before = self.output.replace(output);
        let live = |grant: &Grant| grant.arm == actuator.arm && now < grant.expiry;
        if self.grant.as_ref().is_some_and(live) {
            return Ok(());
        }
        // A gate that starts stands.
        let before = before.filter(|before| before.epoch == output.epoch);
        let (speed, steering, at) =
            before.map_or((0.0, 0.0, now), |before| (before.speed, before.steering, before.at));
        let step = self.deceleration * seconds(now - at);
        let ramp = (speed.abs() - step).max(0.0) * speed.signum();
        if (output.speed - ramp).abs() > ROUNDING || (output.steering - steering).abs() > ROUNDING {
            let words = format!(
                "the gate asks for {:.4} m/s without a permit, the stop ramp is at {ramp:.4}; arm {}, steering {:+.4} rad",
                output.speed,
                actuator.arm,
                output.steering - steering
            );
            return Err((Invariant::Permit, words));
        }
        Ok(())
    }

    /// What goes on the line: a command may be as old as the freshness limit, a ramp may be seen in parts.
    fn line(&mut self, now: Nanos, actuator: &Actuator) -> Verdict {
        let before = core::mem::replace(&mut self.delivered, actuator.speed);
        let late = self.freshness + 2_000_000;
        let live = |grant: &Grant| grant.arm == actuator.arm && now < grant.expiry + late;
        let slower =
            actuator.speed.abs() <= before.abs() + ROUNDING && actuator.speed * before >= 0.0;
        if self.grant.as_ref().is_some_and(live) || slower {
            return Ok(());
        }
        let words = format!(
            "{:.4} m/s reach the vehicle without a permit, after {before:.4}",
            actuator.speed
        );
        Err((Invariant::Permit, words))
    }

    /// A vehicle that was stopped and stands does not move before a newer arm.
    fn motion(&mut self, world: &World) -> Verdict {
        let Some(truth) = &world.fresh.truth else { return Ok(()) };
        let now = world.now();
        let arm = self.grant.map_or(0, |grant| grant.arm);
        let live = self.grant.is_some_and(|grant| now < grant.expiry && grant.withdrawn.is_none());
        let speed = truth.speed.abs();
        if self.rested.is_some_and(|rested| rested < arm) {
            self.rested = None;
        }
        if truth.silent == 1 && speed > MOVES {
            self.silenced = Some(arm);
        }
        self.stands = if speed < REST { self.stands.or(Some(now)) } else { None };
        let stopped = !live || self.silenced == Some(arm);
        self.stopped = if stopped { self.stopped.or(Some(now)) } else { None };
        let long = |since: Nanos| now - since >= EFFECT;
        if self.stopped.is_some_and(long) && self.stands.is_some_and(long) {
            self.rested = Some(arm);
        }
        if self.rested.is_some() && speed > MOVES {
            let words = format!("moves at {speed:.4} m/s after it was stopped under arm {arm}");
            return Err((Invariant::Rearm, words));
        }
        Ok(())
    }
}
