//! What a car in good order may differ by, as parameters with priors.

use std::collections::BTreeMap;

use kerbside_geometry::Vehicle;
use kerbside_simulation::Parameter;

use crate::case::{Allowance, Case};

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

/// The nuisances of a case.
pub(crate) fn nuisances(case: &Case) -> Vec<Nuisance> {
    let vehicle = &case.vehicle;
    let mut all: Vec<Nuisance> = match &case.allowance {
        Some(allowance) => stated(allowance, vehicle),
        None => ordinary(vehicle),
    };
    all.retain(|nuisance| nuisance.deviation > 0.0 && nuisance.deviation.is_finite());
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
