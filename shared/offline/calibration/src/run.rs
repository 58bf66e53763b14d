//! A recorded run, as calibration takes it.

use core::f64::consts::TAU;

use kerbside_geometry::Pose;

/// Readings of one sensor over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Stamps, strictly increasing \[s\].
    pub t: Vec<f64>,
    /// Readings, one per stamp; the unit is the sensor's.
    pub value: Vec<f64>,
}

impl Series {
    /// Rotation \[rad\] of a wheel from unwrapped cumulative counts, `per_revolution` to a turn.
    #[must_use]
    pub fn from_counts(t: Vec<f64>, counts: &[f64], per_revolution: f64) -> Self {
        Self { t, value: counts.iter().map(|count| count * TAU / per_revolution).collect() }
    }

    /// Rotation \[rad\] of a wheel from cumulative counts of `bits` bits that wrap, `per_revolution` to a turn; from 0.
    ///
    /// Between two readings the counter moves by less than half its range.
    #[must_use]
    pub fn from_wrapping_counts(
        t: Vec<f64>,
        counts: &[i64],
        bits: u32,
        per_revolution: f64,
    ) -> Self {
        let unused = 64 - bits.clamp(1, 64);
        let mut unwrapped = 0_i64;
        let mut before = counts.first().copied().unwrap_or(0);
        let value = counts.iter().map(|count| {
            unwrapped = unwrapped.wrapping_add(count.wrapping_sub(before) << unused >> unused);
            before = *count;
            #[allow(clippy::cast_precision_loss)] // 53 bits of counts are exact
            let turned = unwrapped as f64;
            turned * TAU / per_revolution
        });
        let value = value.collect();
        Self { t, value }
    }

    /// Rotation \[rad\] of a wheel from surface speeds \[m/s\] that the vehicle computed with
    /// `radius` \[m\]: the trapezoidal sum, from 0.
    #[must_use]
    pub fn from_speeds(t: Vec<f64>, speeds: &[f64], radius: f64) -> Self {
        let mut value = Vec::with_capacity(speeds.len());
        let mut rotation = 0.0;
        for (index, speed) in speeds.iter().enumerate() {
            if index > 0 {
                let step = t[index] - t[index - 1];
                rotation += 0.5 * (speed + speeds[index - 1]) * step / radius;
            }
            value.push(rotation);
        }
        Self { t, value }
    }

    /// Number of readings.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t.len().min(self.value.len())
    }

    /// Whether there is no reading.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The reading at `t` \[s\], interpolated linearly and held beyond both ends; 0 without readings.
    #[must_use]
    pub fn at(&self, t: f64) -> f64 {
        let length = self.len();
        let after = self.t[..length].partition_point(|stamp| *stamp <= t);
        if length == 0 {
            return 0.0;
        }
        if after == 0 {
            return self.value[0];
        }
        if after == length {
            return self.value[length - 1];
        }
        let (from, to) = (self.t[after - 1], self.t[after]);
        let share = (t - from) / (to - from);
        self.value[after - 1] + share * (self.value[after] - self.value[after - 1])
    }

    /// Mean of the readings within two stamps \[s\]; none where there is none.
    #[must_use]
    pub fn mean(&self, from: f64, to: f64) -> Option<f64> {
        let begin = self.t.partition_point(|stamp| *stamp < from);
        let end = self.t.partition_point(|stamp| *stamp <= to).min(self.value.len());
        let readings = self.value.get(begin..end).filter(|readings| !readings.is_empty())?;
        #[allow(clippy::cast_precision_loss)] // readings
        let count = readings.len() as f64;
        Some(readings.iter().sum::<f64>() / count)
    }

    /// Last reading minus first.
    #[must_use]
    pub fn change(&self) -> f64 {
        match (self.value.first(), self.value.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }

    /// First and last stamp \[s\]; none without readings.
    #[must_use]
    pub fn span(&self) -> Option<(f64, f64)> {
        Some((*self.t.first()?, *self.t.last()?))
    }
}

/// A reading of the reference: the marker's pose in the reference's fixed frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferencePose {
    /// Stamp on the encoders' clock \[s\].
    pub t: f64,
    /// Position \[m\].
    pub x: f64,
    /// Position \[m\].
    pub y: f64,
    /// Heading, wrapped or not \[rad\].
    pub yaw: Option<f64>,
}

/// One uninterrupted drive. What is missing is none or empty; at least one wheel and one kind of
/// truth (reference, end pose, distance or net turn) make it useful.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Run {
    /// Name, for people.
    pub name: String,
    /// What was driven, in free text: `straight`, `circle`, `arc`, ... are understood.
    pub manoeuvre: String,
    /// Cumulative rotation of fl, fr, rl, rr, forward positive \[rad\].
    pub rotation: [Option<Series>; 4],
    /// Steering sensor: road-wheel angle of the equivalent centre wheel as read, left positive \[rad\].
    pub steering: Option<Series>,
    /// Gyro \[rad/s\]: evidence, and in the fit where nothing else tells the heading.
    pub yaw_rate: Option<Series>,
    /// Readings of the reference in order of time.
    pub reference: Vec<ReferencePose>,
    /// Pose of the body at the run's start in the reference's frame, known by itself.
    pub start: Option<Pose>,
    /// Pose of the body at the end relative to the start, measured by hand; its yaw within half a turn.
    pub end_pose: Option<Pose>,
    /// Tape-measured travel of the rear-axle centre \[m\].
    pub distance: Option<f64>,
    /// Net turn known otherwise, whole turns included: 0 along a guide rail \[rad\].
    pub net_turn: Option<f64>,
}

impl Run {
    /// First and last stamp that all wheels share \[s\]; none without wheels.
    #[must_use]
    pub fn span(&self) -> Option<(f64, f64)> {
        let mut spans = self.rotation.iter().flatten().map(Series::span);
        let first = spans.next()??;
        spans.try_fold(first, |(from, to), span| {
            let (begin, end) = span?;
            Some((from.max(begin), to.min(end)))
        })
    }

    /// Which of fl, fr, rl, rr have readings.
    #[must_use]
    pub fn wheels(&self) -> [bool; 4] {
        core::array::from_fn(|wheel| {
            self.rotation[wheel].as_ref().is_some_and(|series| series.len() > 1)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_interpolated_and_held() {
        let series = Series { t: vec![0.0, 1.0, 3.0], value: vec![0.0, 2.0, 4.0] };
        let at = [-1.0, 0.5, 1.0, 2.0, 9.0].map(|t| series.at(t));
        assert_eq!(at, [0.0, 1.0, 2.0, 3.0, 4.0]);
    }

    #[test]
    fn counters_that_wrap_go_on() {
        let counts = [32_766, -32_767, -32_760, 32_765];
        let series = Series::from_wrapping_counts(vec![0.0, 1.0, 2.0, 3.0], &counts, 16, TAU);
        assert_eq!(series.value, [0.0, 3.0, 10.0, -1.0]);
    }

    #[test]
    fn counts_and_speeds_become_rotations() {
        let counts = Series::from_counts(vec![0.0, 1.0], &[0.0, 500.0], 2000.0);
        assert!((counts.change() - 0.25 * TAU).abs() < 1e-12);
        let speeds = Series::from_speeds(vec![0.0, 1.0, 2.0], &[0.0, 1.0, 1.0], 0.5);
        assert!((speeds.change() - 3.0).abs() < 1e-12);
    }
}
