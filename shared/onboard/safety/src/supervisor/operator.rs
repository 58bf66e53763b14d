//! What operators may ask, and why not.

use kerbside_messages::{Cause, Mode, ProcessState, Verb, text};

use super::motion::PoseTrust;
use super::{Action, Actions, Answer, Supervisor, Watch, Why};
use crate::line::line;

impl Supervisor {
    pub(super) fn operator(&mut self, id: u64, verb: Verb, actions: &mut Actions) {
        let refusal = match verb {
            Verb::Arm => self.arm(actions),
            Verb::Stop => {
                self.stop(Why::plain(Cause::Operator), actions);
                None
            }
            Verb::Down => {
                self.go_down(actions);
                None
            }
        };
        // A stop of a vehicle that stands is over at once; the answer says where it led.
        self.advance(actions);
        actions.push(Action::Answer(Answer {
            id,
            accepted: refusal.is_none(),
            arms: self.arms,
            mode: self.mode,
            text: refusal.unwrap_or([0; 160]),
        }));
    }

    /// Permits motion for the next plan, unless something speaks against it, which is returned.
    fn arm(&mut self, actions: &mut Actions) -> Option<[u8; 160]> {
        let hindrance = self.hindrance();
        if hindrance.is_none() {
            self.arms += 1;
            self.enter(Mode::Armed, Why::plain(Cause::Operator), actions);
        }
        hindrance
    }

    /// What speaks against an arm now.
    fn hindrance(&self) -> Option<[u8; 160]> {
        if !matches!(self.mode, Mode::Ready | Mode::Faulted) {
            let words = format_args!("arm works in ready and faulted, the mode is {}", self.mode);
            return Some(line(words));
        }
        if let Some(watch) = self.unhealthy() {
            return Some(unhealthy(watch));
        }
        if let Some(inhibit) = self.inhibits.in_force(self.now) {
            let (who, why) = (text::as_str(&inhibit.who), text::as_str(&inhibit.why));
            return Some(line(format_args!("inhibited by {who}: {why}")));
        }
        let words = match self.motion.pose(self.now, self.freshness()) {
            Some(PoseTrust::Valid) => return None,
            Some(PoseTrust::Unset) => "no pose yet: send a fix",
            Some(PoseTrust::Lost) => "the pose is lost: send a fix",
            None => "no estimate of the pose arrives",
        };
        Some(text::from_str(words))
    }
}

fn unhealthy(watch: &Watch) -> [u8; 160] {
    let (process, state) = (watch.process, watch.state());
    let waiting = text::as_str(&watch.beats.text);
    if state == ProcessState::Healthy {
        return line(format_args!("{process} is not ready: it missed deadlines a moment ago"));
    }
    if waiting.is_empty() {
        line(format_args!("{process} is not ready: {state}"))
    } else {
        line(format_args!("{process} is not ready: {state}, {waiting}"))
    }
}
