//! Cases on which a diagnosis is judged: a vehicle, what its description says, several drives, and what was put in.
//!
//! [`Case::draw`] draws everything that is fixed beforehand into a [`Specification`]. Vehicle, deviations in good order,
//! manoeuvres, stamps and noise come from streams of the seed that know nothing of the [`Kind`]: the same seed gives the
//! same drives of the same car for every kind, so neither order, name, size nor length of anything tells the kind.
//!
//! Who drives is another matter: [`Drives`] is implemented by [`SecondVehicle`], and any plant that understands the listed
//! effects can stand in its place. What it says without noise is read by the same noisy sensors.
//!
//! ```
//! use kerbside_proving_ground::cases::{Case, Errors, Kind};
//! let case = Case::draw(7, Kind::Single);
//! let plan = &case.specification.runs[0];
//! let rows = case.record(plan, true, Errors::Drawn(0));
//! assert!(!rows.commands.is_empty());
//! println!("{}", case.label().text());
//! ```

mod deviations;
mod dice;
mod floor;
mod label;
mod plan;
mod put_in;
mod record;
mod series;
mod specification;
mod text;
mod vehicle;

use crate::insertions::{Effect, definition, merged};

pub use crate::car::SecondVehicle;
pub use floor::{Disturbance, Floor};
pub use label::Label;
pub use put_in::TWINS;
pub use record::{Drives, Errors, Rows, Signals, Task};
pub use series::series;
pub use specification::{Build, Kind, Plan, Specification, Stamps, Uncertainty};
pub use text::{run_text, vehicle_text};

use dice::Dice;
use put_in::Wanted;

/// Streams of a case's seed.
const VEHICLE: u64 = 100;
const TRUTH: u64 = 101;
const FLOOR: u64 = 102;
const COURSE: u64 = 103;
const CAUSE: u64 = 104;

/// What to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// What kind of cause.
    pub kind: Kind,
    /// Which effects; empty leaves it to chance. One of a kind that wants two is joined by another.
    pub ids: Vec<&'static str>,
    /// How strong they are, as a share of their range, 0 to 1; none leaves it to chance.
    pub share: Option<f64>,
    /// Number of runs that may be read; one of them repeats another.
    pub runs: usize,
    /// Number of other runs.
    pub holdout: usize,
    /// Of each run \[s\].
    pub duration: f64,
}

impl Request {
    /// Six runs and three others of 18 s, the rest left to chance.
    #[must_use]
    pub fn new(kind: Kind) -> Self {
        Self { kind, ids: Vec::new(), share: None, runs: 6, holdout: 3, duration: 18.0 }
    }
}

/// A case, and who can record it.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// All that is fixed.
    pub specification: Specification,
}

impl Case {
    /// The case that `seed` draws.
    #[must_use]
    pub fn draw(seed: u64, kind: Kind) -> Self {
        let request = Request::new(kind);
        // Chance picks among what the vehicle can show; there is always something.
        Self::of(seed, &request).unwrap_or_else(|| Self { specification: bare(seed, &request) })
    }

    /// The case that `seed` draws of what is asked for; none where this seed's vehicle lacks a sensor without which an effect
    /// that was asked for by name shows nowhere, or where there is no effect of that name.
    #[must_use]
    pub fn of(seed: u64, request: &Request) -> Option<Self> {
        let mut specification = bare(seed, request);
        let wanted = Wanted { kind: request.kind, ids: &request.ids, share: request.share };
        specification.effects =
            put_in::effects(&mut Dice::new(seed, CAUSE), &specification, &wanted)?;
        Some(Self { specification })
    }

    /// `count` more drives beyond runs and holdout, `duration` \[s\] long each.
    #[must_use]
    pub fn further(&self, count: usize, duration: f64) -> Vec<Plan> {
        let case = &self.specification;
        let known = case.runs.len() + case.holdout.len();
        plan::plans(case, count, duration, false, record::mixed(case.seed, known as u64 + 1))
    }

    /// The rows of a drive of the second vehicle, with or without what is put in.
    #[must_use]
    pub fn record(&self, plan: &Plan, inserted: bool, errors: Errors) -> Rows {
        self.record_by(&SecondVehicle, plan, inserted, errors)
    }

    /// The rows of a drive of another plant.
    #[must_use]
    pub fn record_by(
        &self,
        plant: &dyn Drives,
        plan: &Plan,
        inserted: bool,
        errors: Errors,
    ) -> Rows {
        let case = &self.specification;
        let effects = self.acting(plan, inserted, errors);
        let disturbance = errors.seed().map_or(Disturbance::NONE, |seed| {
            Disturbance::drawn(&case.floor, plan.duration, record::mixed(plan.seed, seed))
        });
        let task = Task { case, plan, effects: &effects, disturbance: &disturbance };
        record::observed(case, plan, &plant.drive(&task), errors)
    }

    /// All effects that act in a drive: deviations in good order, differences from run to run unless nothing errs, and what is
    /// put in. A parameter that is put in has no further deviation, with it or without.
    #[must_use]
    pub fn acting(&self, plan: &Plan, inserted: bool, errors: Errors) -> Vec<Effect> {
        let case = &self.specification;
        let variation: &[Effect] = if errors == Errors::None { &[] } else { &plan.variation };
        let all = merged(&[&case.habits, variation], &case.effects);
        let put_in = |effect: &Effect| case.effects.iter().any(|other| other.id == effect.id);
        all.into_iter().filter(|effect| inserted || !put_in(effect)).collect()
    }

    /// What was put in, as the answer says it.
    #[must_use]
    pub fn label(&self) -> Label {
        Label::new(&self.specification)
    }
}

/// The case before anything is put in.
fn bare(seed: u64, request: &Request) -> Specification {
    let mut case = vehicle::drawn(seed);
    case.kind = request.kind;
    let all = plan::plans(&case, request.runs, request.duration, true, record::mixed(seed, COURSE));
    case.runs = all;
    let others = record::mixed(seed, COURSE + 1);
    case.holdout = plan::plans(&case, request.holdout, request.duration, false, others);
    case
}

/// Whether an effect is on the list.
pub(crate) fn is_listed(id: &str) -> bool {
    definition(id).is_some() && crate::insertions::LISTED.iter().any(|listed| listed.id == id)
}

#[cfg(test)]
mod tests;
