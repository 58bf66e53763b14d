//! What paces a replay.

use super::known;
use crate::layout::layout;
use crate::topics::Process;
use crate::{Header, Refusal};

layout! {
    /// How far a reader has come in a replay: the replay never runs so far ahead that a reader
    /// would lose samples.
    pub struct Uptake {
        /// Header.
        pub header: Header,
        /// Sequence of the newest odometry the reader has taken in; 0 before the first.
        pub odometry: u64,
        /// [`Process`] that reads.
        pub reader: u8 as Process,
        /// Unused.
        pub reserved: [u8; 7],
    }
}

impl Uptake {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        known("reader", Process::from_id(self.reader))
    }
}
