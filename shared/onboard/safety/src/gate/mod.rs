//! The actuation gate: the last decision before the vehicle.

mod slew;
#[cfg(test)]
mod tests;

use kerbside_geometry::Limits;
use kerbside_messages::{
    Actuator, AlterReason, Command, Header, Inhibit, Message, Nanos, Permit, TrackingPhase, seconds,
};

use crate::{Inhibits, SafetySettings, fresh, ns};

/// What the gate sees at a step: the newest admitted sample of each topic. They stand until newer
/// ones come, so their age is judged by the gate, against `now`.
#[derive(Clone, Copy, Debug, Default)]
pub struct GateInputs<'a> {
    /// The newest command.
    pub command: Option<&'a Command>,
    /// The newest permit.
    pub permit: Option<&'a Permit>,
    /// The newest inhibit.
    pub inhibit: Option<&'a Inhibit>,
    /// A newer command came and was refused at its reception.
    pub invalid_command: bool,
}

/// Which arm a permit belongs to: counts start anew with each life of the supervisor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
struct Arm {
    epoch: u64,
    count: u64,
}

impl Arm {
    fn of(permit: &Permit) -> Self {
        Self { epoch: permit.header.epoch, count: permit.arm }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Passage {
    /// No permit has opened it yet.
    Closed,
    /// Open; no command of this arm has come.
    Waiting,
    /// Open; the freshness limit is armed.
    Following,
    /// Shut until a newer arm.
    Latched(AlterReason),
}

/// The actuation gate.
///
/// Nothing moves without a live permit and a fresh command of the same arm. What passes is cut to
/// the vehicle's limits of speed, acceleration, steering and steering rate. A permit that ended, an
/// inhibit in force, a command too old or malformed, or a tracker that gave up make it brake at
/// `limits.deceleration` with the steering held; and it latches: whatever comes afterwards, it
/// stays shut until a permit of a newer arm than any it has seen.
///
/// A gate opens only for an arm that it saw beginning: the first permit it ever sees, if granted
/// already, latches it. So a gate that was restarted in the middle of a drive does not go on by
/// itself, even when nobody noticed.
///
/// The freshness limit is armed by the first fresh command of an arm; until then the vehicle stands
/// and waits. It does not apply to a finished tracker's command of zero speed, which asks for
/// nothing.
#[derive(Clone, Debug)]
pub struct Gate {
    limits: Limits,
    freshness: Nanos,
    permit_life: Nanos,
    inhibits: Inhibits,
    /// The newest arm any permit named, granted or not.
    seen: Option<Arm>,
    /// The arm it acts or acted under.
    acted: u64,
    passage: Passage,
    speed: f64,
    steering: f64,
    last: Option<Nanos>,
}

impl Gate {
    /// A gate that stands, with the steering at zero.
    #[must_use]
    pub fn new(limits: &Limits, settings: &SafetySettings) -> Self {
        Self {
            limits: *limits,
            freshness: ns(settings.timeouts.freshness),
            permit_life: ns(settings.timeouts.permit),
            inhibits: Inhibits::default(),
            seen: None,
            acted: 0,
            passage: Passage::Closed,
            speed: 0.0,
            steering: 0.0,
            last: None,
        }
    }

    /// Takes up an inhibit between steps: with several in one wake-up none may be passed over.
    pub fn inhibit(&mut self, inhibit: &Inhibit) {
        self.inhibits.note(inhibit);
    }

    /// Decides what goes to the vehicle at `now` \[ns\]; to be called on each command and at least
    /// every `actuation_period`. Fills all of `out` but what the sender adds to the header.
    ///
    /// A `now` before that of the previous step counts as that one.
    pub fn step(&mut self, now: Nanos, inputs: GateInputs<'_>, out: &mut Actuator) {
        let last = self.last.unwrap_or(now);
        let now = now.max(last);
        self.last = Some(now);
        if let Some(inhibit) = inputs.inhibit {
            self.inhibits.note(inhibit);
        }
        if let Some(permit) = inputs.permit {
            self.open(now, permit);
        }
        let decision = self.decide(now, &inputs);
        let reason = match decision {
            Ok(command) => self.follow(command, seconds((now - last).min(self.freshness))),
            Err(reason) => {
                self.speed =
                    slew::toward(self.speed, 0.0, self.limits.deceleration * seconds(now - last));
                reason
            }
        };
        self.fill(now, decision.ok(), reason, out);
    }

    /// Opens for a live permit of an arm newer than all seen.
    fn open(&mut self, now: Nanos, permit: &Permit) {
        let arm = Arm::of(permit);
        let newer = self.seen.is_none_or(|seen| arm > seen);
        if newer && self.live(now, permit) {
            self.acted = arm.count;
            self.passage = match self.seen {
                Some(_) => Passage::Waiting,
                None => Passage::Latched(AlterReason::Latched),
            };
        }
        self.seen = self.seen.max(Some(arm));
    }

    /// Granted, not over, and not older than a permit's configured life, whatever its own expiry.
    fn live(&self, now: Nanos, permit: &Permit) -> bool {
        permit.granted == 1
            && permit.arm > 0
            && now < permit.expiry
            && fresh(now, permit.header.sent, self.permit_life)
    }

    /// The command to follow, or why none.
    fn decide<'a>(
        &mut self,
        now: Nanos,
        inputs: &GateInputs<'a>,
    ) -> Result<&'a Command, AlterReason> {
        match self.passage {
            Passage::Closed => return Err(AlterReason::NoPermit),
            Passage::Latched(_) => return Err(AlterReason::Latched),
            Passage::Waiting | Passage::Following => {}
        }
        if let Some(reason) = self.objection(now, inputs) {
            self.passage = Passage::Latched(reason);
            return Err(reason);
        }
        let command = self.own_command(inputs).filter(|command| self.is_fresh(now, command));
        let command = command.ok_or(AlterReason::CommandStale)?;
        self.passage = Passage::Following;
        Ok(command)
    }

