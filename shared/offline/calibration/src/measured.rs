//! What of a whole run is measured by other means than its wheels: length and net turn.

use kerbside_geometry::{Pose, Vehicle, angle, math};

use crate::ackermann::wheel_angle;
use crate::noise::Noise;
use crate::parameters::{Parameter, Parameters};
use crate::run::Run;
use crate::travel::Base;

/// Heading up to which a run counts as straight all along \[rad\], and what nominal radii add that differ by half a
/// per cent.
const STRAIGHT: f64 = 0.2;
const UNEQUAL: f64 = 0.005;
/// Net turn from which a run counts as an arc \[rad\].
const ARC: f64 = 0.7;
/// Share of its travel that a run must go in one direction.
const ONE_WAY: f64 = 0.95;

/// A quantity, and the time over which it was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Measured {
    pub(crate) value: f64,
    pub(crate) deviation: f64,
    pub(crate) from: f64,
    pub(crate) to: f64,
}

/// What kind of run it is, by its wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Straight,
    Arc,
    Other,
}

/// Rotation of a wheel between two stamps \[rad\].
pub(crate) fn rotation(run: &Run, wheel: usize, from: f64, to: f64) -> f64 {
    run.rotation[wheel].as_ref().map_or(0.0, |series| series.at(to) - series.at(from))
}

/// Longitudinal travel of a front wheel \[m\], every increment turned by the wheel's own angle; with the track
/// `track` \[m\]. None without a steering sensor.
pub(crate) fn front_along(
    run: &Run,
    wheel: usize,
    p: &Parameters,
    track: f64,
    (from, to): (f64, f64),
) -> Option<f64> {
    let (series, steering) = (run.rotation[wheel].as_ref()?, run.steering.as_ref()?);
    let side = if wheel == 0 { 1.0 } else { -1.0 };
    let base = p.get(Parameter::Wheelbase);
    let mut before = (from, series.at(from));
    let mut sum = 0.0;
    let inside = series.t.iter().copied().filter(|t| *t > from && *t < to);
    for t in inside.chain(core::iter::once(to)) {
        let now = series.at(t);
        let reading = steering.at(0.5 * (before.0 + t));
        sum += (now - before.1) * wheel_angle(p.road_angle(reading), side, track, base).cos;
        before = (t, now);
    }
    Some(sum * p.values[wheel])
}

/// Net turn by the wheels \[rad\]: of the rear axle, else of the front axle; none where neither tells.
pub(crate) fn turn_by_wheels(run: &Run, p: &Parameters, from: f64, to: f64) -> Option<f64> {
    let wheels = run.wheels();
    let (front, rear) = (p.get(Parameter::TrackFront), p.get(Parameter::TrackRear));
    if wheels[2] && wheels[3] && rear > 0.0 {
        let travel = |wheel: usize| p.values[wheel] * rotation(run, wheel, from, to);
        return Some((travel(3) - travel(2)) / rear);
    }
    if wheels[0] && wheels[1] && front > 0.0 {
        let along = |wheel| front_along(run, wheel, p, front, (from, to));
        return Some((along(1)? - along(0)?) / front);
    }
    turn_by_steering(run, p, from, to)
}

/// Net turn by the steering sensor and any one wheel \[rad\].
pub(crate) fn turn_by_steering(run: &Run, p: &Parameters, from: f64, to: f64) -> Option<f64> {
    let steering = run.steering.as_ref()?;
    let wheels = run.wheels();
    let wheel = [2, 3, 0, 1].into_iter().find(|wheel| wheels[*wheel])?;
    let series = run.rotation[wheel].as_ref()?;
    let mut before = (from, series.at(from));
    let mut turn = 0.0;
    let inside = series.t.iter().copied().filter(|t| *t > from && *t < to);
    for t in inside.chain(core::iter::once(to)) {
        let now = series.at(t);
        let angle = p.road_angle(steering.at(0.5 * (before.0 + t)));
        let share = if wheel < 2 { math::sin(angle) } else { math::tan(angle) };
        turn += (now - before.1) * p.values[wheel] * share / p.get(Parameter::Wheelbase);
        before = (t, now);
    }
    Some(turn)
}

/// Straight, arc or neither, by the wheels and `p`.
pub(crate) fn kind(run: &Run, vehicle: &Vehicle, p: &Parameters) -> Kind {
    let Some(base) = Base::new(run, vehicle) else { return Kind::Other };
    let (from, to) = base.span();
    if base.net() < ONE_WAY * base.travel() {
        return Kind::Other;
    }
    const POINTS: u32 = 20;
    let mut largest = 0.0_f64;
    let mut end = 0.0;
    for point in 1..=POINTS {
        let t = from + (to - from) * f64::from(point) / f64::from(POINTS);
        let Some(turn) = turn_by_wheels(run, p, from, t) else { return Kind::Other };
        largest = largest.max(turn.abs());
        end = turn;
    }
    let track = vehicle.track_rear.max(vehicle.track_front).max(0.1 * vehicle.wheelbase);
    if largest < STRAIGHT + UNEQUAL * base.travel() / track {
        Kind::Straight
    } else if end.abs() > ARC {
        Kind::Arc
    } else {
        Kind::Other
    }
}

/// The body's poses at the first and the last reading of the reference with heading, and their stamps.
fn ends(run: &Run, vehicle: &Vehicle) -> Option<[(f64, Pose); 2]> {
    let (from, to) = run.span()?;
    let marker = vehicle.reference.map_or(Pose::default(), |reference| reference.marker);
    let inside = |t: f64| (from - 0.1..=to + 0.1).contains(&t);
    let mut poses = run.reference.iter().filter(|reading| inside(reading.t)).map(|reading| {
        let seen = Pose::new(reading.x, reading.y, reading.yaw.unwrap_or(f64::NAN));
        let body = if reading.yaw.is_some() { seen.compose(&marker.inverse()) } else { seen };
        (reading.t.clamp(from, to), body)
    });
    let first = poses.next()?;
    Some([first, poses.next_back()?])
}

/// Length of a straight run \[m\]: by tape, by hand, or between the reference's first and last position.
pub(crate) fn length(run: &Run, vehicle: &Vehicle, noise: &Noise) -> Option<Measured> {
    let (from, to) = run.span()?;
    if let Some(value) = run.distance {
        return Some(Measured { value, deviation: noise.distance, from, to });
    }
    if run.reference.is_empty() {
        let end = run.end_pose?;
        let value = math::hypot(end.x, end.y);
        return Some(Measured { value, deviation: noise.hand_position, from, to });
    }
    let [(from, start), (to, end)] = ends(run, vehicle)?;
    let deviation = core::f64::consts::SQRT_2 * noise.position;
    Some(Measured { value: start.distance(&end), deviation, from, to })
}

/// Net turn of a run \[rad\], whole turns taken from the wheels.
pub(crate) fn turn(
    run: &Run,
    vehicle: &Vehicle,
    p: &Parameters,
    noise: &Noise,
) -> Option<Measured> {
    let (from, to) = run.span()?;
    if let Some(value) = run.net_turn {
        return Some(Measured { value, deviation: noise.turn, from, to });
    }
    let (value, deviation, from, to) = if run.reference.is_empty() {
        (run.end_pose?.yaw, noise.hand_yaw, from, to)
    } else {
        let [(from, start), (to, end)] = ends(run, vehicle)?;
        (end.yaw - start.yaw, core::f64::consts::SQRT_2 * noise.yaw, from, to)
    };
    let value = angle::unwrap(turn_by_wheels(run, p, from, to)?, value);
    value.is_finite().then_some(Measured { value, deviation, from, to })
}
