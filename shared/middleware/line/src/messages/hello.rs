//! HELLO: what a vehicle says of itself.

use super::{HAS_STEERING, HAS_YAW_RATE, HELLO, flag, masks, only, unmask};
use crate::PROTOCOL_VERSION;
use crate::bytes::{Fields, Writer};
use crate::errors::{FrameError, Refusal};
use crate::frame::Frame;

/// What a vehicle says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hello {
    /// Identity of this life of the vehicle; another one at each start, since the counters start
    /// anew.
    pub boot: u32,
    /// Width of the wheel counters, 1 to 64: they wrap there. Of no meaning without counters.
    pub counter_bits: u8,
    /// Bit i: wheel i (fl, fr, rl, rr) has a counter.
    pub counts_mask: u8,
    /// Bit i: wheel i reports a speed.
    pub speeds_mask: u8,
    /// There is a steering sensor.
    pub has_steering: bool,
    /// There is a gyro.
    pub has_yaw_rate: bool,
    /// Nominal time between readings \[us\].
    pub reading_period_us: u32,
    /// Without a command for so long the vehicle stops \[ms\].
    pub silence_ms: u16,
}

impl Hello {
    /// Whether every field can be what it says; the host refuses a HELLO where it is not.
    ///
    /// # Errors
    /// [`FrameError::Content`] naming the first impossible field.
    pub fn check(&self) -> Result<(), FrameError> {
        let impossible = |field| Err(FrameError::Content { field });
        match self {
            Self { counts_mask: 1.., counter_bits: 0 | 65.., .. } => impossible("counter_bits"),
            Self { counts_mask: 16.., .. } => impossible("counts_mask"),
            Self { speeds_mask: 16.., .. } => impossible("speeds_mask"),
            Self { reading_period_us: 0, .. } => impossible("reading_period_us"),
            Self { silence_ms: 0, .. } => impossible("silence_ms"),
            _ => Ok(()),
        }
    }

    pub(crate) fn encode(&self) -> Frame {
        let mut writer = Writer::new(HELLO);
        writer.put([PROTOCOL_VERSION]);
        writer.put(self.boot.to_le_bytes());
        writer.put([self.counter_bits, masks(self.counts_mask, self.speeds_mask)]);
        writer.put([flag(self.has_steering, HAS_STEERING) | flag(self.has_yaw_rate, HAS_YAW_RATE)]);
        writer.put(self.reading_period_us.to_le_bytes());
        writer.put(self.silence_ms.to_le_bytes());
        writer.finish()
    }

    /// The inner error is a vehicle that speaks another version.
    pub(crate) fn decode(fields: Fields<'_>) -> Result<Result<Self, Refusal>, FrameError> {
        let version = Fields(fields.0).u8().ok_or(FrameError::Length)?;
        if version != PROTOCOL_VERSION {
            return Ok(Err(Refusal::Version { host: PROTOCOL_VERSION, vehicle: version }));
        }
        let (hello, flags) = Self::fields(fields).ok_or(FrameError::Length)?;
        only(flags, HAS_STEERING | HAS_YAW_RATE)?;
        hello.check()?;
        Ok(Ok(hello))
    }

    fn fields(mut fields: Fields<'_>) -> Option<(Self, u8)> {
        let _version = fields.u8()?;
        let (boot, counter_bits) = (fields.u32()?, fields.u8()?);
        let (counts_mask, speeds_mask) = unmask(fields.u8()?);
        let flags = fields.u8()?;
        let (reading_period_us, silence_ms) = (fields.u32()?, fields.u16()?);
        fields.end()?;
        let (has_steering, has_yaw_rate) = (flags & HAS_STEERING != 0, flags & HAS_YAW_RATE != 0);
        let hello = Self {
            boot,
            counter_bits,
            counts_mask,
            speeds_mask,
            has_steering,
            has_yaw_rate,
            reading_period_us,
            silence_ms,
        };
        Some((hello, flags))
    }

    /// A counter value of `counter_bits`, sign-extended; what lies above is not looked at.
    pub(crate) fn counter(&self, value: i64) -> i64 {
        let unused = 64 - u32::from(self.counter_bits.clamp(1, 64));
        (value << unused) >> unused
    }
}
