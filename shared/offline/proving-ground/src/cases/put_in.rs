//! Which effects are put in, and how strong.

use kerbside_geometry::{WHEELS, Wheel, math};

use super::dice::Dice;
use super::is_listed;
use super::plan::path;
use super::specification::{Kind, Specification};
use crate::insertions::{Definition, Effect, LISTED, Link, Role, UNLISTED};

/// Shares of an effect's range between which chance picks, evenly in the logarithm.
const SHARES: (f64, f64) = (0.05, 0.7);
/// Places that are tried.
const PLACES: usize = 40;
/// Effects that no sensor but the reference shows.
const OF_THE_BODY: [&str; 7] = [
    "radius_scale",
    "lateral_slip",
    "lateral_drift",
    "floor_slope",
    "floor_wave",
    "radius_growth",
    "reference_delay",
];
/// Each of a group does about what the others do: two of one are not put in together.
pub const TWINS: [&[&str]; 6] = [
    &["understeer", "steering_compliance"],
    &["speed_gain", "speed_dead_zone"],
    &["speed_delay", "encoder_delay", "speed_lag"],
    &["steering_delay", "steering_lag", "steering_backlash", "steering_rate_limit"],
    &["reference_delay", "clock_drift"],
    &["drive_slip", "floor_patch"],
];

/// What is wanted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted<'a> {
    pub(super) kind: Kind,
    pub(super) ids: &'a [&'static str],
    pub(super) share: Option<f64>,
}

/// The effects; none where one that is wanted by name does not exist or shows nowhere.
pub(super) fn effects(
    dice: &mut Dice,
    case: &Specification,
    wanted: &Wanted<'_>,
) -> Option<Vec<Effect>> {
    let count = match wanted.kind {
        Kind::Null => 0,
        Kind::Single | Kind::Unknown => 1,
        Kind::Pair => 2,
    };
    let table = if wanted.kind == Kind::Unknown { UNLISTED } else { LISTED };
    let mut ids: Vec<&Definition> = Vec::new();
    for id in wanted.ids.iter().take(count) {
        let known = table.iter().find(|known| known.id == *id)?;
        shows(known, case).then_some(())?;
        ids.push(known);
    }
    while ids.len() < count {
        let twins = |id: &str| {
            let together = |group: &&[&str]| {
                group.contains(&id) && ids.iter().any(|other| group.contains(&other.id))
            };
            ids.iter().any(|other| other.id == id) || TWINS.iter().any(together)
        };
        let fit = |known: &&Definition| shows(known, case) && !twins(known.id);
        let left: Vec<_> = table.iter().filter(fit).collect();
        let known = left.get(dice.below(left.len()))?;
        ids.push(known);
    }
    Some(ids.into_iter().map(|known| sized(dice, case, known, wanted.share)).collect())
}

/// Whether a vehicle has what it takes to show an effect.
fn shows(known: &Definition, case: &Specification) -> bool {
    let vehicle = &case.vehicle;
    let (gyro, sensor) = (vehicle.gyro.is_some(), vehicle.steering_sensor.is_some());
    if known.link == Link::Reference || OF_THE_BODY.contains(&known.id) {
        return vehicle.reference.is_some();
    }
    match known.id {
        "gyro_bias" | "gyro_gain" | "gyro_warming" | "gyro_vibration" => gyro,
        "steering_sensor_offset" | "steering_sensor_gain" | "sensor_bow" => sensor,
        _ => true,
    }
}

