//! The way back: where an effect is a matter of calibration, the lines of vehicle.toml that absorb it, and the file
//! with them, `diagnosis.vehicle.toml`.
//!
//! What is absorbed is no gap any more: the vehicle with these lines is simulated as the one without them and with the
//! effect is; but for the motor, which goes on turning by the radius that it was made for.

use std::fs;

use kerbside_diagnosis::{Diagnosis, FoundEffect, Verdict};
use kerbside_geometry::{SteeringSensor, Vehicle, WHEELS};
use kerbside_settings::parse_vehicle;
use serde_json::{Value, json};
use toml_edit::DocumentMut;

use super::Diagnosed;
use crate::calibrate::output::{number, put, significant};
use crate::exit::Failure;

/// Digits of a value: more say nothing of a vehicle.
const PRECISION: f64 = 1e-6;

/// A key whose value another one absorbs an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Dotted key of vehicle.toml.
    pub key: String,
    /// The value that it had; none where it was not there.
    pub was: Option<f64>,
    /// The value that absorbs.
    pub value: f64,
}

/// What of a diagnosis a vehicle's file can absorb.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Absorbed {
    /// The lines, in the order of the file's reference.
    pub lines: Vec<Line>,
    /// Effects that they absorb.
    pub effects: Vec<&'static str>,
    /// Effects that no key stands for.
    pub left: Vec<&'static str>,
}

impl Absorbed {
    /// What of `found` the file of `vehicle` can absorb: nothing where the verdict does not name effects.
    pub fn of(found: &Diagnosis, vehicle: &Vehicle) -> Self {
        if found.verdict != Verdict::Effects {
            return Self::default();
        }
        let mut absorbing = vehicle.clone();
        let (mut effects, mut left) = (Vec::new(), Vec::new());
        for effect in &found.effects {
            let absorbed = absorb(&mut absorbing, effect).is_some();
            if absorbed { effects.push(effect.id) } else { left.push(effect.id) }
        }
        let mut lines = Vec::new();
        for ((key, was), (_, value)) in keys(vehicle).into_iter().zip(keys(&absorbing)) {
            let Some(value) = value.filter(|value| was != Some(*value)) else { continue };
            let value = significant(value, PRECISION * value.abs().max(was.unwrap_or(0.0).abs()));
            lines.push(Line { key, was, value });
        }
        Self { lines, effects, left }
    }

    /// In a sentence or two, for people; nothing where nothing is absorbed.
    pub fn in_words(&self, file: &str) -> Option<String> {
        if self.lines.is_empty() {
            return None;
        }
        let line = |line: &Line| match line.was {
            Some(was) => format!("{} = {} (was {was})", line.key, line.value),
            None => format!("{} = {}", line.key, line.value),
        };
        let lines: Vec<String> = self.lines.iter().map(line).collect();
        let left = match &self.left[..] {
            [] => String::new(),
            left => format!(" No key stands for {}.", left.join(", ")),
        };
        Some(format!("{file} absorbs {}: {}.{left}", self.effects.join(", "), lines.join(", ")))
    }

    /// The entry in diagnosis.json; null where nothing is absorbed.
    pub fn as_json(&self, file: &str) -> Value {
        if self.lines.is_empty() {
            return Value::Null;
        }
        let line = |line: &Line| json!({ "key": line.key, "was": line.was, "value": line.value });
        let lines: Vec<Value> = self.lines.iter().map(line).collect();
        json!({ "file": file, "absorbs": self.effects, "left": self.left, "lines": lines })
    }
}

/// Changes `vehicle` so that it needs `effect` no more; none where no key stands for it.
fn absorb(vehicle: &mut Vehicle, effect: &FoundEffect) -> Option<()> {
    let value = |name: &str| {
        let found = effect.parameters.iter().find(|parameter| parameter.name == name)?;
        Some(found.value.value).filter(|value| value.is_finite())
    };
    match effect.id {
        "wheelbase_scale" => vehicle.wheelbase *= value("scale")?,
        "track_scale" => {
            vehicle.track_front *= value("front")?;
            vehicle.track_rear *= value("rear")?;
        }
        "radius_scale" => scale_radii(vehicle, [value("scale")?; 4]),
        "radius_difference" => {
            let (front, rear) = (0.5 * value("front")?, 0.5 * value("rear")?);
            scale_radii(vehicle, [1.0 + front, 1.0 - front, 1.0 + rear, 1.0 - rear]);
        }
        "acceleration_limit" => {
            let limits = &mut vehicle.limits;
            limits.acceleration = limits.acceleration.min(value("limit")?);
            limits.deceleration = limits.deceleration.min(limits.acceleration);
        }
        "steering_rate_limit" => {
            let rate = &mut vehicle.limits.steering_rate;
            *rate = rate.min(value("limit")?);
        }
        "steering_sensor_offset" => vehicle.steering_sensor.as_mut()?.offset += value("offset")?,
        "steering_sensor_gain" => vehicle.steering_sensor.as_mut()?.gain *= value("gain")?,
        "reference_marker" => {
            let marker = &mut vehicle.reference.as_mut()?.marker;
            marker.x += value("x")?;
            marker.y += value("y")?;
            marker.yaw += value("yaw")?;
        }
        _ => return absorb_response(vehicle, effect.id, &value),
    }
    Some(())
}

