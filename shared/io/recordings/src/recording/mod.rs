//! Recordings of a running stack: [MCAP](https://mcap.dev/spec) files.
//!
//! Each recorded topic of the table is a channel `/kerbside/NAME` whose messages are CDR and whose
//! schema is the ROS 2 definition made from the message's layout, so that viewers read it without
//! kerbside. What is needed to repeat the run stands in the file too: versions, scenario, seed and
//! instance as metadata `kerbside`, the configuration as attachments `vehicle.toml` and
//! `stack.toml`.
//!
//! Messages are collected in chunks, which are compressed (LZ4) and reach the operating system
//! whole, with a check sum: a recorder that is killed leaves a file that is readable to its last
//! closed chunk. What an end lacks, [`recover`] adds.

mod check;
mod contents;
mod definitions;
mod error;
mod index;
mod parts;
mod provenance;
mod reader;
mod recover;
mod writer;

pub use check::{CheckReport, LayoutMismatch, TopicCount, check};
pub use error::RecordingError;
pub use index::End;
pub use parts::Damage;
pub use provenance::Provenance;
pub use reader::{Record, RecordingReader, Records};
pub use recover::{RecoverReport, recover};
pub use writer::{CHUNK_AGE, CHUNK_BYTES, Chunks, Closed, RecordingWriter, WriteError};

use kerbside_messages::Topic;
use kerbside_messages::topics::TABLE;

/// What channel names begin with.
const PREFIX: &str = "/kerbside/";

/// Name of a topic's channel.
#[must_use]
pub fn channel_name(topic: &Topic) -> String {
    format!("{PREFIX}{}", topic.name)
}

/// The topic of a channel; none for a channel of somebody else.
#[must_use]
pub fn topic_of(channel: &str) -> Option<&'static Topic> {
    let name = channel.strip_prefix(PREFIX)?;
    TABLE.iter().find(|topic| topic.name == name)
}

#[cfg(test)]
mod tests;
