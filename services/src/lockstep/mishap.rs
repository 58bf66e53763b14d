//! What may happen to samples on their way: pure, the same for every topic.

use kerbside_messages::layout::{Kind, Layout};
use kerbside_messages::{Message, Nanos, Process, seal};

/// What happens to samples on their way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Mishap {
    /// They never come.
    Lost,
    /// They come so much later \[ns\].
    Late(Nanos),
    /// They come twice.
    Repeated,
    /// Every two of them change places.
    Swapped,
    /// One of an ended life of the publisher comes before each.
    OldEpoch,
    /// A number in them is none; the seal is right.
    NotFinite(u32),
    /// A field of them is beyond all range; the seal is right.
    OutOfRange(u32),
    /// A bit of them is turned over; the seal is not.
    Flipped(u32),
}

impl Mishap {
    /// Whether no usable sample comes while it lasts: late ones come, but too late where `limit` counts.
    #[must_use]
    pub fn starves(self, limit: Nanos) -> bool {
        match self {
            Self::Lost | Self::NotFinite(_) | Self::Flipped(_) => true,
            Self::Late(by) => by > limit,
            Self::Repeated | Self::Swapped | Self::OldEpoch | Self::OutOfRange(_) => false,
        }
    }

    /// A word for counting.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lost => "lost",
            Self::Late(_) => "late",
            Self::Repeated => "repeated",
            Self::Swapped => "reordered",
            Self::OldEpoch => "old epoch",
            Self::NotFinite(_) => "not finite",
            Self::OutOfRange(_) => "out of range",
            Self::Flipped(_) => "flipped bit",
        }
    }
}

/// A mishap under way between a topic and one of its readers.
#[derive(Debug)]
pub(super) struct Passing<M> {
    mishap: Mishap,
    pub(super) reader: Process,
    pub(super) until: Nanos,
    held: Option<M>,
}

impl<M: Message> Passing<M> {
    pub(super) fn new(mishap: Mishap, reader: Process, until: Nanos) -> Self {
        Self { mishap, reader, until, held: None }
    }

    /// Hands on what becomes of `message`, each with the time at which it arrives.
    pub(super) fn pass(&mut self, now: Nanos, message: &M, mut put: impl FnMut(Nanos, &M)) {
        match self.mishap {
            Mishap::Lost => {}
            Mishap::Late(by) => put(now + by, message),
            Mishap::Repeated => {
                put(now, message);
                put(now, message);
            }
            Mishap::Swapped => match self.held.take() {
                Some(held) => {
                    put(now, message);
                    put(now, &held);
                }
                None => self.held = Some(*message),
            },
            Mishap::OldEpoch => {
                let header = *message.header();
                put(now, &sealed_again(message, header.epoch.saturating_sub(1)));
                put(now, message);
            }
            Mishap::NotFinite(which) => put(now, &spoilt(message, which, f64::NAN)),
            Mishap::OutOfRange(which) => put(now, &spoilt(message, which, 1e30)),
            Mishap::Flipped(bit) => {
                let mut hurt = *message;
                let bit = bit as usize % (8 * size_of::<M>());
                bytemuck::bytes_of_mut(&mut hurt)[bit / 8] ^= 1 << (bit % 8);
                put(now, &hurt);
            }
        }
    }
}

fn sealed_again<M: Message>(message: &M, epoch: u64) -> M {
    let (mut again, header) = (*message, *message.header());
    seal(&mut again, &[], epoch, header.sequence, header.sent);
    again
}

/// The message with its number number `which` replaced; a message without numbers gets an impossible code.
fn spoilt<M: Message>(message: &M, which: u32, value: f64) -> M {
    let mut hurt = *message;
    let bytes = bytemuck::bytes_of_mut(&mut hurt);
    let numbers = places(M::LAYOUT, Kind::F64);
    if let Some(at) = pick(&numbers, which) {
        bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
    } else if let Some(at) = pick(&places(M::LAYOUT, Kind::U8), which) {
        bytes[at] = u8::MAX;
    }
    sealed_again(&hurt, message.header().epoch)
}

