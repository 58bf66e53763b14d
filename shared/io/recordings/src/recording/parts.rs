//! The chunks of a file, one after the other.

use std::path::Path;

use kerbside_messages::Topic;
use mcap::records::op;

use super::contents::{Contents, Trust};
use super::definitions::Definitions;
use super::error::RecordingError;
use super::index::{self, End, Index, Place};

/// Bytes of a file that are not what was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Where the damaged record begins.
    pub offset: u64,
    /// What is wrong with it.
    pub problem: String,
}

impl core::fmt::Display for Damage {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "byte {}: {}", self.offset, self.problem)
    }
}

/// Chunks, and messages outside of chunks, unpacked one at a time.
pub(super) struct Parts<'a> {
    index: &'a Index,
    file: index::Records,
    next: usize,
    bytes: Vec<u8>,
    /// Of the part unpacked last.
    pub(super) contents: Contents,
    /// Of the whole file, as far as it was read.
    pub(super) definitions: Definitions,
}

impl<'a> Parts<'a> {
    pub(super) fn of(index: &'a Index) -> Result<Self, RecordingError> {
        Ok(Self {
            index,
            file: index::Records::open(&index.path)?,
            next: 0,
            bytes: Vec::new(),
            contents: Contents::default(),
            definitions: index.definitions.clone(),
        })
    }

    pub(super) fn path(&self) -> &Path {
        &self.index.path
    }

    /// Unpacks the next part: none after the last one, what is wrong with it where it is damaged.
    pub(super) fn next(&mut self) -> Result<Option<Result<(), Damage>>, RecordingError> {
        let Some(place) = self.index.parts.get(self.next) else {
            self.contents = Contents::default();
            return Ok(None);
        };
        self.next += 1;
        self.unpack(*place, Trust::Checked).map(Some)
    }

    /// Unpacks what is there of a chunk that the file ends in; whether there is one.
    pub(super) fn torn(&mut self) -> Result<bool, RecordingError> {
        let End::Torn { offset } = self.index.end else { return Ok(false) };
        let place = Place { kind: op::CHUNK, offset, length: self.index.bytes - offset };
        let unpacked = self.unpack(place, Trust::Torn)?;
        Ok(unpacked.is_ok() && self.bytes.first() == Some(&op::CHUNK))
    }

    fn unpack(&mut self, place: Place, trust: Trust) -> Result<Result<(), Damage>, RecordingError> {
        self.file.read(place, &mut self.bytes)?;
        let unpacked = self.contents.unpack(&self.bytes, trust, &mut self.definitions);
        Ok(unpacked
            .map_err(|error| Damage { offset: place.offset, problem: error.to_string() })
            .inspect_err(|_| self.contents = Contents::default()))
    }

    /// The damage of a message of `topic` in the part unpacked last.
    pub(super) fn misfit(&self, topic: &Topic) -> Damage {
        let offset = self.next.checked_sub(1).map_or(0, |last| self.index.parts[last].offset);
        let problem = format!("a message of topic {} is not as long as its layout", topic.name);
        Damage { offset, problem }
    }

    pub(super) fn error(&self, damage: Damage) -> RecordingError {
        let Damage { offset, problem } = damage;
        RecordingError::Damaged { path: self.index.path.clone(), offset, problem }
    }
}
