//! The calibrated vehicle.toml: the input's own text with other values, and where they come from.

use kerbside_calibration::Parameter;
use kerbside_geometry::{Vehicle, WHEELS};
use kerbside_settings::parse_vehicle;
use toml_edit::{Array, DocumentMut, Formatted, InlineTable, Item, Table, Value};

use super::fit::{Estimate, Found, key};
use super::{Calibration, Case, Method};
use crate::exit::{Exit, Failure};
use crate::machine;

/// The text of the calibrated vehicle's file: comments and order are the input's.
///
/// # Errors
/// [`Failure`] where the input's text is not TOML, or what is written would not be read again.
pub fn vehicle_text(calibration: &Calibration) -> Result<String, Failure> {
    let provenance =
        Provenance { method: calibration.method, left_out: calibration.judged_by_name() };
    text_of(&calibration.case, &calibration.found, &provenance)
}

/// Where the values come from, beside what was found.
#[derive(Clone, Copy, Debug)]
pub struct Provenance<'a> {
    /// How they were identified.
    pub method: Method,
    /// Runs left out by name.
    pub left_out: Option<&'a [String]>,
}

/// The text of the file of `case`'s vehicle with what was `found`.
///
/// # Errors
/// See [`vehicle_text`].
pub fn text_of(case: &Case, found: &Found, provenance: &Provenance<'_>) -> Result<String, Failure> {
    let mut document: DocumentMut = case
        .text
        .parse()
        .map_err(|error| Failure::new(Exit::Configuration, format!("{}: {error}", case.origin)))?;
    let root = document.as_table_mut();
    speed_radii(root, case.vehicle(), found);
    for estimate in identified(found) {
        put(root, &path_of(estimate.parameter), number(rounded(estimate)));
    }
    right_wheels(root, case.vehicle(), found);
    gyro_bias(root, case.vehicle(), found);
    uncertainty(root, found);
    root.remove("calibration");
    root.insert("calibration", Item::Table(calibration(found, provenance)));
    let text = document.to_string();
    parse_vehicle("the calibrated vehicle.toml", &text)
        .map_err(|error| Failure::internal(format!("what was found is no vehicle: {error}")))?;
    Ok(text)
}

/// What is written down.
fn identified(found: &Found) -> impl Iterator<Item = &Estimate> {
    found.estimates.iter().filter(|found| found.identified)
}

fn path_of(parameter: Parameter) -> Vec<&'static str> {
    key(parameter).split('.').collect()
}

/// Puts `value` at `path`, keeping the space and the comments around what was there; tables that are missing are made.
pub(crate) fn put(table: &mut dyn toml_edit::TableLike, path: &[&str], mut value: Value) {
    let [name, rest @ ..] = path else { return };
    if !rest.is_empty() {
        let item = table.entry(name).or_insert_with(|| {
            let mut table = Table::new();
            // Only for what is in it: without keys of its own it needs no line.
            table.set_implicit(true);
            Item::Table(table)
        });
        if let Some(inner) = item.as_table_like_mut() {
            put(inner, rest, value);
        }
        return;
    }
    match table.get_mut(name).and_then(Item::as_value_mut) {
        Some(old) => {
            *value.decor_mut() = old.decor().clone();
            *old = value;
        }
        None => {
            table.insert(name, Item::Value(value));
        }
    }
}

/// A number that stays a number with a point.
pub(crate) fn number(value: f64) -> Value {
    Value::Float(Formatted::new(value))
}

/// The value with three digits beyond its deviation: more say nothing.
fn rounded(estimate: &Estimate) -> f64 {
    let deviation = estimate.spread.map_or(1e-6 * estimate.nominal.abs(), |spread| spread.0);
    significant(estimate.value, deviation * 1e-3)
}

