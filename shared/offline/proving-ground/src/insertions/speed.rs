//! Between the commanded speed and the motor.

use super::Effect;

/// What is put in there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Speed {
    gain: f64,
    dead_zone: f64,
    /// Beside the vehicle's own \[s\].
    pub(crate) delay: f64,
    lag: f64,
    limit: f64,
    /// Share of the gain that is lost every second \[1/s\].
    sag: f64,
    weak_reverse: f64,
    droop: f64,
    slow_release: f64,
    /// Top speed, against which the droop is stated \[m/s\].
    top: f64,
}

impl Speed {
    pub(crate) fn neutral(top: f64) -> Self {
        Self {
            gain: 1.0,
            dead_zone: 0.0,
            delay: 0.0,
            lag: 0.0,
            limit: f64::INFINITY,
            sag: 0.0,
            weak_reverse: 0.0,
            droop: 0.0,
            slow_release: 0.0,
            top,
        }
    }

    pub(crate) fn take(&mut self, effect: &Effect) {
        match effect.id {
            "speed_gain" => self.gain = effect.get("gain"),
            "speed_delay" => self.delay = effect.get("delay"),
            "speed_lag" => self.lag = effect.get("lag"),
            "speed_dead_zone" => self.dead_zone = effect.get("width"),
            "acceleration_limit" => self.limit = effect.get("limit"),
            "battery_sag" => self.sag = effect.get("rate"),
            "weak_reverse" => self.weak_reverse = effect.get("loss"),
            "quadratic_droop" => self.droop = effect.get("loss"),
            "slow_release" => self.slow_release = effect.get("lag"),
            _ => {}
        }
    }

    /// What the motor is told at `time` \[s\] where `command` \[m/s\] was sent; before its range is limited.
    pub(crate) fn asked(&self, command: f64, time: f64) -> f64 {
        let mut asked = self.gain * command;
        asked *= 1.0 - self.sag * time;
        if command < 0.0 {
            asked *= 1.0 - self.weak_reverse;
        }
        asked *= 1.0 - self.droop * (asked / self.top).abs();
        if asked.abs() < self.dead_zone { 0.0 } else { asked }
    }

    /// Rate of the motor's speed `value`, told to reach `target` \[m/s\], with the vehicle's own `lag` \[s\] and `limit`
    /// \[m/s^2\].
    pub(crate) fn rate(&self, value: f64, target: f64, lag: f64, limit: f64) -> f64 {
        let mut lag = lag + self.lag;
        if target.abs() < value.abs() {
            lag += self.slow_release;
        }
        let limit = limit.min(self.limit);
        ((target - value) / lag).clamp(-limit, limit)
    }
}
