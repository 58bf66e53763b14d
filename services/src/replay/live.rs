//! A drive through processes: an instance of its own is started, read, and ended in order.

use core::time::Duration;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::ProgressBar;
use kerbside_messages::{
    Message, Nanos, Odometry, Process, ProcessRow, ProcessState, Raw, State, Uptake, text,
};
use kerbside_runtime::{Listener, Newest, Session, SessionError, Subscriber, depth, now};

use super::track::Track;
use super::uptake::Uptaker;
use crate::children::Children;
use crate::exit::Failure;
use crate::life::{nanos, stop_flag};
use crate::manoeuvre::cause_of;
use crate::service::Service;

/// Longest wait for the next estimate before looking at everything else.
const WAIT: Duration = Duration::from_millis(5);
/// Odometry that was due so long ago does not come any more.
const STALL: Nanos = 10_000_000_000;
/// Longest wait for the recorder to take in the last of it.
const LAST: Nanos = 5_000_000_000;

/// The verdict on a replay that a person ended.
pub const INTERRUPTED: &str = "interrupted";

/// What came of it.
#[derive(Debug, Default)]
pub struct Live {
    /// The odometry.
    pub track: Track,
    /// Why it ended before its time.
    pub problem: Option<String>,
    /// Besides, what is to be said.
    pub notes: Vec<String>,
    /// From the first estimate to the last \[s\].
    pub seconds: f64,
}

/// Runs the drive `raws` through `service`'s instance; `expected` estimates will come of it.
///
/// # Errors
/// [`Failure`] where the stack cannot be started.
pub fn run(
    service: &Service,
    raws: &[Raw],
    expected: usize,
    progress: &ProgressBar,
) -> Result<Live, Failure> {
    let stop = stop_flag()?;
    let mut children = Children::start(service, None)?;
    let session = children.join(&stop)?;
    let mut desk = Desk::open(&session, service)?;
    let mut live = Live { track: Track::with_capacity(expected), ..Live::default() };
    let schedule = Schedule::of(raws, service.args.speed);
    let end = watch(&mut desk, &mut children, &mut live, expected, &schedule, &stop, progress);
    if end == End::Complete && service.supervised().contains(&Process::Recorder) {
        desk.wait_for_recorder(&mut live);
    }
    live.notes.extend(desk.recorder_says());
    live.problem = match end {
        End::Complete => None,
        End::Failed(why) => Some(why),
        End::SupervisorLost => Some("supervisor lost".to_owned()),
    };
    let lost = live.problem.as_deref() == Some("supervisor lost");
    drop((desk, session));
    children.end(lost);
    Ok(live)
}

/// How watching ended.
#[derive(Debug, PartialEq, Eq)]
enum End {
    Complete,
    Failed(String),
    SupervisorLost,
}

fn watch(
    desk: &mut Desk,
    children: &mut Children,
    live: &mut Live,
    expected: usize,
    schedule: &Schedule,
    stop: &AtomicBool,
    progress: &ProgressBar,
) -> End {
    let mut heard = now();
    let mut first = None;
    loop {
        desk.listener.wait(WAIT);
        let before = live.track.len();
        if let Err(why) = desk.take_in(&mut live.track) {
            return End::Failed(why);
        }
        if live.track.len() > before {
            heard = now();
            let first = *first.get_or_insert(heard);
            live.seconds = kerbside_messages::seconds(heard - first);
            progress.set_position(live.track.len() as u64);
        }
        desk.uptaker.tell(live.track.newest.map_or(0, |odometry| odometry.header.sequence));
        if live.track.len() >= expected {
            return End::Complete;
        }
        if stop.load(Ordering::Relaxed) {
            return End::Failed(INTERRUPTED.to_owned());
        }
        let silence = nanos(desk.supervisor_silence);
        if children.supervisor_ended() || desk.state_age(now()).is_some_and(|age| age > silence) {
            return End::SupervisorLost;
        }
        if let Some(why) = desk.state.get().and_then(failure) {
            return End::Failed(why);
        }
        if now() > heard + STALL + schedule.longest {
            return End::Failed(format!(
                "no more odometry after {} of {expected}",
                live.track.len()
            ));
        }
    }
}

/// What of the processes on the way makes the rest of a replay worthless.
fn failure(state: &State) -> Option<String> {
    let broken = |row: &&ProcessRow| {
        let known = ProcessState::from_code(row.state);
        let bad = matches!(
            known,
            Some(ProcessState::Silent | ProcessState::Dead | ProcessState::GivenUp)
        );
        row.process != Process::Recorder as u8 && (bad || row.restarts > 0)
    };
    let row = state.rows().iter().find(broken)?;
    let process = Process::from_id(row.process).map_or("a process", Process::name);
    let how = match ProcessState::from_code(row.state) {
        Some(ProcessState::Silent) => "fell silent",
        _ => "died",
    };
    Some(format!("{process} {how}; state: {}", cause_of(state)))
}

/// When readings are due.
struct Schedule {
    /// Longest pause between two readings at this speed \[ns\].
    longest: Nanos,
}

