//! One wheel's counter, unwrapped.

use crate::wheels::WheelScale;

/// Readings in a row that must agree on a new level before a counter is taken to have jumped.
const AGREEING: u8 = 3;

/// Implausible readings in a row after which nothing is known of the motion any more.
const REFUSED_IN_A_ROW: u8 = 8;

/// How a reading may be judged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    /// Factor on the wheel's top speed.
    pub(crate) speed_margin: f64,
    /// Longest time that may be bridged \[s\].
    pub(crate) longest_gap: f64,
    /// Time that a reading stands for at least, against jittering stamps \[s\].
    pub(crate) shortest: f64,
}

/// What a reading says of a wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Judgement {
    /// The first of an epoch: it sets the zero.
    First,
    /// It turned so far since the reading before \[m\].
    Turned(f64),
    /// No wheel can have turned so far.
    Implausible,
    /// The motion since the reading before is lost: a new epoch must begin.
    Lost,
}

/// A count at a time \[s\].
#[derive(Clone, Copy, Debug)]
struct Reading {
    count: i64,
    time: f64,
}

/// One wheel's counter.
///
/// Travel is absolute: the counter's own value on the ring of [`WheelScale::ring_bits`], unwrapped
/// from there. So it does not depend on when this object came to life.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counter {
    scale: WheelScale,
    accepted: Option<Reading>,
    /// Sign of the newest motion; 0 before any.
    sense: i64,
    /// Time of the newest reading, accepted or not \[s\].
    newest: Option<f64>,
    position: i64,
    suspect: Option<Reading>,
    agreeing: u8,
    refused: u8,
}

impl Counter {
    pub(crate) fn new(scale: WheelScale) -> Self {
        Self {
            scale,
            accepted: None,
            sense: 0,
            newest: None,
            position: 0,
            suspect: None,
            agreeing: 0,
            refused: 0,
        }
    }

    /// Forgets its readings: the next one is the first of an epoch.
    pub(crate) fn forget(&mut self) {
        *self = Self { position: self.position, ..Self::new(self.scale) };
    }

    /// Travel on the ring of absolute counts, unwrapped \[m\].
    #[allow(clippy::cast_precision_loss)] // Within 2^53 by the choice of the ring.
    pub(crate) fn travel(&self) -> f64 {
        self.position as f64 * self.scale.metres_per_count
    }

    /// Takes `count`, read at `time` \[s\].
    ///
    /// A value out of line is one that no wheel reaches, or that lies behind where the wheel came from. A single one is
    /// `Implausible` and leaves no trace: the next one is measured from the last accepted. Three in a row that agree with one
    /// another but not with it, or eight that agree with nothing, are a counter that jumped: `Lost`. So is one after a gap as
    /// long as eight readings: the vehicle has come too far meanwhile to wait for more.
    pub(crate) fn read(&mut self, count: i64, time: f64, bounds: &Bounds) -> Judgement {
        let reading = Reading { count, time };
        let Some(accepted) = self.accepted else {
            self.zero(reading);
            return Judgement::First;
        };
        if self.ambiguous(time - accepted.time, bounds) {
            return Judgement::Lost;
        }
        let turned = self.difference(count, accepted.count);
        let interval = time - accepted.time;
        let goes_on = self.goes_on(turned, time, bounds);
        self.newest = Some(time);
        if !goes_on || !self.plausible(turned, interval, bounds) {
            return self.doubt(reading, bounds);
        }
        self.accept(reading, turned);
        Judgement::Turned(metres(turned, self.scale.metres_per_count))
    }

    fn zero(&mut self, reading: Reading) {
        self.position = sign_extended(reading.count, self.scale.ring_bits);
        self.accept(reading, 0);
    }

    fn accept(&mut self, reading: Reading, turned: i64) {
        self.position = self.position.wrapping_add(turned);
        self.accepted = Some(reading);
        if turned != 0 {
            self.sense = turned.signum();
        }
        (self.suspect, self.agreeing, self.refused) = (None, 0, 0);
    }

