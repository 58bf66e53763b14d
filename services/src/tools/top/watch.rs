//! What `top` sees: every topic through a small buffer, and what the kernel knows of the processes.

use kerbside_messages::topics::{Delivery, HEARTBEAT, STATE, TABLE};
use kerbside_messages::{
    Heartbeat, Mode, Nanos, Process, ProcessState, Refusal, State, Topic, seconds, text,
};
use kerbside_runtime::{FileLock, Instance, Session, SessionError, now};

use super::super::Named;
use super::super::pace::Pace;
use super::super::tap::Tap;
use super::usage::{Meter, Usage};
use crate::manoeuvre::cause_of;

/// Samples that wait for this tool at most: rates come from sequences, so the newest are enough; of heartbeats all are
/// wanted, and one comes every 20 ms.
const BUFFER: usize = 4;

/// Looks at a stack.
pub struct Watch {
    taps: Vec<Watched>,
    state: Option<State>,
    beats: Vec<(Process, Beat)>,
    meters: Vec<(&'static str, Meter)>,
}

/// A topic, and what was heard of it since the last snapshot.
struct Watched {
    topic: &'static Topic,
    /// None where its places for guests are taken.
    tap: Option<Tap>,
    pace: Pace,
    newest: Option<Nanos>,
}

/// The heartbeats of a process since the last snapshot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beat {
    /// Mean time spent in a step \[s\].
    pub work_mean: f64,
    /// Longest time spent in a step \[s\].
    pub work_max: f64,
    /// Longest time from an input's arrival to the end of its step \[s\].
    pub lateness_max: f64,
    /// Deadlines missed since its start.
    pub misses: u64,
    /// Samples lost on the way since its start.
    pub lost: u64,
    /// Samples refused since its start.
    pub refused: u64,
    /// Heartbeats that came.
    pub count: u32,
}

impl Beat {
    fn take(&mut self, beat: &Heartbeat) {
        self.count += 1;
        self.work_mean += (beat.work_mean - self.work_mean) / f64::from(self.count);
        self.work_max = self.work_max.max(beat.work_max);
        self.lateness_max = self.lateness_max.max(beat.lateness_max);
        (self.misses, self.lost, self.refused) = (beat.misses, beat.lost, beat.refused);
    }
}

/// The stack at one instant.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Name of the instance.
    pub instance: String,
    /// Its mode, in words.
    pub mode: &'static str,
    /// Why, in words; empty where there is nothing to say.
    pub cause: String,
    /// A line per process.
    pub processes: Vec<ProcessLine>,
    /// A line per topic that can be listened to.
    pub topics: Vec<TopicLine>,
}

/// A process.
#[derive(Clone, Debug)]
pub struct ProcessLine {
    /// Its name.
    pub name: &'static str,
    /// Its pid; 0 for none.
    pub pid: u32,
    /// Its state, in words.
    pub state: &'static str,
    /// How often it was restarted.
    pub restarts: u32,
    /// Deadlines it missed.
    pub misses: u32,
    /// Its heartbeats; none where none came.
    pub beat: Option<Beat>,
    /// What the kernel accounts to it.
    pub usage: Usage,
    /// What it waits for, or says.
    pub says: String,
}

/// A topic.
#[derive(Clone, Debug)]
pub struct TopicLine {
    /// Its line of the table.
    pub topic: &'static Topic,
    /// Samples sent per second \[Hz\].
    pub rate: Option<f64>,
    /// Age of the newest sample's content now \[s\].
    pub age: Option<f64>,
    /// Samples that this tool's own small buffer passed over.
    pub skipped: u64,
    /// Samples that failed this tool's checks, since it looks.
    pub refused: u64,
    /// Why the newest of them did.
    pub refusal: Option<Refusal>,
    /// Nobody may listen any more: all places for guests are taken.
    pub full: bool,
}

impl TopicLine {
    /// The rate of the table, of all services together \[Hz\].
    #[must_use]
    pub fn nominal(&self) -> Option<f64> {
        Named { topic: self.topic, process: None }.nominal()
    }
}

impl Watch {
    /// Subscribes to every topic.
    ///
    /// # Errors
    /// [`SessionError`] where even the state cannot be listened to.
    pub fn open(session: &Session) -> Result<Self, SessionError> {
        let mut taps = Vec::new();
        for topic in TABLE.iter().filter(|topic| topic.delivery != Delivery::RequestResponse) {
            let tap = match Tap::open(session, Named { topic, process: None }, BUFFER) {
                Ok(tap) => Some(tap),
                Err(SessionError::Full { .. }) if topic.id != STATE.id => None,
                Err(error) => return Err(error),
            };
            taps.push(Watched { topic, tap, pace: Pace::default(), newest: None });
        }
        let meter = |process: Process| {
            let mut meter = Meter::default();
            // A share of a processor is between two looks: this is the first.
            if let Some(pid) = FileLock::holder(&session.instance().process_lock(process)) {
                meter.read(pid);
            }
            (process.name(), meter)
        };
        let meters = Process::ALL.into_iter().map(meter).collect();
        Ok(Self { taps, state: None, beats: Vec::new(), meters })
    }

