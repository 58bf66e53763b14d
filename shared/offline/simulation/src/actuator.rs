//! What both actuators share: a command waits, is cut to the limit, and is approached through a
//! lag.

use crate::delay::Delay;
use crate::lag::Lag;
use crate::plant::Actuation;

/// Gain, dead zone, delay, limit, lag.
#[derive(Clone, Debug)]
pub(crate) struct Actuator {
    commands: Delay,
    gain: f64,
    dead_zone: f64,
    limit: f64,
    lag: Lag,
}

impl Actuator {
    /// At rest at zero.
    pub(crate) fn new(actuation: &Actuation) -> Self {
        Self {
            commands: Delay::new(actuation.delay),
            gain: actuation.gain,
            dead_zone: actuation.dead_zone,
            limit: actuation.limit,
            lag: Lag::new(actuation.lag, actuation.rate_limit),
        }
    }

    /// Takes in a command stamped `stamp` \[s\].
    pub(crate) fn command(&mut self, stamp: f64, value: f64) {
        self.commands.push(stamp, value);
    }

    /// Lets the commands act that are due at `now` \[s\]. Returns whether the value jumped.
    pub(crate) fn begin(&mut self, now: f64) -> bool {
        let due = self.commands.take(now);
        due.is_some_and(|value| self.lag.aim(self.wanted(value)))
    }

    /// The command that keeps the value where it is.
    pub(crate) fn holding(&self) -> f64 {
        self.lag.value() / self.gain
    }

    fn wanted(&self, command: f64) -> f64 {
        let wanted = command * self.gain;
        let wanted = if wanted.abs() < self.dead_zone { 0.0 } else { wanted };
        wanted.clamp(-self.limit, self.limit)
    }

    /// When the next command begins to act \[s\].
    pub(crate) fn next(&self) -> f64 {
        self.commands.next()
    }

    /// The lag behind the limit.
    pub(crate) fn lag(&self) -> &Lag {
        &self.lag
    }

    /// Moves on to a value that the lag foretold.
    pub(crate) fn move_to(&mut self, value: f64) {
        self.lag.move_to(value);
    }
}
