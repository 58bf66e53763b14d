//! Recorded readings in place of a vehicle.
//!
//! Topics in: `uptake`. Topics out: `raw`, each reading with its recorded arrival; only `sent` is now.
//!
//! Readings begin once everybody who reads is there, and never run more than [`AHEAD`] estimates ahead of the slowest
//! of them: nobody's buffer overflows, however fast it goes.

use core::time::Duration;

use kerbside_messages::{
    Admission, Message, Nanos, Process, ProcessState, Raw, State, Uptake, seal,
};
use kerbside_runtime::{Listener, Publisher, Subscriber, now};

use crate::exit::{Exit, Failure};
use crate::life::{Life, Service, nanos};
use crate::replay::{Input, Order, only_source};

/// Estimates that may be on their way: half a buffer.
const AHEAD: u64 = kerbside_messages::topics::IN_ORDER as u64 / 2;
/// Longest wait.
const WAIT: Duration = Duration::from_millis(10);

/// Runs the interface.
///
/// # Errors
/// [`Failure`] where the process cannot take part, or its input cannot be read.
pub fn run(service: &Service) -> Result<Exit, Failure> {
    let Some(path) = &service.args.input else {
        return Err(Failure::internal("a replay without input"));
    };
    let input = Input::open(&only_source(path)?, service.args.vehicle.as_deref())?;
    let mut life = Life::join(service, 1)?;
    let mut raw = life.publisher::<Raw>()?;
    let mut readers = Readers::open(&life, service)?;
    let listener = life.listener::<Uptake>()?;
    let mut feed = Feed::new(&input.raws, service.args.speed);
    while life.goes_on() {
        wait(&listener, &feed, &readers);
        readers.take_in(feed.leading);
        if feed.begun.is_none() {
            let missing = if service.args.restarted {
                Some("its end: a replay that died does not go on")
            } else {
                readers.missing(life.state())
            };
            life.waits_for(missing);
            feed.begun = missing.is_none().then(now);
            continue;
        }
        life.begin(now());
        readers.judge_recorder(life.state());
        feed.send(&mut raw, readers.slowest().saturating_add(AHEAD));
        life.checkpoint(0);
        life.end();
    }
    Ok(life.exit())
}

fn wait(listener: &Listener, feed: &Feed<'_>, readers: &Readers) {
    let latest = now() + nanos(WAIT);
    let held = feed.leading >= readers.slowest().saturating_add(AHEAD);
    let due = feed.due().filter(|_| !held);
    listener.wait_until(due.map_or(latest, |due| due.min(latest)));
}

/// Readings, sent one after the other.
struct Feed<'a> {
    raws: core::iter::Peekable<core::slice::Iter<'a, Raw>>,
    first: Nanos,
    speed: Option<f64>,
    /// When the first reading was due.
    begun: Option<Nanos>,
    epoch: u64,
    order: Order,
    /// What ingest will say to each reading.
    admission: Admission<Raw>,
    /// Readings sent that lead to an estimate.
    leading: u64,
}

impl<'a> Feed<'a> {
    fn new(raws: &'a [Raw], speed: Option<f64>) -> Self {
        Self {
            raws: raws.iter().peekable(),
            first: raws.first().map_or(0, |raw| raw.arrival),
            speed,
            begun: None,
            epoch: now(),
            order: Order::default(),
            admission: Admission::default(),
            leading: 0,
        }
    }

    /// When the next reading is to be sent; none where none is left, or nothing may be sent yet.
    fn due(&self) -> Option<Nanos> {
        let (begun, next) = (self.begun?, self.raws.clone().next()?);
        let Some(speed) = self.speed else { return Some(begun) };
        let since = kerbside_messages::seconds(next.arrival.saturating_sub(self.first));
        Some(begun.saturating_add(kerbside_messages::nanos(since / speed)))
    }

