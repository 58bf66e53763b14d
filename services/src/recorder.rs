//! The recorder: samples to disk.
//!
//! Topics in: every recorded topic of the table. It polls, so that no publisher pays for it, and a disk that blocks
//! or is full costs the recording alone.

use core::time::Duration;
use std::fs::File;
use std::path::{Path, PathBuf};

use kerbside_messages::{
    Actuator, Command, Fix, Heartbeat, Inhibit, Message, Odometry, Permit, Process, Raw, Restore,
    State, Travel, Truth,
};
use kerbside_recordings::recording::{Provenance, RecordingWriter, WriteError};
use kerbside_runtime::{PlanSubscriber, Session, SessionError, Subscriber, Ticker, depth, now};

use crate::exit::{Exit, Failure};
use crate::life::{self, Service, Worker};

/// Time between looks at the topics.
const POLL: Duration = Duration::from_millis(20);

/// Runs the recorder.
///
/// # Errors
/// [`Failure`] where the process cannot take part.
pub fn run(service: &Service) -> Result<Exit, Failure> {
    life::run_with_worker(service, Recorder::open, |recorder, worker| recorder.record(worker))
}

/// A recording in a file.
type Writer = RecordingWriter<File>;
/// One topic's way into the recording.
type Feed = Box<dyn FnMut(&mut Writer) -> Result<(), WriteError>>;

struct Recorder {
    feeds: Vec<Feed>,
    poll: Ticker,
    disk: Disk,
}

/// The file, while it can be written.
enum Disk {
    Open { writer: Box<Writer>, path: PathBuf },
    Failed,
}

impl Recorder {
    fn open(session: &Session, service: &Service) -> Result<Self, SessionError> {
        let mut feeds = vec![
            feed::<Raw>(session, None)?,
            feed::<Travel>(session, None)?,
            feed::<Odometry>(session, None)?,
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
        Ok(Self { feeds, poll: Ticker::new(POLL), disk: Disk::create(service) })
    }

    fn record(&mut self, worker: &Worker) {
        self.poll.wait();
        worker.progress();
        let Disk::Open { writer, path } = &mut self.disk else {
            return;
        };
        let fed = self.feeds.iter_mut().try_for_each(|feed| feed(writer));
        let done = fed.and_then(|()| writer.close_chunk_if_older(now()).map(|_| ()));
        if let Err(error) = done {
            tracing::error!(path = %path.display(), %error, "recording ends here; everything else goes on");
            worker.says(&format!("recording failed: {error}"));
            self.disk = Disk::Failed;
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Disk::Open { writer, path } = &mut self.disk
            && let Err(error) = writer.finish()
        {
            tracing::error!(path = %path.display(), %error, "recording not closed; recording recover reads it");
        }
    }
}

impl Disk {
    fn create(service: &Service) -> Self {
        let path = free_path(&recording_path(service));
        let opened = RecordingWriter::create(&path, &provenance(service), now());
        match opened {
            Ok(writer) => {
                tracing::info!(path = %path.display(), "recording");
                Self::Open { writer: Box::new(writer), path }
            }
            Err(error) => {
                tracing::error!(path = %path.display(), %error, "no recording; everything else goes on");
                Self::Failed
            }
        }
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
        vehicle: Some(service.stack.vehicle_text.to_string()),
        ..Provenance::default()
    }
}

fn feed<M: Message>(session: &Session, process: Option<Process>) -> Result<Feed, SessionError> {
    let mut subscriber: Subscriber<M> = session.subscriber(process, depth(M::TOPIC))?;
    Ok(Box::new(move |writer| {
        while let Some(sample) = subscriber.receive() {
            writer.write_message(&*sample, &[], now())?;
        }
        Ok(())
    }))
}

fn plan_feed(session: &Session) -> Result<Feed, SessionError> {
    let mut subscriber: PlanSubscriber = session.plan_subscriber()?;
    Ok(Box::new(move |writer| {
        if !subscriber.update() {
            return Ok(());
        }
        let Some((head, points)) = subscriber.get() else { return Ok(()) };
        writer.write_message(head, bytemuck::cast_slice(points), now())
    }))
}
