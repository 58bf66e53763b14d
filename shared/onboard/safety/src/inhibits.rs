//! Who forbids motion, and until when.

use kerbside_messages::{Inhibit, Nanos};

const SLOTS: usize = 8;

/// An inhibit as it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Standing {
    /// When it ends \[ns\].
    pub expiry: Nanos,
    /// Who asked: UTF-8, filled up with zeros.
    pub who: [u8; 32],
    /// Why: UTF-8, filled up with zeros.
    pub why: [u8; 96],
}

/// The inhibits of several askers. A newer one of the same asker replaces the older, so an asker
/// can prolong or withdraw its own and nobody else's.
#[derive(Clone, Debug, Default, Hash)]
pub struct Inhibits {
    slots: [Option<Standing>; SLOTS],
}

impl Inhibits {
    /// Takes up an inhibit.
    ///
    /// With more askers than slots the one that ends first is forgotten: the others forbid motion
    /// for at least as long, unless they withdraw early.
    pub fn note(&mut self, inhibit: &Inhibit) {
        let new = Standing { expiry: inhibit.expiry, who: inhibit.who, why: inhibit.why };
        let own = self.slots.iter().position(|slot| slot.is_some_and(|slot| slot.who == new.who));
        if let Some(own) = own {
            self.slots[own] = Some(new);
            return;
        }
        if let Some(slot) = self.slots.iter_mut().min_by_key(|slot| slot.map(|slot| slot.expiry))
            && slot.is_none_or(|slot| slot.expiry < new.expiry)
        {
            *slot = Some(new);
        }
    }

    /// The inhibit in force that ends last.
    #[must_use]
    pub fn in_force(&self, now: Nanos) -> Option<&Standing> {
        self.slots.iter().flatten().filter(|slot| now < slot.expiry).max_by_key(|slot| slot.expiry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerbside_messages::text::from_str;

    fn inhibit(who: &str, expiry: Nanos) -> Inhibit {
        Inhibit { who: from_str(who), expiry, ..Inhibit::default() }
    }

    #[test]
    fn an_asker_changes_its_own_inhibit_alone() {
        let mut inhibits = Inhibits::default();
        inhibits.note(&inhibit("door", 100));
        inhibits.note(&inhibit("bumper", 50));
        inhibits.note(&inhibit("bumper", 0));
        assert_eq!(inhibits.in_force(99).map(|slot| slot.expiry), Some(100));
        assert!(inhibits.in_force(100).is_none(), "over at its expiry");
        inhibits.note(&inhibit("door", 0));
        assert!(inhibits.in_force(10).is_none());
    }

    #[test]
    fn more_askers_than_slots_lose_no_time() {
        for order in [[1, 3, 5, 7, 9, 11, 13, 15, 12, 14], [15, 13, 11, 9, 7, 5, 3, 1, 2, 4]] {
            let mut inhibits = Inhibits::default();
            for (asker, expiry) in order.into_iter().enumerate() {
                inhibits.note(&inhibit(&format!("asker {asker}"), expiry));
            }
            assert!((0..15).all(|now| inhibits.in_force(now).is_some()));
            assert!(inhibits.in_force(15).is_none());
        }
    }
}
