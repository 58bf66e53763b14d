//! Which channel of a file is which topic, and whether its messages are laid out as ours.

use std::collections::BTreeMap;

use kerbside_messages::Topic;
use kerbside_messages::schema::{ros_definition, schema_name};
use mcap::records::{Channel, Record, SchemaHeader};

use super::provenance::LAYOUT_KEY;
use super::topic_of;

/// The schemas and channels of a file.
#[derive(Clone, Debug, Default)]
pub(super) struct Definitions {
    pub(super) schemas: BTreeMap<u16, (SchemaHeader, Vec<u8>)>,
    pub(super) channels: BTreeMap<u16, Channel>,
}

/// A channel as a reader sees it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Known {
    /// A topic in this build's layout.
    Ours,
    /// A topic in another layout; the version that the file states for it.
    OtherLayout(Option<String>),
}

impl Definitions {
    /// Takes a schema or channel; anything else is left alone.
    pub(super) fn take(&mut self, record: Record<'_>) {
        match record {
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, (header, data.into_owned()));
            }
            Record::Channel(channel) => {
                self.channels.insert(channel.id, channel);
            }
            _ => {}
        }
    }

    /// The topic of a channel; none for a channel of somebody else.
    pub(super) fn topic(&self, channel: u16) -> Option<&'static Topic> {
        topic_of(&self.channels.get(&channel)?.topic)
    }

    /// Whether this build reads the channel `channel` of a topic.
    pub(super) fn known(&self, channel: u16, topic: &Topic) -> Known {
        let Some(channel) = self.channels.get(&channel) else { return Known::OtherLayout(None) };
        let ours = self.schemas.get(&channel.schema_id).is_some_and(|(header, data)| {
            let theirs = String::from_utf8_lossy(data);
            header.name == schema_name(topic)
                && header.encoding == "ros2msg"
                && fields(&theirs).eq(fields(&ros_definition(topic)))
        });
        if ours && channel.message_encoding == "cdr" {
            return Known::Ours;
        }
        Known::OtherLayout(channel.metadata.get(LAYOUT_KEY).cloned())
    }
}

/// The lines of a definition without comments: what they mean to a reader of bytes.
fn fields(definition: &str) -> impl Iterator<Item = &str> {
    definition
        .lines()
        .map(|line| line.split('#').next().unwrap_or_default().trim())
        .filter(|line| !line.is_empty())
}
