//! What was measured of motor and rack.

use kerbside_geometry::{Vehicle, WHEELS, math};
use kerbside_simulation::{InMotion, Sample};

use crate::bins::to_f64;
use crate::case::{Run, Series, Wheels};
use crate::path::{driven_share, rolling};

/// Motor and rack as measured.
#[derive(Debug)]
pub(crate) struct Followed {
    /// Speed of the motor \[m/s\].
    pub speeds: Vec<Sample>,
    /// Angle of the rack \[rad\].
    pub racks: Vec<Sample>,
    /// What tells the turn.
    pub turn: Turn,
}

/// What the angle of the rack was taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turn {
    /// The steering sensor.
    Sensor,
    /// How much farther one wheel of an axle went than the other.
    Wheels,
    /// The gyro.
    Gyro,
    /// The yaw of the reference.
    Reference,
    /// Nothing: the rack is taken to stand straight.
    Nothing,
}

/// Time over which the first motion is averaged \[s\].
const FIRST: f64 = 0.2;
/// Time over which a way becomes a speed \[s\]: over less, stamps that are off by a millisecond make leaps of it.
const DIFFERENCED: f64 = 0.099;
/// Share of the speed limit below which a car stands.
const STANDS: f64 = 0.02;

impl Followed {
    /// How the car moved at the begin; at rest and straight where it stood.
    pub(crate) fn motion(&self, vehicle: &Vehicle) -> InMotion {
        let mean = |samples: &[Sample]| {
            let begin = samples.first().map_or(0.0, |first| first.t);
            let first: Vec<f64> =
                samples.iter().take_while(|s| s.t <= begin + FIRST).map(|s| s.value).collect();
            first.iter().sum::<f64>() / to_f64(first.len().max(1))
        };
        let (speed, rack) = (mean(&self.speeds), mean(&self.racks));
        if speed.abs() < STANDS * vehicle.limits.speed {
            return InMotion::default();
        }
        let limit = vehicle.limits.steering;
        InMotion { speed, rack: rack.clamp(-limit, limit) }
    }
}

/// The driven wheels that were read (or all that were) and the steering sensor; without one what the wheels of an axle,
/// the gyro or the reference say of the turn; without any the rack stands straight.
pub(crate) fn follow(run: &Run, vehicle: &Vehicle) -> Followed {
    let series = run.wheels.series();
    let share = driven_share(vehicle);
    let read = |wheel: usize| series.has(wheel);
    let driven: Vec<usize> = (0..4).filter(|wheel| share[*wheel] > 0.0 && read(*wheel)).collect();
    let all_driven = driven.len() == share.iter().filter(|share| **share > 0.0).count();
    let used =
        if !driven.is_empty() { driven } else { (0..4).filter(|wheel| read(*wheel)).collect() };
    let mut speeds = speeds(run, vehicle, &used);
    let angle =
        |reading: f64| vehicle.steering_sensor.map_or(reading, |sensor| sensor.angle(reading));
    let rows =
        run.steering.t.iter().zip(&run.steering.value).filter(|(_, value)| value[0].is_finite());
    let sensed: Vec<Sample> =
        rows.map(|(t, value)| Sample { t: *t, value: angle(value[0]) }).collect();
    let sources = [
        (Turn::Sensor, sensed),
        (Turn::Wheels, turning(run, vehicle)),
        (Turn::Gyro, by_rates(&rates(&run.gyro), vehicle, &speeds, &used)),
        (Turn::Reference, by_rates(&turns(&run.reference), vehicle, &speeds, &used)),
    ];
    let (turn, racks) = sources
        .into_iter()
        .find(|(_, racks)| !racks.is_empty())
        .unwrap_or((Turn::Nothing, Vec::new()));
    if !all_driven {
        // The motor turns other wheels, too, than those that were read.
        for sample in &mut speeds {
            let curvature = math::tan(between(&racks, sample.t)) / vehicle.wheelbase;
            let roll = rolling(vehicle, curvature);
            let own = used.iter().map(|w| roll[*w].0).sum::<f64>() / to_f64(used.len().max(1));
            let motor: f64 = share.iter().zip(&roll).map(|(share, roll)| share * roll.0).sum();
            sample.value *= motor / own.max(1e-9);
        }
    }
    Followed { speeds, racks, turn }
}

