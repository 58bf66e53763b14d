//! START: the host's wish for a session.

use super::START;
use crate::PROTOCOL_VERSION;
use crate::bytes::{Fields, Writer};
use crate::errors::{FrameError, Refusal};
use crate::frame::Frame;

/// The host's wish for a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Start {
    pub(crate) boot: u32,
    pub(crate) sequence: u32,
}

impl Start {
    pub(crate) fn encode(self) -> Frame {
        let mut writer = Writer::new(START);
        writer.put([PROTOCOL_VERSION]);
        writer.put(self.boot.to_le_bytes());
        writer.put(self.sequence.to_le_bytes());
        writer.finish()
    }

    /// The inner error is why a vehicle with the boot id `boot` does not take it.
    pub(crate) fn decode(
        fields: Fields<'_>,
        boot: u32,
    ) -> Result<Result<Self, Refusal>, FrameError> {
        let version = Fields(fields.0).u8().ok_or(FrameError::Length)?;
        if version != PROTOCOL_VERSION {
            return Ok(Err(Refusal::Version { host: version, vehicle: PROTOCOL_VERSION }));
        }
        let start = Self::fields(fields).ok_or(FrameError::Length)?;
        if start.boot != boot {
            return Ok(Err(Refusal::Boot { asked: start.boot, vehicle: boot }));
        }
        Ok(Ok(start))
    }

    fn fields(mut fields: Fields<'_>) -> Option<Self> {
        let _version = fields.u8()?;
        let start = Self { boot: fields.u32()?, sequence: fields.u32()? };
        fields.end()?;
        Some(start)
    }
}
