//! Vehicles in good order, and how they err.

use kerbside_geometry::{
    Actuators, Drive, Encoders, Footprint, Gyro, Limits, Pose, Reference, SteeringSensor, Vehicle,
    math,
};

use super::dice::Dice;
use super::floor::Floor;
use super::specification::{Build, Kind, Specification, Uncertainty};
use super::{FLOOR, TRUTH, VEHICLE};
use crate::insertions::Effect;
use crate::sensors::Coloured;

/// Wheelbases from a car of 1:10 to one of full size \[m\].
const WHEELBASES: (f64, f64) = (0.25, 2.9);
/// A wheelbase beyond which a car carries people and counts coarsely \[m\].
const LARGE: f64 = 1.5;

/// Everything but kind, effects and runs.
pub(super) fn drawn(seed: u64) -> Specification {
    let mut dice = Dice::new(seed, VEHICLE);
    let vehicle = described(&mut dice);
    let mut dice = Dice::new(seed, TRUTH);
    let uncertainty = uncertainty(&mut dice, &vehicle);
    let (truth, habits) = in_good_order(&mut dice, &vehicle, &uncertainty);
    let build = build(&mut dice, &vehicle);
    let mut dice = Dice::new(seed, FLOOR);
    Specification {
        seed,
        kind: Kind::Null,
        floor: floor(&mut dice, &vehicle),
        reference_yaw: vehicle.reference.is_some() && dice.chance(0.85),
        uncertainty,
        truth,
        habits,
        build,
        vehicle,
        effects: Vec::new(),
        runs: Vec::new(),
        holdout: Vec::new(),
    }
}

fn rounded(value: f64, digits: i32) -> f64 {
    let step = 10.0_f64.powi(digits);
    (value * step).round() / step
}

/// What the description says.
fn described(dice: &mut Dice) -> Vehicle {
    let wheelbase = rounded(dice.log_between(WHEELBASES.0, WHEELBASES.1), 2);
    let size = wheelbase / 0.5;
    let radius = rounded(wheelbase * dice.between(0.11, 0.15), 4);
    let rear = rounded(radius * if dice.chance(0.2) { dice.between(0.95, 1.05) } else { 1.0 }, 4);
    let track = rounded(wheelbase * dice.between(0.54, 0.64), 3);
    let (length, width) = (wheelbase * dice.between(1.45, 1.7), track * dice.between(1.1, 1.25));
    let limits = Limits {
        speed: rounded(0.5 * math::powf(size, 0.8) * dice.between(0.8, 1.3), 2),
        acceleration: rounded(0.3 * math::powf(size, 0.7) * dice.between(0.8, 1.4), 2),
        deceleration: 0.0,
        steering: rounded(dice.between(0.45, 0.62), 3),
        steering_rate: rounded(dice.between(0.5, 1.1), 2),
    };
    Vehicle {
        speed_radius: [None; 4],
        name: format!("car-{:.0}", wheelbase * 100.0),
        wheelbase,
        track_front: track,
        track_rear: rounded(track * dice.between(0.98, 1.02), 3),
        radius: [radius, radius, rear, rear],
        drive: dice.one(&[Drive::Rear, Drive::Front, Drive::Rear, Drive::All], Drive::Rear),
        footprint: Footprint {
            length: rounded(length, 2),
            width: rounded(width, 2),
            rear_overhang: rounded(0.4 * (length - wheelbase), 2),
        },
        limits: Limits { deceleration: limits.acceleration, ..limits },
        actuators: Some(Actuators {
            speed_delay: rounded(dice.between(0.01, 0.06), 3),
            speed_lag: rounded(dice.between(0.06, 0.25), 3),
            steering_delay: rounded(dice.between(0.01, 0.05), 3),
            steering_lag: rounded(dice.between(0.03, 0.1), 3),
            ..Actuators::default()
        }),
        encoders: encoders(dice, wheelbase),
        steering_sensor: sensor(dice, 0.8)
            .map(|rate| SteeringSensor::new(rounded(dice.between(0.0008, 0.003), 4), rate)),
        gyro: sensor(dice, 0.78).map(|rate| Gyro {
            noise: rounded(dice.between(0.0015, 0.004), 4),
            rate,
            bias: 0.0,
        }),
        reference: reference(dice, wheelbase),
    }
}

