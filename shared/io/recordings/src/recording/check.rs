//! Is a recording whole?

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use kerbside_messages::schema::decode_cdr;
use kerbside_messages::{LAYOUT_VERSION, Nanos};

use super::definitions::Known;
use super::error::RecordingError;
use super::index::{End, Index, Sum};
use super::parts::{Damage, Parts};
use super::provenance::Provenance;

/// How many messages a channel has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopicCount {
    /// Name of the channel; its number where the file does not name it.
    pub channel: String,
    /// Messages.
    pub messages: u64,
}

/// A topic whose messages this build cannot read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LayoutMismatch {
    /// The topic.
    pub topic: &'static str,
    /// The version of the layouts that the file states; none where it states none.
    pub recorded: Option<String>,
}

impl core::fmt::Display for LayoutMismatch {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let recorded = self.recorded.as_deref().unwrap_or("unknown");
        let topic = self.topic;
        write!(f, "topic {topic}: layout version {recorded}; this build reads {LAYOUT_VERSION}")
    }
}

/// What is in a recording, and what is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CheckReport {
    /// The file.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// How it ends.
    pub end: End,
    /// Chunks that are whole.
    pub chunks: u64,
    /// Messages in them, by channel.
    pub topics: Vec<TopicCount>,
    /// Earliest and latest log time \[ns\]; none without messages.
    pub time: Option<(Nanos, Nanos)>,
    /// What is not as it was written.
    pub damage: Vec<Damage>,
    /// Topics that this build cannot read.
    pub mismatches: Vec<LayoutMismatch>,
    /// Where it comes from.
    pub provenance: Provenance,
}

impl CheckReport {
    /// Whether the file is complete, undamaged, and laid out as this build's messages.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.end == End::Complete && self.damage.is_empty() && self.mismatches.is_empty()
    }

    /// Messages of all channels.
    #[must_use]
    pub fn messages(&self) -> u64 {
        self.topics.iter().map(|topic| topic.messages).sum()
    }

    /// A sentence for everything that is wrong.
    #[must_use]
    pub fn problems(&self) -> Vec<String> {
        let end = match self.end {
            End::Complete => None,
            End::Unfinished => Some("ends without a footer".to_owned()),
            End::Torn { offset } => Some(format!("byte {offset}: ends within this record")),
        };
        let damage = self.damage.iter().map(ToString::to_string);
        end.into_iter()
            .chain(damage)
            .chain(self.mismatches.iter().map(ToString::to_string))
            .collect()
    }
}

/// Reads the whole file `path`, verifying every check sum.
///
/// # Errors
/// [`RecordingError::Io`] or [`RecordingError::NotMcap`]; all else is in the report.
pub fn check(path: &Path) -> Result<CheckReport, RecordingError> {
    let index = Index::of(path)?;
    let mut tally = Tally::default();
    tally.damage.extend(index.damaged.iter().cloned());
    let mut parts = Parts::of(&index)?;
    while let Some(unpacked) = parts.next()? {
        match unpacked {
            Ok(()) => tally.take(&parts),
            Err(damage) => tally.damage.push(damage),
        }
    }
    for sum in &index.sums {
        tally.damage.extend(wrong_sum(&index, sum)?);
    }
    let name = |(channel, messages): (&u16, &u64)| TopicCount {
        channel: parts
            .definitions
            .channels
            .get(channel)
            .map_or_else(|| format!("channel {channel}"), |channel| channel.topic.clone()),
        messages: *messages,
    };
    Ok(CheckReport {
        path: path.into(),
        bytes: index.bytes,
        end: index.end,
        chunks: tally.chunks,
        topics: tally.messages.iter().map(name).collect(),
        time: tally.time,
        damage: tally.damage,
        mismatches: mismatches(&parts),
        provenance: index.provenance.clone(),
    })
}

#[derive(Default)]
struct Tally {
    chunks: u64,
    messages: BTreeMap<u16, u64>,
    time: Option<(Nanos, Nanos)>,
    damage: Vec<Damage>,
}

impl Tally {
    fn take(&mut self, parts: &Parts<'_>) {
        self.chunks += 1;
        for entry in &parts.contents.entries {
            *self.messages.entry(entry.channel).or_default() += 1;
            let (first, last) = self.time.unwrap_or((entry.log_time, entry.log_time));
            self.time = Some((first.min(entry.log_time), last.max(entry.log_time)));
            let Some(topic) = parts.definitions.topic(entry.channel) else { continue };
            let fits = decode_cdr(topic, parts.contents.message(entry)).is_some();
            if !fits && parts.definitions.known(entry.channel, topic) == Known::Ours {
                self.damage.push(parts.misfit(topic));
            }
        }
    }
}

fn mismatches(parts: &Parts<'_>) -> Vec<LayoutMismatch> {
    let of_channel = |channel: &u16| {
        let topic = parts.definitions.topic(*channel)?;
        match parts.definitions.known(*channel, topic) {
            Known::Ours => None,
            Known::OtherLayout(recorded) => Some(LayoutMismatch { topic: topic.name, recorded }),
        }
    };
    parts.definitions.channels.keys().filter_map(of_channel).collect()
}

/// The damage, where the bytes of a stretch are not those that were summed; 0 stands for no sum.
fn wrong_sum(index: &Index, stated: &Sum) -> Result<Option<Damage>, RecordingError> {
    let io = |source| RecordingError::Io { path: index.path.clone(), source };
    let mut file = File::open(&index.path).map_err(io)?;
    file.seek(SeekFrom::Start(stated.start)).map_err(io)?;
    let mut data = file.take(stated.end - stated.start);
    let mut sum = crc32fast::Hasher::new();
    let mut block = vec![0; 1 << 16];
    loop {
        match data.read(&mut block).map_err(io)? {
            0 => break,
            length => sum.update(&block[..length]),
        }
    }
    let problem = format!("check sum of the bytes from here to {} does not match", stated.end);
    let wrong = stated.saved != 0 && sum.finalize() != stated.saved;
    Ok(wrong.then_some(Damage { offset: stated.start, problem }))
}
