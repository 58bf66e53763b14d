//! What can be wrong with a frame, and with a partner.

/// Why a frame was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// More bytes without a delimiter than any frame has.
    #[error("longer than any frame")]
    Overlong,
    /// Not a COBS encoding.
    #[error("not a COBS encoding")]
    Malformed,
    /// The bytes are not those that were sent.
    #[error("check sum does not match")]
    CheckSum,
    /// A message type that this end does not receive.
    #[error("unknown message type {0:#04x}")]
    Kind(u8),
    /// Too short or too long for its type.
    #[error("wrong length for its type")]
    Length,
    /// A field with a value that it cannot have.
    #[error("field {field} has an impossible value")]
    Content {
        /// Its name.
        field: &'static str,
    },
}

/// How many frames were refused, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineErrors {
    /// See [`FrameError::Overlong`].
    pub overlong: u64,
    /// See [`FrameError::Malformed`].
    pub malformed: u64,
    /// See [`FrameError::CheckSum`].
    pub check_sum: u64,
    /// See [`FrameError::Kind`].
    pub kind: u64,
    /// See [`FrameError::Length`].
    pub length: u64,
    /// See [`FrameError::Content`].
    pub content: u64,
}

impl LineErrors {
    /// All of them.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.overlong + self.malformed + self.check_sum + self.kind + self.length + self.content
    }

    pub(crate) fn count(&mut self, error: FrameError) {
        let counter = match error {
            FrameError::Overlong => &mut self.overlong,
            FrameError::Malformed => &mut self.malformed,
            FrameError::CheckSum => &mut self.check_sum,
            FrameError::Kind(_) => &mut self.kind,
            FrameError::Length => &mut self.length,
            FrameError::Content { .. } => &mut self.content,
        };
        *counter += 1;
    }
}

/// Why host and vehicle do not come together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// They speak different versions of the protocol.
    #[error("the host speaks version {host} of the line protocol, the vehicle version {vehicle}")]
    Version {
        /// The host's version.
        host: u8,
        /// The vehicle's version.
        vehicle: u8,
    },
    /// The host asked for a life of the vehicle that is over; it asks anew after the next HELLO.
    #[error("the host asked for boot id {asked:#010x}, the vehicle's is {vehicle:#010x}")]
    Boot {
        /// What the host's START said.
        asked: u32,
        /// The vehicle's boot id.
        vehicle: u32,
    },
}
