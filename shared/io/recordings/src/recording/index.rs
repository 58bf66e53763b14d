//! The records of a file one after the other, without looking into chunks.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use mcap::MAGIC;
use mcap::records::{Record, op};

use super::definitions::Definitions;
use super::error::RecordingError;
use super::parts::Damage;
use super::provenance::{METADATA, Provenance};

/// Bytes before the body of each record: its kind and its length.
pub(super) const HEAD: usize = 9;

/// How a recording ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// With index and footer: it was completed.
    Complete,
    /// After a whole record, without footer: the recorder was killed between two chunks.
    Unfinished,
    /// Within the record that begins at byte `offset`: the recorder was killed, or the disk was
    /// full, in the middle of it.
    Torn {
        /// Where the record begins.
        offset: u64,
    },
}

/// A record in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) kind: u8,
    pub(super) offset: u64,
    /// Of the whole record, as far as it is there.
    pub(super) length: u64,
}

/// A check sum over the bytes from `start` to `end`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sum {
    pub(super) start: u64,
    pub(super) end: u64,
    pub(super) saved: u32,
}

/// What a file holds, by place.
#[derive(Debug)]
pub(super) struct Index {
    pub(super) path: PathBuf,
    /// Chunks, and messages outside of chunks, in order.
    pub(super) parts: Vec<Place>,
    /// Metadata and attachments, in order.
    pub(super) asides: Vec<Place>,
    pub(super) provenance: Provenance,
    /// Of schemas and channels outside of chunks.
    pub(super) definitions: Definitions,
    pub(super) end: End,
    /// Check sums over long stretches that a complete file states.
    pub(super) sums: Vec<Sum>,
    /// Where the summary begins, once that is known.
    summary: u64,
    pub(super) bytes: u64,
    /// Asides that are not what was written.
    pub(super) damaged: Vec<Damage>,
}

/// A file read record by record.
pub(super) struct Records {
    path: PathBuf,
    reader: BufReader<File>,
    offset: u64,
    pub(super) length: u64,
}

impl Records {
    pub(super) fn open(path: &Path) -> Result<Self, RecordingError> {
        let io = |source| RecordingError::Io { path: path.into(), source };
        let file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let reader = BufReader::with_capacity(1 << 16, file);
        let mut records = Self { path: path.into(), reader, offset: 0, length };
        let mut magic = Vec::new();
        let place = Place { kind: 0, offset: 0, length: length.min(MAGIC.len() as u64) };
        records.read(place, &mut magic)?;
        if magic != MAGIC {
            return Err(RecordingError::NotMcap { path: path.into() });
        }
        Ok(records)
    }

    /// The bytes of a record, its head included.
    pub(super) fn read(&mut self, place: Place, into: &mut Vec<u8>) -> Result<(), RecordingError> {
        self.seek(place.offset)?;
        into.resize(usize::try_from(place.length).unwrap_or(usize::MAX), 0);
        self.reader.read_exact(into).map_err(|source| self.io(source))?;
        self.offset = place.offset + place.length;
        Ok(())
    }

    fn seek(&mut self, offset: u64) -> Result<(), RecordingError> {
        // Relative, because that keeps what is in the buffer.
        let by = offset.cast_signed() - self.offset.cast_signed();
        self.reader.seek_relative(by).map_err(|source| self.io(source))?;
        self.offset = offset;
        Ok(())
    }

    fn io(&self, source: std::io::Error) -> RecordingError {
        RecordingError::Io { path: self.path.clone(), source }
    }

    /// The record at `offset`; none where the file ends before it is whole.
    fn place(&mut self, offset: u64) -> Result<Option<Place>, RecordingError> {
        if self.length - offset < HEAD as u64 {
            return Ok(None);
        }
        let mut head = Vec::new();
        self.read(Place { kind: 0, offset, length: HEAD as u64 }, &mut head)?;
        let (kind, length) = (head[0], le_u64(&head[1..]).unwrap_or(u64::MAX));
        let whole =
            length.checked_add(HEAD as u64).filter(|length| *length <= self.length - offset);
        Ok(whole.map(|length| Place { kind, offset, length }))
    }
}

pub(super) fn le_u64(bytes: &[u8]) -> Option<u64> {
    bytes.first_chunk().copied().map(u64::from_le_bytes)
}

pub(super) fn le_u32(bytes: &[u8]) -> Option<u32> {
    bytes.first_chunk().copied().map(u32::from_le_bytes)
}

