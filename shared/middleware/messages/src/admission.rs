//! What a receiver checks before it uses a sample.

use crate::header::{LAYOUT_VERSION, check_sum};
use crate::topics::{Delivery, Publisher};
use crate::{Message, Nanos};

/// Why a sample is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Another version of the layouts.
    #[error("layout version {found}, ours is {LAYOUT_VERSION}")]
    Version {
        /// What the sample says.
        found: u16,
    },
    /// A sample of another topic.
    #[error("sample of topic number {found}")]
    Topic {
        /// What the sample says.
        found: u16,
    },
    /// The bytes are not those that were sent.
    #[error("check sum does not match")]
    CheckSum,
    /// From a life of the publisher that ended.
    #[error("from an earlier epoch of its publisher")]
    Epoch,
    /// Repeated, or overtaken by a newer one.
    #[error("repeated or out of order")]
    Order,
    /// Older than its topic allows.
    #[error("too old")]
    Stale,
    /// Sent after now.
    #[error("from the future")]
    Future,
    /// A number that is none.
    #[error("field {field} is not finite")]
    NotFinite {
        /// Its name.
        field: &'static str,
    },
    /// A number beyond what it can be.
    #[error("field {field} is out of range")]
    OutOfRange {
        /// Its name.
        field: &'static str,
    },
}

impl Refusal {
    /// Reasons counted apart.
    pub const KINDS: usize = 9;

    /// Index for counting.
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::Version { .. } => 0,
            Self::Topic { .. } => 1,
            Self::CheckSum => 2,
            Self::Epoch => 3,
            Self::Order => 4,
            Self::Stale => 5,
            Self::Future => 6,
            Self::NotFinite { .. } => 7,
            Self::OutOfRange { .. } => 8,
        }
    }
}

/// How many samples were refused, by reason, and how many never came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Refusals {
    /// By [`Refusal::index`].
    pub by_reason: [u64; Refusal::KINDS],
    /// Sequence numbers that were skipped.
    pub lost: u64,
    /// The newest refusal.
    pub newest: Option<Refusal>,
}

impl Refusals {
    /// All reasons together.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.by_reason.iter().sum()
    }
}

/// A receiver's memory of one topic: lets a sample through or counts why not.
#[derive(Clone, Copy, Debug)]
pub struct Admission<M> {
    epoch: u64,
    sequence: u64,
    counts: Refusals,
    message: core::marker::PhantomData<fn(M)>,
}

impl<M> Default for Admission<M> {
    fn default() -> Self {
        Self {
            epoch: 0,
            sequence: 0,
            counts: Refusals::default(),
            message: core::marker::PhantomData,
        }
    }
}

impl<M: Message> Admission<M> {
    /// Whether `message`, followed by `tail`, may be used at `now`. Order is judged for topics with one publisher.
    ///
    /// Freshness is not judged here but where the sample is used: a standing sample grows old while it is held.
    ///
    /// # Errors
    /// The first check that fails.
    pub fn admit(&mut self, message: &M, tail: &[u8], now: Nanos) -> Result<Admitted, Refusal> {
        self.judge(message, tail, now).inspect_err(|refusal| self.count(*refusal))
    }

    /// The same for a sample that never leaves its process, as number `sequence` of `epoch`: what a seal proves of
    /// the way is not asked, and nobody needs to seal it.
    ///
    /// # Errors
    /// The first check that fails.
    pub fn admit_unsealed(
        &mut self,
        message: &M,
        epoch: u64,
        sequence: u64,
    ) -> Result<Admitted, Refusal> {
        let judged = message.validate().and_then(|()| self.place(epoch, sequence));
        judged.inspect_err(|refusal| self.count(*refusal))
    }

    fn count(&mut self, refusal: Refusal) {
        self.counts.by_reason[refusal.index()] += 1;
        self.counts.newest = Some(refusal);
    }

    /// What was refused so far.
    #[must_use]
    pub fn counts(&self) -> &Refusals {
        &self.counts
    }

    fn judge(&mut self, message: &M, tail: &[u8], now: Nanos) -> Result<Admitted, Refusal> {
        let header = *message.header();
        if header.version != LAYOUT_VERSION {
            return Err(Refusal::Version { found: header.version });
        }
        if header.topic != M::TOPIC.id {
            return Err(Refusal::Topic { found: header.topic });
        }
        if M::TOPIC.protected && header.check_sum != check_sum(message, tail) {
            return Err(Refusal::CheckSum);
        }
        if header.sent > now {
            return Err(Refusal::Future);
        }
        message.validate()?;
        self.place(header.epoch, header.sequence)
    }

    fn place(&mut self, epoch: u64, sequence: u64) -> Result<Admitted, Refusal> {
        if !matches!(M::TOPIC.publisher, Publisher::One(_)) {
            return Ok(Admitted { missing: 0, new_epoch: false });
        }
        self.order(epoch, sequence)
    }

