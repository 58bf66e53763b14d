//! Which other effect the runs of a case cannot tell from one that was put in, however well anybody looks: the plant is
//! driven with the other one in its place, at the size at which it comes closest, and what sets the two apart is
//! measured as the size of an effect is, see `size`.

use kerbside_proving_ground::cases::{Case, Drives, TWINS};
use kerbside_proving_ground::insertions::{Definition, Effect, LISTED, Parameter, Role};

use super::size::{Change, Measure, sizes};

/// Below this many standard deviations two effects are twins: as little shows of an effect that is "not excited".
pub const TWIN: f64 = 3.0;
/// Further effects that may look alike, though two of them together may show.
const ALIKE: [&[&str]; 3] = [
    &["drive_slip", "radius_scale", "reference_scale"],
    &["steering_gain", "wheelbase_scale"],
    &["lateral_drift", "steering_offset"],
];
/// Steps towards the closest size.
const STEPS: usize = 5;
/// A step that comes no closer than to this share of the distance before is the last.
const CLOSER: f64 = 0.95;
/// Where they begin, and by how much a slope is measured, as shares of the range.
const BEGIN: f64 = 0.15;
const PROBE: f64 = 0.02;

/// An effect in place of one that was put in.
#[derive(Clone, Debug, PartialEq)]
pub struct Twin {
    /// What was put in.
    pub of: &'static str,
    /// What might as well have been.
    pub id: &'static str,
    /// How far apart the two are at the closest, in standard deviations.
    pub apart: f64,
}

/// How the effects of a case are known: sizes in their order, and how close others of the same kind come.
#[must_use]
pub fn measured(case: &Case, plant: &dyn Drives) -> (Vec<f64>, Vec<Twin>) {
    if case.specification.effects.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let measure = Measure::new(case, plant);
    let sizes = sizes(case, &measure);
    let mut twins = Vec::new();
    for (index, effect) in case.specification.effects.iter().enumerate() {
        let present = |id: &str| case.specification.effects.iter().any(|other| other.id == id);
        let groups = TWINS.iter().chain(&ALIKE).filter(|group| group.contains(&effect.id));
        for id in groups.flat_map(|group| group.iter()).filter(|id| !present(id)) {
            let Some((known, parameter)) = of_one_size(id) else { continue };
            let rival = Rival { case, index, known, parameter };
            let apart = closest(&measure, &rival);
            twins.push(Twin { of: effect.id, id, apart });
        }
    }
    (sizes, twins)
}

/// An effect that has a single parameter, which says how strong it is.
fn of_one_size(id: &str) -> Option<(&'static Definition, &'static Parameter)> {
    let known = LISTED.iter().find(|known| known.id == id && !known.of_wheel)?;
    let [parameter] = known.parameters else { return None };
    matches!(parameter.role, Role::Size | Role::Limit).then_some((known, parameter))
}

/// Another effect in the place of one of a case's.
struct Rival<'a> {
    case: &'a Case,
    index: usize,
    known: &'static Definition,
    parameter: &'static Parameter,
}

impl Rival<'_> {
    /// The case with it, at a share of its range; a share below 0 is of the range to the other side.
    fn at(&self, share: f64) -> Case {
        let mut case = self.case.clone();
        let vehicle = &case.specification.vehicle;
        let Parameter { name, neutral, low, high, .. } = *self.parameter;
        let scale = self.parameter.unit.scale(vehicle);
        let value = match self.parameter.role {
            Role::Limit => vehicle.limits.steering_rate * (1.0 - share) + share * scale * low,
            _ if share < 0.0 => neutral - share * (low - neutral) * scale,
            _ => neutral + share * (high - neutral) * scale,
        };
        case.specification.effects[self.index] = Effect::new(self.known.id, &[(name, value)]);
        case
    }

    /// Whether it has two sides.
    fn has_two_sides(&self) -> bool {
        self.parameter.role == Role::Size && self.parameter.low < self.parameter.neutral
    }
}

/// How far it is from the case at the closest.
fn closest(measure: &Measure<'_>, rival: &Rival<'_>) -> f64 {
    let sides: &[f64] = if rival.has_two_sides() { &[1.0, -1.0] } else { &[1.0] };
    sides.iter().map(|side| descended(measure, rival, *side)).fold(f64::INFINITY, f64::min)
}

/// By Gauss and Newton's steps in the share of the range on one side.
fn descended(measure: &Measure<'_>, rival: &Rival<'_>, side: f64) -> f64 {
    let left = |share: f64| measure.change(&rival.at(side * share));
    let (mut share, mut best) = (BEGIN, f64::INFINITY);
    for _ in 0..STEPS {
        let now: Change = left(share);
        let apart = measure.length(&now);
        let closer = apart < CLOSER * best;
        best = best.min(apart);
        if !closer {
            break;
        }
        let slope = left(share + PROBE).minus(&now, 1.0 / PROBE);
        let square = measure.product(&slope, &slope);
        if square <= 0.0 {
            break;
        }
        let next = (share - measure.product(&slope, &now) / square).clamp(0.0, 1.0 - PROBE);
        if (next - share).abs() < 1e-3 {
            break;
        }
        share = next;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::Simulated;
    use kerbside_proving_ground::cases::{Kind, Request};

    fn case(id: &'static str, share: f64, sees: impl Fn(&Case) -> bool) -> Case {
        let kind = Kind::Single;
        let request =
            Request { ids: vec![id], share: Some(share), duration: 8.0, ..Request::new(kind) };
        let mut cases = (0..200).filter_map(|seed| Case::of(seed, &request));
        cases.find(|case| sees(case)).unwrap()
    }

    fn apart(case: &Case, id: &str) -> f64 {
        let (_, twins) = measured(case, &Simulated);
        twins.iter().find(|twin| twin.id == id).unwrap().apart
    }

    #[test]
    fn a_weak_understeer_is_a_weak_compliance_and_a_strong_one_is_not() {
        let posed = |case: &Case| case.specification.reference_yaw;
        let (weak, strong) = (case("understeer", 0.02, posed), case("understeer", 0.7, posed));
        let (weak, strong) =
            (apart(&weak, "steering_compliance"), apart(&strong, "steering_compliance"));
        assert!(weak < TWIN, "{weak}");
        assert!(strong > 3.0 * weak, "{strong} against {weak}");
    }

    #[test]
    fn an_effect_is_no_closer_to_another_than_to_itself() {
        let lag = case("steering_lag", 0.3, |_| true);
        let rival = |id: &'static str| {
            let (known, parameter) = of_one_size(id).unwrap();
            Rival { case: &lag, index: 0, known, parameter }
        };
        let measure = Measure::new(&lag, &Simulated);
        let itself = closest(&measure, &rival("steering_lag"));
        assert!(itself < 0.3, "{itself}");
        assert!(closest(&measure, &rival("steering_delay")) > itself);
    }
}
