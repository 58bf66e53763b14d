//! Motor and rack of a run without commands, from what its sensors measured.

use kerbside_calibration::Series;
use kerbside_geometry::{Drive, Vehicle, WHEELS, Wheel, math};
use kerbside_recordings::run_folder::Run;
use kerbside_simulation::{Effects, Parameter, Sample};

/// Time over which a wheel's speed is taken \[s\]: the counts of a slow wheel are few.
const WINDOW: f64 = 0.1;
/// Time over which the difference of two wheels tells how the car turns \[s\].
const TURN: f64 = 0.4;

/// What drives the body.
pub(super) struct Motion {
    /// Of the motor \[m/s\].
    pub(super) speeds: Vec<Sample>,
    /// Of the rack \[rad\].
    pub(super) racks: Vec<Sample>,
    /// Where the rack was not measured, a sentence that says so.
    pub(super) note: Option<String>,
}

/// Motor and rack of `recorded`, the errors that `effects` give to its sensors taken out.
///
/// # Errors
/// What is missing.
pub(super) fn motion(
    recorded: &Run,
    rotations: &[Option<Series>; 4],
    vehicle: &Vehicle,
    effects: &Effects,
) -> Result<Motion, String> {
    let rotations = seen(rotations, effects);
    let (racks, note) = match measured_racks(recorded, vehicle, effects) {
        Some(racks) => (racks, None),
        None => {
            let racks = turning(&rotations, vehicle).ok_or(
                "there is no commands.csv, and neither steering.csv nor two rear wheels tell how the car turned",
            )?;
            let note = "the rack is taken from the difference of the rear wheels: there is no steering.csv";
            (racks, Some(note.to_owned()))
        }
    };
    let rack = Series {
        t: racks.iter().map(|sample| sample.t).collect(),
        value: racks.iter().map(|sample| sample.value).collect(),
    };
    let speeds = motor(&rotations, vehicle, |t| math::tan(rack.at(t)) / vehicle.wheelbase);
    if speeds.is_empty() {
        return Err("there is no commands.csv, and the wheels were read less than twice".to_owned());
    }
    Ok(Motion { speeds, racks, note })
}

fn value(effects: &Effects, id: &str, name: &str) -> f64 {
    Parameter::find(id, name).map_or(0.0, |parameter| effects.get(parameter))
}

/// True rotations at true times.
fn seen(rotations: &[Option<Series>; 4], effects: &Effects) -> [Option<Series>; 4] {
    let delay = value(effects, "encoder_delay", "delay");
    WHEELS.map(|wheel| {
        let shown = rotations[wheel.index()].as_ref()?;
        let lost = Parameter::find_at("count_loss", "fraction", wheel);
        let kept = 1.0 - lost.map_or(0.0, |parameter| effects.get(parameter));
        Some(Series {
            t: shown.t.iter().map(|t| t - delay).collect(),
            value: shown.value.iter().map(|rotation| rotation / kept).collect(),
        })
    })
}

fn measured_racks(recorded: &Run, vehicle: &Vehicle, effects: &Effects) -> Option<Vec<Sample>> {
    let table = recorded.steering.as_ref()?;
    let (nominal_gain, nominal_offset) =
        vehicle.steering_sensor.map_or((1.0, 0.0), |sensor| (sensor.gain, sensor.offset));
    let gain = nominal_gain * value(effects, "steering_sensor_gain", "gain");
    let offset = nominal_offset + value(effects, "steering_sensor_offset", "offset");
    let rows = table.rows.iter().filter_map(|row| Some((row.t, row.angle?)));
    let racks: Vec<Sample> =
        rows.map(|(t, angle)| Sample { t, value: (angle - offset) / gain }).collect();
    (!racks.is_empty()).then_some(racks)
}

/// The rack that turns the car as its rear wheels say; held while they hardly roll.
fn turning(rotations: &[Option<Series>; 4], vehicle: &Vehicle) -> Option<Vec<Sample>> {
    let [_, _, Some(left), Some(right)] = rotations else { return None };
    let [_, _, left_radius, right_radius] = vehicle.radius;
    let mut rack = 0.0;
    let samples = left.t.iter().map(|t| {
        let change = |series: &Series| series.at(t + 0.5 * TURN) - series.at(t - 0.5 * TURN);
        let (left, right) = (change(left) * left_radius, change(right) * right_radius);
        let travel = 0.5 * (left + right);
        if travel.abs() > 0.01 * vehicle.wheelbase {
            let curvature = (right - left) / (vehicle.track_rear * travel);
            rack = math::atan(curvature * vehicle.wheelbase);
        }
        Sample { t: *t, value: rack }
    });
    (vehicle.track_rear > 0.0).then(|| samples.collect())
}

/// The motor's speed: mean rotation rate of the driven wheels times the mean of their nominal radii. Where not all of
/// them were read, the wheels that were tell the body's speed, and rolling without slip the rest.
fn motor(
    rotations: &[Option<Series>; 4],
    vehicle: &Vehicle,
    curvature: impl Fn(f64) -> f64,
) -> Vec<Sample> {
    let there = |wheel: &Wheel| wheel.is_left() || vehicle.wheel_position(*wheel).1 != 0.0;
    let driven: Vec<Wheel> =
        WHEELS.into_iter().filter(|wheel| is_driven(vehicle, *wheel) && there(wheel)).collect();
    let read = |wheel: &Wheel| rotations[wheel.index()].is_some();
    let all = driven.iter().all(read);
    let used: Vec<Wheel> = if all {
        driven.clone()
    } else {
        WHEELS.into_iter().filter(|wheel| there(wheel) && read(wheel)).collect()
    };
    let Some(first) = used.iter().find_map(|wheel| rotations[wheel.index()].as_ref()) else {
        return Vec::new();
    };
    let rate = |wheel: &Wheel, t: f64| {
        let series = rotations[wheel.index()].as_ref();
        series.map_or(0.0, |series| {
            (series.at(t + 0.5 * WINDOW) - series.at(t - 0.5 * WINDOW)) / WINDOW
        })
    };
    let sample = |t: &f64| {
        let curvature = if all { 0.0 } else { curvature(*t) };
        // Rotation of a wheel per metre of the rear-axle centre.
        let per_metre = |wheel: &Wheel| {
            let (x, y) = vehicle.wheel_position(*wheel);
            let along = 1.0 - y * curvature;
            math::hypot(along, x * curvature) / vehicle.radius[wheel.index()]
        };
        let share = if all { 1.0 } else { mean(&driven, per_metre) };
        let rate = mean(&used, |wheel| rate(wheel, *t) / if all { 1.0 } else { per_metre(wheel) });
        Sample { t: *t, value: rate * share * vehicle.driven_radius() }
    };
    if first.len() < 2 { Vec::new() } else { first.t.iter().map(sample).collect() }
}

fn mean(wheels: &[Wheel], of: impl Fn(&Wheel) -> f64) -> f64 {
    wheels.iter().map(of).sum::<f64>() / wheels.len() as f64
}

fn is_driven(vehicle: &Vehicle, wheel: Wheel) -> bool {
    match vehicle.drive {
        Drive::All => true,
        Drive::Front => wheel.is_front(),
        Drive::Rear => !wheel.is_front(),
    }
}