impl Schedule {
    fn of(raws: &[Raw], speed: Option<f64>) -> Self {
        let pause = |pair: &[Raw]| pair[1].arrival.saturating_sub(pair[0].arrival);
        let longest = raws.windows(2).map(pause).max().unwrap_or(0);
        let scaled = |speed| kerbside_messages::nanos(kerbside_messages::seconds(longest) / speed);
        Self { longest: speed.map_or(0, scaled) }
    }
}

/// The operator's ports.
struct Desk {
    odometry: Subscriber<Odometry>,
    listener: Listener,
    uptaker: Uptaker,
    uptakes: Subscriber<Uptake>,
    state: Newest<State>,
    recorded: u64,
    supervisor_silence: Duration,
}

impl Desk {
    fn open(session: &Session, service: &Service) -> Result<Self, SessionError> {
        Ok(Self {
            // There before the first uptake is told, and so before the first reading is sent.
            odometry: session.subscriber(None, depth(Odometry::TOPIC))?,
            listener: session.listener::<Odometry>()?,
            uptaker: Uptaker::open(session, Process::Operator)?,
            uptakes: session.subscriber(None, depth(Uptake::TOPIC))?,
            state: Newest::of(session.subscriber(None, 1)?),
            recorded: 0,
            supervisor_silence: service.safety().timeouts.supervisor_silence,
        })
    }

    /// Takes in what came; the error says what cannot be mended: a sample that never came, another life.
    fn take_in(&mut self, track: &mut Track) -> Result<(), String> {
        while let Some(odometry) = self.odometry.receive() {
            if odometry.new_epoch && !track.is_empty() {
                return Err("estimator died; another life of it goes on elsewhere".to_owned());
            }
            let expected = track.len() as u64 + 1;
            if odometry.header.sequence != expected {
                let lost = odometry.header.sequence.saturating_sub(expected);
                return Err(format!("{lost} samples of odometry were lost on the way"));
            }
            track.push(&odometry);
        }
        self.state.update();
        self.take_in_uptakes();
        Ok(())
    }

    fn take_in_uptakes(&mut self) {
        while let Some(uptake) = self.uptakes.receive() {
            if uptake.reader == Process::Recorder as u8 {
                self.recorded = uptake.odometry;
            }
        }
    }

    fn state_age(&self, now: Nanos) -> Option<Nanos> {
        self.state.age(now)
    }

    /// Waits until the recorder has taken in the last of it; a recorder that does not is said.
    fn wait_for_recorder(&mut self, live: &mut Live) {
        let (last, deadline) = (live.track.len() as u64, now() + LAST);
        while self.recorded < last && now() < deadline {
            self.listener.wait(WAIT);
            self.uptaker.tell(last);
            self.state.update();
            self.take_in_uptakes();
        }
        if self.recorded < last {
            live.notes.push(format!("recording: only {} of {last} estimates", self.recorded));
        }
    }

    /// What the recorder has to say: a full disk, or that it was restarted.
    fn recorder_says(&self) -> Vec<String> {
        let state = self.state.get();
        let rows = state.map(State::rows).unwrap_or_default();
        let row = rows.iter().find(|row| row.process == Process::Recorder as u8);
        let mut said = Vec::new();
        if let Some(row) = row {
            let words = text::as_str(&row.waiting_for);
            said.extend(
                (row.restarts > 0).then(|| "recorder died: the recording has a hole".to_owned()),
            );
            said.extend((!words.is_empty()).then(|| format!("recorder: {words}")));
        }
        said
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(rows: &[(Process, ProcessState, u32)]) -> State {
        let mut state = State { rows: rows.len() as u32, ..State::default() };
        for (row, (process, condition, restarts)) in state.processes.iter_mut().zip(rows) {
            (row.process, row.state) = (*process as u8, condition.code());
            row.restarts = *restarts;
        }
        state
    }

    #[test]
    fn a_death_on_the_way_ends_a_replay_and_is_named() {
        use ProcessState::{Dead, Healthy, Silent, Starting};
        let fine = [(Process::Interface, Starting, 0), (Process::Ingest, Healthy, 0)];
        assert_eq!(failure(&state(&fine)), None);
        let dead = failure(&state(&[(Process::Ingest, Dead, 0)])).unwrap();
        assert!(dead.starts_with("ingest died"), "{dead}");
        let back = failure(&state(&[(Process::Estimator, Healthy, 1)])).unwrap();
        assert!(back.starts_with("estimator died"), "{back}");
        let silent = failure(&state(&[(Process::Interface, Silent, 0)])).unwrap();
        assert!(silent.starts_with("interface fell silent"), "{silent}");
        assert_eq!(failure(&state(&[(Process::Recorder, Dead, 1)])), None);
    }

    #[test]
    fn a_slow_replay_may_pause_as_long_as_the_drive_did() {
        let raws = [0, 10, 2_000_000_010].map(|arrival| Raw { arrival, ..Raw::default() });
        assert_eq!(Schedule::of(&raws, None).longest, 0);
        assert_eq!(Schedule::of(&raws, Some(0.5)).longest, 4_000_000_000);
    }
}
