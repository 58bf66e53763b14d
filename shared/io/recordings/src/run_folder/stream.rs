//! A run as the sequence of readings that a vehicle's line would have delivered.

use kerbside_messages::{Header, NANOS_PER_SECOND, Nanos, Raw};

use super::{CountRow, GyroRow, Run, SpeedRow, SteeringRow};

/// The stamp of a run's `t = 0` \[ns\]: a run begins one second after the clock did, so that no
/// stamp is ever zero, which elsewhere means "none".
pub const BASE: Nanos = 1_000_000_000;

/// The stamp of the instant `t` \[s\] of a run: [`BASE`] and `t`, to the nearest nanosecond.
#[must_use]
#[allow(clippy::cast_possible_truncation)] // `as` saturates, and tables hold no such stamps.
pub fn stamp_of(t: f64) -> Nanos {
    BASE.saturating_add_signed((t * NANOS_PER_SECOND).round() as i64)
}

/// The readings of a run in order of time: each row of encoders (or wheels), steering and gyro is
/// one, and rows of the same nanosecond come in that order.
///
/// Arrival, stamp, origin and the vehicle's own time are all [`stamp_of`] the row's `t`: a run
/// folder knows one time. Frames count from 1; the vehicle's life (`boot`) is 1 throughout. Where
/// a run has both counts and speeds, counts are streamed.
#[derive(Clone, Debug)]
pub struct RawStream<'a> {
    counts: &'a [CountRow],
    speeds: &'a [SpeedRow],
    steering: &'a [SteeringRow],
    gyro: &'a [GyroRow],
    frame: u32,
}

impl<'a> RawStream<'a> {
    /// From the beginning of `run`.
    #[must_use]
    pub fn new(run: &'a Run) -> Self {
        let counts = run.encoders.as_ref().map_or(&[][..], |table| &table.rows);
        let speeds = run.wheels.as_ref().map_or(&[][..], |table| &table.rows);
        Self {
            counts,
            speeds: if counts.is_empty() { speeds } else { &[] },
            steering: run.steering.as_ref().map_or(&[][..], |table| &table.rows),
            gyro: run.gyro.as_ref().map_or(&[][..], |table| &table.rows),
            frame: 0,
        }
    }

    /// Stamps of the next row of each file; the latest possible where a file is used up.
    fn heads(&self) -> [Nanos; 4] {
        let head = |t: Option<f64>| t.map_or(Nanos::MAX, stamp_of);
        [
            head(self.counts.first().map(|row| row.t)),
            head(self.speeds.first().map(|row| row.t)),
            head(self.steering.first().map(|row| row.t)),
            head(self.gyro.first().map(|row| row.t)),
        ]
    }

    fn fill_from(&mut self, file: usize, raw: &mut Raw) -> Option<()> {
        match file {
            0 => {
                let row = self.counts.split_off_first()?;
                (raw.counts, raw.counts_mask) = (row.counts, row.mask);
            }
            1 => {
                let row = self.speeds.split_off_first()?;
                (raw.speeds, raw.speeds_mask) = (row.speeds, row.mask);
            }
            2 => {
                let row = self.steering.split_off_first()?;
                raw.steering = row.angle.unwrap_or_default();
                raw.has_steering = u8::from(row.angle.is_some());
            }
            _ => {
                let row = self.gyro.split_off_first()?;
                raw.yaw_rate = row.yaw_rate.unwrap_or_default();
                raw.has_yaw_rate = u8::from(row.yaw_rate.is_some());
            }
        }
        Some(())
    }
}

impl Iterator for RawStream<'_> {
    type Item = Raw;

    fn next(&mut self) -> Option<Raw> {
        let heads = self.heads();
        // The first of equal stamps wins: ties come in the order of the files.
        let (file, stamp) = heads.into_iter().enumerate().min_by_key(|(_, stamp)| *stamp)?;
        let mut raw = Raw {
            header: Header::stamped(stamp, stamp),
            vehicle_time: stamp,
            arrival: stamp,
            boot: 1,
            ..Raw::default()
        };
        self.fill_from(file, &mut raw)?;
        self.frame = self.frame.wrapping_add(1);
        raw.frame = self.frame;
        Some(raw)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.counts.len() + self.speeds.len() + self.steering.len() + self.gyro.len();
        (left, Some(left))
    }
}

impl ExactSizeIterator for RawStream<'_> {}
