//! Speed and yaw rate from coarse increments.

use kerbside_messages::Nanos;

use crate::wheels::elapsed;

/// Time over which differences are taken \[s\]: of a 0.2 mm count it makes 3 mm/s, and 20 ms of
/// delay.
const WINDOW: f64 = 0.040;

/// Shorter differences say nothing \[s\].
const SHORTEST: f64 = 0.015;

/// Entries, and the time between two of them at least, so that they span the window at any rate
/// \[s\].
const ENTRIES: usize = 16;
const SPACING: f64 = 0.003;

/// Cumulative signed distance \[m\] and turn \[rad\] at a time.
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    stamp: Nanos,
    distance: f64,
    turn: f64,
}

/// Differences of cumulative distance and turn over [`WINDOW`], or over one reading's interval
/// where that is longer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twist {
    entries: [Entry; ENTRIES],
    count: usize,
    head: usize,
    now: Entry,
    interval: f64,
    known: bool,
    speed: f64,
    yaw_rate: f64,
}

impl Twist {
    pub(crate) fn new() -> Self {
        Self {
            entries: [Entry::default(); ENTRIES],
            count: 0,
            head: 0,
            now: Entry::default(),
            interval: 0.0,
            known: false,
            speed: 0.0,
            yaw_rate: 0.0,
        }
    }

    /// The pose rolled `distance` and turned by `turn` up to `stamp`.
    pub(crate) fn push(&mut self, stamp: Nanos, distance: f64, turn: f64) {
        if self.count > 0 {
            self.interval = elapsed(stamp, self.now.stamp);
        }
        self.now.stamp = stamp;
        self.now.distance += distance;
        self.now.turn += turn;
        self.differentiate();
        self.remember();
    }

    /// Speed and yaw rate at `stamp`: held for three intervals of the wheels, then fading.
    pub(crate) fn at(&self, stamp: Nanos) -> (f64, f64) {
        let age = elapsed(stamp, self.now.stamp);
        let hold = 3.0 * self.interval + WINDOW;
        let fading = if age > hold { hold / age } else { 1.0 };
        (self.speed * fading, self.yaw_rate * fading)
    }

    /// Speed at the last push, where there were pushes over long enough a time \[m/s\].
    pub(crate) fn speed(&self) -> Option<f64> {
        self.known.then_some(self.speed)
    }

    fn differentiate(&mut self) {
        (self.speed, self.yaw_rate, self.known) = (0.0, 0.0, false);
        let Some(then) = self.reference().copied() else { return };
        let interval = elapsed(self.now.stamp, then.stamp);
        if interval >= SHORTEST {
            self.known = true;
            self.speed = (self.now.distance - then.distance) / interval;
            self.yaw_rate = (self.now.turn - then.turn) / interval;
        }
    }

    /// The newest entry that is a window old, else the oldest.
    fn reference(&self) -> Option<&Entry> {
        let newest_first =
            (1..=self.count).map(|back| &self.entries[(self.head + ENTRIES - back) % ENTRIES]);
        let mut oldest = None;
        for entry in newest_first {
            oldest = Some(entry);
            if elapsed(self.now.stamp, entry.stamp) >= WINDOW {
                break;
            }
        }
        oldest
    }

    fn remember(&mut self) {
        let newest = &self.entries[(self.head + ENTRIES - 1) % ENTRIES];
        if self.count > 0 && elapsed(self.now.stamp, newest.stamp) < SPACING {
            return;
        }
        self.entries[self.head] = self.now;
        self.head = (self.head + 1) % ENTRIES;
        self.count = (self.count + 1).min(ENTRIES);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_roll_is_read_at_any_rate() {
        for rate in [5_u32, 20, 50, 200, 1000] {
            let mut twist = Twist::new();
            let step = 1.0 / f64::from(rate);
            for sample in 0..3 * rate {
                let stamp = u64::from(sample) * 1_000_000_000 / u64::from(rate);
                twist.push(stamp, -0.2 * step, 0.3 * step);
                if f64::from(sample) * step > 0.25 {
                    let (speed, yaw_rate) = twist.at(stamp);
                    assert!((speed + 0.2).abs() < 1e-6, "{rate} Hz: {speed}");
                    assert!((yaw_rate - 0.3).abs() < 1e-6, "{rate} Hz: {yaw_rate}");
                }
            }
        }
    }

    #[test]
    fn coarse_counts_are_smoothed() {
        let (mut twist, count) = (Twist::new(), 0.000_22);
        let (mut counted, mut worst) = (0.0_f64, 0.0_f64);
        for sample in 0..400_u64 {
            let counts = (0.05 * 0.005 * sample as f64 / count).floor();
            twist.push(sample * 5_000_000, (counts - counted) * count, 0.0);
            counted = counts;
            if sample > 20 {
                worst = worst.max((twist.at(sample * 5_000_000).0 - 0.05).abs());
            }
        }
        assert!(worst < 1.01 * count / WINDOW, "{worst}");
    }

    #[test]
    fn without_wheels_the_twist_fades() {
        let mut twist = Twist::new();
        for sample in 0..20_u64 {
            twist.push(sample * 10_000_000, 0.002, 0.0);
        }
        assert!((twist.at(200_000_000).0 - 0.2).abs() < 1e-9);
        let late = twist.at(190_000_000 + 700_000_000).0;
        assert!((late - 0.02).abs() < 1e-9, "{late}");
    }
}