    /// Sends what is due, until so many have been sent that lead to an estimate.
    fn send(&mut self, publisher: &mut Publisher<Raw>, limit: u64) {
        let now = now();
        while self.leading < limit && self.due().is_some_and(|due| due <= now) {
            let Some(raw) = self.raws.next() else { return };
            self.send_one(publisher, raw);
        }
    }

    fn send_one(&mut self, publisher: &mut Publisher<Raw>, raw: &Raw) {
        let (mut sealed, place, sent) = (*raw, self.order.place(raw), now());
        seal(&mut sealed, &[], self.epoch + place.life, place.sequence, sent);
        self.leading += u64::from(self.admission.admit(&sealed, &[], sent).is_ok());
        if let Err(error) = publisher.send_sealed(&sealed) {
            tracing::error!(%error, "reading lost");
        }
    }
}

/// One who takes in estimates.
#[derive(Clone, Copy, Debug)]
struct Reader {
    epoch: u64,
    taken: u64,
}

/// Those who take in estimates: the operator who asked for the replay, and the recorder where there is one.
struct Readers {
    uptake: Subscriber<Uptake>,
    operator: Option<Reader>,
    recorder: Option<Reader>,
    records: bool,
}

impl Readers {
    fn open(life: &Life, service: &Service) -> Result<Self, Failure> {
        Ok(Self {
            uptake: life.subscriber(kerbside_runtime::depth(Uptake::TOPIC))?,
            operator: None,
            recorder: None,
            records: service.supervised().contains(&Process::Recorder),
        })
    }

    /// Takes in how far each has come, `leading` estimates being expected by now.
    fn take_in(&mut self, leading: u64) {
        while let Some(uptake) = self.uptake.receive() {
            let reader = match Process::from_id(uptake.reader) {
                Some(Process::Operator) => &mut self.operator,
                Some(Process::Recorder) => &mut self.recorder,
                _ => continue,
            };
            let (epoch, taken) = (uptake.header.epoch, uptake.odometry);
            match reader {
                Some(known) if known.epoch == epoch => known.taken = known.taken.max(taken),
                // What was on its way before a reader came is none of its business.
                _ => *reader = Some(Reader { epoch, taken: taken.max(leading) }),
            }
        }
    }

    /// What has to be there before readings begin.
    fn missing(&self, state: Option<&State>) -> Option<&'static str> {
        let others_beat = state.is_some_and(|state| {
            state
                .rows()
                .iter()
                .filter(|row| row.process != Process::Interface as u8)
                .all(|row| row.state == ProcessState::Healthy.code())
        });
        if !others_beat {
            Some("the other processes")
        } else if self.operator.is_none() {
            Some("the operator who reads the odometry")
        } else if self.records && self.recorder.is_none() {
            Some("the recorder")
        } else {
            None
        }
    }

    /// A recorder that is not well is not waited for: its trouble costs the recording alone.
    fn judge_recorder(&mut self, state: Option<&State>) {
        let well = |state: &State| {
            state.rows().iter().any(|row| {
                row.process == Process::Recorder as u8 && row.state == ProcessState::Healthy.code()
            })
        };
        if state.is_some_and(|state| !well(state)) {
            self.recorder = None;
        }
    }

    /// How far the slowest has come.
    fn slowest(&self) -> u64 {
        let known = [self.operator, self.recorder].into_iter().flatten();
        known.map(|reader| reader.taken).min().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raws() -> Vec<Raw> {
        (0..5).map(|k| Raw { arrival: 1_000 + 100 * k, ..Raw::default() }).collect()
    }

    #[test]
    fn a_speed_sets_when_readings_are_due_and_none_makes_them_due_at_once() {
        let raws = raws();
        let mut feed = Feed::new(&raws, Some(0.5));
        assert_eq!(feed.due(), None);
        feed.begun = Some(50);
        assert_eq!(feed.due(), Some(50));
        feed.raws.nth(2);
        assert_eq!(feed.due(), Some(50 + 600));
        feed.speed = None;
        assert_eq!(feed.due(), Some(50));
        feed.raws.nth(1);
        assert_eq!(feed.due(), None);
    }
}
