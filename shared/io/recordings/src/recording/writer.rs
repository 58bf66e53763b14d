//! Writing a recording.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::Path;

use bytemuck::bytes_of;
use kerbside_messages::schema::{encode_cdr, ros_definition, schema_name};
use kerbside_messages::topics::TABLE;
use kerbside_messages::{LAYOUT_VERSION, Message, Nanos, Topic};
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, WriteOptions};

use super::channel_name;
use super::provenance::{LAYOUT_KEY, METADATA, Provenance, STACK, VEHICLE};

/// A chunk is closed once it holds so many bytes before compression.
pub const CHUNK_BYTES: usize = 256 * 1024;
/// A chunk is closed once it spans so much time \[ns\].
pub const CHUNK_AGE: Nanos = 1_000_000_000;

/// How a recording is cut into chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chunks {
    /// A chunk is closed once it holds so many bytes before compression.
    pub bytes: usize,
    /// Whether they are compressed (LZ4).
    pub compressed: bool,
}

impl Default for Chunks {
    fn default() -> Self {
        Self { bytes: CHUNK_BYTES, compressed: true }
    }
}

/// Why something was not recorded. After the first of the writing errors nothing is recorded any
/// more, and nothing else is harmed.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// No space, or no quota, is left.
    #[error("the disk is full: {0}")]
    DiskFull(std::io::Error),
    /// The file may not grow further.
    #[error("the file has reached the largest size allowed: {0}")]
    FileTooLarge(std::io::Error),
    /// The operating system refused for another reason.
    #[error("{0}")]
    Io(std::io::Error),
    /// The container cannot hold it.
    #[error("{0}")]
    Container(McapError),
    /// A topic that is not recorded.
    #[error("topic {0} is not one that is recorded")]
    NotRecorded(&'static str),
    /// An earlier error ended the recording.
    #[error("an earlier error ended this recording")]
    Failed,
    /// The recording was completed.
    #[error("this recording is complete")]
    Complete,
}

impl From<std::io::Error> for WriteError {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Self::DiskFull(error),
            ErrorKind::FileTooLarge => Self::FileTooLarge(error),
            _ => Self::Io(error),
        }
    }
}

impl From<McapError> for WriteError {
    fn from(error: McapError) -> Self {
        match error {
            McapError::Io(error) => error.into(),
            other => Self::Container(other),
        }
    }
}

/// What a completed recording holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Closed {
    /// Messages.
    pub messages: u64,
    /// Chunks.
    pub chunks: u64,
}

pub(super) type Container<W> = mcap::Writer<NoSeek<BufWriter<W>>>;

/// An MCAP container on `sink` whose chunks are closed by [`mcap::Writer::flush`] alone. A chunk is
/// put together in memory, so that the file never holds one without its length.
pub(super) fn container<W: Write>(sink: W, chunks: Chunks) -> Result<Container<W>, McapError> {
    WriteOptions::new()
        .profile("ros2")
        .library(concat!("kerbside ", env!("CARGO_PKG_VERSION")))
        .compression(chunks.compressed.then_some(Compression::Lz4))
        .chunk_size(None)
        .disable_seeking(true)
        .create(NoSeek::new(BufWriter::with_capacity(CHUNK_BYTES, sink)))
}

enum State<W: Write> {
    Open(Box<Container<W>>),
    Failed,
    Complete,
}

/// A recording that is being written.
///
/// A chunk is closed, and handed to the operating system, when it holds [`Chunks::bytes`] or spans
/// [`CHUNK_AGE`], whichever comes first; where nothing is recorded for a while,
/// [`RecordingWriter::close_chunk_if_older`] sees to the second.
///
/// Dropping it without [`RecordingWriter::finish`] completes it too, without saying so.
pub struct RecordingWriter<W: Write> {
    state: State<W>,
    channels: BTreeMap<u16, u16>,
    cdr: Vec<u8>,
    /// Log time of the first message of the open chunk, and bytes in it.
    open_since: Option<Nanos>,
    open_bytes: usize,
    chunk_bytes: usize,
    closed: Closed,
}

impl RecordingWriter<File> {
    /// A new recording in the file `path`, which must not exist, begun at `now`.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn create(path: &Path, provenance: &Provenance, now: Nanos) -> Result<Self, WriteError> {
        Self::create_in_chunks(path, provenance, now, Chunks::default())
    }

    /// The same in other chunks than the usual ones.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn create_in_chunks(
        path: &Path,
        provenance: &Provenance,
        now: Nanos,
        chunks: Chunks,
    ) -> Result<Self, WriteError> {
        Self::in_chunks(File::create_new(path)?, provenance, now, chunks)
    }
}

