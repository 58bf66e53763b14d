//! The order of recorded readings: which life of the interface sent each, and as which of its samples. What the
//! recording lacks stays lacking, live as in one process.

use kerbside_messages::Raw;

/// A reading's place in a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Lives of the recorded interface that ended before.
    pub life: u64,
    /// Sequence within the life.
    pub sequence: u64,
}

/// Gives each reading its place.
#[derive(Clone, Copy, Debug, Default)]
pub struct Order {
    epoch: Option<u64>,
    place: Place,
}

impl Order {
    /// The place of the next reading. Readings of a run folder have no sequence; they are counted.
    pub fn place(&mut self, raw: &Raw) -> Place {
        let header = &raw.header;
        let before = self.epoch.replace(header.epoch);
        if before.is_some_and(|epoch| epoch != header.epoch) {
            self.place = Place { life: self.place.life + 1, sequence: 0 };
        }
        self.place.sequence =
            if header.sequence > 0 { header.sequence } else { self.place.sequence + 1 };
        self.place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(epoch: u64, sequence: u64) -> Raw {
        let mut raw = Raw::default();
        (raw.header.epoch, raw.header.sequence) = (epoch, sequence);
        raw
    }

    #[test]
    fn a_recordings_gaps_and_lives_are_kept() {
        let mut order = Order::default();
        let places = [raw(7, 4), raw(7, 5), raw(7, 9), raw(8, 1)].map(|raw| {
            let place = order.place(&raw);
            (place.life, place.sequence)
        });
        assert_eq!(places, [(0, 4), (0, 5), (0, 9), (1, 1)]);
    }

    #[test]
    fn readings_without_a_sequence_are_counted() {
        let mut order = Order::default();
        let places = [raw(0, 0), raw(0, 0), raw(0, 0)].map(|raw| order.place(&raw).sequence);
        assert_eq!(places, [1, 2, 3]);
    }
}
