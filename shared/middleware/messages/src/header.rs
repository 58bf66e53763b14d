//! The header every sample starts with.

use crate::layout::{Described, layout};
use crate::topics::Topic;
use crate::{Nanos, Refusal};

/// The version of the layouts, for names that are put together when they are compiled.
macro_rules! layout_version {
    () => {
        4
    };
}

pub(crate) use layout_version;

/// Version of all layouts together; part of every type name, so that processes of different builds refuse each other.
/// A change of a layout raises it: `layouts.txt` beside this crate's manifest holds what it stands for.
pub const LAYOUT_VERSION: u16 = layout_version!();

layout! {
    /// The header every sample starts with.
    pub struct Header {
        /// Version of the layouts, [`LAYOUT_VERSION`].
        pub version: u16,
        /// Number of the topic in the table.
        pub topic: u16,
        /// CRC-32 over all other bytes of the sample, on protected topics; else 0.
        pub check_sum: u32,
        /// Which life of the publisher this is: changes whenever it restarts.
        pub epoch: u64,
        /// Counts the samples of an epoch, from 1.
        pub sequence: u64,
        /// When the content was true or measured \[ns\].
        pub stamp: u64,
        /// Stamp of the encoder reading that caused this sample \[ns\]; 0 where none did.
        pub origin: u64,
        /// When the sample was handed over \[ns\].
        pub sent: u64,
    }
}

impl Header {
    /// A header of content that was true at `stamp`, caused by the reading stamped `origin`; the sender adds the rest.
    #[must_use]
    pub fn stamped(stamp: Nanos, origin: Nanos) -> Self {
        Self { stamp, origin, ..Self::default() }
    }
}

/// A payload of a topic.
pub trait Message:
    Described + bytemuck::Pod + Default + PartialEq + core::fmt::Debug + Send + Sync
{
    /// Its line in the table.
    const TOPIC: &'static Topic;
    /// Name of its type in shared memory, with the version of the layouts.
    const TYPE_NAME: &'static str;

    /// Its header.
    fn header(&self) -> &Header;

    /// Its header.
    fn header_mut(&mut self) -> &mut Header;

    /// Whether every field is finite and in range.
    ///
    /// # Errors
    /// [`Refusal::NotFinite`] or [`Refusal::OutOfRange`].
    fn validate(&self) -> Result<(), Refusal>;
}

/// The check sum of a sample of `M`: CRC-32 over its bytes and those of `tail`, its own field left out.
#[must_use]
pub fn check_sum<M: Message>(message: &M, tail: &[u8]) -> u32 {
    let bytes = bytemuck::bytes_of(message);
    let field = core::mem::offset_of!(Header, check_sum);
    let mut crc = crc32fast::Hasher::new();
    crc.update(&bytes[..field]);
    crc.update(&bytes[field + size_of::<u32>()..]);
    crc.update(tail);
    crc.finalize()
}

/// Fills in what the sender adds to a header: version, topic, epoch, sequence, time, and the check sum of protected topics.
pub fn seal<M: Message>(message: &mut M, tail: &[u8], epoch: u64, sequence: u64, sent: Nanos) {
    let header = message.header_mut();
    header.version = LAYOUT_VERSION;
    header.topic = M::TOPIC.id;
    header.epoch = epoch;
    header.sequence = sequence;
    header.sent = sent;
    header.check_sum = 0;
    if M::TOPIC.protected {
        message.header_mut().check_sum = check_sum(message, tail);
    }
}