    fn doubt(&mut self, reading: Reading, bounds: &Bounds) -> Judgement {
        let agrees = self.suspect.is_some_and(|suspect| {
            let turned = self.difference(reading.count, suspect.count);
            self.plausible(turned, reading.time - suspect.time, bounds)
        });
        self.agreeing = if agrees { self.agreeing + 1 } else { 1 };
        self.refused += 1;
        self.suspect = Some(reading);
        let patience = f64::from(REFUSED_IN_A_ROW) * bounds.shortest;
        let unread = self.accepted.is_none_or(|accepted| reading.time - accepted.time > patience);
        if unread || self.agreeing >= AGREEING || self.refused >= REFUSED_IN_A_ROW {
            return Judgement::Lost;
        }
        Judgement::Implausible
    }

    /// Whether the counter may have gone round by more than half meanwhile.
    fn ambiguous(&self, interval: f64, bounds: &Bounds) -> bool {
        interval > bounds.longest_gap || self.scale.top_speed * interval > 0.5 * self.scale.range()
    }

    /// Whether the wheel can have turned so many counts, quantisation allowed for.
    fn plausible(&self, turned: i64, interval: f64, bounds: &Bounds) -> bool {
        let reach = self.scale.top_speed * bounds.speed_margin * interval.max(bounds.shortest);
        metres(turned, self.scale.metres_per_count).abs()
            <= reach + 2.0 * self.scale.metres_per_count
    }

    /// Whether the wheel can have turned back so far against its newest motion, where no reading is missing: a vehicle
    /// that turns about stands in between.
    fn goes_on(&self, turned: i64, time: f64, bounds: &Bounds) -> bool {
        let follows = self.newest.is_some_and(|newest| time - newest <= 1.5 * bounds.shortest);
        if !follows || turned.signum() * self.sense >= 0 {
            return true;
        }
        // Once in doubt, what lies back is no motion that caught up with the counter.
        let reach = if self.refused == 0 { self.scale.top_speed * bounds.shortest } else { 0.0 };
        let travelled = metres(turned, self.scale.metres_per_count).abs();
        travelled <= reach + 2.0 * self.scale.metres_per_count
    }

    /// Counts from `before` to `now`, the shorter way round.
    fn difference(&self, now: i64, before: i64) -> i64 {
        sign_extended(now.wrapping_sub(before), self.scale.counter_bits)
    }
}

#[allow(clippy::cast_precision_loss)] // A difference that large is refused.
fn metres(counts: i64, metres_per_count: f64) -> f64 {
    counts as f64 * metres_per_count
}

