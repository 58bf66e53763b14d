//! The recorder: samples to disk.
//!
//! Topics in: every recorded topic of the table. It polls, so that no publisher pays for it; the subscribers' buffers
//! hold what comes while the disk is busy. A disk that is full, or too slow even for them, costs the recording alone,
//! and `status` says so. A file that has grown as large as the configuration allows is closed and the next one begun.

mod disk;
mod kept;

use core::cell::Cell;
use core::time::Duration;
use std::rc::Rc;

use kerbside_messages::{
    Actuator, Command, Fix, Header, Heartbeat, Inhibit, Message, Odometry, Permit, Process, Raw,
    Restore, State, Travel, Truth,
};
use kerbside_recordings::recording::WriteError;
use kerbside_runtime::{PlanSubscriber, Session, SessionError, Subscriber, Ticker, depth, now};

use self::disk::{Disk, Writer};
use crate::exit::{Exit, Failure};
use crate::life::{self, Service, Worker};
use crate::replay::Uptaker;

/// Time between looks at the topics.
const POLL: Duration = Duration::from_millis(20);
/// The same in a replay, which goes as fast as its slowest reader.
const REPLAY_POLL: Duration = Duration::from_millis(2);

/// Runs the recorder.
///
/// # Errors
/// [`Failure`] where the process cannot take part.
pub fn run(service: &Service) -> Result<Exit, Failure> {
    life::run_with_worker(service, Recorder::open, |recorder, worker| recorder.record(worker))
}

/// One topic's way into the recording; tells how many of its samples were overwritten before they got there.
type Feed = Box<dyn FnMut(&mut Writer) -> Result<u64, WriteError>>;

struct Recorder {
    feeds: Vec<Feed>,
    poll: Ticker,
    disk: Disk,
    lost: u64,
    /// A new file was begun: the standing plan is to be written into it.
    restate_plan: Rc<Cell<bool>>,
    /// Sequence of the newest odometry taken in.
    taken: Rc<Cell<u64>>,
    /// In a replay, where that is told.
    uptaker: Option<Uptaker>,
}

impl Recorder {
    fn open(session: &Session, service: &Service) -> Result<Self, SessionError> {
        let taken = Rc::new(Cell::new(0));
        let newest = Rc::clone(&taken);
        let restate_plan = Rc::new(Cell::new(false));
        let mut feeds = vec![
            raw_feed(session, service)?,
            feed::<Travel>(session, None)?,
            feed_seen::<Odometry>(session, None, move |header| newest.set(header.sequence))?,
            feed::<Restore>(session, None)?,
            feed::<Fix>(session, None)?,
            plan_feed(session, Rc::clone(&restate_plan))?,
            feed::<Command>(session, None)?,
            feed::<Permit>(session, None)?,
            feed::<Inhibit>(session, None)?,
            feed::<Actuator>(session, None)?,
            feed::<State>(session, None)?,
            feed::<Truth>(session, None)?,
        ];
        for process in service.supervised() {
            feeds.push(feed::<Heartbeat>(session, Some(process))?);
        }
        let disk = Disk::create(service);
        let replays = service.replays();
        let uptaker = replays.then(|| Uptaker::open(session, Process::Recorder)).transpose()?;
        let poll = Ticker::new(if replays { REPLAY_POLL } else { POLL });
        Ok(Self { feeds, poll, disk, lost: 0, restate_plan, taken, uptaker })
    }

    fn record(&mut self, worker: &Worker) {
        self.poll.wait();
        worker.progress();
        self.take_in(worker);
        if let Some(uptaker) = &mut self.uptaker {
            // Where nothing is recorded any more, nobody needs to wait for it.
            uptaker.tell(if self.disk.is_open() { self.taken.get() } else { u64::MAX });
        }
    }

    fn take_in(&mut self, worker: &Worker) {
        let Some(writer) = self.disk.writer() else {
            worker.says(self.disk.why());
            return;
        };
        match take_in(&mut self.feeds, writer) {
            Ok(lost) => {
                if lost > self.lost {
                    self.lost = lost;
                    tracing::warn!(lost, "samples came faster than the disk takes them");
                    worker.says(&format!("{lost} samples lost: the disk is slow"));
                }
                // A file of its own needs the plan that stands, too.
                self.restate_plan.set(self.disk.begin_next_if_full());
            }
            Err(error) => self.disk.fail(&error),
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.disk.close(self.lost);
    }
}

/// Records what came; how many samples were lost so far.
fn take_in(feeds: &mut [Feed], writer: &mut Writer) -> Result<u64, WriteError> {
    let mut lost = 0;
    for feed in feeds {
        lost = u64::saturating_add(lost, feed(writer)?);
    }
    writer.close_chunk_if_older(now())?;
    Ok(lost)
}

fn feed<M: Message>(session: &Session, process: Option<Process>) -> Result<Feed, SessionError> {
    feed_seen::<M>(session, process, |_| ())
}

/// The same, each sample's header being shown to `see`.
fn feed_seen<M: Message>(
    session: &Session,
    process: Option<Process>,
    see: impl Fn(&Header) + 'static,
) -> Result<Feed, SessionError> {
    let mut subscriber: Subscriber<M> = session.subscriber(process, depth(M::TOPIC))?;
    let mut gaps = Gaps::default();
    Ok(Box::new(move |writer| {
        while let Some(sample) = subscriber.receive() {
            gaps.take(sample.header());
            see(sample.header());
            writer.write_message(&*sample, &[], now())?;
        }
        Ok(gaps.lost)
    }))
}

/// Readings; what of a replay's sequence is missing was lost long ago, and is no loss of this recorder.
fn raw_feed(session: &Session, service: &Service) -> Result<Feed, SessionError> {
    let mut raw = feed::<Raw>(session, None)?;
    let counts = u64::from(!service.replays());
    Ok(Box::new(move |writer| Ok(counts * raw(writer)?)))
}

fn plan_feed(session: &Session, restate: Rc<Cell<bool>>) -> Result<Feed, SessionError> {
    let mut subscriber: PlanSubscriber = session.plan_subscriber()?;
    Ok(Box::new(move |writer| {
        if (subscriber.update() | restate.take())
            && let Some((head, points)) = subscriber.get()
        {
            writer.write_message(head, bytemuck::cast_slice(points), now())?;
        }
        Ok(0)
    }))
}

/// Counts what a topic's sequence skips: the receiver's own count leaves out topics of which the newest counts.
#[derive(Clone, Copy, Debug, Default)]
struct Gaps {
    newest: Option<(u64, u64)>,
    lost: u64,
}

impl Gaps {
    fn take(&mut self, header: &Header) {
        if let Some((epoch, sequence)) = self.newest
            && epoch == header.epoch
        {
            let missing = header.sequence.saturating_sub(sequence).saturating_sub(1);
            self.lost = self.lost.saturating_add(missing);
        }
        self.newest = Some((header.epoch, header.sequence));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_counted_within_a_publishers_life() {
        let mut gaps = Gaps::default();
        for (epoch, sequence) in [(1, 5), (1, 6), (1, 9), (2, 1), (2, 2), (2, 4)] {
            gaps.take(&Header { epoch, sequence, ..Header::default() });
        }
        assert_eq!(gaps.lost, 2 + 1);
        // Nor does a sequence of a hostile publisher end the recorder.
        for (epoch, sequence) in [(3, 1), (3, u64::MAX), (3, 1), (4, 1), (4, u64::MAX)] {
            gaps.take(&Header { epoch, sequence, ..Header::default() });
        }
        assert_eq!(gaps.lost, u64::MAX);
    }
}