    /// Takes in what came.
    pub fn take_in(&mut self) {
        for watched in &mut self.taps {
            let Some(tap) = &mut watched.tap else { continue };
            tap.take(|sample| {
                watched.pace.take(sample.process, sample.header);
                watched.newest = Some(sample.header.stamp.max(watched.newest.unwrap_or(0)));
                if watched.topic.id == STATE.id {
                    self.state = Some(bytemuck::pod_read_unaligned(sample.bytes));
                } else if watched.topic.id == HEARTBEAT.id {
                    take_beat(&mut self.beats, &bytemuck::pod_read_unaligned(sample.bytes));
                }
            });
        }
    }

    /// What was seen since the last one.
    pub fn snapshot(&mut self, instance: &Instance) -> Snapshot {
        let beats = core::mem::take(&mut self.beats);
        let state = self.state.unwrap_or_default();
        let processes = self.processes(instance, &state, &beats);
        let topics = self.taps.iter_mut().map(Watched::line).collect();
        let mode = self.state.map_or("silent", |state| state.mode().name());
        let cause = if self.state.is_some() { cause_of(&state) } else { String::new() };
        Snapshot { instance: instance.name().to_owned(), mode, cause, processes, topics }
    }

    fn processes(
        &mut self,
        instance: &Instance,
        state: &State,
        beats: &[(Process, Beat)],
    ) -> Vec<ProcessLine> {
        let mut lines: Vec<_> = state
            .rows()
            .iter()
            .filter_map(|row| {
                let process = Process::from_id(row.process)?;
                let state =
                    ProcessState::from_code(row.state).map_or("unknown", ProcessState::name);
                let beat = beats.iter().find(|(of, _)| *of == process).map(|(_, beat)| *beat);
                Some(ProcessLine {
                    name: process.name(),
                    pid: row.pid,
                    state,
                    restarts: row.restarts,
                    misses: row.misses,
                    beat,
                    usage: Usage::default(),
                    says: text::as_str(&row.waiting_for).to_owned(),
                })
            })
            .collect();
        for process in [Process::Supervisor, Process::Vehicle] {
            if let Some(pid) = FileLock::holder(&instance.process_lock(process)) {
                lines.push(outside(process, pid));
            }
        }
        for line in &mut lines {
            if let Some((_, meter)) = self.meters.iter_mut().find(|(name, _)| *name == line.name) {
                line.usage = meter.read(line.pid);
            }
        }
        lines
    }
}

/// A process that nobody supervises.
fn outside(process: Process, pid: u32) -> ProcessLine {
    ProcessLine {
        name: process.name(),
        pid,
        state: "alive",
        restarts: 0,
        misses: 0,
        beat: None,
        usage: Usage::default(),
        says: String::new(),
    }
}

fn take_beat(beats: &mut Vec<(Process, Beat)>, beat: &Heartbeat) {
    let Some(process) = Process::from_id(beat.process) else { return };
    if !beats.iter().any(|(known, _)| *known == process) {
        beats.push((process, Beat::default()));
    }
    if let Some((_, known)) = beats.iter_mut().find(|(known, _)| *known == process) {
        known.take(beat);
    }
}

impl Watched {
    /// The line of this topic; what is heard from now on is of the next one.
    fn line(&mut self) -> TopicLine {
        let pace = core::mem::take(&mut self.pace);
        let refusals = self.tap.as_ref().map(Tap::refusals).unwrap_or_default();
        TopicLine {
            topic: self.topic,
            rate: pace.rate(),
            age: self.newest.map(|stamp| seconds(now().saturating_sub(stamp))),
            skipped: pace.lost(),
            refused: refusals.total(),
            refusal: refusals.newest,
            full: self.tap.is_none(),
        }
    }
}

impl core::fmt::Debug for Watch {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "Watch({} topics, {:?})",
            self.taps.len(),
            self.state.map(|state| Mode::name(state.mode()))
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heartbeats_are_drawn_together_by_process() {
        let mut beats = Vec::new();
        let beat = |process: Process, work, late| Heartbeat {
            process: process as u8,
            work_mean: work,
            work_max: 2.0 * work,
            lateness_max: late,
            misses: 3,
            ..Heartbeat::default()
        };
        take_beat(&mut beats, &beat(Process::Ingest, 1e-4, 2e-3));
        take_beat(&mut beats, &beat(Process::Tracker, 9e-4, 0.0));
        take_beat(&mut beats, &beat(Process::Ingest, 3e-4, 1e-3));
        take_beat(&mut beats, &Heartbeat { process: 99, ..Heartbeat::default() });
        let (process, ingest) = beats[0];
        assert_eq!((beats.len(), process), (2, Process::Ingest));
        assert!((ingest.work_mean - 2e-4).abs() < 1e-12 && (ingest.work_max - 6e-4).abs() < 1e-12);
        assert_eq!((ingest.lateness_max, ingest.misses), (2e-3, 3));
    }
}