/// Rate of a sensor \[Hz\] that so many vehicles have.
fn sensor(dice: &mut Dice, share: f64) -> Option<f64> {
    let (has, rate) = (dice.chance(share), dice.one(&[25.0, 40.0, 50.0], 40.0));
    has.then_some(rate)
}

/// Counts of all wheels or of one axle; a few vehicles report speeds instead.
fn encoders(dice: &mut Dice, wheelbase: f64) -> Option<Encoders> {
    let fine = [1024.0, 2048.0, 4096.0];
    let counts = dice.one(if wheelbase > LARGE { &[256.0, 1024.0, 2048.0] } else { &fine }, 2048.0);
    let wheels = match dice.below(10) {
        0 => [false, false, true, true],
        1 => [true, true, false, false],
        _ => [true; 4],
    };
    let (bits, rate, has) =
        (dice.one(&[16, 32], 32), dice.one(&[50.0, 50.0, 100.0], 50.0), dice.chance(0.85));
    has.then(|| Encoders {
        counts_per_revolution: wheels.map(|wheel| wheel.then_some(counts)),
        counter_bits: bits,
        noise_per_distance: None,
        rate,
    })
}

fn reference(dice: &mut Dice, wheelbase: f64) -> Option<Reference> {
    let position = 0.002 * math::powf(wheelbase / 0.5, 0.9) * dice.between(0.7, 1.3);
    let (has, off) = (dice.chance(0.95), dice.chance(0.4));
    let mut place = |share: f64, step: i32| rounded(dice.between(-share, share), step);
    let (x, y, yaw) = (place(0.6 * wheelbase, 2), place(0.15 * wheelbase, 2), place(0.1, 2));
    let marker = if off { Pose::new(x, y, yaw) } else { Pose::default() };
    let (yaw_noise, rate) =
        (rounded(dice.between(0.0015, 0.003), 4), dice.one(&[20.0, 25.0], 25.0));
    has.then(|| Reference { position_noise: rounded(position, 4), yaw_noise, rate, marker })
}

/// What its description may be wrong by.
fn uncertainty(dice: &mut Dice, vehicle: &Vehicle) -> Uncertainty {
    let mut share = |share: f64| share * dice.log_between(0.7, 1.6);
    let response = vehicle.response();
    let [front, _, rear, _] = vehicle.radius;
    let fields = vec![
        ("wheelbase", share(0.002) * vehicle.wheelbase),
        ("track_front", share(0.003) * vehicle.track_front),
        ("track_rear", share(0.003) * vehicle.track_rear),
        ("radius", share(0.0014) * front.min(rear)),
        ("speed_lag", share(0.04) * response.speed_lag),
        ("steering_lag", share(0.06) * response.steering_lag),
    ];
    let mut effects = vec![
        ("speed_gain", "gain", share(0.003)),
        ("steering_gain", "gain", share(0.004)),
        ("steering_offset", "offset", share(0.001)),
    ];
    if vehicle.gyro.is_some() {
        effects.push(("gyro_bias", "bias", share(0.0003)));
        effects.push(("gyro_gain", "gain", share(0.002)));
    }
    if vehicle.steering_sensor.is_some() {
        effects.push(("steering_sensor_offset", "offset", share(0.001)));
    }
    if vehicle.reference.is_some() {
        let length = share(0.002) * vehicle.wheelbase;
        effects.push(("reference_marker", "x", length));
        effects.push(("reference_marker", "y", length));
        effects.push(("reference_marker", "yaw", share(0.001)));
    }
    let written = |value: f64| rounded(value, 6);
    Uncertainty {
        fields: fields.into_iter().map(|(name, value)| (name, written(value))).collect(),
        effects: effects.into_iter().map(|(id, name, value)| (id, name, written(value))).collect(),
    }
}