    fn order(&mut self, epoch: u64, sequence: u64) -> Result<Admitted, Refusal> {
        if epoch < self.epoch {
            return Err(Refusal::Epoch);
        }
        let new_epoch = epoch > self.epoch;
        if !new_epoch && sequence <= self.sequence {
            return Err(Refusal::Order);
        }
        let expected = if new_epoch { sequence } else { self.sequence + 1 };
        let missing = sequence - expected;
        if matches!(M::TOPIC.delivery, Delivery::InOrder { .. }) {
            // A hostile peer may leave out as many as it likes, again and again.
            self.counts.lost = self.counts.lost.saturating_add(missing);
        }
        (self.epoch, self.sequence) = (epoch, sequence);
        Ok(Admitted { missing, new_epoch })
    }
}

/// What is known of a sample that was let through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Admitted {
    /// Samples of this epoch that never came.
    pub missing: u64,
    /// First sample of a new life of the publisher.
    pub new_epoch: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Permit, Raw, seal};

    fn sample(epoch: u64, sequence: u64) -> Raw {
        let mut raw = Raw::default();
        seal(&mut raw, &[], epoch, sequence, 10);
        raw
    }

    #[test]
    fn order_and_epochs_are_judged() {
        let mut admission = Admission::<Raw>::default();
        assert_eq!(
            admission.admit(&sample(1, 5), &[], 10),
            Ok(Admitted { missing: 0, new_epoch: true })
        );
        assert_eq!(admission.admit(&sample(1, 5), &[], 10), Err(Refusal::Order));
        assert_eq!(
            admission.admit(&sample(1, 8), &[], 10),
            Ok(Admitted { missing: 2, new_epoch: false })
        );
        assert_eq!(
            admission.admit(&sample(2, 1), &[], 10),
            Ok(Admitted { missing: 0, new_epoch: true })
        );
        assert_eq!(admission.admit(&sample(1, 9), &[], 10), Err(Refusal::Epoch));
        assert_eq!(admission.counts().lost, 2);
        assert_eq!(admission.counts().total(), 2);
    }

    #[test]
    fn no_leap_of_the_sequence_is_too_far_to_count() {
        let mut admission = Admission::<Raw>::default();
        for epoch in 1..4 {
            assert!(admission.admit(&sample(epoch, 1), &[], 10).is_ok());
            assert!(admission.admit(&sample(epoch, u64::MAX), &[], 10).is_ok());
            assert_eq!(admission.admit(&sample(epoch, 5), &[], 10), Err(Refusal::Order));
        }
        assert_eq!(admission.counts().lost, u64::MAX);
    }

    #[test]
    fn a_sample_that_needs_no_seal_is_judged_as_a_sealed_one() {
        let places = [(1, 5), (1, 5), (1, 8), (2, 1), (1, 9), (2, 2)];
        let contents = [Raw::default(), Raw { yaw_rate: f64::NAN, ..Raw::default() }];
        let (mut sealed, mut unsealed) = (Admission::<Raw>::default(), Admission::default());
        for (epoch, sequence) in places {
            for content in &contents {
                let mut raw = *content;
                seal(&mut raw, &[], epoch, sequence, 10);
                let judged = sealed.admit(&raw, &[], 10);
                assert_eq!(unsealed.admit_unsealed(content, epoch, sequence), judged);
            }
        }
        assert_eq!(unsealed.counts(), sealed.counts());
        assert!(sealed.counts().lost > 0 && sealed.counts().total() > 6);
    }

    #[test]
    fn a_flipped_bit_anywhere_is_refused() {
        let mut permit = Permit { arm: 3, granted: 1, ..Permit::default() };
        seal(&mut permit, &[], 1, 1, 5);
        for bit in 0..8 * size_of::<Permit>() {
            let mut hurt = permit;
            bytemuck::bytes_of_mut(&mut hurt)[bit / 8] ^= 1 << (bit % 8);
            assert!(Admission::default().admit(&hurt, &[], 10).is_err(), "bit {bit}");
        }
        assert!(Admission::default().admit(&permit, &[], 10).is_ok());
    }

    #[test]
    fn rubbish_is_refused_before_it_is_used() {
        let mut raw = Raw { steering: f64::NAN, ..Raw::default() };
        seal(&mut raw, &[], 1, 1, 5);
        assert_eq!(
            Admission::default().admit(&raw, &[], 10),
            Err(Refusal::NotFinite { field: "steering" })
        );
        assert_eq!(Admission::default().admit(&sample(1, 1), &[], 9), Err(Refusal::Future));
        let mut old = sample(1, 1);
        old.header.version = 9;
        assert_eq!(Admission::default().admit(&old, &[], 10), Err(Refusal::Version { found: 9 }));
    }
}
