//! The recorder: samples to disk.
//!
//! Topics in: every recorded topic of the table. It polls, so that no publisher pays for it; the subscribers' buffers
//! hold what comes while the disk is busy. A disk that is full, or too slow even for them, costs the recording alone,
//! and `status` says so.

use core::cell::Cell;
use core::time::Duration;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use kerbside_messages::{
    Actuator, Command, Fix, Header, Heartbeat, Inhibit, Message, Odometry, Permit, Process, Raw,
    Restore, State, Travel, Truth,
};
use kerbside_recordings::recording::{Chunks, Provenance, RecordingWriter, WriteError};
use kerbside_runtime::{PlanSubscriber, Session, SessionError, Subscriber, Ticker, depth, now};
use kerbside_settings::Compression;

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

/// A recording in a file.
type Writer = RecordingWriter<File>;
/// One topic's way into the recording; tells how many of its samples were overwritten before they got there.
type Feed = Box<dyn FnMut(&mut Writer) -> Result<u64, WriteError>>;

struct Recorder {
    feeds: Vec<Feed>,
    poll: Ticker,
    disk: Disk,
    lost: u64,
    /// Sequence of the newest odometry taken in.
    taken: Rc<Cell<u64>>,
    /// In a replay, where that is told.
    uptaker: Option<Uptaker>,
}

/// The file, while it can be written.
enum Disk {
    Open { writer: Box<Writer>, path: PathBuf },
    Failed { why: String },
}

impl Recorder {
    fn open(session: &Session, service: &Service) -> Result<Self, SessionError> {
        let taken = Rc::new(Cell::new(0));
        let newest = Rc::clone(&taken);
        let mut feeds = vec![
            raw_feed(session, service)?,
            feed::<Travel>(session, None)?,
            feed_seen::<Odometry>(session, None, move |header| newest.set(header.sequence))?,
            feed::<Restore>(session, None)?,
            feed::<Fix>(session, None)?,
            plan_feed(session)?,
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
        Ok(Self { feeds, poll, disk, lost: 0, taken, uptaker })
    }

    fn record(&mut self, worker: &Worker) {
        self.poll.wait();
        worker.progress();
        self.take_in(worker);
        if let Some(uptaker) = &mut self.uptaker {
            // Where nothing is recorded any more, nobody needs to wait for it.
            let recording = matches!(self.disk, Disk::Open { .. });
            uptaker.tell(if recording { self.taken.get() } else { u64::MAX });
        }
    }

    fn take_in(&mut self, worker: &Worker) {
        match &mut self.disk {
            Disk::Open { writer, path } => match take_in(&mut self.feeds, writer) {
                Ok(lost) if lost > self.lost => {
                    self.lost = lost;
                    tracing::warn!(lost, "samples came faster than the disk takes them");
                    worker.says(&format!("{lost} samples lost: the disk is slow"));
                }
                Ok(_) => {}
                Err(error) => {
                    tracing::error!(path = %path.display(), %error, "recording ends here; everything else goes on");
                    self.disk = Disk::Failed { why: format!("recording ended: {}", short(&error)) };
                }
            },
            Disk::Failed { why } => worker.says(why),
        }
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

/// The error in the few words that a heartbeat has room for.
fn short(error: &WriteError) -> String {
    match error {
        WriteError::DiskFull(_) => "the disk is full".to_owned(),
        WriteError::FileTooLarge(_) => "the file may not grow".to_owned(),
        WriteError::Io(error) => error.kind().to_string(),
        other => other.to_string(),
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        let Disk::Open { writer, path } = &mut self.disk else { return };
        match writer.finish() {
            Ok(closed) => {
                let (messages, chunks, lost) = (closed.messages, closed.chunks, self.lost);
                tracing::info!(path = %path.display(), messages, chunks, lost, "recording closed");
            }
            Err(error) => {
                tracing::error!(path = %path.display(), %error, "recording not closed; recording recover reads it");
            }
        }
    }
}

impl Disk {
    fn create(service: &Service) -> Self {
        let path = free_path(&recording_path(service));
        let opened = path.parent().map_or(Ok(()), fs::create_dir_all).map_err(WriteError::from);
        let opened = opened.and_then(|()| {
            RecordingWriter::create_in_chunks(&path, &provenance(service), now(), chunks(service))
        });
        match opened {
            Ok(writer) => {
                tracing::info!(path = %path.display(), "recording");
                Self::Open { writer: Box::new(writer), path }
            }
            Err(error) => {
                tracing::error!(path = %path.display(), %error, "no recording; everything else goes on");
                Self::Failed { why: format!("no recording: {}", short(&error)) }
            }
        }
    }
}

fn chunks(service: &Service) -> Chunks {
    let settings = &service.stack.recorder;
    Chunks {
        bytes: settings.chunk_size as usize,
        compressed: settings.compression == Compression::Lz4,
    }
}

/// Where to record: as asked for, else in the configured folder, else in the user's state folder.
fn recording_path(service: &Service) -> PathBuf {
    if let Some(path) = &service.args.recording {
        return path.clone();
    }
    let folder = service
        .stack
        .recorder
        .folder
        .clone()
        .unwrap_or_else(|| crate::output::state_folder().join("recordings"));
    folder.join(format!("{}-{}.mcap", service.instance.name(), crate::output::stamp()))
}

/// A restarted recorder must not overwrite what its predecessor saved.
fn free_path(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let numbered = |number: u32| path.with_file_name(format!("{stem}-{number}.mcap"));
    core::iter::once(path.to_owned())
        .chain((2..).map(numbered))
        .find(|path| !path.exists())
        .unwrap_or_default()
}

fn provenance(service: &Service) -> Provenance {
    Provenance {
        version: Some(env!("CARGO_PKG_VERSION").to_owned()),
        instance: Some(service.instance.name().to_owned()),
        scenario: service.args.scenario.clone(),
        vehicle: Some(service.stack.vehicle_text.clone()),
        stack: Some(service.stack_text.clone()),
        ..Provenance::default()
    }
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

fn plan_feed(session: &Session) -> Result<Feed, SessionError> {
    let mut subscriber: PlanSubscriber = session.plan_subscriber()?;
    Ok(Box::new(move |writer| {
        if subscriber.update()
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

    #[test]
    fn what_ends_a_recording_fits_a_heartbeat() {
        let errors = [
            std::io::ErrorKind::StorageFull,
            std::io::ErrorKind::FileTooLarge,
            std::io::ErrorKind::PermissionDenied,
        ];
        for kind in errors {
            let words = format!("recording ended: {}", short(&std::io::Error::from(kind).into()));
            assert!(words.len() <= Heartbeat::default().text.len(), "{words}");
        }
    }

    #[test]
    fn a_successor_takes_another_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        assert_eq!(free_path(&path), path);
        fs::write(&path, "").unwrap();
        fs::write(folder.path().join("run-2.mcap"), "").unwrap();
        assert_eq!(free_path(&path), folder.path().join("run-3.mcap"));
    }
}
