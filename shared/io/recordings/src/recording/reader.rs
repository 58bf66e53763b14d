//! Reading a recording.

use std::collections::BTreeMap;
use std::path::Path;

use kerbside_messages::schema::decode_cdr;
use kerbside_messages::{Message, Nanos, Plan, Topic, TrajectoryPoint};

use super::definitions::Known;
use super::error::RecordingError;
use super::index::{End, Index};
use super::parts::Parts;
use super::provenance::Provenance;

/// A recording that is read: complete, or ended by a kill.
///
/// Messages come in the order of the file, which is the order in which the recorder saw them. Every
/// chunk's check sum is verified before anything in it is used. Where the file ends within a
/// record, reading ends before that record; [`RecordingReader::end`] says so.
#[derive(Debug)]
pub struct RecordingReader {
    index: Index,
}

/// A message of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record<'a> {
    /// Its topic.
    pub topic: &'static Topic,
    /// When the recorder saw it \[ns\].
    pub log_time: Nanos,
    /// When it was handed over \[ns\].
    pub publish_time: Nanos,
    /// The sequence of its header, cut to 32 bits.
    pub sequence: u32,
    /// Its bytes.
    pub message: &'a [u8],
    /// The bytes that follow: a plan's points.
    pub tail: &'a [u8],
}

impl Record<'_> {
    /// The message; none where it is of another topic.
    #[must_use]
    pub fn decode<M: Message>(&self) -> Option<M> {
        (self.topic.id == M::TOPIC.id)
            .then(|| bytemuck::try_pod_read_unaligned(self.message).ok())?
    }
}

impl RecordingReader {
    /// The recording in the file `path`.
    ///
    /// # Errors
    /// [`RecordingError::Io`] or [`RecordingError::NotMcap`].
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        Ok(Self { index: Index::of(path)? })
    }

    /// Where the recording comes from.
    #[must_use]
    pub fn provenance(&self) -> &Provenance {
        &self.index.provenance
    }

    /// How the file ends.
    #[must_use]
    pub fn end(&self) -> End {
        self.index.end
    }

    /// The messages of `topics` in the order of the file.
    ///
    /// # Errors
    /// [`RecordingError::Io`] where the file cannot be opened again.
    pub fn records(&self, topics: &[&Topic]) -> Result<Records<'_>, RecordingError> {
        Ok(Records {
            parts: Parts::of(&self.index)?,
            wanted: topics.iter().map(|topic| topic.id).collect(),
            channels: BTreeMap::new(),
            next_entry: 0,
        })
    }

    /// Shows every message `M` to `visit`.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub fn for_each<M: Message>(&self, mut visit: impl FnMut(&M)) -> Result<(), RecordingError> {
        let mut records = self.records(&[M::TOPIC])?;
        while let Some(record) = records.next()? {
            record.decode().iter().for_each(&mut visit);
        }
        Ok(())
    }

    /// Every message `M`.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub fn read_all<M: Message>(&self) -> Result<Vec<M>, RecordingError> {
        let mut all = Vec::new();
        self.for_each(|message: &M| all.push(*message))?;
        Ok(all)
    }

    /// Shows every plan and its points to `visit`.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub fn for_each_plan(
        &self,
        mut visit: impl FnMut(&Plan, &[TrajectoryPoint]),
    ) -> Result<(), RecordingError> {
        let mut records = self.records(&[Plan::TOPIC])?;
        while let Some(record) = records.next()? {
            let points = record.tail.chunks_exact(size_of::<TrajectoryPoint>());
            let points: Vec<TrajectoryPoint> = points.map(bytemuck::pod_read_unaligned).collect();
            record.decode().iter().for_each(|plan| visit(plan, &points));
        }
        Ok(())
    }
}

/// The messages of some topics, one after the other.
pub struct Records<'a> {
    parts: Parts<'a>,
    wanted: Vec<u16>,
    /// The topic of each channel met so far; none where it is not wanted.
    channels: BTreeMap<u16, Option<&'static Topic>>,
    next_entry: usize,
}

impl Records<'_> {
    /// The next message; none after the last.
    ///
    /// # Errors
    /// [`RecordingError`]; nothing can be read after it.
    #[allow(clippy::should_implement_trait)] // What it gives borrows from it.
    pub fn next(&mut self) -> Result<Option<Record<'_>>, RecordingError> {
        let topic = loop {
            let Some(entry) = self.parts.contents.entries.get(self.next_entry) else {
                self.next_entry = 0;
                match self.parts.next()? {
                    Some(unpacked) => unpacked.map_err(|damage| self.parts.error(damage))?,
                    None => return Ok(None),
                }
                continue;
            };
            self.next_entry += 1;
            if let Some(topic) = self.wanted_topic(entry.channel)? {
                break topic;
            }
        };
        let entry = self.parts.contents.entries[self.next_entry - 1];
        let (message, tail) = decode_cdr(topic, self.parts.contents.message(&entry))
            .ok_or_else(|| self.parts.error(self.parts.misfit(topic)))?;
        Ok(Some(Record {
            topic,
            log_time: entry.log_time,
            publish_time: entry.publish_time,
            sequence: entry.sequence,
            message,
            tail,
        }))
    }

    fn wanted_topic(&mut self, channel: u16) -> Result<Option<&'static Topic>, RecordingError> {
        if let Some(known) = self.channels.get(&channel) {
            return Ok(*known);
        }
        let definitions = &self.parts.definitions;
        let topic = definitions.topic(channel).filter(|topic| self.wanted.contains(&topic.id));
        if let Some(topic) = topic
            && let Known::OtherLayout(version) = definitions.known(channel, topic)
        {
            return Err(RecordingError::Layout {
                path: self.parts.path().into(),
                topic: topic.name,
                recorded: version.unwrap_or_else(|| "unknown".to_owned()),
            });
        }
        self.channels.insert(channel, topic);
        Ok(topic)
    }
}
