//! Making a complete recording of a damaged or unfinished one.

use std::borrow::Cow;
use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;

use mcap::records::{MessageHeader, Record, op};
use mcap::{Attachment, McapError};

use super::definitions::Definitions;
use super::error::RecordingError;
use super::index::{self, HEAD, Index};
use super::parts::{Damage, Parts};
use super::writer::{Chunks, Container, container};

/// What was recovered, and what was not.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecoverReport {
    /// Messages of the new file.
    pub messages: u64,
    /// How many of them come from the chunk that the file ended in, which no check sum covers.
    pub from_torn_chunk: u64,
    /// Chunks that could be read.
    pub chunks: u64,
    /// Messages left out because the file does not say what channel they are of.
    pub unnamed: u64,
    /// What could not be read and was left out.
    pub lost: Vec<Damage>,
}

/// Copies whatever can be read of the recording `path` into the new file `out`, complete with index
/// and footer: metadata, attachments, all messages of undamaged chunks, and of a chunk that the
/// file ends in those that are there. Channels of others are copied as they are.
///
/// # Errors
/// [`RecordingError`]; `out` is then not left behind.
pub fn recover(path: &Path, out: &Path) -> Result<RecoverReport, RecordingError> {
    let index = Index::of(path)?;
    let definitions = definitions_of(&index)?;
    let file = File::create_new(out).map_err(|source| match source.kind() {
        ErrorKind::AlreadyExists => RecordingError::Exists { path: out.into() },
        _ => RecordingError::Io { path: out.into(), source },
    })?;
    let copied = copy(&index, &definitions, file, out);
    if copied.is_err() {
        // What stopped the copy is reported; a half-made file would only be taken for a whole one.
        let _ = std::fs::remove_file(out);
    }
    copied
}

/// Everything that the file says about channels, wherever it says it: a damaged first chunk is made
/// good by the index of a complete file.
fn definitions_of(index: &Index) -> Result<Definitions, RecordingError> {
    let mut parts = Parts::of(index)?;
    while parts.next()?.is_some() {}
    parts.torn()?;
    Ok(parts.definitions)
}

fn copy(
    index: &Index,
    definitions: &Definitions,
    file: File,
    out: &Path,
) -> Result<RecoverReport, RecordingError> {
    let to_error =
        |error: McapError| RecordingError::Write { path: out.into(), source: error.into() };
    let mut container = container(file, Chunks::default()).map_err(to_error)?;
    copy_asides(index, &mut container, &to_error)?;
    define(definitions, &mut container).map_err(to_error)?;
    let mut report = RecoverReport { lost: index.damaged.clone(), ..RecoverReport::default() };
    let mut parts = Parts::of(index)?;
    while let Some(unpacked) = parts.next()? {
        match unpacked {
            Ok(()) => {
                copy_part(&parts, definitions, &mut container, &mut report).map_err(to_error)?;
                report.chunks += 1;
            }
            Err(damage) => report.lost.push(damage),
        }
    }
    if parts.torn()? {
        let before = report.messages;
        copy_part(&parts, definitions, &mut container, &mut report).map_err(to_error)?;
        report.from_torn_chunk = report.messages - before;
    }
    container.finish().map_err(to_error)?;
    Ok(report)
}

fn copy_asides(
    index: &Index,
    container: &mut Container<File>,
    to_error: &impl Fn(McapError) -> RecordingError,
) -> Result<(), RecordingError> {
    let mut file = index::Records::open(&index.path)?;
    let mut bytes = Vec::new();
    for place in &index.asides {
        file.read(*place, &mut bytes)?;
        copy_aside(place.kind, &bytes[HEAD..], container).map_err(to_error)?;
    }
    Ok(())
}

/// Copies a metadata record or an attachment; one that cannot be read is among the damages already.
fn copy_aside(kind: u8, body: &[u8], container: &mut Container<File>) -> Result<(), McapError> {
    if kind != op::ATTACHMENT {
        return match mcap::parse_record(kind, body) {
            Ok(Record::Metadata(metadata)) => container.write_metadata(&metadata),
            _ => Ok(()),
        };
    }
    let Ok(found) = index::attachment(body) else { return Ok(()) };
    container.attach(&Attachment {
        log_time: found.log_time,
        create_time: found.create_time,
        name: found.name,
        media_type: found.media_type,
        data: Cow::Borrowed(found.data),
    })
}

fn define(definitions: &Definitions, container: &mut Container<File>) -> Result<(), McapError> {
    for (id, (header, data)) in definitions.schemas.iter().filter(|(id, _)| **id != 0) {
        container.add_schema_with_id(*id, &header.name, &header.encoding, data)?;
    }
    for (id, channel) in &definitions.channels {
        // 0 means "no schema": a channel whose own was lost keeps its messages.
        let known = definitions.schemas.contains_key(&channel.schema_id);
        container.add_channel_with_id(
            *id,
            if known { channel.schema_id } else { 0 },
            &channel.topic,
            &channel.message_encoding,
            &channel.metadata,
        )?;
    }
    container.flush()
}

fn copy_part(
    parts: &Parts<'_>,
    definitions: &Definitions,
    container: &mut Container<File>,
    report: &mut RecoverReport,
) -> Result<(), McapError> {
    for entry in &parts.contents.entries {
        if !definitions.channels.contains_key(&entry.channel) {
            report.unnamed += 1;
            continue;
        }
        let header = MessageHeader {
            channel_id: entry.channel,
            sequence: entry.sequence,
            log_time: entry.log_time,
            publish_time: entry.publish_time,
        };
        container.write_to_known_channel(&header, parts.contents.message(entry))?;
        report.messages += 1;
    }
    container.flush()
}
