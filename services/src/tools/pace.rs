//! Rate, jitter, age and losses of a topic, from the headers of its samples.

use kerbside_messages::{Header, Nanos, Process, seconds};

/// Samples of one life of one publisher.
#[derive(Clone, Debug)]
struct Stream {
    process: Option<Process>,
    epoch: u64,
    first: (u64, Nanos),
    last: (u64, Nanos),
    seen: u64,
}

/// What was heard of a topic. All times are from the headers: when this tool looked is no part of them.
#[derive(Clone, Debug, Default)]
pub struct Pace {
    streams: Vec<Stream>,
    intervals: Vec<Nanos>,
    ages: Vec<Nanos>,
}

/// Percentiles of times \[s\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Half are no longer.
    pub p50: f64,
    /// 99 of 100 are no longer.
    pub p99: f64,
    /// The longest.
    pub max: f64,
}

impl Spread {
    /// Of these times; none where there are none.
    fn of(mut times: Vec<Nanos>) -> Option<Self> {
        times.sort_unstable();
        let last = times.len().checked_sub(1)?;
        let at = |hundredths: usize| seconds(times[last * hundredths / 100]);
        Some(Self { p50: at(50), p99: at(99), max: at(100) })
    }
}

impl Pace {
    /// Takes in a sample of `process`'s service.
    pub fn take(&mut self, process: Option<Process>, header: &Header) {
        self.ages.push(header.sent.saturating_sub(header.stamp));
        let now = (header.sequence, header.sent);
        let same = |stream: &&mut Stream| (stream.process, stream.epoch) == (process, header.epoch);
        let Some(stream) = self.streams.iter_mut().find(same) else {
            let epoch = header.epoch;
            return self.streams.push(Stream { process, epoch, first: now, last: now, seen: 1 });
        };
        // What was skipped says nothing of a single interval.
        if header.sequence == stream.last.0 + 1 {
            self.intervals.push(header.sent.saturating_sub(stream.last.1));
        }
        (stream.last, stream.seen) = (now, stream.seen + 1);
    }

    /// Samples that were seen.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.streams.iter().map(|stream| stream.seen).sum()
    }

    /// Samples that were sent between the first and the last one seen, and were not seen.
    #[must_use]
    pub fn lost(&self) -> u64 {
        let lost =
            |stream: &Stream| (stream.last.0 - stream.first.0 + 1).saturating_sub(stream.seen);
        self.streams.iter().map(lost).sum()
    }

    /// Samples sent per second, of all publishers together \[Hz\]; none where nobody sent two.
    #[must_use]
    #[allow(clippy::cast_precision_loss)] // sequences are far below 2^53
    pub fn rate(&self) -> Option<f64> {
        let rate = |stream: &Stream| {
            let (count, span) = (stream.last.0 - stream.first.0, stream.last.1 - stream.first.1);
            (count > 0 && span > 0).then(|| count as f64 / seconds(span))
        };
        self.streams.iter().filter_map(rate).reduce(|sum, rate| sum + rate)
    }

    /// Time from one sample to the next.
    #[must_use]
    pub fn period(&self) -> Option<Spread> {
        Spread::of(self.intervals.clone())
    }

    /// By how much that differs from its median.
    #[must_use]
    pub fn jitter(&self) -> Option<Spread> {
        let mut sorted = self.intervals.clone();
        sorted.sort_unstable();
        let median = *sorted.get(sorted.len().checked_sub(1)? / 2)?;
        Spread::of(sorted.into_iter().map(|interval| interval.abs_diff(median)).collect())
    }

    /// How old the content is when it is sent.
    #[must_use]
    pub fn age(&self) -> Option<Spread> {
        Spread::of(self.ages.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Nanos = 1_000_000;

    fn header(epoch: u64, sequence: u64, sent: Nanos) -> Header {
        Header { epoch, sequence, sent, stamp: sent - 2 * MS, ..Header::default() }
    }

    #[test]
    fn rate_and_jitter_are_the_publishers() {
        let mut pace = Pace::default();
        for (sequence, sent) in [(1, 100), (2, 105), (3, 110), (4, 117), (5, 120), (8, 135)] {
            pace.take(None, &header(1, sequence, sent * MS));
        }
        assert_eq!((pace.samples(), pace.lost()), (6, 2));
        assert!((pace.rate().unwrap() - 200.0).abs() < 1e-9, "seven intervals in 35 ms");
        assert_eq!(pace.period(), Some(Spread { p50: 0.005, p99: 0.005, max: 0.007 }));
        assert_eq!(pace.jitter(), Some(Spread { p50: 0.0, p99: 0.002, max: 0.002 }));
        assert_eq!(pace.age().unwrap().max, 0.002);
    }

    #[test]
    fn publishers_add_up_and_lives_are_apart() {
        let mut pace = Pace::default();
        for beat in 0..10 {
            pace.take(Some(Process::Ingest), &header(1, beat + 1, 1000 * MS + beat * 20 * MS));
            pace.take(Some(Process::Tracker), &header(7, beat + 90, 1003 * MS + beat * 20 * MS));
        }
        assert!((pace.rate().unwrap() - 100.0).abs() < 1e-9);
        pace.take(Some(Process::Tracker), &header(8, 1, 9000 * MS));
        assert_eq!((pace.samples(), pace.lost()), (21, 0), "a new life begins at one");
    }

    #[test]
    fn one_sample_has_no_rate() {
        let mut pace = Pace::default();
        assert_eq!((pace.rate(), pace.period(), pace.age()), (None, None, None));
        pace.take(None, &header(1, 1, 5 * MS));
        assert_eq!((pace.rate(), pace.jitter(), pace.samples()), (None, None, 1));
    }
}