impl Index {
    pub(super) fn of(path: &Path) -> Result<Self, RecordingError> {
        let mut records = Records::open(path)?;
        let mut index = Self {
            path: path.into(),
            parts: Vec::new(),
            asides: Vec::new(),
            provenance: Provenance::default(),
            definitions: Definitions::default(),
            end: End::Unfinished,
            sums: Vec::new(),
            summary: 0,
            bytes: records.length,
            damaged: Vec::new(),
        };
        let mut offset = MAGIC.len() as u64;
        while offset < records.length {
            let Some(place) = records.place(offset)? else {
                index.end = End::Torn { offset };
                return Ok(index);
            };
            offset += place.length;
            if place.kind == op::FOOTER {
                index.take(place, &mut records)?;
                index.end = index.end_after(offset, &mut records)?;
                return Ok(index);
            }
            index.take(place, &mut records)?;
        }
        Ok(index)
    }

    /// What follows the footer decides whether it was written to its end.
    fn end_after(&self, offset: u64, records: &mut Records) -> Result<End, RecordingError> {
        let mut magic = Vec::new();
        let length = (records.length - offset).min(MAGIC.len() as u64);
        records.read(Place { kind: 0, offset, length }, &mut magic)?;
        Ok(if magic == MAGIC { End::Complete } else { End::Torn { offset } })
    }

    fn take(&mut self, place: Place, records: &mut Records) -> Result<(), RecordingError> {
        let mut bytes = Vec::new();
        match place.kind {
            op::CHUNK | op::MESSAGE => self.parts.push(place),
            op::SCHEMA | op::CHANNEL | op::DATA_END | op::FOOTER => {
                records.read(place, &mut bytes)?;
                self.take_definition(place, &bytes);
            }
            op::METADATA | op::ATTACHMENT => {
                records.read(place, &mut bytes)?;
                self.asides.push(place);
                self.take_aside(place, &bytes);
            }
            _ => {}
        }
        Ok(())
    }

    fn take_definition(&mut self, place: Place, bytes: &[u8]) {
        match mcap::parse_record(place.kind, &bytes[HEAD..]) {
            Ok(Record::DataEnd(end)) => {
                self.summary = place.offset + place.length;
                self.sums.push(Sum { start: 0, end: place.offset, saved: end.data_section_crc });
            }
            // The sum includes the footer up to the sum itself.
            Ok(Record::Footer(footer)) => self.sums.push(Sum {
                start: self.summary,
                end: place.offset + place.length - 4,
                saved: footer.summary_crc,
            }),
            Ok(record) => self.definitions.take(record),
            Err(error) => self.damage(place, error.to_string()),
        }
    }

    fn damage(&mut self, place: Place, problem: String) {
        self.damaged.push(Damage { offset: place.offset, problem });
    }

    fn take_aside(&mut self, place: Place, bytes: &[u8]) {
        if place.kind == op::ATTACHMENT {
            match attachment(&bytes[HEAD..]) {
                Ok(found) => self.provenance.take_attachment(&found.name, found.data),
                Err(problem) => self.damage(place, problem),
            }
            return;
        }
        match mcap::parse_record(place.kind, &bytes[HEAD..]) {
            Ok(Record::Metadata(record)) if record.name == METADATA => {
                self.provenance.take_map(record.metadata);
            }
            Ok(_) => {}
            Err(error) => self.damage(place, error.to_string()),
        }
    }
}

/// An attachment, its check sum verified.
pub(super) struct Attached<'a> {
    pub(super) log_time: u64,
    pub(super) create_time: u64,
    pub(super) name: String,
    pub(super) media_type: String,
    pub(super) data: &'a [u8],
}

/// The body of an attachment's record. Read here and not by the `mcap` crate, which takes the
/// lengths inside on trust.
pub(super) fn attachment(body: &[u8]) -> Result<Attached<'_>, String> {
    let short = || "attachment shorter than it says".to_owned();
    let (checked, crc) = body.split_last_chunk::<4>().ok_or_else(short)?;
    let parse = || {
        let (log_time, rest) = (le_u64(checked)?, checked.get(8..)?);
        let (create_time, rest) = (le_u64(rest)?, rest.get(8..)?);
        let (name, rest) = string(rest)?;
        let (media_type, rest) = string(rest)?;
        let length = usize::try_from(le_u64(rest)?).ok()?;
        let data = rest.get(8..).filter(|data| data.len() == length)?;
        Some(Attached { log_time, create_time, name, media_type, data })
    };
    let found = parse().ok_or_else(short)?;
    match u32::from_le_bytes(*crc) {
        0 => Ok(found),
        saved if saved == crc32fast::hash(checked) => Ok(found),
        _ => Err(format!("check sum of attachment {} does not match", found.name)),
    }
}

fn string(bytes: &[u8]) -> Option<(String, &[u8])> {
    let length = le_u32(bytes)? as usize;
    let (text, rest) = bytes.get(4..)?.split_at_checked(length)?;
    Some((String::from_utf8_lossy(text).into_owned(), rest))
}
