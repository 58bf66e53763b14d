//! Processes that start, beat, fail and come back.

use kerbside_messages::{Cause, Heartbeat, Mode, Nanos, Process, text};

use super::watch::{Life, Watch};
use super::{Action, Actions, Exit, KILL_AFTER, START_TIMEOUT, Supervisor, Why};
use crate::line::line;
use crate::ns;

impl Supervisor {
    pub(super) fn spawned(&mut self, process: Process, pid: u32, actions: &mut Actions) {
        let (now, down) = (self.now, self.processes_end());
        let Some(watch) = self.watch(process).filter(|watch| !watch.external) else { return };
        watch.begin(now, pid);
        if down {
            actions.push(Action::Terminate(process));
        }
    }

    pub(super) fn spawn_failed(&mut self, process: Process, actions: &mut Actions) {
        if self.watch(process).is_some_and(|watch| matches!(watch.life, Life::Spawning { .. })) {
            self.lost(process, line(format_args!("{process} could not be started")), actions);
        }
    }

    pub(super) fn exited(&mut self, process: Process, exit: Exit, actions: &mut Actions) {
        if self.watch(process).is_some_and(|watch| watch.is_child()) {
            actions.push(Action::CleanUp);
            self.lost(process, line(format_args!("{process} died: {exit}")), actions);
        }
    }

    /// A child is gone: back-off, or giving up.
    fn lost(&mut self, process: Process, words: [u8; 128], actions: &mut Actions) {
        let watch = self.watches.iter_mut().find(|watch| watch.process == process);
        let Some(watch) = watch else { return };
        if self.mode == Mode::Down {
            watch.life = Life::Ended;
            return;
        }
        let given_up = watch.died(self.now, &self.settings);
        self.after_death(process, words, actions);
        if given_up {
            actions.push(Action::Failed { process, cause: Cause::GaveUp });
            let text = line(format_args!("{process} died too often and is not started again"));
            self.fault(Why { cause: Cause::GaveUp, culprit: Some(process), text }, actions);
        }
    }

    fn after_death(&mut self, process: Process, words: [u8; 128], actions: &mut Actions) {
        if process == Process::Estimator {
            self.motion.estimator_died();
        }
        self.process_fault(process, Cause::Died, words, actions);
    }

    /// A fault of a process: said, and for the control path a fault of the stack.
    fn process_fault(
        &mut self,
        process: Process,
        cause: Cause,
        text: [u8; 128],
        actions: &mut Actions,
    ) {
        actions.push(Action::Failed { process, cause });
        let mode = self.mode;
        if self.watch(process).is_some_and(|watch| watch.stops(mode)) {
            self.fault(Why { cause, culprit: Some(process), text }, actions);
        }
    }

    pub(super) fn heartbeat(&mut self, beat: &Heartbeat, actions: &mut Actions) {
        let now = self.now;
        let Some(process) = Process::from_id(beat.process) else { return };
        let Some(watch) = self.watch(process) else { return };
        let life = (beat.pid, beat.header.epoch);
        if watch.external && (watch.pid, watch.epoch) != life {
            let known = watch.pid != 0;
            watch.begin(now, beat.pid);
            watch.epoch = beat.header.epoch;
            if known {
                actions.push(Action::CleanUp);
                self.after_death(process, line(format_args!("{process} was restarted")), actions);
            }
        }
        self.judge(process, beat, actions);
    }

    /// A beat of the life that is supervised now.
    fn judge(&mut self, process: Process, beat: &Heartbeat, actions: &mut Actions) {
        let now = self.now;
        let down = self.mode == Mode::Down;
        let Some(watch) = self.watch(process) else { return };
        let supervised = matches!(
            watch.life,
            Life::Starting { .. } | Life::Running { .. } | Life::Faulty { .. }
        );
        if !supervised || watch.pid != beat.pid || down {
            return;
        }
        let was_ready = watch.beats.ready;
        let verdict = watch.beats.take(now, beat, &watch.rules);
        match (watch.life, verdict.fault) {
            (_, Some(cause)) => self.distrust(process, cause, actions),
            (Life::Starting { .. }, None) if watch.beats.ready => {
                watch.life = Life::Running { since: now };
            }
            (Life::Faulty { silent: true, .. }, None) if verdict.good_window => {
                watch.life = Life::Running { since: now };
            }
            (Life::Running { .. }, None) if was_ready && beat.ready != 1 => {
                self.became_unready(process, beat, actions);
            }
            _ => {}
        }
    }

