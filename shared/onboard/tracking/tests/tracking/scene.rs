//! Plans of arcs and lines with standing steering, and the samples around them.

use kerbside_geometry::{Pose, math};
use kerbside_messages::{
    EstimatorState, Header, Mode, Nanos, Odometry, Permit, Plan, TrajectoryPoint, nanos,
};

pub(crate) const ARM: u64 = 7;
const INTERVAL: f64 = 0.02;
const ACCELERATION: f64 = 0.15;
const SPEED: f64 = 0.2;
const STEERING_RATE: f64 = 0.64;
const PAUSE: f64 = 0.3;

/// Lengths (negative in reverse) and steering angles, one after the other.
pub(crate) type Path = [(f64, f64)];

/// Forward on an arc, back on the opposite one, a straight back.
pub(crate) const GARAGE: &Path = &[(0.9, 0.45), (-0.9, -0.45), (-0.7, 0.0)];
/// The reverse S of a parallel slot and a short line forward.
pub(crate) const PARALLEL: &Path = &[(-0.7, -0.48), (-0.7, 0.48), (0.12, 0.0)];

pub(crate) fn mirrored(path: &Path) -> Vec<(f64, f64)> {
    path.iter().map(|(length, steering)| (*length, -steering)).collect()
}

/// A plan with its points.
#[derive(Clone, Debug)]
pub(crate) struct Scene {
    pub(crate) plan: Plan,
    pub(crate) points: Vec<TrajectoryPoint>,
    pub(crate) goal: Pose,
}

/// Times, in s, of speeding up and of constant speed on a length.
fn trapezoid(length: f64) -> (f64, f64) {
    let rise = (SPEED / ACCELERATION).min((length / ACCELERATION).sqrt());
    (rise, length / (ACCELERATION * rise) - rise)
}

/// Distance, speed and acceleration at `time` on a length.
fn profile(length: f64, time: f64) -> (f64, f64, f64) {
    let (rise, hold) = trapezoid(length);
    let (top, fall) = (ACCELERATION * rise, time - rise - hold);
    if time < rise {
        (0.5 * ACCELERATION * time * time, ACCELERATION * time, ACCELERATION)
    } else if fall < 0.0 {
        (0.5 * top * rise + top * (time - rise), top, 0.0)
    } else {
        let left = (rise - fall).max(0.0);
        let speed = ACCELERATION * left;
        (
            length - 0.5 * ACCELERATION * left * left,
            speed,
            if left > 0.0 { -ACCELERATION } else { 0.0 },
        )
    }
}

impl Scene {
    /// From `start`, wheels straight.
    pub(crate) fn new(wheelbase: f64, start: Pose, path: &Path) -> Self {
        let (mut points, mut pose, mut steering) = (Vec::new(), start, 0.0);
        for (length, next) in path {
            let turning = (next - steering).abs() / STEERING_RATE;
            stand(&mut points, &pose, steering, *next, turning);
            pose = drive(&mut points, &pose, wheelbase, *length, *next);
            steering = *next;
        }
        stand(&mut points, &pose, steering, steering, 0.0);
        for (index, point) in points.iter_mut().enumerate() {
            point.time = INTERVAL * index as f64;
        }
        let plan = Plan {
            id: 3,
            arm: ARM,
            interval: INTERVAL,
            duration: points.last().expect("points").time,
            points: points.len() as u32,
            ..Plan::default()
        };
        Self { plan, points, goal: pose }
    }
}

fn steps(duration: f64) -> usize {
    (duration / INTERVAL).ceil() as usize
}

fn stand(points: &mut Vec<TrajectoryPoint>, pose: &Pose, from: f64, to: f64, turning: f64) {
    for step in 0..steps(turning + PAUSE) {
        let turned = STEERING_RATE * INTERVAL * step as f64;
        let steering = if to > from { (from + turned).min(to) } else { (from - turned).max(to) };
        let Pose { x, y, yaw } = *pose;
        points.push(TrajectoryPoint { x, y, yaw, steering, ..Default::default() });
    }
}

fn drive(
    points: &mut Vec<TrajectoryPoint>,
    from: &Pose,
    wheelbase: f64,
    length: f64,
    steering: f64,
) -> Pose {
    let curvature = math::tan(steering) / wheelbase;
    let (rise, hold) = trapezoid(length.abs());
    for step in 0..steps(2.0 * rise + hold) {
        let (distance, speed, acceleration) = profile(length.abs(), INTERVAL * step as f64);
        let distance = distance * length.signum();
        let Pose { x, y, yaw } = from.advance(distance, distance * curvature);
        let (speed, acceleration) = (speed * length.signum(), acceleration * length.signum());
        points.push(TrajectoryPoint {
            x,
            y,
            yaw,
            speed,
            acceleration,
            steering,
            ..Default::default()
        });
    }
    from.advance(length, length * curvature)
}

/// A valid estimate with a small covariance.
pub(crate) fn odometry(time: f64, pose: &Pose, standstill: bool) -> Odometry {
    let mut odometry = Odometry {
        header: Header::stamped(stamp(time), stamp(time)),
        x: pose.x,
        y: pose.y,
        yaw: pose.yaw,
        state: EstimatorState::Valid.code(),
        standstill: u8::from(standstill),
        resets: 1,
        ..Odometry::default()
    };
    [odometry.covariance[0], odometry.covariance[4], odometry.covariance[8]] = [4e-6, 4e-6, 3e-6];
    odometry
}

/// A permit of `arm` that lives for 150 ms.
pub(crate) fn permit(time: f64, arm: u64, mode: Mode) -> Permit {
    Permit { arm, expiry: stamp(time + 0.15), mode: mode.code(), granted: 1, ..Permit::default() }
}

/// The host's clock does not begin at 0.
pub(crate) fn stamp(time: f64) -> Nanos {
    nanos(1000.0 + time)
}
