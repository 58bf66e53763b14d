//! Alive, deadline and order supervision of one process, from its heartbeats.
//!
//! The three supervisions are those of AUTOSAR's watchdog manager: how often a sign of life comes,
//! how long a step takes, and whether its checkpoints come in sequence. Too many signs are a fault
//! as well as too few: a loop that spins does not do its work.

use kerbside_messages::{Cause, Heartbeat, Nanos, Process};

use crate::recent::Recent;
use crate::{Timeouts, ns};

/// Misses are counted over a second.
const MISS_WINDOW: Nanos = 1_000_000_000;

/// What a process's heartbeats are held against.
#[derive(Clone, Copy, Debug, Hash)]
pub(crate) struct Rules {
    /// Window over which heartbeats are counted; also the longest silence.
    pub(crate) window: Nanos,
    least: u32,
    most: u32,
    misses: u32,
}

impl Rules {
    /// At least a quarter of the beats that belong into a window, at most twice as many: what lies
    /// between is the scheduler of a busy machine.
    pub(crate) fn new(process: Process, timeouts: &Timeouts) -> Self {
        let slow = matches!(process, Process::Planner | Process::Recorder | Process::Gateway);
        let window = ns(if slow { timeouts.slow_window } else { timeouts.heartbeat_window });
        let expected = window / ns(timeouts.heartbeat).max(1);
        let expected = u32::try_from(expected).unwrap_or(u32::MAX / 4);
        Self {
            window,
            least: (expected / 4).max(1),
            most: 2 * (expected + 1),
            misses: timeouts.deadline_misses,
        }
    }
}

/// What a heartbeat says of its process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Verdict {
    /// What is wrong.
    pub(crate) fault: Option<Cause>,
    /// A window was closed with as many beats as belong into it.
    pub(crate) good_window: bool,
}

/// A process's heartbeats in one life of it.
#[derive(Clone, Debug, Hash)]
pub(crate) struct Beats {
    /// When the newest was sent.
    pub(crate) last: Option<Nanos>,
    /// Misses as the newest states them.
    pub(crate) misses: u64,
    /// Until when the process counts as late.
    pub(crate) late_until: Nanos,
    /// Whether the newest says that the loop runs.
    pub(crate) ready: bool,
    /// What the newest says the process waits for, or what failed.
    pub(crate) text: [u8; 64],
    window_start: Nanos,
    count: u32,
    disorders: u32,
    recent_misses: Recent,
}

impl Beats {
    pub(crate) fn new(rules: &Rules) -> Self {
        Self {
            last: None,
            misses: 0,
            late_until: 0,
            ready: false,
            text: [0; 64],
            window_start: 0,
            count: 0,
            disorders: 0,
            recent_misses: Recent::new(rules.misses),
        }
    }

    /// Takes up a heartbeat.
    pub(crate) fn take(&mut self, now: Nanos, beat: &Heartbeat, rules: &Rules) -> Verdict {
        let sent = beat.header.sent.min(now).max(self.last.unwrap_or(0));
        let window = self.count_in_window(sent, rules);
        let late = self.too_many_misses(sent, beat);
        let disorder = beat.disorders > self.disorders;
        let fault = if beat.failed != 0 {
            Some(Cause::SelfCheck)
        } else if disorder {
            Some(Cause::Order)
        } else if self.count > rules.most {
            Some(Cause::TooManyBeats)
        } else if window == Some(false) {
            Some(Cause::Silent)
        } else {
            late.then_some(Cause::DeadlineMisses)
        };
        self.last = Some(sent);
        self.misses = beat.misses;
        self.ready = beat.ready == 1;
        self.text = beat.text;
        self.disorders = beat.disorders;
        Verdict { fault, good_window: window == Some(true) }
    }

    /// Whether nothing was heard for longer than a window.
    pub(crate) fn silent(&self, now: Nanos, rules: &Rules) -> bool {
        self.last.is_some_and(|last| now.saturating_sub(last) > rules.window)
    }

    /// Where the beat closes a window: whether enough came in it.
    fn count_in_window(&mut self, sent: Nanos, rules: &Rules) -> Option<bool> {
        let first = self.last.is_none();
        let after_silence = self.silent(sent, rules);
        if !first && !after_silence && sent - self.window_start < rules.window {
            self.count += 1;
            return None;
        }
        let enough = self.count >= rules.least && !after_silence;
        self.window_start = sent;
        self.count = 1;
        (!first).then_some(enough)
    }

    /// Misses count once the loop runs: those of a start say nothing.
    fn too_many_misses(&mut self, sent: Nanos, beat: &Heartbeat) -> bool {
        if !self.ready {
            return false;
        }
        // More than the ring holds at once are as good as a full ring.
        let new = beat.misses.saturating_sub(self.misses).min(64);
        let late = (0..new).fold(false, |_, _| self.recent_misses.happened(sent, MISS_WINDOW));
        if late {
            self.late_until = sent.saturating_add(MISS_WINDOW);
        }
        late
    }
}
