//! COMMAND: what the actuators shall do.

use super::{COMMAND, finite};
use crate::bytes::{Fields, Writer};
use crate::errors::FrameError;
use crate::frame::Frame;

/// What the actuators shall do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Command {
    pub(crate) sequence: u32,
    pub(crate) speed: f32,
    pub(crate) steering: f32,
}

impl Command {
    pub(crate) fn encode(self) -> Frame {
        let mut writer = Writer::new(COMMAND);
        writer.put(self.sequence.to_le_bytes());
        writer.put(self.speed.to_le_bytes());
        writer.put(self.steering.to_le_bytes());
        writer.finish()
    }

    pub(crate) fn decode(fields: Fields<'_>) -> Result<Self, FrameError> {
        let command = Self::fields(fields).ok_or(FrameError::Length)?;
        finite("speed", &[command.speed])?;
        finite("steering", &[command.steering])?;
        Ok(command)
    }

    fn fields(mut fields: Fields<'_>) -> Option<Self> {
        let command =
            Self { sequence: fields.u32()?, speed: fields.f32()?, steering: fields.f32()? };
        fields.end()?;
        Some(command)
    }
}
