//! A pure delay of commands.

use std::collections::VecDeque;

/// Commands on their way: each acts a fixed time after its own stamp and holds until the next one
/// acts.
#[derive(Clone, Debug)]
pub(crate) struct Delay {
    delay: f64,
    pending: VecDeque<(f64, f64)>,
}

impl Delay {
    /// A delay of `delay` \[s\].
    pub(crate) fn new(delay: f64) -> Self {
        // Half a second of commands at 200 Hz: more only grows the queue.
        Self { delay, pending: VecDeque::with_capacity(128) }
    }

    /// Takes in a value stamped `stamp` \[s\]. One stamped before its predecessor acts right after
    /// that one.
    pub(crate) fn push(&mut self, stamp: f64, value: f64) {
        let newest = self.pending.back().map_or(f64::NEG_INFINITY, |newest| newest.0);
        self.pending.push_back(((stamp + self.delay).max(newest), value));
    }

    /// When the next value acts \[s\]; infinity for none.
    pub(crate) fn next(&self) -> f64 {
        self.pending.front().map_or(f64::INFINITY, |next| next.0)
    }

    /// The newest value that acts by `now` \[s\] and was not taken before.
    pub(crate) fn take(&mut self, now: f64) -> Option<f64> {
        let mut taken = None;
        while self.next() <= now {
            taken = self.pending.pop_front().map(|(_, value)| value);
        }
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_act_in_order_and_not_before_their_time() {
        let mut delay = Delay::new(0.5);
        delay.push(1.0, 10.0);
        delay.push(2.0, 20.0);
        delay.push(2.1, 21.0);
        assert_eq!(delay.take(1.499), None);
        assert_eq!(delay.next(), 1.5);
        assert_eq!(delay.take(1.5), Some(10.0));
        assert_eq!(delay.take(9.0), Some(21.0), "the newest of those that are due");
        assert_eq!((delay.take(9.0), delay.next()), (None, f64::INFINITY));
    }

    #[test]
    fn an_older_stamp_does_not_overtake() {
        let mut delay = Delay::new(0.0);
        delay.push(2.0, 20.0);
        delay.push(1.0, 10.0);
        assert_eq!(delay.take(1.5), None);
        assert_eq!(delay.take(2.0), Some(10.0));
    }
}
