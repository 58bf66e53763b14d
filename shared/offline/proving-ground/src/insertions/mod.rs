//! What is put into the second vehicle so that it does not do what its description says.
//!
//! An [`Effect`] is an id with its parameters. [`LISTED`] has those that a diagnosis may name, [`UNLISTED`] others, which
//! it can only find to be unknown. Each acts at its own place on the way from command to reading, and the places are
//! files of their own:
//!
//! - `speed`, `steering`: between command and motor or rack;
//! - `ground`: linkage, wheels, tyres and floor. Where side force bends the path, what that amounts to in the listed
//!   parameter is measured on the vehicle itself ([`measured`]);
//! - `sensing`, `reference`: between motion and reading.

mod effect;
mod ground;
mod listed;
pub(crate) mod measure;
mod reference;
mod sensing;
mod speed;
mod steering;
mod unlisted;

use crate::cases::Specification;

pub use effect::{Definition, Effect, Link, Parameter, Role, Unit, merged};
pub(crate) use ground::{Ground, Present};
pub use listed::LISTED;
pub use measure::{Measured, measured};
pub(crate) use reference::Sight;
pub(crate) use sensing::Sensing;
pub(crate) use speed::Speed;
pub(crate) use steering::Steering;
pub use unlisted::UNLISTED;

/// The definition of an effect, listed or not.
#[must_use]
pub fn definition(id: &str) -> Option<&'static Definition> {
    LISTED.iter().chain(UNLISTED).find(|definition| definition.id == id)
}

/// Everything that is put into a vehicle, by place.
#[derive(Clone, Debug)]
pub(crate) struct Insertions {
    pub(crate) speed: Speed,
    pub(crate) steering: Steering,
    pub(crate) ground: Ground,
    pub(crate) sensing: Sensing,
    pub(crate) reference: Sight,
}

impl Insertions {
    /// `effects` in the vehicle of `case`; the last of several with the same id counts.
    pub(crate) fn new(case: &Specification, effects: &[Effect]) -> Self {
        let limits = &case.vehicle.limits;
        let mut all = Self {
            speed: Speed::neutral(limits.speed),
            steering: Steering::neutral(limits.steering),
            ground: Ground::neutral(limits, case.vehicle.wheelbase),
            sensing: Sensing::neutral(limits),
            reference: Sight::neutral(),
        };
        for effect in effects {
            all.speed.take(effect);
            all.steering.take(effect);
            all.ground.take(effect);
            all.sensing.take(effect);
            all.reference.take(effect);
        }
        all
    }
}
