//! What a car in good order may differ by, as parameters with priors.

use std::collections::BTreeMap;

use kerbside_geometry::Vehicle;
use kerbside_simulation::Parameter;

use crate::case::{Allowance, Case, Wheels};

/// A parameter that is never the diagnosis: it may be a little off its neutral value in any car.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nuisance {
    pub parameter: Parameter,
    /// Standard deviation about the neutral value, in the parameter's unit.
    pub deviation: f64,
}

/// Shares of what is measured by tape when vehicle.toml states nothing.
const LENGTH: f64 = 0.002;
const RADIUS: f64 = 0.0015;
const LAG: f64 = 0.05;
/// Acceleration of free fall \[m/s2\].
pub(crate) const GRAVITY: f64 = 9.81;
/// Slip of a tyre per force over load, along and across: one over its stiffness (Pacejka, *Tire and Vehicle Dynamics*,
/// chapter 1, has 10 to 30 per unit of load).
pub(crate) const CREEP: f64 = 0.025;
const SIDE_CREEP: f64 = 0.06;
/// Delay of a speed that is the mean over some tens of milliseconds \[s\].
const MEAN_TIME: f64 = 0.008;
/// What stamps of different sources are off by \[s\].
const STAMP: f64 = 0.004;
/// Share by which the radius behind a reported speed is off.
const ROUNDED: f64 = 0.002;

/// The nuisances of a case.
pub(crate) fn nuisances(case: &Case) -> Vec<Nuisance> {
    let vehicle = &case.vehicle;
    let mut all: Vec<Nuisance> =
        case.allowance.as_ref().map(|allowance| stated(allowance, vehicle)).unwrap_or_default();
    for own in ordinary(vehicle).into_iter().chain(inherent(case)) {
        // What vehicle.toml states goes before.
        if all.iter().all(|nuisance| nuisance.parameter != own.parameter) {
            all.push(own);
        }
    }
    all.retain(|nuisance| nuisance.deviation > 0.0 && nuisance.deviation.is_finite());
    all
}

/// Whether vehicle.toml states an allowance of some things, but not of all that are measured by tape.
pub(crate) fn is_partly_stated(case: &Case) -> bool {
    let Some(allowance) = &case.allowance else { return false };
    let stated = stated(allowance, &case.vehicle);
    ordinary(&case.vehicle)
        .iter()
        .any(|own| stated.iter().all(|nuisance| nuisance.parameter != own.parameter))
}

/// What every car has and nobody states: tyres that creep in proportion to their force over their load, a linkage that
/// is no rock, and wheel speeds that are means over a short time and computed with a rounded radius.
fn inherent(case: &Case) -> Vec<Nuisance> {
    let vehicle = &case.vehicle;
    let mut all = Vec::new();
    let mut put = |id: &str, name: &str, deviation: f64| {
        let found = Parameter::of(id).filter(|parameter| parameter.definition().name == name);
        all.extend(found.map(|parameter| Nuisance { parameter, deviation }));
    };
    put("acceleration_slip", "rate", 2.0 * CREEP / GRAVITY);
    put("lateral_slip", "rate", SIDE_CREEP / GRAVITY);
    put("understeer", "gradient", 0.3 * SIDE_CREEP / (GRAVITY * vehicle.wheelbase));
    put("steering_compliance", "rate", 0.0003 / vehicle.limits.acceleration.max(1e-3));
    put("speed_delay", "delay", STAMP);
    put("steering_delay", "delay", STAMP);
    put("reference_delay", "delay", STAMP);
    let means = case.runs.iter().any(|run| matches!(run.wheels, Wheels::Speed(_)));
    put("encoder_delay", "delay", if means { MEAN_TIME } else { 0.5 * STAMP });
    if means {
        put("count_loss", "fraction", ROUNDED);
    }
    all
}

fn stated(allowance: &Allowance, vehicle: &Vehicle) -> Vec<Nuisance> {
    let mut all = Vec::new();
    let mut put = |id: &str, name: &str, deviation: f64| {
        let found = Parameter::of(id).filter(|parameter| parameter.definition().name == name);
        // A limit that is not there has no deviation.
        let linear = found.filter(|parameter| parameter.neutral().is_finite());
        all.extend(linear.map(|parameter| Nuisance { parameter, deviation }));
    };
    for (field, deviation) in &allowance.fields {
        match field.as_str() {
            "wheelbase" => put("wheelbase_scale", "scale", deviation / vehicle.wheelbase),
            "track_front" => put("track_scale", "front", deviation / vehicle.track_front),
            "track_rear" => put("track_scale", "rear", deviation / vehicle.track_rear),
            "radius" => put("radius", "factor", deviation / vehicle.driven_radius()),
            "acceleration" => {
                put("limits", "acceleration", deviation / vehicle.limits.acceleration)
            }
            "steering_rate" => {
                put("limits", "steering_rate", deviation / vehicle.limits.steering_rate)
            }
            "speed_delay" => put("speed_delay", "delay", *deviation),
            "speed_lag" => put("speed_lag", "lag", *deviation),
            "steering_delay" => put("steering_delay", "delay", *deviation),
            "steering_lag" => put("steering_lag", "lag", *deviation),
            _ => {}
        }
    }
    for ((id, name), deviation) in &allowance.effects {
        put(id, name, *deviation);
    }
    all
}

/// A car measured by tape: a few per mille of its lengths, and what calibrations of such cars leave.
fn ordinary(vehicle: &Vehicle) -> Vec<Nuisance> {
    let response = vehicle.response();
    let length = vehicle.wheelbase / 0.5;
    let mut effects = BTreeMap::new();
    for (id, name, deviation) in [
        ("wheelbase_scale", "scale", LENGTH),
        ("track_scale", "front", LENGTH),
        ("track_scale", "rear", LENGTH),
        ("radius", "factor", RADIUS),
        ("speed_lag", "lag", LAG * response.speed_lag.max(0.02)),
        ("steering_lag", "lag", LAG * response.steering_lag.max(0.02)),
        ("speed_gain", "gain", 0.003),
        ("steering_gain", "gain", 0.004),
        ("steering_offset", "offset", 0.001),
        ("steering_sensor_offset", "offset", 0.001),
        ("gyro_bias", "bias", 0.0005),
        ("gyro_gain", "gain", 0.002),
        ("reference_marker", "x", 0.002 * length),
        ("reference_marker", "y", 0.002 * length),
        ("reference_marker", "yaw", 0.001),
    ] {
        effects.insert((id.to_owned(), name.to_owned()), deviation);
    }
    stated(&Allowance { effects, ..Allowance::default() }, vehicle)
}