/// `value` to the decimal place of `step`.
pub(crate) fn significant(value: f64, step: f64) -> f64 {
    if !(step > 0.0 && step.is_finite()) {
        return value;
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
    let decimals = (-step.log10()).ceil().clamp(0.0, 15.0) as usize;
    format!("{value:.decimals$}").parse().unwrap_or(value)
}

/// A vehicle that reports speeds goes on computing them with the radii that it had.
fn speed_radii(root: &mut Table, vehicle: &Vehicle, found: &Found) {
    if vehicle.encoders.is_some() {
        return;
    }
    for estimate in identified(found) {
        let Some(wheel) = WHEELS.into_iter().find(|w| Parameter::radius(*w) == estimate.parameter)
        else {
            continue;
        };
        let index = wheel.index();
        let used = vehicle.speed_radius[index].unwrap_or(vehicle.radius[index]);
        put(root, &["speed_radius", wheel.name()], number(used));
    }
}

/// Without a track there is one wheel, and a radius of its twin that was stated beside it is no other.
fn right_wheels(root: &mut Table, vehicle: &Vehicle, found: &Found) {
    let twins = [
        (vehicle.track_front, Parameter::RadiusFrontLeft, "fr"),
        (vehicle.track_rear, Parameter::RadiusRearLeft, "rr"),
    ];
    for (track, left, right) in twins {
        let of_left = identified(found).find(|found| found.parameter == left);
        let stated =
            root.get("radius").and_then(Item::as_table_like).is_some_and(|t| t.contains_key(right));
        if let (Some(of_left), true) = (of_left, track == 0.0 && stated) {
            put(root, &["radius", right], number(rounded(of_left)));
        }
    }
}

/// What the gyro reads at rest, and how surely the next drive's is that: of one run alone nothing is said of the next.
fn gyro_bias(root: &mut Table, vehicle: &Vehicle, found: &Found) {
    let Some(bias) = found.gyro_bias.filter(|_| vehicle.gyro.is_some()) else { return };
    let step = bias.deviation.unwrap_or(1e-3) * 1e-3;
    put(root, &["gyro", "bias"], number(significant(bias.value, step)));
    if let Some(deviation) = bias.deviation {
        let stated = number(significant(deviation, deviation * 1e-2));
        put(root, &["uncertainty", "effect", "gyro_bias", "bias"], stated);
    }
}

/// `[uncertainty]` and `[uncertainty.effect]` from the covariance.
fn uncertainty(root: &mut Table, found: &Found) {
    let mut radius = 0.0_f64;
    for estimate in identified(found) {
        let Some((deviation, _)) = estimate.spread else { continue };
        let deviation = deviation.hypot(found.between[estimate.parameter.index()].sqrt());
        let stated = number(significant(deviation, deviation * 1e-2));
        match estimate.parameter {
            Parameter::TrackFront => put(root, &["uncertainty", "track_front"], stated),
            Parameter::TrackRear => put(root, &["uncertainty", "track_rear"], stated),
            Parameter::Wheelbase => put(root, &["uncertainty", "wheelbase"], stated),
            Parameter::SteeringZero => {
                put(root, &["uncertainty", "effect", "steering_sensor_offset", "offset"], stated);
            }
            Parameter::SteeringGain => {
                put(root, &["uncertainty", "effect", "steering_sensor_gain", "gain"], stated);
            }
            Parameter::MarkerX | Parameter::MarkerY | Parameter::MarkerYaw => {
                let name = estimate.parameter.name().trim_start_matches("marker.");
                put(root, &["uncertainty", "effect", "reference_marker", name], stated);
            }
            // The file has one figure for all wheels: that of the least known.
            _ => radius = radius.max(deviation),
        }
    }
    if radius > 0.0 {
        put(root, &["uncertainty", "radius"], number(significant(radius, radius * 1e-2)));
    }
}

/// The table `[calibration]`.
fn calibration(found: &Found, provenance: &Provenance<'_>) -> Table {
    let mut table = Table::new();
    table.decor_mut().set_prefix("\n# Written by `kerbside calibrate`.\n");
    let mut say = |name: &str, value: Value| table.insert(name, Item::Value(value));
    say("method", provenance.method.name().into());
    say("version", env!("CARGO_PKG_VERSION").into());
    say("date", machine::date().into());
    say("runs", texts(found.runs.iter().map(String::as_str)));
    if let Some(judged) = provenance.left_out {
        say("left_out", texts(judged.iter().map(String::as_str)));
    }
    let parameters = identified(found).map(|found| found.parameter);
    let parameters: Vec<Parameter> = parameters.collect();
    say("parameters", texts(parameters.iter().map(|parameter| key(*parameter))));
    if let Some(rows) = covariance(found, &parameters) {
        say("covariance", rows);
    }
    if let Some(allowance) = allowance(found, &parameters) {
        table.insert("allowance", Item::Value(allowance));
    }
    table.insert("residuals", Item::Table(residuals(found)));
    let mut rejected = Table::new();
    for run in &found.rejected {
        rejected.insert(&run.run, Item::Value(run.why.as_str().into()));
    }
    if !rejected.is_empty() {
        table.insert("rejected", Item::Table(rejected));
    }
    table
}

fn texts<'a>(names: impl Iterator<Item = &'a str>) -> Value {
    Value::Array(names.collect::<Array>())
}

