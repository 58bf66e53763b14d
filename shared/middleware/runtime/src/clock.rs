//! The host's monotonic clock.

use core::time::Duration;

use kerbside_messages::Nanos;
use rustix::thread::{ClockId, NanosleepRelativeResult};
use rustix::time::{Timespec, clock_gettime};

/// The monotonic clock \[ns\].
#[must_use]
#[allow(clippy::cast_sign_loss)] // the monotonic clock starts at boot and is never negative
pub fn now() -> Nanos {
    let time = clock_gettime(rustix::time::ClockId::Monotonic);
    time.tv_sec as Nanos * 1_000_000_000 + time.tv_nsec as Nanos
}

/// Time that all threads of this process have had a processor \[ns\].
#[must_use]
#[allow(clippy::cast_sign_loss)] // it starts at zero
pub fn processor_time() -> Nanos {
    let time = clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as Nanos * 1_000_000_000 + time.tv_nsec as Nanos
}

/// A timespec of so many nanoseconds.
#[allow(clippy::cast_possible_wrap)] // both parts are far below 2^63
pub(crate) fn timespec(nanos: Nanos) -> Timespec {
    Timespec { tv_sec: (nanos / 1_000_000_000) as i64, tv_nsec: (nanos % 1_000_000_000) as i64 }
}

/// Wakes at absolute multiples of a period; after an overrun the next wake-up is counted from now.
#[derive(Debug)]
pub struct Ticker {
    period: Nanos,
    next: Nanos,
    overruns: u64,
}

impl Ticker {
    /// A ticker whose first tick is one period from now.
    #[must_use]
    pub fn new(period: Duration) -> Self {
        let period = u64::try_from(period.as_nanos()).unwrap_or(u64::MAX).max(1);
        Self { period, next: now() + period, overruns: 0 }
    }

    /// When the next tick is due \[ns\].
    #[must_use]
    pub fn next(&self) -> Nanos {
        self.next
    }

    /// Ticks that came too late to be kept.
    #[must_use]
    pub fn overruns(&self) -> u64 {
        self.overruns
    }

    /// Whether the tick is due at `now`; if so the next one is set.
    pub fn due(&mut self, now: Nanos) -> bool {
        if now < self.next {
            return false;
        }
        self.next += self.period;
        if self.next <= now {
            self.overruns += 1;
            self.next = now + self.period;
        }
        true
    }

    /// Counts the next tick from `now`: what it is for was done just now.
    pub fn restart(&mut self, now: Nanos) {
        self.next = now + self.period;
    }

    /// Sleeps until the next tick is due, and sets the one after it.
    pub fn wait(&mut self) {
        loop {
            let now = now();
            if self.due(now) {
                return;
            }
            let pause = timespec(self.next - now);
            match rustix::thread::clock_nanosleep_relative(ClockId::Monotonic, &pause) {
                NanosleepRelativeResult::Ok | NanosleepRelativeResult::Interrupted(_) => {}
                NanosleepRelativeResult::Err(_) => std::thread::yield_now(),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ticker_keeps_its_grid_and_counts_overruns() {
        let mut ticker = Ticker { period: 10, next: 100, overruns: 0 };
        assert!(!ticker.due(99));
        assert!(ticker.due(100));
        assert_eq!(ticker.next(), 110);
        assert!(ticker.due(135));
        assert_eq!((ticker.next(), ticker.overruns()), (145, 1));
        ticker.restart(138);
        assert!(!ticker.due(147) && ticker.due(148));
    }
}
