//! Order and rate of the readings on the line.

use kerbside_messages::Raw;

/// Where a reading stands after the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// The first of this life of the vehicle.
    First,
    /// It follows; so many frames between are missing.
    Next {
        /// Frames that never came.
        missing: u32,
    },
    /// It came before, or is older than what came before.
    Repeated,
}

/// Judges frame numbers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sequence {
    newest: Option<(u32, u64)>,
}

impl Sequence {
    /// The place of `raw`; `restarted`: the interface was, and may have begun to count frames anew.
    ///
    /// A frame is a repetition only if neither its number nor the vehicle's time went on: a line
    /// that counts anew under the same boot id is believed, and so is a clock that was set back.
    pub(crate) fn judge(&mut self, raw: &Raw, restarted: bool) -> Place {
        let Some((frame, time)) = self.newest else {
            self.newest = Some((raw.frame, raw.vehicle_time));
            return Place::First;
        };
        let ahead = raw.frame.wrapping_sub(frame).cast_signed();
        let repeated = if restarted { ahead == 0 } else { ahead <= 0 };
        if repeated && raw.vehicle_time <= time {
            return Place::Repeated;
        }
        self.newest = Some((raw.frame, raw.vehicle_time));
        Place::Next { missing: ahead.saturating_sub(1).max(0).cast_unsigned() }
    }
}

/// An interval longer than so many usual ones has a hole.
const HOLE: f64 = 2.5;

/// Learns how often the wheels are read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rate {
    usual: f64,
}

impl Rate {
    /// Begins with the rate that the vehicle's file states \[Hz\]; 0 where it states none.
    pub(crate) fn new(stated: f64) -> Self {
        Self { usual: if stated.is_finite() && stated > 0.0 { 1.0 / stated } else { 0.0 } }
    }

    /// The usual interval \[s\]; 0 before the first.
    pub(crate) fn usual(&self) -> f64 {
        self.usual
    }

    /// Takes an interval between two readings of the wheels \[s\]; says whether it has a hole.
    ///
    /// The usual interval follows by 2 % a reading, holes counted as twice the usual, so that
    /// neither a wrong belief nor a hole stays in it.
    pub(crate) fn has_hole(&mut self, interval: f64) -> bool {
        if self.usual == 0.0 {
            self.usual = interval;
            return false;
        }
        let hole = interval > HOLE * self.usual;
        self.usual += 0.02 * (interval.min(2.0 * self.usual) - self.usual);
        hole
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(frame: u32, time: u64) -> Raw {
        Raw { frame, vehicle_time: time, ..Raw::default() }
    }

    #[test]
    fn frames_are_counted_over_the_wrap() {
        let mut sequence = Sequence::default();
        assert_eq!(sequence.judge(&frame(u32::MAX - 1, 10), false), Place::First);
        assert_eq!(sequence.judge(&frame(1, 20), false), Place::Next { missing: 2 });
        assert_eq!(sequence.judge(&frame(1, 20), false), Place::Repeated);
        assert_eq!(sequence.judge(&frame(0, 15), false), Place::Repeated);
        assert_eq!(sequence.judge(&frame(2, 20), false), Place::Next { missing: 0 });
    }

    #[test]
    fn what_goes_on_in_time_is_no_repetition() {
        let mut sequence = Sequence::default();
        sequence.judge(&frame(900, 10), false);
        assert_eq!(sequence.judge(&frame(1, 20), false), Place::Next { missing: 0 });
        assert_eq!(sequence.judge(&frame(2, 5), false), Place::Next { missing: 0 });
        assert_eq!(sequence.judge(&frame(1, 3), true), Place::Next { missing: 0 });
        assert_eq!(sequence.judge(&frame(1, 3), true), Place::Repeated);
    }

    #[test]
    fn the_usual_interval_is_learnt_and_holes_are_seen() {
        let mut rate = Rate::new(10.0);
        for _ in 0..400 {
            rate.has_hole(0.005);
        }
        assert!((rate.usual() - 0.005).abs() < 1e-4);
        assert!(rate.has_hole(0.015));
        assert!(!rate.has_hole(0.005));
        let mut unknown = Rate::new(0.0);
        assert!(!unknown.has_hole(0.2));
        assert_eq!(unknown.usual(), 0.2);
    }
}