/// The same for how the actuators respond.
fn absorb_response(
    vehicle: &mut Vehicle,
    id: &str,
    value: &dyn Fn(&str) -> Option<f64>,
) -> Option<()> {
    let mut response = vehicle.response();
    let longer = |time: f64, name| Some((time + value(name)?).max(0.0));
    match id {
        "speed_gain" => response.speed_gain *= value("gain")?,
        "speed_delay" => response.speed_delay = longer(response.speed_delay, "delay")?,
        "speed_lag" => response.speed_lag = longer(response.speed_lag, "lag")?,
        "steering_gain" => response.steering_gain *= value("gain")?,
        "steering_delay" => response.steering_delay = longer(response.steering_delay, "delay")?,
        "steering_lag" => response.steering_lag = longer(response.steering_lag, "lag")?,
        "steering_offset" => {
            let offset = value("offset")?;
            response.steering_offset += offset;
            // At the rack it reads what it read; straight wheels are another angle of the rack.
            if let Some(SteeringSensor { offset: reading, gain, .. }) = &mut vehicle.steering_sensor
            {
                *reading -= *gain * offset;
            }
        }
        _ => return None,
    }
    vehicle.actuators = Some(response);
    Some(())
}

/// Scales the radii fl, fr, rl, rr. A vehicle that reports speeds goes on computing them with those that it had.
fn scale_radii(vehicle: &mut Vehicle, scales: [f64; 4]) {
    for wheel in WHEELS.map(|wheel| wheel.index()) {
        let radius = vehicle.radius[wheel];
        if vehicle.encoders.is_none() {
            vehicle.speed_radius[wheel].get_or_insert(radius);
        }
        vehicle.radius[wheel] = radius * scales[wheel];
    }
}

/// The keys that an effect may change, with what they hold.
fn keys(vehicle: &Vehicle) -> Vec<(String, Option<f64>)> {
    let of_wheels = |table: &str, values: [Option<f64>; 4]| {
        WHEELS.map(|wheel| (format!("{table}.{}", wheel.name()), values[wheel.index()]))
    };
    let actuators = vehicle.actuators;
    let sensor = vehicle.steering_sensor;
    let marker = vehicle.reference.map(|reference| reference.marker);
    let mut keys = vec![
        ("wheelbase".to_owned(), Some(vehicle.wheelbase)),
        ("track_front".to_owned(), Some(vehicle.track_front)),
        ("track_rear".to_owned(), Some(vehicle.track_rear)),
    ];
    keys.extend(of_wheels("radius", vehicle.radius.map(Some)));
    keys.extend(of_wheels("speed_radius", vehicle.speed_radius));
    let more = [
        ("limits.acceleration", Some(vehicle.limits.acceleration)),
        ("limits.deceleration", Some(vehicle.limits.deceleration)),
        ("limits.steering_rate", Some(vehicle.limits.steering_rate)),
        ("actuators.speed_delay", actuators.map(|response| response.speed_delay)),
        ("actuators.speed_lag", actuators.map(|response| response.speed_lag)),
        ("actuators.steering_delay", actuators.map(|response| response.steering_delay)),
        ("actuators.steering_lag", actuators.map(|response| response.steering_lag)),
        ("actuators.speed_gain", actuators.map(|response| response.speed_gain)),
        ("actuators.steering_gain", actuators.map(|response| response.steering_gain)),
        ("actuators.steering_offset", actuators.map(|response| response.steering_offset)),
        ("steering_sensor.offset", sensor.map(|sensor| sensor.offset)),
        ("steering_sensor.gain", sensor.map(|sensor| sensor.gain)),
        ("reference.marker.x", marker.map(|marker| marker.x)),
        ("reference.marker.y", marker.map(|marker| marker.y)),
        ("reference.marker.yaw", marker.map(|marker| marker.yaw)),
    ];
    keys.extend(more.map(|(key, value)| (key.to_owned(), value)));
    keys
}