/// Speed of the motor by the wheels in `used`.
fn speeds(run: &Run, vehicle: &Vehicle, used: &[usize]) -> Vec<Sample> {
    let series = run.wheels.series();
    let (count, radius) = (to_f64(used.len()), vehicle.driven_radius());
    let mut speeds = Vec::with_capacity(series.t.len());
    let mut last: Option<(f64, f64)> = None;
    for (t, value) in series.t.iter().zip(&series.value) {
        if used.is_empty() || used.iter().any(|wheel| !value[*wheel].is_finite()) {
            continue;
        }
        if matches!(run.wheels, Wheels::Speed(_)) {
            let turn: f64 = used.iter().map(|wheel| value[*wheel] / vehicle.radius[*wheel]).sum();
            speeds.push(Sample { t: *t, value: radius * turn / count });
            continue;
        }
        let turned: f64 = used.iter().map(|wheel| value[*wheel]).sum();
        if let Some((before, from)) = last {
            if t - before < DIFFERENCED {
                continue;
            }
            speeds.push(Sample {
                t: 0.5 * (t + before),
                value: radius * (turned - from) / count / (t - before),
            });
        }
        last = Some((*t, turned));
    }
    speeds
}

/// Yaw rates of the gyro, neighbours averaged.
fn rates(gyro: &Series<1>) -> Vec<Sample> {
    let mut rates = Vec::new();
    let (mut sum, mut stamps, mut count, mut from) = (0.0, 0.0, 0.0, f64::NEG_INFINITY);
    for (t, row) in gyro.t.iter().zip(&gyro.value).filter(|(_, row)| row[0].is_finite()) {
        if count > 0.0 && t - from >= COMPARED - 1e-6 {
            rates.push(Sample { t: stamps / count, value: sum / count });
            (sum, stamps, count) = (0.0, 0.0, 0.0);
        }
        if count == 0.0 {
            from = *t;
        }
        (sum, stamps, count) = (sum + row[0], stamps + t, count + 1.0);
    }
    rates
}

/// Yaw rates between rows of the reference some time apart.
fn turns(reference: &Series<3>) -> Vec<Sample> {
    let mut rates = Vec::new();
    let mut from: Option<(f64, f64)> = None;
    for (t, row) in reference.t.iter().zip(&reference.value).filter(|(_, row)| row[2].is_finite()) {
        match from {
            Some((before, _)) if t - before < 2.0 * COMPARED => continue,
            Some((before, yaw)) => {
                rates.push(Sample { t: 0.5 * (t + before), value: (row[2] - yaw) / (t - before) });
            }
            None => {}
        }
        from = Some((*t, row[2]));
    }
    rates
}

/// The angles at which the body would turn at these rates, at the speed of the wheels in `used`.
fn by_rates(rates: &[Sample], vehicle: &Vehicle, speeds: &[Sample], used: &[usize]) -> Vec<Sample> {
    let slow = STANDS * vehicle.limits.speed;
    let places = used.iter().map(|wheel| vehicle.wheel_position(WHEELS[*wheel]));
    let (x, y) = places.fold((0.0, 0.0), |sum, place| (sum.0 + place.0, sum.1 + place.1));
    let count = to_f64(used.len().max(1));
    let (ahead, aside) = (x / count, y / count);
    // A car that stands keeps its wheels where they were.
    let angle = |rate: &Sample| {
        // A wheel off the middle of the rear axle rolls another way in a bend than that.
        let rolled = between(speeds, rate.t);
        let along = (rolled * rolled - (ahead * rate.value).powi(2)).max(0.0).sqrt();
        let speed = along.copysign(rolled) + aside * rate.value;
        (speed.abs() > slow).then(|| Sample {
            t: rate.t,
            value: math::atan(vehicle.wheelbase * rate.value / speed).clamp(-LARGEST, LARGEST),
        })
    };
    rates.iter().filter_map(angle).collect()
}