    /// Beats, but does not work any more: a fault where the vehicle may be moving.
    fn became_unready(&mut self, process: Process, beat: &Heartbeat, actions: &mut Actions) {
        if !self.permits() && self.mode != Mode::Stopping {
            return;
        }
        let line_lost = process == Process::Interface;
        let cause = if line_lost { Cause::LineLost } else { Cause::Stale };
        let words = line(format_args!("{process}: {cause}: {}", text::as_str(&beat.text)));
        self.process_fault(process, cause, words, actions);
    }

    /// A process that is late stays; one that does wrong, or nothing, is not waited for long.
    fn distrust(&mut self, process: Process, cause: Cause, actions: &mut Actions) {
        let now = self.now;
        let Some(watch) = self.watch(process) else { return };
        if cause != Cause::DeadlineMisses {
            let silent = cause == Cause::Silent;
            let from = if silent { watch.beats.last.unwrap_or(now) } else { now };
            let kill_at = from.saturating_add(KILL_AFTER).max(now);
            match watch.life {
                // Known already. What was only silent may turn out worse, not better.
                Life::Faulty { kill_at, silent: before } => {
                    watch.life = Life::Faulty { kill_at, silent: before && silent };
                    return;
                }
                _ => watch.life = Life::Faulty { kill_at, silent },
            }
            if watch.external && silent {
                actions.push(Action::CleanUp);
            }
        }
        let detail = self.watch(process).map_or([0; 64], |watch| watch.beats.text);
        let detail = text::as_str(&detail);
        let words = if cause == Cause::SelfCheck {
            line(format_args!("{process}: {cause}: {detail}"))
        } else {
            line(format_args!("{process}: {cause}"))
        };
        self.process_fault(process, cause, words, actions);
    }

    /// What only time brings about: silence, starts, restarts, kills.
    pub(super) fn supervise(&mut self, actions: &mut Actions) {
        if self.mode == Mode::Down {
            return;
        }
        for index in 0..self.watches.len() {
            let watch = &self.watches[index];
            let listening = matches!(watch.life, Life::Starting { .. } | Life::Running { .. });
            if listening && watch.beats.silent(self.now, &watch.rules) {
                self.distrust(watch.process, Cause::Silent, actions);
            }
            let watch = &mut self.watches[index];
            watch.forgive(self.now, &self.settings);
            match watch.life {
                Life::Spawning { since } if overdue(since, self.now) => {
                    let process = watch.process;
                    let words = line(format_args!("the start of {process} was not answered"));
                    self.lost(process, words, actions);
                }
                _ if !watch.external => drive_child(watch, self.now, actions),
                _ => {}
            }
        }
    }
}

fn overdue(since: Nanos, now: Nanos) -> bool {
    now.saturating_sub(since) >= ns(START_TIMEOUT)
}

/// Starts a child when its time has come, and ends one that is of no use.
fn drive_child(watch: &mut Watch, now: Nanos, actions: &mut Actions) {
    let process = watch.process;
    match watch.life {
        Life::Waiting { until, .. } if now >= until => {
            watch.life = Life::Spawning { since: now };
            actions.push(Action::Spawn(process));
        }
        Life::Starting { since } if overdue(since, now) && watch.beats.text[0] == 0 => {
            kill(watch, now, actions);
        }
        Life::Faulty { kill_at, .. } if now >= kill_at => kill(watch, now, actions),
        Life::Killed { again } if now >= again => kill(watch, now, actions),
        _ => {}
    }
}

fn kill(watch: &mut Watch, now: Nanos, actions: &mut Actions) {
    watch.life = Life::Killed { again: now.saturating_add(KILL_AFTER) };
    actions.push(Action::Kill(watch.process));
}