/// A number of any size, six digits of it.
fn scientific(value: f64) -> Value {
    format!("{value:.5e}").parse().unwrap_or_else(|_| number(value))
}

/// The parameters' rows and columns, a row a line.
fn covariance(found: &Found, parameters: &[Parameter]) -> Option<Value> {
    let matrix = found.covariance.as_ref()?;
    let mut rows = Array::new();
    for one in parameters {
        let entry = |other: &Parameter| {
            // The halves are the same but for rounding.
            let (a, b) = (one.index().min(other.index()), one.index().max(other.index()));
            scientific(matrix[(a, b)])
        };
        let mut row = Value::Array(parameters.iter().map(entry).collect());
        row.decor_mut().set_prefix("\n  ");
        rows.push_formatted(row);
    }
    rows.set_trailing("\n");
    Some(Value::Array(rows))
}

/// Standard deviations of the parameters from drive to drive; none where there is nothing beyond the noise.
fn allowance(found: &Found, parameters: &[Parameter]) -> Option<Value> {
    let variances = parameters.iter().map(|parameter| found.between[parameter.index()]);
    let deviations: Vec<f64> = variances.map(f64::sqrt).collect();
    let any = deviations.iter().any(|deviation| *deviation > 0.0);
    any.then(|| Value::Array(deviations.into_iter().map(scientific).collect()))
}

/// Factor on the variances; root mean squares per run in standard deviations, as believed: 1.
fn residuals(found: &Found) -> Table {
    let (mut table, mut runs) = (Table::new(), Table::new());
    table.insert("inflation", Item::Value(number(significant(found.inflation, 1e-3))));
    for run in &found.residuals {
        let mut of_run = InlineTable::new();
        of_run.insert("reference", number(significant(run.truth, 1e-2)));
        if run.comparison_count > 0 {
            of_run.insert("axles", number(significant(run.comparison, 1e-2)));
        }
        if let Some(lag) = run.lag {
            of_run.insert("lag", number(significant(lag, 1e-3)));
        }
        runs.insert(&run.run, Item::Value(of_run.into()));
    }
    if !runs.is_empty() {
        table.insert("runs", Item::Table(runs));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_change_and_comments_stay() {
        let text = "# car\nwheelbase = 0.5   # by tape\nradius = { fl = 0.07, fr = 0.07 } # all\n[limits]\nspeed = 1.0\n";
        let mut document: DocumentMut = text.parse().unwrap();
        put(document.as_table_mut(), &["wheelbase"], number(0.501));
        put(document.as_table_mut(), &["radius", "fr"], number(0.0711));
        put(document.as_table_mut(), &["uncertainty", "wheelbase"], number(0.001));
        let expected = "# car\nwheelbase = 0.501   # by tape\nradius = { fl = 0.07, fr = 0.0711 } # all\n[limits]\nspeed = 1.0\n\n[uncertainty]\nwheelbase = 0.001\n";
        assert_eq!(document.to_string(), expected);
    }

    #[test]
    fn digits_end_where_the_deviation_says_nothing() {
        assert_eq!(significant(0.069_515_123_4, 1e-8), 0.069_515_12);
        assert_eq!(significant(0.1, 0.0), 0.1);
        assert_eq!(significant(-0.003_5, f64::NAN), -0.003_5);
    }
}
