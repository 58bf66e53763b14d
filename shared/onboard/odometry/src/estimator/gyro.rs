//! The heading's turn between two looks at a wheel, from a gyro with its own rhythm.

use kerbside_messages::{FilterState, Nanos};

use crate::wheels::elapsed;

/// A yaw rate is held so long \[s\]; then a new one is awaited.
const LONGEST_HOLD: f64 = 1.0;

/// Integrates the yaw rate: held after the newest reading, by the trapezoidal rule as soon as the
/// next one is there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GyroIntegral {
    noise: f64,
    newest: Option<(f64, Nanos)>,
    reached: Nanos,
    held: f64,
    turn: f64,
    variance: f64,
    /// When it was last cleared.
    since: Option<Nanos>,
}

impl GyroIntegral {
    /// Of a gyro with this standard deviation \[rad/s\].
    pub(crate) fn new(noise: f64) -> Self {
        Self { noise, newest: None, reached: 0, held: 0.0, turn: 0.0, variance: 0.0, since: None }
    }

    /// Goes on to `stamp`, at which `rate` \[rad/s\] was read, if any was.
    pub(crate) fn advance(&mut self, stamp: Nanos, rate: Option<f64>) {
        if let Some((newest, _)) = self.newest {
            let hold = newest * elapsed(stamp, self.reached);
            self.turn += hold;
            self.held += hold;
        }
        self.reached = stamp;
        self.since.get_or_insert(stamp);
        if let Some(rate) = rate {
            self.take(rate, stamp);
        }
    }

    fn take(&mut self, rate: f64, stamp: Nanos) {
        if let Some((before, since)) = self.newest {
            let interval = elapsed(stamp, since);
            self.turn += 0.5 * (before + rate) * interval - self.held;
            self.variance += self.noise * self.noise * interval * interval;
        }
        self.held = 0.0;
        self.newest = Some((rate, stamp));
    }

    /// The turn since it was last cleared and its variance \[rad, rad^2\]; none where the newest
    /// reading is too old.
    pub(crate) fn turn(&self) -> Option<(f64, f64)> {
        let (_, stamp) = self.newest?;
        (elapsed(self.reached, stamp) <= LONGEST_HOLD).then_some((self.turn, self.variance))
    }

    /// The turn went into the pose, or was none.
    pub(crate) fn clear(&mut self) {
        (self.turn, self.variance) = (0.0, 0.0);
        self.since = Some(self.reached);
    }

    /// Time of that turn \[s\].
    pub(crate) fn time(&self) -> f64 {
        self.since.map_or(0.0, |since| elapsed(self.reached, since))
    }

    /// Writes it down for a later life.
    pub(crate) fn save(&self, out: &mut FilterState) {
        let (rate, stamp) = self.newest.unwrap_or_default();
        out.has_gyro = u8::from(self.newest.is_some());
        (out.gyro_rate, out.gyro_stamp) = (rate, stamp);
        (out.gyro_held, out.gyro_turn, out.gyro_variance) = (self.held, self.turn, self.variance);
        (out.gyro_reached, out.gyro_since) = (self.reached, self.since.unwrap_or(self.reached));
    }

    /// Goes on where an earlier life was, unless this one has read the gyro itself.
    pub(crate) fn load(&mut self, saved: &FilterState) {
        if self.newest.is_none() && saved.has_gyro == 1 {
            self.newest = Some((saved.gyro_rate, saved.gyro_stamp));
            (self.held, self.turn) = (saved.gyro_held, saved.gyro_turn);
            self.variance = saved.gyro_variance.max(0.0);
            (self.reached, self.since) = (saved.gyro_reached, Some(saved.gyro_since));
        }
    }

    /// Variance of a reading \[rad^2/s^2\].
    pub(crate) fn rate_variance(&self) -> f64 {
        self.noise * self.noise
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_rhythm_of_looking_gives_the_trapezoidal_sum() {
        let ms = 1_000_000;
        let readings = [(0, 0.1), (10, 0.3), (25, -0.2), (40, 0.4)];
        let mut gyro = GyroIntegral::new(0.01);
        let mut sum = 0.0;
        for time in 0..=40 {
            let rate = readings.iter().find(|(at, _)| *at == time).map(|(_, rate)| *rate);
            gyro.advance(time * ms, rate);
            if time % 3 == 0 {
                sum += gyro.turn().map_or(0.0, |(turn, _)| turn);
                gyro.clear();
            }
        }
        sum += gyro.turn().map_or(0.0, |(turn, _)| turn);
        let expected = 0.2 * 0.010 + 0.05 * 0.015 + 0.1 * 0.015;
        assert!((sum - expected).abs() < 1e-15, "{sum}");
    }

    #[test]
    fn a_silent_gyro_is_not_held_for_ever() {
        let mut gyro = GyroIntegral::new(0.01);
        assert!(gyro.turn().is_none());
        gyro.advance(0, Some(0.1));
        gyro.advance(900_000_000, None);
        assert!(gyro.turn().is_some());
        gyro.advance(1_100_000_000, None);
        assert!(gyro.turn().is_none());
    }
}