/// The lowest `bits` of `value` (1 to 64), sign-extended.
fn sign_extended(value: i64, bits: u32) -> i64 {
    let unused = 64 - bits;
    (value << unused) >> unused
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BOUNDS: Bounds = Bounds { speed_margin: 3.0, longest_gap: 2.0, shortest: 0.005 };

    fn counter(bits: u32) -> Counter {
        Counter::new(WheelScale {
            metres_per_count: 0.001,
            counter_bits: bits,
            ring_bits: bits.min(32),
            speed_scale: 1.0,
            top_speed: 1.0,
        })
    }

    /// Reads counts every 5 ms.
    fn read_all(counter: &mut Counter, counts: &[i64]) -> Vec<Judgement> {
        let mut time = 0.0;
        let next = |count: &i64| {
            time += 0.005;
            counter.read(*count, time, &BOUNDS)
        };
        counts.iter().map(next).collect()
    }

    #[test]
    fn the_zero_is_the_counters_own() {
        let mut one = counter(32);
        read_all(&mut one, &[5000, 5003]);
        let mut other = counter(32);
        read_all(&mut other, &[5003]);
        assert_eq!(one.travel(), other.travel());
        assert!((one.travel() - 5.003).abs() < 1e-12);
    }

    #[test]
    fn an_outlier_leaves_no_trace() {
        let mut counter = counter(32);
        let judged = read_all(&mut counter, &[0, 2, 900, 6, 8]);
        assert_eq!(judged[2], Judgement::Implausible);
        assert_eq!(judged[3], Judgement::Turned(0.004));
        assert_eq!(counter.travel(), 0.008);
    }

    #[test]
    fn after_a_gap_an_outlier_is_a_lost_counter() {
        let mut counter = counter(32);
        read_all(&mut counter, &[900, 902, 904]);
        assert_eq!(counter.read(1, 0.3, &BOUNDS), Judgement::Lost);
    }

    #[test]
    fn a_wheel_does_not_turn_about_within_a_reading() {
        let mut counter = counter(32);
        // Forward at 0.8 m/s, then counted from zero again: as if back at 2.4 m/s.
        let judged = read_all(&mut counter, &[0, 4, 8, 12, 0, 4, 8]);
        assert_eq!(judged[3], Judgement::Turned(0.004));
        assert_eq!(judged[4..6], [Judgement::Implausible; 2]);
        assert_eq!(judged[6], Judgement::Lost);
        assert_eq!(counter.travel(), 0.012);
    }

    #[test]
    fn a_wheel_that_slips_turns_about_or_is_counted_in_bursts_is_followed() {
        let mut counter = counter(32);
        let judged = read_all(&mut counter, &[0, 5, 20, 20, 35, 35, 30, 24, 9, 9, 12]);
        let turned = [5, 15, 0, 15, 0, -5, -6, -15, 0, 3].map(|counts| f64::from(counts) * 0.001);
        assert_eq!(judged[1..], turned.map(Judgement::Turned));
    }

    #[test]
    fn a_jump_that_stays_is_lost_motion() {
        let mut counter = counter(32);
        let judged = read_all(&mut counter, &[0, 2, 900, 902, 904]);
        assert_eq!(judged[2..4], [Judgement::Implausible; 2]);
        assert_eq!(judged[4], Judgement::Lost);
        assert_eq!(counter.travel(), 0.002);
    }

    #[test]
    fn noise_for_long_is_lost_motion_and_never_travel() {
        let mut counter = counter(32);
        let counts = [0, 500, -700, 4000, 90, -900, 3000, 800, -6000];
        let judged = read_all(&mut counter, &counts);
        assert_eq!(judged[8], Judgement::Lost);
        assert!(judged[1..8].iter().all(|judgement| *judgement == Judgement::Implausible));
    }

    #[test]
    fn a_gap_that_a_counter_cannot_tell_is_lost() {
        let mut narrow = counter(8);
        narrow.read(0, 0.0, &BOUNDS);
        assert_eq!(narrow.read(100, 0.1, &BOUNDS), Judgement::Turned(0.1));
        assert_eq!(narrow.read(120, 0.24, &BOUNDS), Judgement::Lost);
        let mut wide = counter(32);
        wide.read(0, 0.0, &BOUNDS);
        assert_eq!(wide.read(120, 2.1, &BOUNDS), Judgement::Lost);
    }

    #[test]
    fn a_late_stamp_makes_no_motion_implausible() {
        let mut counter = counter(32);
        counter.read(0, 0.0, &BOUNDS);
        assert_eq!(counter.read(5, 0.005, &BOUNDS), Judgement::Turned(0.005));
        assert_eq!(counter.read(10, 0.0051, &BOUNDS), Judgement::Turned(0.005));
    }

    proptest! {
        #[test]
        fn wraps_do_not_show(
            bits in 6_u32..=64,
            start in any::<i64>(),
            steps in prop::collection::vec(-7_i64..=7, 1..300),
        ) {
            let (mut wrapping, mut straight) = (counter(bits), counter(bits));
            let (mut count, mut sum, mut time) = (start, 0, 0.0);
            wrapping.read(sign_extended(count, bits), time, &BOUNDS);
            straight.read(count, time, &BOUNDS);
            let zero = wrapping.travel();
            for step in steps {
                (count, sum, time) = (count.wrapping_add(step), sum + step, time + 0.005);
                let judged = wrapping.read(sign_extended(count, bits), time, &BOUNDS);
                prop_assert_eq!(judged, Judgement::Turned(metres(step, 0.001)));
                prop_assert_eq!(straight.read(count, time, &BOUNDS), judged);
            }
            prop_assert!((wrapping.travel() - zero - metres(sum, 0.001)).abs() < 1e-8);
        }
    }
}
