//! A first-order lag whose rate is limited, solved exactly.

use kerbside_geometry::math;

/// A lag shorter than this counts as none \[s\].
const SHORTEST: f64 = 1e-6;
/// Within this of its target a value is there: below the rounding of any speed \[m/s\] or angle
/// \[rad\] in use.
const SETTLED: f64 = 1e-15;
/// So far beyond the rate limit still counts as within it, so that rounding cannot keep a ramp
/// alive.
const TOLERANCE: f64 = 1e-12;
/// A quarter of a per mille of the change per step is what Simpson's rule loses on an exponential
/// of this step, in lags.
const RESOLUTION: f64 = 0.5;

/// `value' = (target - value) / lag`, cut to `+-limit`: first a ramp, then an exponential decay.
#[derive(Clone, Debug)]
pub(crate) struct Lag {
    value: f64,
    target: f64,
    lag: f64,
    limit: f64,
}

/// How the value moves until the next kink.
enum Phase {
    Settled,
    Ramp { rate: f64 },
    Decay,
}

impl Lag {
    /// At rest at zero; `lag` \[s\], `limit` of the rate \[1/s\], possibly infinite.
    pub(crate) fn new(lag: f64, limit: f64) -> Self {
        let lag = if lag < SHORTEST { 0.0 } else { lag };
        Self { value: 0.0, target: 0.0, lag, limit }
    }

    /// The value now.
    pub(crate) fn value(&self) -> f64 {
        self.value
    }

    /// Aims at `target`. Returns whether the value jumped there, as it does without lag and limit.
    pub(crate) fn aim(&mut self, target: f64) -> bool {
        self.target = target;
        let jumps = self.lag == 0.0 && self.limit.is_infinite() && self.value != target;
        if jumps {
            self.value = target;
        }
        jumps
    }

    /// Longest time over which the value is smooth enough for one step of the quadrature \[s\].
    pub(crate) fn smooth(&self) -> f64 {
        match self.phase() {
            Phase::Settled => f64::INFINITY,
            Phase::Ramp { rate } => self.ramp_end(rate).0,
            Phase::Decay => RESOLUTION * self.lag,
        }
    }

    /// The values after half of `step` \[s\] and after all of it. `step` is at most
    /// [`Self::smooth`].
    pub(crate) fn ahead(&self, step: f64) -> [f64; 2] {
        match self.phase() {
            Phase::Settled => [self.value; 2],
            Phase::Ramp { rate } => {
                let (duration, end) = self.ramp_end(rate);
                let full = if step < duration { self.value + rate * step } else { end };
                [self.value + rate * (0.5 * step), full]
            }
            Phase::Decay => self.decay(step),
        }
    }

    /// Rates now and at the two values that [`Self::ahead`] foretells, all on this side of the next
    /// kink \[1/s\].
    pub(crate) fn rates(&self, ahead: &[f64; 2]) -> [f64; 3] {
        match self.phase() {
            Phase::Settled => [0.0; 3],
            Phase::Ramp { rate } => [rate; 3],
            Phase::Decay if self.lag == 0.0 => [0.0; 3],
            Phase::Decay => {
                [self.value, ahead[0], ahead[1]].map(|value| (self.target - value) / self.lag)
            }
        }
    }

    /// Time until the value passes through zero \[s\]; infinity where it does not.
    pub(crate) fn zero(&self) -> f64 {
        if self.value * self.target >= 0.0 {
            return f64::INFINITY;
        }
        match self.phase() {
            Phase::Settled => f64::INFINITY,
            // A ramp that ends before zero is left to the decay after it.
            Phase::Ramp { rate } => -self.value / rate,
            Phase::Decay => self.lag * math::ln((self.target - self.value) / self.target),
        }
    }

    /// Moves on to `value`, one of [`Self::ahead`].
    pub(crate) fn move_to(&mut self, value: f64) {
        self.value = value;
    }

    fn decay(&self, step: f64) -> [f64; 2] {
        if self.lag == 0.0 {
            return [self.target; 2];
        }
        let half = math::exp(-0.5 * step / self.lag);
        let gap = self.target - self.value;
        let left = gap * half * half;
        let full = if left.abs() < SETTLED { self.target } else { self.target - left };
        [self.target - gap * half, full]
    }

    fn phase(&self) -> Phase {
        let gap = self.target - self.value;
        if gap == 0.0 {
            Phase::Settled
        } else if gap.abs() > self.reach() + TOLERANCE {
            Phase::Ramp { rate: if gap > 0.0 { self.limit } else { -self.limit } }
        } else {
            Phase::Decay
        }
    }