/// A vehicle within that, and how it errs where there is no field.
fn in_good_order(
    dice: &mut Dice,
    vehicle: &Vehicle,
    uncertainty: &Uncertainty,
) -> (Vehicle, Vec<Effect>) {
    let mut truth = vehicle.clone();
    let mut response = vehicle.response();
    for (field, deviation) in &uncertainty.fields {
        let mut off = || dice.within(*deviation);
        match *field {
            "wheelbase" => truth.wheelbase += off(),
            "track_front" => truth.track_front += off(),
            "track_rear" => truth.track_rear += off(),
            "radius" => truth.radius.iter_mut().for_each(|radius| *radius += off()),
            "speed_lag" => response.speed_lag += off(),
            _ => response.steering_lag += off(),
        }
    }
    truth.actuators = Some(response);
    (truth, deviating(dice, uncertainty, 1.0))
}

/// Effects of `share` of the uncertainty each.
pub(super) fn deviating(dice: &mut Dice, uncertainty: &Uncertainty, share: f64) -> Vec<Effect> {
    let mut effects: Vec<Effect> = Vec::new();
    for (id, name, deviation) in &uncertainty.effects {
        let neutral = Effect::new(id, &[]).get(name);
        let value = neutral + dice.within(share * deviation);
        match effects.last_mut().filter(|last| last.id == *id) {
            Some(last) => last.values.push((name, value)),
            None => effects.push(Effect::new(id, &[(name, value)])),
        }
    }
    effects
}

/// Mass and tyres of a car on a hard floor. The tyres' stiffness over load lies where those of passenger cars and of
/// solid rubber do (Pacejka, *Tire and Vehicle Dynamics*, section 1.2).
fn build(dice: &mut Dice, vehicle: &Vehicle) -> Build {
    let size = vehicle.wheelbase / 0.5;
    let rear = dice.between(0.03, 0.08);
    Build {
        mass: 15.0 * size * size * size * dice.between(0.5, 1.0),
        gyration: dice.between(0.42, 0.52),
        centre_of_mass: dice.between(0.4, 0.56),
        lateral_compliance: [rear * dice.between(1.0, 1.05), rear],
        longitudinal_compliance: dice.between(0.01, 0.03),
        friction: dice.between(0.7, 1.0),
        rolling_resistance: dice.between(0.005, 0.015),
        ackermann: dice.between(0.97, 1.0),
        linkage: dice.between(0.0, 0.001) / (vehicle.limits.acceleration / 0.3),
        toe: dice.between(-0.0005, 0.001),
        gyro_latency: dice.between(0.0, 0.0025),
    }
}

fn floor(dice: &mut Dice, vehicle: &Vehicle) -> Floor {
    let mut coloured = |deviation: f64, low: f64, high: f64| Coloured {
        deviation: deviation * dice.log_between(0.5, 1.5),
        time_constant: dice.log_between(low, high),
    };
    let sensor = vehicle.steering_sensor.map_or(0.0, |sensor| sensor.noise);
    let gyro = vehicle.gyro.map_or(0.0, |gyro| gyro.noise);
    let reference =
        vehicle.reference.map_or((0.0, 0.0), |known| (known.position_noise, known.yaw_noise));
    let colours = [
        coloured(0.002, 0.4, 1.5),
        coloured(0.001, 0.4, 1.5),
        coloured(0.001, 0.4, 1.5),
        coloured(0.3 * sensor, 0.3, 2.0),
        coloured(0.15 * gyro, 0.5, 4.0),
        coloured(0.6 * reference.0, 0.3, 2.0),
        coloured(0.4 * reference.1, 0.3, 2.0),
    ];
    let [slip, angle, side, steering_coloured, gyro_coloured, position_coloured, yaw_coloured] =
        colours;
    let mut white = |believed: f64| believed * dice.between(0.8, 1.25);
    Floor {
        slip,
        angle,
        side,
        wheel_speed: white(0.01 * vehicle.limits.speed),
        steering: white(sensor),
        steering_coloured,
        gyro: white(gyro),
        gyro_coloured,
        position: white(reference.0),
        position_coloured,
        yaw: white(reference.1),
        yaw_coloured,
    }
}