    /// Why an open gate must shut, if it must.
    fn objection(&self, now: Nanos, inputs: &GateInputs<'_>) -> Option<AlterReason> {
        let permitted = inputs
            .permit
            .is_some_and(|permit| self.live(now, permit) && self.seen == Some(Arm::of(permit)));
        if !permitted {
            return Some(AlterReason::PermitExpired);
        }
        if self.inhibits.in_force(now).is_some() {
            return Some(AlterReason::Inhibited);
        }
        if inputs.invalid_command {
            return Some(AlterReason::CommandInvalid);
        }
        match self.own_command(inputs) {
            Some(command) => self.command_objection(now, command),
            None if self.passage == Passage::Following => Some(AlterReason::CommandStale),
            None => None,
        }
    }

    fn command_objection(&self, now: Nanos, command: &Command) -> Option<AlterReason> {
        if command.validate().is_err() {
            return Some(AlterReason::CommandInvalid);
        }
        if command.phase == TrackingPhase::Stopped.code() {
            return Some(AlterReason::TrackerStop);
        }
        let asks_nothing = command.phase == TrackingPhase::Finished.code() && command.speed == 0.0;
        let armed = self.passage == Passage::Following && !asks_nothing;
        (armed && !self.is_fresh(now, command)).then_some(AlterReason::CommandStale)
    }

    /// The newest command, if it is of the arm the gate is open for.
    fn own_command<'a>(&self, inputs: &GateInputs<'a>) -> Option<&'a Command> {
        inputs.command.filter(|command| command.arm == self.acted)
    }

    /// Sent lately, and caused by a reading that is not older either.
    fn is_fresh(&self, now: Nanos, command: &Command) -> bool {
        fresh(now, command.header.sent, self.freshness)
            && fresh(now, command.header.origin, self.freshness)
    }

    /// Goes toward the command as far as the limits allow within `dt` \[s\].
    fn follow(&mut self, command: &Command, dt: f64) -> AlterReason {
        let limits = &self.limits;
        let speed = slew::within(command.speed, limits.speed);
        self.speed =
            slew::speed(self.speed, speed, limits.acceleration * dt, limits.deceleration * dt);
        let steering = slew::within(command.steering, limits.steering);
        self.steering = slew::toward(self.steering, steering, limits.steering_rate * dt);
        if slew::same(self.speed, command.speed) && slew::same(self.steering, command.steering) {
            AlterReason::None
        } else {
            AlterReason::Limited
        }
    }

    fn fill(
        &self,
        now: Nanos,
        followed: Option<&Command>,
        reason: AlterReason,
        out: &mut Actuator,
    ) {
        let latch = match self.passage {
            Passage::Latched(reason) => reason,
            _ => AlterReason::None,
        };
        *out = Actuator {
            header: Header::stamped(now, followed.map_or(0, |command| command.header.origin)),
            speed: self.speed,
            steering: self.steering,
            arm: self.acted,
            command: followed.map_or(0, |command| command.header.sequence),
            reason: reason.code(),
            latch: latch.code(),
            ..Actuator::default()
        };
    }
}
