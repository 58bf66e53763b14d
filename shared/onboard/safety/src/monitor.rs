//! The supervision a process does on itself: loop timing, order of checkpoints, heartbeats.

use kerbside_messages::{Header, Heartbeat, Nanos, Process, seconds, text};

use crate::{Timeouts, ns};

/// Watches a process's loop from within and fills its heartbeats.
///
/// A loop calls [`Self::begin`] when its input is there, [`Self::checkpoint`] 0, 1, 2, ... on its
/// way, [`Self::end`] after its output, and [`Self::beat`] in each round. A backlog drained in one
/// wake-up is one step. Nothing is allocated.
#[derive(Clone, Debug)]
pub struct LoopMonitor {
    deadline: Nanos,
    interval: Nanos,
    checkpoints: u32,
    /// Since the start, as heartbeats state it; the figures of time since the newest heartbeat.
    totals: Heartbeat,
    work_sum: f64,
    loops: u32,
    step: Option<Step>,
    beaten: Option<Nanos>,
    silenced: bool,
}

/// A step under way.
#[derive(Clone, Copy, Debug)]
struct Step {
    begun: Nanos,
    arrival: Nanos,
    next: u32,
}

impl LoopMonitor {
    /// A monitor of a loop that passes `checkpoints` checkpoints in each step.
    #[must_use]
    pub fn new(process: Process, pid: u32, timeouts: &Timeouts, checkpoints: u32) -> Self {
        Self {
            deadline: ns(timeouts.deadline),
            interval: ns(timeouts.heartbeat),
            checkpoints,
            totals: Heartbeat { process: process as u8, pid, ..Heartbeat::default() },
            work_sum: 0.0,
            loops: 0,
            step: None,
            beaten: None,
            silenced: false,
        }
    }

    /// A step begins at `now`, whose newest input arrived at `arrival`.
    pub fn begin(&mut self, now: Nanos, arrival: Nanos) {
        self.in_order(self.step.is_none());
        self.step = Some(Step { begun: now, arrival, next: 0 });
    }

    /// A newer input, which arrived at `arrival`, joins the step under way: a backlog is one step.
    pub fn arrived(&mut self, arrival: Nanos) {
        if let Some(step) = &mut self.step {
            step.arrival = step.arrival.max(arrival);
        }
    }

    /// The step passes a checkpoint.
    pub fn checkpoint(&mut self, index: u32) {
        let expected = self.step.map(|step| step.next);
        self.in_order(expected == Some(index));
        if let Some(step) = &mut self.step {
            step.next = index.saturating_add(1);
        }
    }

    /// The step ends; returns whether it missed its deadline.
    pub fn end(&mut self, now: Nanos) -> bool {
        let Some(step) = self.step.take() else {
            self.in_order(false);
            return false;
        };
        self.in_order(step.next == self.checkpoints);
        let lateness = now.saturating_sub(step.arrival);
        let work = seconds(now.saturating_sub(step.begun));
        self.work_sum += work;
        self.loops = self.loops.saturating_add(1);
        self.totals.steps += 1;
        self.totals.work_max = self.totals.work_max.max(work);
        self.totals.lateness_max = self.totals.lateness_max.max(seconds(lateness));
        let missed = lateness > self.deadline;
        self.totals.misses += u64::from(missed);
        missed
    }

    /// Whether the loop runs, and what it waits for if it does not.
    pub fn set_ready(&mut self, ready: bool, waiting_for: &str) {
        self.totals.ready = u8::from(ready);
        self.totals.text = text::from_str(if ready { "" } else { waiting_for });
    }

    /// What a ready process has to say beside being ready.
    pub fn set_text(&mut self, text: &str) {
        if self.totals.failed == 0 && self.totals.ready == 1 {
            self.totals.text = text::from_str(text);
        }
    }

    /// Whether the process has real-time rights.
    pub fn set_realtime(&mut self, realtime: bool) {
        self.totals.realtime = u8::from(realtime);
    }

    /// Samples refused, and lost on the way, since the start.
    pub fn set_counts(&mut self, refused: u64, lost: u64) {
        (self.totals.refused, self.totals.lost) = (refused, lost);
    }

    /// The process failed its own check: one more heartbeat says why, then none comes.
    pub fn fail(&mut self, why: &str) {
        if self.totals.failed == 0 {
            self.totals.failed = 1;
            self.totals.ready = 0;
            self.totals.text = text::from_str(why);
            self.beaten = None;
        }
    }

