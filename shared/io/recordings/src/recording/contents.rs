//! The messages of a chunk.

use mcap::McapError;
use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::definitions::Definitions;
use super::index::{le_u32, le_u64};

/// No record, and no chunk, is larger: a size beyond it is a damaged one.
const LIMIT: usize = 64 << 20;

/// A message in a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    pub(super) channel: u16,
    pub(super) sequence: u32,
    pub(super) log_time: u64,
    pub(super) publish_time: u64,
    start: usize,
    end: usize,
}

/// What is in a chunk, unpacked. Used again for the next one.
#[derive(Debug, Default)]
pub(super) struct Contents {
    bytes: Vec<u8>,
    pub(super) entries: Vec<Entry>,
}

/// How a chunk is to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Trust {
    /// It must be whole, and its check sum right, before anything in it is used.
    Checked,
    /// It is the torn last one: what can be unpacked is used.
    Torn,
}

impl Contents {
    /// The message of an entry.
    pub(super) fn message(&self, entry: &Entry) -> &[u8] {
        &self.bytes[entry.start..entry.end]
    }

    /// Unpacks the record `bytes`, a chunk or a single message, head included; what it defines goes
    /// to `definitions`.
    pub(super) fn unpack(
        &mut self,
        bytes: &[u8],
        trust: Trust,
        definitions: &mut Definitions,
    ) -> Result<(), McapError> {
        self.bytes.clear();
        self.entries.clear();
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(trust == Trust::Checked)
            .with_record_length_limit(LIMIT);
        let mut reader = LinearReader::new_with_options(options);
        let mut rest = bytes;
        while let Some(event) = reader.next_event() {
            match event {
                Ok(LinearReadEvent::ReadRequest(wanted)) => {
                    let (next, after) = rest.split_at(wanted.min(rest.len()));
                    reader.insert(next.len()).copy_from_slice(next);
                    reader.notify_read(next.len());
                    rest = after;
                }
                Ok(LinearReadEvent::Record { data, opcode: op::MESSAGE }) => self.take(data)?,
                Ok(LinearReadEvent::Record { data, opcode }) => {
                    define(opcode, data, definitions)?;
                }
                Err(_) if trust == Trust::Torn => break,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn take(&mut self, record: &[u8]) -> Result<(), McapError> {
        let start = self.bytes.len();
        let end = start + record.len().saturating_sub(22);
        let entry = || {
            Some(Entry {
                channel: record.first_chunk().copied().map(u16::from_le_bytes)?,
                sequence: le_u32(record.get(2..)?)?,
                log_time: le_u64(record.get(6..)?)?,
                publish_time: le_u64(record.get(14..)?)?,
                start,
                end,
            })
        };
        self.entries.push(entry().ok_or(McapError::UnexpectedEoc)?);
        self.bytes.extend_from_slice(&record[22..]);
        Ok(())
    }
}

fn define(kind: u8, data: &[u8], definitions: &mut Definitions) -> Result<(), McapError> {
    if matches!(kind, op::SCHEMA | op::CHANNEL) {
        definitions.take(mcap::parse_record(kind, data)?.into_owned());
    }
    Ok(())
}
