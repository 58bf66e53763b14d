//! A fault under way: what it does to the vehicle and to its process, judged on the vehicle's truth.

use kerbside_messages::{Mode, Nanos, Process, ProcessState, State, Truth, seconds};
use kerbside_safety::bounds;

use super::strike::Blow;
use crate::service::Service;

/// A vehicle stands below this speed \[m/s\].
const REST: f64 = 1e-3;
/// Rounding and a truth's period \[m\].
const ROUNDING: f64 = 1e-3;
/// A process that is not back after so long does not come back \[ns\].
const BACK: Nanos = 15_000_000_000;

/// What the stop-distance inequality allows.
#[derive(Clone, Copy, Debug)]
pub struct Allowed {
    timeout: f64,
    response: f64,
    settle: f64,
    deceleration: f64,
}

impl Allowed {
    /// Of this vehicle with these time-outs.
    #[must_use]
    pub fn of(service: &Service) -> Self {
        let (vehicle, safety) = (&service.vehicle, service.safety());
        let response = vehicle.response();
        Self {
            timeout: bounds::longest_timeout(safety),
            response: response.speed_delay + response.speed_lag,
            settle: bounds::stop_times(vehicle, safety).settle.as_secs_f64(),
            deceleration: vehicle.limits.deceleration,
        }
    }

    /// From a speed \[m/s\]: distance \[m\] and time \[s\].
    #[must_use]
    pub fn from(&self, speed: f64) -> (f64, f64) {
        let (v, a) = (speed, self.deceleration);
        let distance = v * (self.timeout + self.response) + v * v / (2.0 * a) + ROUNDING;
        (distance, self.timeout + self.settle + v / a)
    }
}

/// A fault that was injected, with what has been seen of it.
#[derive(Clone, Debug)]
pub struct Flight {
    /// Whom it befell.
    pub process: Process,
    /// What.
    pub blow: Blow,
    /// In which mode.
    pub mode: Mode,
    /// When \[ns\].
    pub at: Nanos,
    /// Who was struck.
    pub pid: u32,
    /// The fastest the vehicle went since \[m/s\].
    pub fastest: f64,
    /// Rolled since \[m\].
    pub rolled: f64,
    /// Until when it moved \[ns\].
    pub moved: Nanos,
    /// The simulated vehicle's own time of the blow, and until when it moved \[ns\]: where the machine starves it, it stands
    /// still in the middle of its motion.
    own: (Nanos, Nanos),
    /// Whether a stalled process was let go on.
    pub resumed: bool,
    /// When its process died, by us or by its supervisor \[ns\].
    died: Option<Nanos>,
    /// When it was back \[ns\].
    back: Option<Nanos>,
    /// Whether motion ended for it.
    pub stopped: bool,
    distance: f64,
    moving: bool,
    arms: u64,
    left: bool,
}

/// What became of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// Not over yet.
    Flying,
    /// All is as it should be again.
    Over,
    /// It did not stop within the bound.
    NotStopped,
    /// What failed did not come back.
    NotBack,
}

impl Flight {
    /// A blow at `at`.
    #[must_use]
    pub fn new(
        process: Process,
        blow: Blow,
        pid: u32,
        at: Nanos,
        state: &State,
        truth: &Truth,
    ) -> Self {
        let moving = truth.speed.abs() >= REST;
        let own = truth.vehicle_time + at.saturating_sub(truth.header.stamp);
        Self {
            process,
            blow,
            mode: state.mode(),
            at,
            pid,
            fastest: truth.speed.abs(),
            rolled: 0.0,
            moved: at,
            own: (own, own),
            resumed: false,
            died: (blow == Blow::Kill).then_some(at),
            back: None,
            stopped: false,
            distance: truth.distance,
            moving,
            arms: state.arms,
            left: false,
        }
    }