/// The text of the vehicle's file of a case with the lines that absorb: comments and order are the file's.
///
/// # Errors
/// [`Failure`] where the file cannot be read any more, or what is written would not be read again.
pub fn text(diagnosed: &Diagnosed, absorbed: &Absorbed) -> Result<String, Failure> {
    let origin = &diagnosed.input.origin;
    let text = fs::read_to_string(origin)
        .map_err(|error| Failure::internal(format!("{origin}: {error}")))?;
    text_with(&text, &diagnosed.found.case, absorbed)
}

fn text_with(text: &str, case: &str, absorbed: &Absorbed) -> Result<String, Failure> {
    let mut document: DocumentMut = text.parse().map_err(Failure::internal)?;
    for Line { key, value, .. } in &absorbed.lines {
        let path: Vec<&str> = key.split('.').collect();
        // Where nothing else is stated, it follows the acceleration by itself.
        let stated = || document.get(path[0]).and_then(|table| table.get(path[1])).is_some();
        if key == "limits.deceleration" && !stated() {
            continue;
        }
        put(document.as_table_mut(), &path, number(*value));
    }
    let head = format!(
        "# The vehicle of the case {}, as kerbside {} found it: absorbs {}.\n",
        super::document::one_line(case),
        env!("CARGO_PKG_VERSION"),
        absorbed.effects.join(", ")
    );
    let text = format!("{head}{document}");
    parse_vehicle("diagnosis.vehicle.toml", &text)
        .map_err(|error| Failure::internal(format!("what was found is no vehicle: {error}")))?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use kerbside_diagnosis::{FoundParameter, Interval};
    use kerbside_geometry::Pose;
    use kerbside_settings::COMPILED_IN;
    use kerbside_simulation::{Effects, Noise, Parameter, Simulator, effects};

    use super::*;
    use crate::diagnose::made_up;

    fn effect(id: &str, values: &[f64]) -> FoundEffect {
        let definition = effects::library().iter().find(|known| known.id == id).unwrap();
        let parameters = definition.parameters.iter().zip(values);
        let parameters = parameters.map(|(parameter, value)| FoundParameter {
            name: parameter.name,
            unit: parameter.unit,
            value: Interval { value: *value, low: *value, high: *value },
        });
        FoundEffect {
            id: definition.id,
            link: definition.link,
            wheel: None,
            parameters: parameters.collect(),
            probability: 0.97,
        }
    }

    fn found(effects: Vec<FoundEffect>) -> Diagnosis {
        Diagnosis { effects, ..made_up::two_effects() }
    }

    /// Where a drive with steps of speed and steering ends, and what steering sensor and counters then show.
    fn driven(vehicle: &Vehicle, effect: Option<&FoundEffect>) -> (Pose, f64, [i64; 4]) {
        let mut altered = Effects::default();
        for parameter in effect.iter().flat_map(|effect| &effect.parameters) {
            let place = Parameter::find(effect.unwrap().id, parameter.name).unwrap();
            altered.set(place, parameter.value.value);
        }
        let mut simulator =
            Simulator::with_effects(vehicle, &altered, Pose::default(), &Noise::NONE, 1);
        for (time, speed, steering) in
            [(0.5, 0.3, 0.2), (3.0, 0.1, -0.3), (5.0, -0.4, 0.1), (8.0, 0.2, 0.15)]
        {
            simulator.advance(time);
            simulator.command(time, speed, steering);
        }
        simulator.advance(12.0);
        let reading = simulator.reading();
        (simulator.pose(), reading.steering.unwrap(), reading.counts)
    }

    #[test]
    fn the_vehicle_with_the_lines_drives_as_the_one_with_the_effect() {
        let vehicle = Vehicle::paper_car();
        let cases: [(&str, &[f64]); 13] = [
            ("speed_gain", &[0.9]),
            ("speed_delay", &[0.07]),
            ("speed_lag", &[0.2]),
            ("acceleration_limit", &[0.1]),
            ("steering_gain", &[1.15]),
            ("steering_delay", &[0.1]),
            ("steering_lag", &[0.3]),
            ("steering_rate_limit", &[0.2]),
            ("steering_offset", &[0.04]),
            ("steering_sensor_offset", &[-0.03]),
            ("steering_sensor_gain", &[0.9]),
            ("wheelbase_scale", &[1.08]),
            ("track_scale", &[0.95, 1.1]),
        ];
        for (id, values) in cases {
            let effect = effect(id, values);
            let mut absorbing = vehicle.clone();
            absorb(&mut absorbing, &effect).unwrap();
            let (pose, steering, counts) = driven(&vehicle, Some(&effect));
            let (again, reading, shown) = driven(&absorbing, None);
            let apart = pose.distance(&again) + (pose.yaw - again.yaw).abs();
            assert!(apart < 1e-6, "{id}: {pose:?} and {again:?}");
            assert!((steering - reading).abs() < 1e-9, "{id}: reads {steering} and {reading}");
            let near = counts.iter().zip(shown).all(|(one, other)| (one - other).abs() <= 1);
            assert!(near, "{id}: {counts:?} and {shown:?}");
            assert_ne!(driven(&vehicle, None), (pose, steering, counts), "{id} does nothing");
        }
    }

    #[test]
    fn radii_are_absorbed_and_reported_speeds_keep_theirs() {
        let mut vehicle = Vehicle::paper_car();
        let scale =
            found(vec![effect("radius_scale", &[1.02]), effect("radius_difference", &[0.0, 0.01])]);
        let absorbed = Absorbed::of(&scale, &vehicle);
        let of = |absorbed: &Absorbed, key: &str| {
            absorbed.lines.iter().find(|line| line.key == key).map(|line| line.value)
        };
        let radius = vehicle.radius[2];
        assert!((of(&absorbed, "radius.rl").unwrap() - 1.02 * 1.005 * radius).abs() < 1e-6);
        assert!((of(&absorbed, "radius.rr").unwrap() - 1.02 * 0.995 * radius).abs() < 1e-6);
        assert_eq!(of(&absorbed, "speed_radius.rl"), None);
        vehicle.encoders = None;
        let absorbed = Absorbed::of(&scale, &vehicle);
        assert_eq!(of(&absorbed, "speed_radius.rl"), Some(radius));
    }

    #[test]
    fn what_no_key_stands_for_is_said_and_a_guess_changes_nothing() {
        let vehicle = Vehicle::paper_car();
        let absorbed = Absorbed::of(&made_up::two_effects(), &vehicle);
        assert_eq!(
            (&absorbed.effects[..], &absorbed.left[..]),
            (&["speed_gain"][..], &["count_loss"][..])
        );
        let words = absorbed.in_words("diagnosis.vehicle.toml").unwrap();
        let expected = "diagnosis.vehicle.toml absorbs speed_gain: actuators.speed_gain = 0.951 (was 1). \
                        No key stands for count_loss.";
        assert_eq!(words, expected);
        assert_eq!(absorbed.as_json("f")["lines"][0]["key"], "actuators.speed_gain");
        let slip = Absorbed::of(&found(vec![effect("drive_slip", &[0.1])]), &vehicle);
        assert_eq!((slip.in_words("f"), slip.as_json("f")), (None, Value::Null));
        assert_eq!(Absorbed::of(&made_up::ambiguous(), &vehicle), Absorbed::default());
    }

    #[test]
    fn the_file_keeps_its_comments_and_is_read_again() {
        let shipped = COMPILED_IN.iter().find(|(path, _)| *path == "vehicles/paper-1-6.toml");
        let effects = ["steering_gain", "acceleration_limit", "speed_lag"];
        let effects = effects.into_iter().zip([[1.1], [0.2], [0.05]]);
        let found = found(effects.map(|(id, value)| effect(id, &value)).collect());
        let absorbed = Absorbed::of(&found, &Vehicle::paper_car());
        let text = text_with(shipped.unwrap().1, "a\ncase", &absorbed).unwrap();
        assert!(text.starts_with("# The vehicle of the case a case, as kerbside"), "{text}");
        assert!(text.contains("steering = 0.5236           # 30 degrees"), "{text}");
        assert!(!text.contains("deceleration"), "it follows the acceleration");
        let vehicle = parse_vehicle("again", &text).unwrap().value.vehicle;
        let response = vehicle.response();
        assert!((response.steering_gain - 1.1).abs() < 1e-6);
        assert!((response.speed_lag - 0.15).abs() < 1e-6);
        assert_eq!((vehicle.limits.acceleration, vehicle.limits.deceleration), (0.2, 0.2));
    }
}
