//! REFUSE: why the vehicle gives no session.

use super::REFUSE;
use crate::PROTOCOL_VERSION;
use crate::bytes::{Fields, Writer};
use crate::errors::{FrameError, Refusal};
use crate::frame::Frame;

const REASON_VERSION: u8 = 1;
const REASON_BOOT: u8 = 2;

/// REFUSE, sent by a vehicle with the boot id `boot`.
pub(crate) fn encode_refusal(refusal: Refusal, boot: u32) -> Frame {
    let (reason, version, asked) = match refusal {
        Refusal::Version { host, .. } => (REASON_VERSION, host, 0),
        Refusal::Boot { asked, .. } => (REASON_BOOT, PROTOCOL_VERSION, asked),
    };
    let mut writer = Writer::new(REFUSE);
    writer.put([PROTOCOL_VERSION]);
    writer.put(boot.to_le_bytes());
    writer.put([reason, version]);
    writer.put(asked.to_le_bytes());
    writer.finish()
}

/// The vehicle's REFUSE.
pub(crate) fn decode_refusal(mut fields: Fields<'_>) -> Result<Refusal, FrameError> {
    let vehicle = fields.u8().ok_or(FrameError::Length)?;
    if vehicle != PROTOCOL_VERSION {
        return Ok(Refusal::Version { host: PROTOCOL_VERSION, vehicle });
    }
    let (boot, reason, host, asked) = refusal_fields(fields).ok_or(FrameError::Length)?;
    match reason {
        REASON_VERSION => Ok(Refusal::Version { host, vehicle }),
        REASON_BOOT => Ok(Refusal::Boot { asked, vehicle: boot }),
        _ => Err(FrameError::Content { field: "reason" }),
    }
}

fn refusal_fields(mut fields: Fields<'_>) -> Option<(u32, u8, u8, u32)> {
    let found = (fields.u32()?, fields.u8()?, fields.u8()?, fields.u32()?);
    fields.end()?;
    Some(found)
}