    /// When a stalled process is to go on \[ns\].
    #[must_use]
    pub fn resume_at(&self) -> Option<Nanos> {
        match self.blow {
            Blow::Stall(span) if !self.resumed => Some(self.at + span),
            _ => None,
        }
    }

    /// Takes in a truth. What moves under a later arm is no longer this fault's.
    pub fn truth(&mut self, truth: &Truth, arms: u64) {
        if truth.header.stamp <= self.at || arms > self.arms {
            return;
        }
        let speed = truth.speed.abs();
        self.fastest = self.fastest.max(speed);
        self.rolled = truth.distance - self.distance;
        if speed >= REST {
            self.moved = truth.header.stamp;
            self.own.1 = truth.vehicle_time.max(self.own.0);
        }
    }

    /// Takes in a state.
    pub fn state(&mut self, state: &State) {
        if state.header.sent <= self.at {
            return;
        }
        self.left |= !matches!(state.mode(), Mode::Driving | Mode::Armed | Mode::Done);
        let row = state.rows().iter().find(|row| row.process == self.process as u8);
        let Some(row) = row else { return };
        if row.pid != self.pid {
            self.died.get_or_insert(state.header.sent);
        }
        let healthy = row.state == ProcessState::Healthy.code();
        if self.died.is_some() && row.pid != self.pid && healthy && state.healthy == 1 {
            self.back.get_or_insert(state.header.sent);
        }
    }

    /// What has become of it at `now`, with the newest state.
    pub fn course(&mut self, now: Nanos, state: &State, allowed: &Allowed) -> Course {
        let (distance, time) = allowed.from(self.fastest);
        let stood = seconds(now.saturating_sub(self.moved)) > 0.1;
        let must_stop = self.blow.must_stop(self.process) && self.moving;
        let judged = must_stop || self.left;
        self.stopped |= stood && self.left;
        let taken = self.stop_time();
        if must_stop && (self.rolled > distance || taken > time) {
            return Course::NotStopped;
        }
        let whole =
            self.back.is_some() || (self.died.is_none() && self.is_resumed() && state.healthy == 1);
        let settled = !judged || stood || state.arms > self.arms;
        if whole && settled && now > self.at + 300_000_000 {
            return Course::Over;
        }
        if now > self.at + BACK { Course::NotBack } else { Course::Flying }
    }

    fn is_resumed(&self) -> bool {
        self.blow == Blow::Kill || self.resumed
    }

    /// From its process's death to a stack that is whole again \[s\].
    #[must_use]
    pub fn recovery(&self) -> Option<f64> {
        Some(seconds(self.back?.saturating_sub(self.died?)))
    }

    /// Time until the vehicle stood, by the host's clock or by its own, where the machine let it live for less \[s\].
    #[must_use]
    pub fn stop_time(&self) -> f64 {
        seconds((self.moved - self.at).min(self.own.1 - self.own.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerbside_messages::Header;

    #[test]
    fn a_vehicle_that_the_machine_starves_is_timed_by_its_own_clock() {
        let ms = 1_000_000;
        let truth = |stamp: Nanos, own: Nanos, speed: f64| Truth {
            header: Header::stamped(stamp * ms, 0),
            vehicle_time: own * ms,
            speed,
            ..Truth::default()
        };
        let stall = Blow::Stall(1_500 * ms);
        let begun = truth(1_000, 400, 0.2);
        let mut flight =
            Flight::new(Process::Actuation, stall, 1, 1_010 * ms, &State::default(), &begun);
        flight.truth(&truth(1_500, 900, 0.1), 0);
        assert!((flight.stop_time() - 0.49).abs() < 1e-9);
        // Nothing for most of a second, and it goes on where it was.
        flight.truth(&truth(2_400, 920, 0.09), 0);
        flight.truth(&truth(2_900, 1_420, 0.0), 0);
        assert!((flight.stop_time() - 0.51).abs() < 1e-9, "{}", flight.stop_time());
    }
}
