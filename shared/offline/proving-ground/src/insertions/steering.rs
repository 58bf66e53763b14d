//! Between the commanded steering and the rack.

use super::Effect;

/// A servo that sticks lets go when it is asked for the whole width, and sticks again this share of it before its target.
const SETTLED: f64 = 0.1;

/// What is put in there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Steering {
    gain: f64,
    /// Beside the vehicle's own \[s\].
    pub(crate) delay: f64,
    lag: f64,
    limit: f64,
    backlash: f64,
    stick: f64,
    uneven: f64,
    bow: f64,
    /// Full lock, against which the bow is stated \[rad\].
    lock: f64,
}

impl Steering {
    pub(crate) fn neutral(lock: f64) -> Self {
        Self {
            gain: 1.0,
            delay: 0.0,
            lag: 0.0,
            limit: f64::INFINITY,
            backlash: 0.0,
            stick: 0.0,
            uneven: 0.0,
            bow: 0.0,
            lock,
        }
    }

    pub(crate) fn take(&mut self, effect: &Effect) {
        match effect.id {
            "steering_gain" => self.gain = effect.get("gain"),
            "steering_delay" => self.delay = effect.get("delay"),
            "steering_lag" => self.lag = effect.get("lag"),
            "steering_rate_limit" => self.limit = effect.get("limit"),
            "steering_backlash" => self.backlash = effect.get("width"),
            "steering_stick" => self.stick = effect.get("width"),
            "uneven_steering" => self.uneven = effect.get("difference"),
            "bowed_steering" => self.bow = effect.get("loss"),
            _ => {}
        }
    }

    /// What the servo is told where `command` \[rad\] was sent; before its range is limited.
    pub(crate) fn asked(&self, command: f64) -> f64 {
        let side = if command < 0.0 { -0.5 } else { 0.5 };
        let asked = self.gain * command * (1.0 + side * self.uneven);
        asked * (1.0 - self.bow * (asked / self.lock).abs())
    }

    /// Rate of the servo at `value`, told to reach `target` \[rad\], with the vehicle's own `lag` \[s\] and `limit`
    /// \[rad/s\].
    pub(crate) fn rate(&self, value: f64, target: f64, stuck: bool, lag: f64, limit: f64) -> f64 {
        if stuck {
            return 0.0;
        }
        let limit = limit.min(self.limit);
        ((target - value) / (lag + self.lag)).clamp(-limit, limit)
    }

    /// Whether a servo at `value` that `was` stuck or not is stuck from now on.
    pub(crate) fn sticks(&self, was: bool, value: f64, target: f64) -> bool {
        let wanted = (target - value).abs();
        self.stick > 0.0 && wanted <= if was { self.stick } else { SETTLED * self.stick }
    }

    /// The rack behind the play, where it was at `rack` and the servo is at `servo` \[rad\].
    pub(crate) fn play(&self, rack: f64, servo: f64) -> f64 {
        let half = 0.5 * self.backlash;
        rack.clamp(servo - half, servo + half)
    }
}
