//! One supervised process: its life, its heartbeats, its restarts.

use kerbside_messages::{Mode, Nanos, Process, ProcessRow, ProcessState};

use super::Supervised;
use super::beats::{Beats, Rules};
use crate::recent::Recent;
use crate::{SafetySettings, ns};

/// Where a process is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Life {
    /// To be started at `until`; `died`: again.
    Waiting { until: Nanos, died: bool },
    /// An external process that does not beat.
    Awaited,
    /// The start was asked for.
    Spawning { since: Nanos },
    /// Runs, and was never ready yet.
    Starting { since: Nanos },
    /// Was ready; `since` when it was not faulty.
    Running { since: Nanos },
    /// Not trusted any more; a child is killed at `kill_at` unless it recovers from silence.
    Faulty { kill_at: Nanos, silent: bool },
    /// Killed, and not reaped yet; killed again at `again`.
    Killed { again: Nanos },
    /// Died too often.
    GivenUp,
    /// Went down with the stack.
    Ended,
}

/// One supervised process.
#[derive(Clone, Debug, Hash)]
pub(crate) struct Watch {
    pub(crate) process: Process,
    pub(crate) external: bool,
    pub(crate) life: Life,
    pub(crate) pid: u32,
    /// The life of an external process, beside its pid: containers give the same pid again.
    pub(crate) epoch: u64,
    pub(crate) starts: u32,
    pub(crate) beats: Beats,
    pub(crate) rules: Rules,
    pause: Nanos,
    deaths: Recent,
}

impl Watch {
    pub(crate) fn new(supervised: Supervised, settings: &SafetySettings) -> Self {
        let rules = Rules::new(supervised.process, &settings.timeouts);
        let life = if supervised.external {
            Life::Awaited
        } else {
            Life::Waiting { until: 0, died: false }
        };
        Self {
            process: supervised.process,
            external: supervised.external,
            life,
            pid: 0,
            epoch: 0,
            starts: 0,
            beats: Beats::new(&rules),
            rules,
            pause: ns(settings.restart.backoff),
            deaths: Recent::new(settings.restart.deaths),
        }
    }

    /// Beats, in time, and is ready.
    pub(crate) fn healthy(&self, now: Nanos) -> bool {
        matches!(self.life, Life::Running { .. })
            && self.beats.ready
            && now >= self.beats.late_until
            && !self.beats.silent(now, &self.rules)
    }

    /// A process of the supervisor's own that exists, or may.
    pub(crate) fn is_child(&self) -> bool {
        let gone =
            matches!(self.life, Life::Waiting { .. } | Life::Awaited | Life::GivenUp | Life::Ended);
        !self.external && !gone
    }

    /// A new life begins.
    pub(crate) fn begin(&mut self, now: Nanos, pid: u32) {
        self.pid = pid;
        self.starts = self.starts.saturating_add(1);
        self.beats = Beats::new(&self.rules);
        self.life = Life::Starting { since: now };
    }

    /// The process died: pause before the next start, longer with each. Returns whether it died
    /// too often to be started again.
    pub(crate) fn died(&mut self, now: Nanos, settings: &SafetySettings) -> bool {
        let restart = &settings.restart;
        self.pid = 0;
        if self.deaths.happened(now, ns(restart.deaths_window)) {
            self.life = Life::GivenUp;
            return true;
        }
        self.life = Life::Waiting { until: now.saturating_add(self.pause), died: true };
        self.pause = self.pause.saturating_mul(2).min(ns(restart.backoff_limit));
        false
    }

    /// Healthy for long: the next pause is a short one again.
    pub(crate) fn forgive(&mut self, now: Nanos, settings: &SafetySettings) {
        if let Life::Running { since } = self.life
            && now.saturating_sub(since) >= ns(settings.restart.healthy)
        {
            self.pause = ns(settings.restart.backoff);
        }
    }

    /// What `status` shows.
    pub(crate) fn row(&self, now: Nanos) -> ProcessRow {
        let age = self.beats.last.map_or(0, |last| now.saturating_sub(last) / 1_000_000);
        ProcessRow {
            pid: self.pid,
            restarts: self.starts.saturating_sub(1),
            misses: u32::try_from(self.beats.misses).unwrap_or(u32::MAX),
            age_ms: u32::try_from(age).unwrap_or(u32::MAX),
            process: self.process as u8,
            state: self.state().code(),
            waiting_for: self.beats.text,
            ..ProcessRow::default()
        }
    }

    /// Its state in the words of messages.
    pub(crate) fn state(&self) -> ProcessState {
        match self.life {
            Life::Waiting { died: false, .. } => ProcessState::Waiting,
            Life::Waiting { died: true, .. } | Life::Ended => ProcessState::Dead,
            Life::Awaited => ProcessState::External,
            Life::Running { .. } if self.beats.ready => ProcessState::Healthy,
            Life::Spawning { .. } | Life::Starting { .. } | Life::Running { .. } => {
                ProcessState::Starting
            }
            Life::Faulty { .. } | Life::Killed { .. } => ProcessState::Silent,
            Life::GivenUp => ProcessState::GivenUp,
        }
    }

    /// Whether its faults stop the vehicle in that mode: those of the control path do wherever
    /// something may be under way; planner and recorder only come back.
    pub(crate) fn stops(&self, mode: Mode) -> bool {
        self.process.on_control_path() && mode != Mode::Down
    }
}
