//! Going down: stop, end, leave nothing behind.

use kerbside_messages::{Cause, Mode, Nanos};

use super::watch::Life;
use super::{Action, Actions, Supervisor, TERMINATE_GRACE, Why};
use crate::ns;

/// How far the end has come.
#[derive(Clone, Copy, Debug, Hash)]
pub(super) struct Ending {
    /// The vehicle may be moving and stops first.
    moving: bool,
    /// When the processes were last asked to end.
    asked: Option<Nanos>,
    killed: bool,
    finished: bool,
}

impl Supervisor {
    /// The permit ends at once; the processes once the vehicle stands.
    pub(super) fn go_down(&mut self, actions: &mut Actions) {
        if self.mode == Mode::Down {
            return;
        }
        let moving = self.permits() || self.mode == Mode::Stopping;
        self.ending = Some(Ending { moving, asked: None, killed: false, finished: false });
        self.enter(Mode::Down, Why::plain(Cause::Operator), actions);
    }

    pub(super) fn continue_ending(&mut self, actions: &mut Actions) {
        let Some(mut ending) = self.ending.filter(|ending| !ending.finished) else { return };
        match ending.asked {
            None if !ending.moving || self.halted() || self.stop_is_over() => {
                self.terminate_all(actions);
                ending.asked = Some(self.now);
            }
            Some(asked) if self.now - asked >= ns(TERMINATE_GRACE) => {
                ending.killed |= self.kill_all(actions);
                ending.asked = Some(self.now);
            }
            _ => {}
        }
        if ending.asked.is_some() && !self.watches.iter().any(super::Watch::is_child) {
            ending.finished = true;
            actions.push(Action::CleanUp);
            actions.push(Action::Finished { exit: u8::from(ending.killed) });
        }
        self.ending = Some(ending);
    }

    /// Going down does not wait longer than a stop takes, even if the vehicle seems to move on.
    fn stop_is_over(&self) -> bool {
        self.now - self.since >= ns(self.stop.stop)
    }

    /// Those that consume end before those that feed them.
    fn terminate_all(&self, actions: &mut Actions) {
        for watch in self.watches.iter().rev().filter(|watch| has_pid(watch.life, watch.external)) {
            actions.push(Action::Terminate(watch.process));
        }
    }

    /// Whether there was one to kill. A start that was never answered is given up.
    fn kill_all(&mut self, actions: &mut Actions) -> bool {
        let mut killed = false;
        for watch in self.watches.iter_mut().rev().filter(|watch| watch.is_child()) {
            if has_pid(watch.life, watch.external) {
                actions.push(Action::Kill(watch.process));
                killed = true;
            } else {
                watch.life = Life::Ended;
            }
        }
        killed
    }

    /// Whether the processes have been asked to end.
    pub(super) fn processes_end(&self) -> bool {
        self.ending.is_some_and(|ending| ending.asked.is_some())
    }
}

fn has_pid(life: Life, external: bool) -> bool {
    let running = matches!(
        life,
        Life::Starting { .. } | Life::Running { .. } | Life::Faulty { .. } | Life::Killed { .. }
    );
    running && !external
}