fn pick(places: &[usize], which: u32) -> Option<usize> {
    places.get(which as usize % places.len().max(1)).copied()
}

/// Where fields of that kind lie, those of the header and unused ones left out.
fn places(layout: &Layout, kind: Kind) -> Vec<usize> {
    let mut found = Vec::new();
    for field in layout.fields {
        if field.name == "header" || field.name == "reserved" {
            continue;
        }
        let count = field.count.unwrap_or(1);
        match field.kind {
            Kind::Nested(part) => {
                for index in 0..count {
                    let inner = places(part, kind);
                    found.extend(inner.iter().map(|at| field.offset + index * part.size + at));
                }
            }
            own if own == kind => {
                let size = if kind == Kind::F64 { 8 } else { 1 };
                found.extend((0..count).map(|index| field.offset + index * size));
            }
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerbside_messages::{Admission, Odometry, Permit, Raw, Refusal};

    const READER: Process = Process::Tracker;

    fn pass<M: Message>(mishap: Mishap, messages: &[M]) -> Vec<(Nanos, M)> {
        let mut passing = Passing::new(mishap, READER, Nanos::MAX);
        let mut out = Vec::new();
        for message in messages {
            passing.pass(10, message, |due, sample| out.push((due, *sample)));
        }
        out
    }

    fn sealed<M: Message>(sequence: u64) -> M {
        let mut message = M::default();
        seal(&mut message, &[], 5, sequence, 10);
        message
    }

    #[test]
    fn samples_are_lost_late_doubled_and_out_of_order() {
        let two = [sealed::<Raw>(1), sealed::<Raw>(2)];
        let order = |out: &[(Nanos, Raw)]| -> Vec<_> {
            out.iter().map(|(due, raw)| (*due, raw.header.sequence)).collect()
        };
        assert_eq!(order(&pass(Mishap::Lost, &two)), []);
        assert_eq!(order(&pass(Mishap::Late(7), &two)), [(17, 1), (17, 2)]);
        assert_eq!(order(&pass(Mishap::Repeated, &two)), [(10, 1), (10, 1), (10, 2), (10, 2)]);
        assert_eq!(order(&pass(Mishap::Swapped, &two)), [(10, 2), (10, 1)]);
    }

    #[test]
    fn what_is_spoilt_is_refused_for_what_it_is() {
        let judge = |odometry: &Odometry| Admission::default().admit(odometry, &[], 10);
        let messages = [sealed::<Odometry>(1)];
        assert!(judge(&messages[0]).is_ok());
        for which in 0..200 {
            let hurt = pass(Mishap::NotFinite(which), &messages)[0].1;
            let refusal = judge(&hurt);
            assert!(
                matches!(refusal, Err(Refusal::NotFinite { .. } | Refusal::OutOfRange { .. })),
                "number {which}: {refusal:?}"
            );
        }
        for bit in (0..8 * size_of::<Permit>()).step_by(7) {
            let hurt = pass(Mishap::Flipped(bit as u32), &[sealed::<Permit>(1)])[0].1;
            assert!(Admission::default().admit(&hurt, &[], 10).is_err(), "bit {bit}");
        }
        let mut reader = Admission::<Permit>::default();
        let out = pass(Mishap::OldEpoch, &[sealed::<Permit>(1), sealed::<Permit>(2)]);
        let judged: Vec<_> =
            out.iter().map(|(_, permit)| reader.admit(permit, &[], 10).is_ok()).collect();
        assert_eq!(
            judged,
            [true, true, false, true],
            "the zombie is refused once the living spoke"
        );
    }

    #[test]
    fn a_message_without_numbers_gets_a_code_that_is_none() {
        let hurt = pass(Mishap::OutOfRange(1), &[sealed::<Permit>(1)])[0].1;
        assert!(Admission::default().admit(&hurt, &[], 10).is_err(), "{hurt:?}");
    }
}
