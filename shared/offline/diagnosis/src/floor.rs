//! What noise alone makes of a run's residuals.

use kerbside_geometry::math;
use rand::Rng;

use crate::bench::Bench;
use crate::bins::{self, Channels, to_f64};
use crate::follow::Turn;
use crate::noise::{Level, Noise, draw};
use crate::path::{Path, driven_share};

/// Time over which a sensor's white noise acts on what follows it \[s\].
const BRIEF: f64 = 0.1;

/// Largest disturbance that counts as noise: a share, or an angle \[rad\].
const BELIEVABLE: f64 = 0.05;

/// Draws the residuals of a run whose model is right. One that follows what was measured has the noise of those sensors
/// as errors of motor and rack, and these sensors agree with the model: it was driven by them.
pub(crate) fn drawn(
    bench: &Bench<'_>,
    noise: &Noise,
    run: usize,
    random: &mut impl Rng,
) -> Vec<Channels> {
    let noise = &believable(noise);
    let Some(turn) = bench.ready.followed_turn(run) else {
        return draw(&bench.coefficients[run], noise, random);
    };
    let mut rows = draw(&bench.coefficients[run], &followed(bench, noise, run, turn), random);
    let share = driven_share(bench.ready.vehicle);
    let present = |channel: usize| bench.coefficients[run].present.iter().any(|bin| bin[channel]);
    let driven: Vec<usize> = (0..4).filter(|w| share[*w] > 0.0 && present(*w)).collect();
    for row in &mut rows {
        match turn {
            Turn::Sensor => row[bins::STEERING] = 0.0,
            Turn::Gyro => row[bins::GYRO] = 0.0,
            Turn::Reference => row[bins::REFERENCE + 2] = 0.0,
            Turn::Wheels | Turn::Nothing => {}
        }
        // Their mean is what was followed; of an axle that told the turn their difference, too.
        let mean = driven.iter().map(|w| row[*w]).sum::<f64>() / to_f64(driven.len().max(1));
        for wheel in &driven {
            row[*wheel] = if turn == Turn::Wheels { 0.0 } else { row[*wheel] - mean };
        }
    }
    rows
}

/// The noise, with disturbances of motor, ground and rack no larger than noise can be: what is larger was estimated from
/// a gap, and is one.
fn believable(noise: &Noise) -> Noise {
    let mut own = Noise { follows: false, ..*noise };
    for level in [
        Level::Speed,
        Level::Slip,
        Level::Curvature,
        Level::Side,
        Level::Rack,
        Level::Wheel,
        Level::RunSpeed,
        Level::RunSlip,
        Level::RunCurvature,
        Level::RunSide,
        Level::RunRack,
    ] {
        own.set(level, own.get(level).min(BELIEVABLE));
    }
    own
}

/// The noise of sensors that drive the model, as errors of motor and rack.
fn followed(bench: &Bench<'_>, noise: &Noise, run: usize, turn: Turn) -> Noise {
    let vehicle = bench.ready.vehicle;
    let coefficients = &bench.coefficients[run];
    let steps = &bench.paths[run].steps;
    let square = steps.iter().map(|step| step.distance * step.distance).sum::<f64>();
    let speed = (square / to_f64(steps.len().max(1))).sqrt() / coefficients.width;
    let speed = speed.max(0.01 * vehicle.limits.speed);
    // Counts are off by a part of one, however far it goes: only speeds add up.
    let wheel = if coefficients.speeds { noise.get(Level::WheelWhite) } else { 0.0 };
    let track = if vehicle.track_rear > 0.0 { vehicle.track_rear } else { vehicle.track_front };
    let rate = match turn {
        Turn::Wheels => 1.41 * wheel / track.max(1e-3),
        Turn::Gyro => math::hypot(noise.get(Level::GyroWhite), noise.get(Level::GyroColour)),
        Turn::Reference => noise.get(Level::YawWhite),
        Turn::Sensor | Turn::Nothing => 0.0,
    };
    let rack = match turn {
        Turn::Sensor => noise.get(Level::SteeringWhite),
        _ => vehicle.wheelbase * rate / speed,
    };
    let mut own = *noise;
    own.set(Level::Speed, wheel / speed);
    own.set(Level::SpeedTime, BRIEF);
    own.set(Level::Rack, rack);
    own.set(Level::RackTime, BRIEF);
    own.set(Level::RunSpeed, 0.0);
    own.set(Level::RunRack, 0.0);
    own
}

/// A path with errors in its body frame, as poses in the reference frame.
pub(crate) fn in_frame(path: &Path, errors: &[Channels]) -> Vec<Channels> {
    path.pose
        .iter()
        .zip(errors)
        .map(|(pose, error)| {
            let (x, y) = pose.transform(error[bins::REFERENCE], error[bins::REFERENCE + 1]);
            let mut row = *error;
            row[bins::REFERENCE..].copy_from_slice(&[x, y, pose.yaw + error[bins::REFERENCE + 2]]);
            row
        })
        .collect()
}