/// The value at `t` \[s\] on straight lines between samples.
fn between(samples: &[Sample], t: f64) -> f64 {
    let next = samples.partition_point(|sample| sample.t < t);
    match (next.checked_sub(1).map(|k| samples[k]), samples.get(next)) {
        (Some(a), Some(b)) => a.value + (b.value - a.value) * (t - a.t) / (b.t - a.t),
        (Some(a), None) => a.value,
        (None, Some(b)) => b.value,
        (None, None) => 0.0,
    }
}

/// Time over which two wheels' ways are compared \[s\].
const COMPARED: f64 = 0.2;
/// Largest angle that two wheels' ways are taken for \[rad\].
const LARGEST: f64 = 1.35;
/// An angle beyond which the wheels of an axle turn against each other about a point between them \[rad\].
const ON_THE_SPOT: f64 = 1.3;
/// Times the way of a car that stands by which its wheels go apart where it turns on the spot.
const SPOT: f64 = 20.0;

/// When a vehicle turned on the spot \[s\], as two wheels of an axle tell it, or a steered wheel that stands nearly across:
/// there a little more of an angle is any curvature, and no error is small.
pub(crate) fn spots(run: &Run, vehicle: &Vehicle) -> Vec<(f64, f64)> {
    let followed = follow(run, vehicle);
    // A sensor that shows what its vehicle cannot do is a mistake.
    let steers_across = followed.turn == Turn::Sensor && vehicle.limits.steering > ON_THE_SPOT;
    if followed.turn != Turn::Wheels && !steers_across {
        return Vec::new();
    }
    let mut spots: Vec<(f64, f64)> = Vec::new();
    for sample in followed.racks.iter().filter(|sample| sample.value.abs() > ON_THE_SPOT) {
        let (from, to) = (sample.t - COMPARED, sample.t + COMPARED);
        match spots.last_mut().filter(|last| from <= last.1 + COMPARED) {
            Some(last) => last.1 = to,
            None => spots.push((from, to)),
        }
    }
    spots
}

/// Without a steering sensor: the angle at which the two wheels of the rear axle would roll as far as they did; of the
/// front one where the rear one was not read (at small angles the same). Straight where no axle was read on both sides.
fn turning(run: &Run, vehicle: &Vehicle) -> Vec<Sample> {
    let series = run.wheels.series();
    let axles = [([2, 3], vehicle.track_rear), ([0, 1], vehicle.track_front)];
    let read = |wheels: &[usize; 2]| wheels.iter().all(|wheel| series.has(*wheel));
    let Some(([left, right], track)) =
        axles.iter().find(|(wheels, track)| *track > 0.0 && read(wheels))
    else {
        return Vec::new();
    };
    let reports = matches!(run.wheels, Wheels::Speed(_));
    let way = |row: &[f64; 4], wheel: usize| {
        row[wheel] * if reports { 1.0 } else { vehicle.radius[wheel] }
    };
    let mut racks = Vec::new();
    let mut from: Option<(f64, [f64; 2])> = None;
    for (t, row) in series.t.iter().zip(&series.value) {
        let ways = [way(row, *left), way(row, *right)];
        if ways.iter().any(|way| !way.is_finite()) {
            continue;
        }
        let (at, [l, r]) = match from {
            _ if reports => (*t, ways),
            None => {
                from = Some((*t, ways));
                continue;
            }
            Some((before, _)) if t - before < COMPARED => continue,
            Some((before, earlier)) => {
                from = Some((*t, ways));
                (0.5 * (t + before), [ways[0] - earlier[0], ways[1] - earlier[1]])
            }
        };
        let (mean, apart) = (0.5 * (l + r), r - l);
        let least = 1e-3 * vehicle.radius[*left];
        // A car that stands keeps its wheels where they were; one that turns on the spot is no car.
        if mean.abs() > least {
            let value = math::atan(vehicle.wheelbase * apart / (track * mean));
            racks.push(Sample { t: at, value: value.clamp(-LARGEST, LARGEST) });
        } else if apart.abs() > SPOT * least {
            racks.push(Sample { t: at, value: LARGEST.copysign(apart) });
        }
    }
    racks
}
