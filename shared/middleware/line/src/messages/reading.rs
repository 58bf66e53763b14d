//! READING: what the sensors say.

use super::{HAS_STEERING, HAS_YAW_RATE, Hello, READING, bit, finite, flag, masks, only, unmask};
use crate::bytes::{Fields, Writer};
use crate::errors::FrameError;
use crate::frame::Frame;

/// Counts are 64 bit wide.
const WIDE: u8 = 1 << 2;
/// The acknowledged sequence is one.
const ACKNOWLEDGES: u8 = 1 << 3;
/// Commands stay away.
const SILENT: u8 = 1 << 4;

/// What the sensors say at one instant. Values outside the masks are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensors {
    /// The vehicle's own time \[ns since its start\].
    pub time: u64,
    /// Bit i: wheel i (fl, fr, rl, rr) has a count.
    pub counts_mask: u8,
    /// Cumulative counts as read, the counter's bits sign-extended; forward positive.
    pub counts: [i64; 4],
    /// Bit i: wheel i has a speed.
    pub speeds_mask: u8,
    /// Surface speeds \[m/s\].
    pub speeds: [f32; 4],
    /// Road-wheel angle, left positive \[rad\].
    pub steering: Option<f32>,
    /// Yaw rate, counter-clockwise positive \[rad/s\].
    pub yaw_rate: Option<f32>,
}

impl Sensors {
    /// What of it may be sent after `hello`: what was declared, counters cut to their width, and no
    /// number that is none, since the host would have to refuse the whole reading.
    pub(crate) fn declared(&self, hello: &Hello) -> Self {
        let finite =
            (0..4).filter(|i| self.speeds[*i].is_finite()).fold(0, |mask, i| mask | 1 << i);
        let counts_mask = self.counts_mask & hello.counts_mask & 0xf;
        let speeds_mask = self.speeds_mask & hello.speeds_mask & finite;
        let count = |i: usize| if bit(counts_mask, i) { hello.counter(self.counts[i]) } else { 0 };
        let speed = |i: usize| if bit(speeds_mask, i) { self.speeds[i] } else { 0.0 };
        Self {
            time: self.time,
            counts_mask,
            counts: core::array::from_fn(count),
            speeds_mask,
            speeds: core::array::from_fn(speed),
            steering: self.steering.filter(|v| hello.has_steering && v.is_finite()),
            yaw_rate: self.yaw_rate.filter(|v| hello.has_yaw_rate && v.is_finite()),
        }
    }
}

/// A reading as it goes over the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The vehicle's boot id.
    pub boot: u32,
    /// One more with each reading, from 0 at boot; wraps.
    pub sequence: u32,
    /// Sequence of the newest START or COMMAND that the vehicle took; none before the first.
    pub acknowledged: Option<u32>,
    /// The vehicle stops, or stands, because commands stay away.
    pub silent: bool,
    /// What the sensors say.
    pub sensors: Sensors,
}

impl Reading {
    /// The sensors must be such as [`Sensors::declared`] gives.
    pub(crate) fn encode(&self, wide: bool) -> Frame {
        let sensors = &self.sensors;
        let mut writer = Writer::new(READING);
        writer.put([self.flags(wide), masks(sensors.counts_mask, sensors.speeds_mask)]);
        writer.put(self.boot.to_le_bytes());
        writer.put(self.sequence.to_le_bytes());
        writer.put(self.acknowledged.unwrap_or(0).to_le_bytes());
        writer.put(sensors.time.to_le_bytes());
        put_counts(&mut writer, sensors, wide);
        for i in (0..4).filter(|i| bit(sensors.speeds_mask, *i)) {
            writer.put(sensors.speeds[i].to_le_bytes());
        }
        for value in [sensors.steering, sensors.yaw_rate].into_iter().flatten() {
            writer.put(value.to_le_bytes());
        }
        writer.finish()
    }

    fn flags(&self, wide: bool) -> u8 {
        flag(self.sensors.steering.is_some(), HAS_STEERING)
            | flag(self.sensors.yaw_rate.is_some(), HAS_YAW_RATE)
            | flag(wide, WIDE)
            | flag(self.acknowledged.is_some(), ACKNOWLEDGES)
            | flag(self.silent, SILENT)
    }

    pub(crate) fn decode(fields: Fields<'_>) -> Result<Self, FrameError> {
        let flags = Fields(fields.0).u8().ok_or(FrameError::Length)?;
        only(flags, HAS_STEERING | HAS_YAW_RATE | WIDE | ACKNOWLEDGES | SILENT)?;
        let reading = Self::fields(fields).ok_or(FrameError::Length)?;
        reading.check_finite()?;
        Ok(reading)
    }

    fn fields(mut fields: Fields<'_>) -> Option<Self> {
        let flags = fields.u8()?;
        let (counts_mask, speeds_mask) = unmask(fields.u8()?);
        let (boot, sequence, acknowledged) = (fields.u32()?, fields.u32()?, fields.u32()?);
        let time = fields.u64()?;
        let mut sensors = Sensors { time, counts_mask, speeds_mask, ..Sensors::default() };
        for i in (0..4).filter(|i| bit(counts_mask, *i)) {
            let wide = flags & WIDE != 0;
            sensors.counts[i] = if wide { fields.i64()? } else { fields.i32()?.into() };
        }
        for i in (0..4).filter(|i| bit(speeds_mask, *i)) {
            sensors.speeds[i] = fields.f32()?;
        }
        if flags & HAS_STEERING != 0 {
            sensors.steering = Some(fields.f32()?);
        }
        if flags & HAS_YAW_RATE != 0 {
            sensors.yaw_rate = Some(fields.f32()?);
        }
        fields.end()?;
        let acknowledged = (flags & ACKNOWLEDGES != 0).then_some(acknowledged);
        Some(Self { boot, sequence, acknowledged, silent: flags & SILENT != 0, sensors })
    }

    fn check_finite(&self) -> Result<(), FrameError> {
        finite("speeds", &self.sensors.speeds)?;
        finite("steering", self.sensors.steering.as_slice())?;
        finite("yaw_rate", self.sensors.yaw_rate.as_slice())
    }

    /// Fails where the reading holds what `hello` did not declare; cuts counters to their width.
    pub(crate) fn conform(mut self, hello: &Hello) -> Result<Self, FrameError> {
        let undeclared = |field| Err(FrameError::Content { field });
        let sensors = &mut self.sensors;
        if sensors.counts_mask & !hello.counts_mask != 0 {
            return undeclared("counts_mask");
        }
        if sensors.speeds_mask & !hello.speeds_mask != 0 {
            return undeclared("speeds_mask");
        }
        if sensors.steering.is_some() && !hello.has_steering {
            return undeclared("steering");
        }
        if sensors.yaw_rate.is_some() && !hello.has_yaw_rate {
            return undeclared("yaw_rate");
        }
        sensors.counts = sensors.counts.map(|count| hello.counter(count));
        Ok(self)
    }
}

#[allow(clippy::cast_possible_truncation)] // Narrow counters have at most 32 bits.
fn put_counts(writer: &mut Writer, sensors: &Sensors, wide: bool) {
    for i in (0..4).filter(|i| bit(sensors.counts_mask, *i)) {
        if wide {
            writer.put(sensors.counts[i].to_le_bytes());
        } else {
            writer.put((sensors.counts[i] as i32).to_le_bytes());
        }
    }
}