impl<W: Write> RecordingWriter<W> {
    /// A new recording on `sink`, begun at `now`. Provenance and the schemas of all recorded topics
    /// have reached the sink when this returns.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn new(sink: W, provenance: &Provenance, now: Nanos) -> Result<Self, WriteError> {
        Self::in_chunks(sink, provenance, now, Chunks::default())
    }

    /// The same in other chunks than the usual ones.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn in_chunks(
        sink: W,
        provenance: &Provenance,
        now: Nanos,
        chunks: Chunks,
    ) -> Result<Self, WriteError> {
        let mut container = container(sink, chunks)?;
        write_provenance(&mut container, provenance, now)?;
        let channels = write_channels(&mut container)?;
        container.flush()?;
        Ok(Self {
            state: State::Open(Box::new(container)),
            channels,
            cdr: Vec::with_capacity(CHUNK_BYTES),
            open_since: None,
            open_bytes: 0,
            chunk_bytes: chunks.bytes,
            closed: Closed::default(),
        })
    }

    /// Records the bytes `message` of a sample of `topic`, followed by `tail`: handed over at
    /// `publish_time`, seen by the recorder at `log_time`.
    ///
    /// # Errors
    /// [`WriteError`]; [`WriteError::Failed`] ever after the first that came from writing.
    pub fn write(
        &mut self,
        topic: &Topic,
        log_time: Nanos,
        publish_time: Nanos,
        sequence: u64,
        message: &[u8],
        tail: &[u8],
    ) -> Result<(), WriteError> {
        let channel = self.channels.get(&topic.id).copied();
        let channel_id = channel.ok_or(WriteError::NotRecorded(topic.name))?;
        self.cdr.clear();
        encode_cdr(topic, message, tail, &mut self.cdr);
        #[allow(clippy::cast_possible_truncation)] // MCAP has 32 bits for it; the message has all.
        let header =
            MessageHeader { channel_id, sequence: sequence as u32, log_time, publish_time };
        let cdr = core::mem::take(&mut self.cdr);
        let written = self.attempt(|container| container.write_to_known_channel(&header, &cdr));
        self.open_bytes += cdr.len();
        self.cdr = cdr;
        written?;
        self.closed.messages += 1;
        self.open_since.get_or_insert(log_time);
        if self.open_bytes >= self.chunk_bytes {
            return self.close_chunk();
        }
        self.close_chunk_if_older(log_time).map(|_| ())
    }

    /// Records `message`, followed by `tail`, as seen at `log_time`.
    ///
    /// # Errors
    /// As [`RecordingWriter::write`].
    pub fn write_message<M: Message>(
        &mut self,
        message: &M,
        tail: &[u8],
        log_time: Nanos,
    ) -> Result<(), WriteError> {
        let header = message.header();
        let (sent, sequence) = (header.sent, header.sequence);
        self.write(M::TOPIC, log_time, sent, sequence, bytes_of(message), tail)
    }

    /// Closes the open chunk if its first message is older than [`CHUNK_AGE`] at `now`; whether it
    /// did.
    ///
    /// # Errors
    /// As [`RecordingWriter::write`].
    pub fn close_chunk_if_older(&mut self, now: Nanos) -> Result<bool, WriteError> {
        match self.open_since {
            Some(since) if now.saturating_sub(since) >= CHUNK_AGE => {
                self.close_chunk().map(|()| true)
            }
            _ => Ok(false),
        }
    }

    /// Closes the open chunk, where there is one: what was recorded so far survives a kill.
    ///
    /// # Errors
    /// As [`RecordingWriter::write`].
    pub fn close_chunk(&mut self) -> Result<(), WriteError> {
        let was_open = self.open_since.take().is_some();
        self.open_bytes = 0;
        self.attempt(mcap::Writer::flush)?;
        self.closed.chunks += u64::from(was_open);
        Ok(())
    }

    /// Completes the recording with index and footer.
    ///
    /// # Errors
    /// As [`RecordingWriter::write`].
    pub fn finish(&mut self) -> Result<Closed, WriteError> {
        self.close_chunk()?;
        self.attempt(|container| container.finish().map(|_| ()))?;
        self.state = State::Complete;
        Ok(self.closed)
    }

    /// Whether an error ended the recording.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        matches!(self.state, State::Failed)
    }

    /// What reached the operating system so far, and messages of the open chunk.
    #[must_use]
    pub fn written(&self) -> Closed {
        self.closed
    }

    fn attempt(
        &mut self,
        act: impl FnOnce(&mut Container<W>) -> Result<(), McapError>,
    ) -> Result<(), WriteError> {
        let container = match &mut self.state {
            State::Open(container) => container,
            State::Failed => return Err(WriteError::Failed),
            State::Complete => return Err(WriteError::Complete),
        };
        act(container).map_err(|error| {
            if let State::Open(container) = core::mem::replace(&mut self.state, State::Failed) {
                // What is left in the buffer must not follow a torn record later.
                drop(container.into_inner().into_inner().into_parts());
            }
            error.into()
        })
    }
}

fn write_provenance<W: Write>(
    container: &mut Container<W>,
    provenance: &Provenance,
    now: Nanos,
) -> Result<(), McapError> {
    let mut metadata = provenance.to_map();
    metadata.insert(LAYOUT_KEY.to_owned(), LAYOUT_VERSION.to_string());
    container.write_metadata(&Metadata { name: METADATA.to_owned(), metadata })?;
    for (name, text) in [(VEHICLE, &provenance.vehicle), (STACK, &provenance.stack)] {
        if let Some(text) = text {
            container.attach(&Attachment {
                log_time: now,
                create_time: now,
                name: name.to_owned(),
                media_type: "application/toml".to_owned(),
                data: Cow::Borrowed(text.as_bytes()),
            })?;
        }
    }
    Ok(())
}

/// The channel of each recorded topic, by the topic's number.
fn write_channels<W: Write>(container: &mut Container<W>) -> Result<BTreeMap<u16, u16>, McapError> {
    let version = BTreeMap::from([(LAYOUT_KEY.to_owned(), LAYOUT_VERSION.to_string())]);
    let mut channels = BTreeMap::new();
    for topic in TABLE.iter().filter(|topic| topic.recorded) {
        let definition = ros_definition(topic);
        let schema = container.add_schema(&schema_name(topic), "ros2msg", definition.as_bytes())?;
        let channel = container.add_channel(schema, &channel_name(topic), "cdr", &version)?;
        channels.insert(topic.id, channel);
    }
    Ok(channels)
}