    /// Where a heartbeat is due at `now`, fills it but for what the sender adds to the header.
    pub fn beat(&mut self, now: Nanos, heartbeat: &mut Heartbeat) -> bool {
        let due = self.beaten.is_none_or(|beaten| now.saturating_sub(beaten) >= self.interval);
        if self.silenced || !due {
            return false;
        }
        self.beaten = Some(now);
        self.silenced = self.totals.failed == 1;
        *heartbeat = self.totals;
        heartbeat.header = Header::stamped(now, 0);
        heartbeat.work_mean = self.work_sum / f64::from(self.loops.max(1));
        (self.work_sum, self.loops) = (0.0, 0);
        (self.totals.work_max, self.totals.lateness_max) = (0.0, 0.0);
        true
    }

    fn in_order(&mut self, order: bool) {
        self.totals.disorders = self.totals.disorders.saturating_add(u32::from(!order));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Nanos = 1_000_000;

    fn monitor() -> LoopMonitor {
        LoopMonitor::new(Process::Ingest, 7, &Timeouts::default(), 2)
    }

    fn step(monitor: &mut LoopMonitor, begin: Nanos, arrival: Nanos, end: Nanos) -> bool {
        monitor.begin(begin, arrival);
        monitor.checkpoint(0);
        monitor.checkpoint(1);
        monitor.end(end)
    }

    #[test]
    fn a_deadline_counts_from_the_newest_inputs_arrival() {
        let mut monitor = monitor();
        assert!(!step(&mut monitor, 40 * MS, 0, 50 * MS), "the deadline itself is in time");
        assert!(step(&mut monitor, 90 * MS, 60 * MS, 110 * MS + 1));
        let mut beat = Heartbeat::default();
        assert!(monitor.beat(120 * MS, &mut beat));
        assert_eq!((beat.steps, beat.misses, beat.disorders), (2, 1, 0));
        assert!((beat.work_mean - 0.015).abs() < 1e-8, "{}", beat.work_mean);
        assert!((beat.work_max - 0.020).abs() < 1e-8, "{}", beat.work_max);
        assert!((beat.lateness_max - 0.050).abs() < 1e-8, "{}", beat.lateness_max);
    }

    #[test]
    fn heartbeats_come_at_their_interval_and_figures_of_time_start_anew() {
        let (mut monitor, mut beat) = (monitor(), Heartbeat::default());
        step(&mut monitor, 0, 0, MS);
        assert!(monitor.beat(0, &mut beat));
        assert!(!monitor.beat(20 * MS - 1, &mut beat));
        assert!(monitor.beat(20 * MS, &mut beat));
        assert_eq!((beat.work_max, beat.work_mean, beat.lateness_max), (0.0, 0.0, 0.0));
        assert_eq!((beat.steps, beat.pid, beat.process), (1, 7, 1));
    }

    #[test]
    fn each_way_out_of_order_counts() {
        let broken: [fn(&mut LoopMonitor); 6] = [
            |m| {
                m.end(1);
            },
            |m| m.checkpoint(0),
            |m| {
                m.begin(0, 0);
                m.begin(1, 1);
                m.checkpoint(0);
                m.checkpoint(1);
                m.end(2);
            },
            |m| {
                m.begin(0, 0);
                m.checkpoint(0);
                m.end(2);
            },
            |m| {
                m.begin(0, 0);
                m.checkpoint(1);
                m.end(2);
            },
            |m| {
                m.begin(0, 0);
                m.checkpoint(0);
                m.checkpoint(0);
                m.checkpoint(1);
                m.end(2);
            },
        ];
        for (index, way) in broken.into_iter().enumerate() {
            let (mut monitor, mut beat) = (monitor(), Heartbeat::default());
            way(&mut monitor);
            assert!(monitor.beat(0, &mut beat));
            assert_eq!(beat.disorders, 1, "way {index}");
        }
    }

    #[test]
    fn a_failed_process_says_why_once_and_falls_silent() {
        let (mut monitor, mut beat) = (monitor(), Heartbeat::default());
        monitor.set_ready(true, "");
        assert!(monitor.beat(0, &mut beat));
        assert_eq!((beat.ready, beat.failed), (1, 0));
        monitor.fail("the filter's covariance is not positive");
        assert!(monitor.beat(1, &mut beat), "at once, not at the next interval");
        assert_eq!((beat.ready, beat.failed), (0, 1));
        assert_eq!(text::as_str(&beat.text), "the filter's covariance is not positive");
        assert!((1..100).all(|k| !monitor.beat(k * 20 * MS, &mut beat)));
    }
}