/// An effect with its parameters.
fn sized(dice: &mut Dice, case: &Specification, known: &Definition, share: Option<f64>) -> Effect {
    let listed = is_listed(known.id);
    let share = match share {
        Some(share) => share,
        None if listed => dice.log_between(SHARES.0, SHARES.1),
        None => dice.between(0.0, 1.0),
    };
    let sizes = known.parameters.iter().filter(|known| known.role == Role::Size).count();
    let mut values = Vec::new();
    for parameter in known.parameters {
        let scale = parameter.unit.scale(&case.vehicle);
        let (low, high, neutral) = (parameter.low, parameter.high, parameter.neutral);
        let value = match parameter.role {
            Role::Size if listed => {
                // Of several sizes each may be the smaller one.
                let part = if sizes > 1 { dice.between(0.4, 1.0) } else { 1.0 };
                let up = low >= neutral || dice.chance(0.5);
                let end = if up { high } else { low };
                let scaled = |value: f64| neutral + (value - neutral) * scale;
                scaled(neutral + share * part * (end - neutral))
            }
            Role::Size => scale * math::exp(math::ln(low) + share * math::ln(high / low)),
            Role::Limit => {
                let own = match known.id {
                    "acceleration_limit" => case.vehicle.limits.acceleration,
                    _ => case.vehicle.limits.steering_rate,
                };
                own - share * (own - scale * low)
            }
            Role::Free | Role::Place => scale * dice.between(low, high),
        };
        values.push((parameter.name, rounded(value)));
    }
    let wheel = known.of_wheel.then(|| a_wheel(dice, case));
    let mut effect = Effect { id: known.id, values, wheel };
    if known.parameters.iter().any(|parameter| parameter.role == Role::Place) {
        put_in_the_way(dice, case, &mut effect);
    }
    if known.id == "reference_marker" && !case.reference_yaw {
        set(&mut effect, "yaw", 0.0);
    }
    effect
}

/// To four digits, as a person would write it.
fn rounded(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    let digits = 3 - magnitude(value);
    let step = 10.0_f64.powi(digits);
    (value * step).round() / step
}

#[allow(clippy::cast_possible_truncation)] // A decimal exponent.
fn magnitude(value: f64) -> i32 {
    (math::ln(value.abs()) / core::f64::consts::LN_10).floor() as i32
}

fn set(effect: &mut Effect, name: &str, value: f64) {
    effect.values.iter_mut().filter(|known| known.0 == name).for_each(|known| known.1 = value);
}

/// A wheel that is read.
fn a_wheel(dice: &mut Dice, case: &Specification) -> Wheel {
    let read = |wheel: &Wheel| {
        let encoders = case.vehicle.encoders.as_ref();
        encoders.is_none_or(|known| known.counts_per_revolution[wheel.index()].is_some())
    };
    let wheels: Vec<_> = WHEELS.into_iter().filter(read).collect();
    dice.one(&wheels, Wheel::RearLeft)
}

/// Moves an effect's place to where as many runs as possible pass into it and out again.
fn put_in_the_way(dice: &mut Dice, case: &Specification, effect: &mut Effect) {
    let paths: Vec<_> = case.runs.iter().map(|plan| path(&case.vehicle, plan)).collect();
    let all: Vec<_> = paths.iter().flatten().copied().collect();
    if all.is_empty() {
        return;
    }
    let radius = effect.get("radius");
    let worth = |(x, y): (f64, f64)| -> f64 {
        let share = |path: &Vec<(f64, f64)>| {
            let inside = path.iter().filter(|at| math::hypot(at.0 - x, at.1 - y) < radius).count();
            #[allow(clippy::cast_precision_loss)] // A few hundred.
            let share = inside as f64 / path.len().max(1) as f64;
            if share > 0.0 && share < 0.8 { 1.0 + share } else { 0.0 }
        };
        paths.iter().map(share).sum()
    };
    let mut best = (f64::NEG_INFINITY, (0.0, 0.0));
    for _ in 0..PLACES {
        let place = dice.one(&all, (0.0, 0.0));
        let off = |dice: &mut Dice| dice.between(-0.4, 0.4) * radius;
        let place = (rounded(place.0 + off(dice)), rounded(place.1 + off(dice)));
        let worth = worth(place);
        if worth > best.0 {
            best = (worth, place);
        }
    }
    set(effect, "x", best.1.0);
    set(effect, "y", best.1.1);
}