    /// Distance from the target within which the lag itself keeps the rate below the limit.
    fn reach(&self) -> f64 {
        if self.lag == 0.0 { 0.0 } else { self.lag * self.limit }
    }

    /// Duration and last value of a ramp.
    fn ramp_end(&self, rate: f64) -> (f64, f64) {
        let end = if rate > 0.0 { self.target - self.reach() } else { self.target + self.reach() };
        (((end - self.value) / rate).max(0.0), end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(lag: &mut Lag, mut time: f64, step: f64) -> f64 {
        while time > 0.0 {
            let dt = step.min(lag.smooth()).min(time);
            let [_, end] = lag.ahead(dt);
            lag.move_to(end);
            time -= dt;
        }
        lag.value()
    }

    /// The closed solution: a ramp of limit * time, then the exponential.
    fn solution(target: f64, lag: f64, limit: f64, time: f64) -> f64 {
        let ramp = ((target.abs() - limit * lag) / limit).max(0.0);
        if time < ramp {
            return limit * time * target.signum();
        }
        let gap = target.abs() - limit * ramp;
        (target.abs() - gap * (-(time - ramp) / lag).exp()) * target.signum()
    }

    #[test]
    fn ramp_and_decay_follow_the_closed_solution() {
        for (target, step) in [(0.4, 0.005), (-0.4, 0.0017), (0.02, 0.1), (-0.02, 0.003)] {
            for time in [0.01, 0.3, 1.0, 1.2333, 1.5, 3.0] {
                let mut lag = Lag::new(0.1, 0.3);
                lag.aim(target);
                let (value, expected) =
                    (run(&mut lag, time, step), solution(target, 0.1, 0.3, time));
                assert!((value - expected).abs() < 1e-12, "{target} {time}: {value} {expected}");
            }
        }
    }

    #[test]
    fn without_lag_and_limit_the_value_jumps_and_without_lag_alone_it_ramps() {
        let mut ideal = Lag::new(0.0, f64::INFINITY);
        assert!(ideal.aim(0.3));
        assert_eq!(ideal.value(), 0.3);
        let mut ramp = Lag::new(0.0, 2.0);
        assert!(!ramp.aim(1.0));
        assert!((run(&mut ramp, 0.25, 0.01) - 0.5).abs() < 1e-12);
        assert_eq!(run(&mut ramp, 0.3, 0.01), 1.0);
    }

    #[test]
    fn an_infinite_limit_leaves_a_pure_lag() {
        let mut lag = Lag::new(0.2, f64::INFINITY);
        lag.aim(1.0);
        assert!((run(&mut lag, 0.2, 0.01) - (1.0 - (-1.0_f64).exp())).abs() < 1e-12);
    }

    #[test]
    fn a_value_is_zero_when_foretold_and_its_rate_is_its_derivative() {
        for (limit, from, to) in [(0.3, 0.4, -0.4), (0.3, -0.02, 0.01), (f64::INFINITY, 0.4, -0.2)]
        {
            let mut lag = Lag::new(0.1, limit);
            lag.move_to(from);
            lag.aim(to);
            let mut zero = lag.zero();
            while lag.smooth() < zero {
                let step = lag.smooth().min(0.01);
                let [_, end] = lag.ahead(step);
                lag.move_to(end);
                zero -= step;
                assert!((lag.zero() - zero).abs() < 1e-12, "{} {zero}", lag.zero());
            }
            assert!(lag.ahead(zero)[1].abs() < 1e-15);
            let ahead = lag.ahead(2e-6);
            let rates = lag.rates(&ahead);
            let slope = (ahead[1] - lag.value()) / 2e-6;
            assert!((rates[1] - slope).abs() < 1e-6, "{rates:?} {slope}");
            assert!((rates[0] + rates[2] - 2.0 * rates[1]).abs() < 1e-6, "{rates:?}");
        }
        let mut lag = Lag::new(0.1, 0.3);
        assert_eq!((lag.zero(), lag.rates(&[0.0; 2])), (f64::INFINITY, [0.0; 3]));
        lag.aim(0.2);
        assert_eq!(lag.zero(), f64::INFINITY, "it is there already");
    }

    #[test]
    fn every_value_comes_to_rest_exactly() {
        let mut lag = Lag::new(0.1, 0.3);
        lag.aim(0.317);
        assert_eq!(run(&mut lag, 10.0, 0.005), 0.317);
        lag.aim(0.0);
        assert_eq!(run(&mut lag, 10.0, 0.005), 0.0);
        assert_eq!(lag.smooth(), f64::INFINITY);
    }
}
