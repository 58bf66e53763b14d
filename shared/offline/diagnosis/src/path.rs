//! The path about which errors are linear, and residuals in its frame.

use kerbside_geometry::{Drive, Pose, Vehicle, WHEELS, Wheel, angle, math};

use crate::bins::{Binned, CHANNELS, Channels, MISSING, REFERENCE};

/// Motion of the car from the middle of one bin to that of the next.
#[derive(Clone, Copy, Debug, Default)]
pub struct Step {
    /// Displacement of the compared point in the frame at the begin \[m\].
    pub along: f64,
    /// See `along`.
    pub across: f64,
    /// Turn \[rad\].
    pub turn: f64,
    /// Signed distance of the rear-axle centre \[m\].
    pub distance: f64,
    /// Mean angle of the road wheels \[rad\].
    pub steering: f64,
}

/// The path of one run, bin by bin.
#[derive(Clone, Debug)]
pub struct Path {
    /// Pose of the compared point in the middle of each bin, yaw unwrapped.
    pub pose: Vec<Pose>,
    /// One step fewer than poses.
    pub steps: Vec<Step>,
}

/// Where a car is, for [`Path::new`].
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Body, yaw unwrapped.
    pub pose: Pose,
    /// Angle of the road wheels \[rad\].
    pub steering: f64,
}

impl Path {
    /// From the car's place in the middle of each bin.
    #[must_use]
    pub fn new(places: &[Place], point: Pose) -> Self {
        let pose: Vec<Pose> = places.iter().map(|place| place.pose.compose(&point)).collect();
        let steps = (1..places.len()).map(|k| {
            let [from, to] = [&pose[k - 1], &pose[k]];
            let (sin, cos) = math::sin_cos(places[k - 1].pose.yaw);
            let (dx, dy) = (to.x - from.x, to.y - from.y);
            Step {
                along: cos * dx + sin * dy,
                across: -sin * dx + cos * dy,
                turn: places[k].pose.yaw - places[k - 1].pose.yaw,
                distance: cos * (places[k].pose.x - places[k - 1].pose.x)
                    + sin * (places[k].pose.y - places[k - 1].pose.y),
                steering: 0.5 * (places[k].steering + places[k - 1].steering),
            }
        });
        Self {
            steps: steps.collect(),
            pose: places
                .iter()
                .zip(pose)
                .map(|(place, p)| Pose { yaw: place.pose.yaw, ..p })
                .collect(),
        }
    }
}

/// Measured minus predicted, so that a linear model about `path` holds even where both have drifted apart: wheels,
/// steering and gyro as they are; the reference's residual accumulates the differences of the displacements, each seen
/// in its own body frame, and is given in the path's body frame.
#[must_use]
pub fn residuals(
    binned: &Binned,
    path: &Path,
    measured: &[Channels],
    predicted: &[Channels],
) -> Vec<Channels> {
    let mut residuals = vec![MISSING; measured.len()];
    for (k, residual) in residuals.iter_mut().enumerate() {
        for channel in 0..REFERENCE {
            residual[channel] = measured[k][channel] - predicted[k][channel];
        }
    }
    if binned.has_yaw {
        with_yaw(path, measured, predicted, &mut residuals);
    } else {
        without_yaw(path, measured, predicted, &mut residuals);
    }
    residuals
}

fn pose_of(channels: &Channels) -> Pose {
    Pose::new(channels[REFERENCE], channels[REFERENCE + 1], channels[REFERENCE + 2])
}

fn with_yaw(
    path: &Path,
    measured: &[Channels],
    predicted: &[Channels],
    residuals: &mut [Channels],
) {
    // The error now, in the path's body frame, and the poses it stands for.
    let mut last: Option<(Pose, Pose)> = None;
    let (mut ex, mut ey, mut eyaw) = (0.0, 0.0, 0.0);
    // Displacement of the path since the bin of `last`, in the frame of that bin.
    let (mut dx, mut dy, mut turn) = (0.0, 0.0, 0.0_f64);
    for k in 0..measured.len() {
        if k > 0 {
            let step = &path.steps[k - 1];
            let (sin, cos) = math::sin_cos(turn);
            dx += cos * step.along - sin * step.across;
            dy += sin * step.along + cos * step.across;
            turn += step.turn;
        }
        let (m, p) = (pose_of(&measured[k]), pose_of(&predicted[k]));
        if !m.is_finite() || !p.is_finite() {
            continue;
        }
        if let Some((m0, p0)) = last {
            let (dm, dp) = (local(&m0, &m), local(&p0, &p));
            let (x, y) = (ex + dm.0 - dp.0 - eyaw * dy, ey + dm.1 - dp.1 + eyaw * dx);
            let (sin, cos) = math::sin_cos(turn);
            (ex, ey) = (cos * x + sin * y, -sin * x + cos * y);
            eyaw += angle::wrap(m.yaw - m0.yaw) - angle::wrap(p.yaw - p0.yaw);
        }
        last = Some((m, p));
        (dx, dy, turn) = (0.0, 0.0, 0.0);
        residuals[k][REFERENCE..].copy_from_slice(&[ex, ey, eyaw]);
    }
}

fn local(from: &Pose, to: &Pose) -> (f64, f64) {
    let (sin, cos) = math::sin_cos(from.yaw);
    let (dx, dy) = (to.x - from.x, to.y - from.y);
    (cos * dx + sin * dy, -sin * dx + cos * dy)
}

fn without_yaw(
    path: &Path,
    measured: &[Channels],
    predicted: &[Channels],
    residuals: &mut [Channels],
) {
    for (k, residual) in residuals.iter_mut().enumerate() {
        let (m, p) = (&measured[k], &predicted[k]);
        let (dx, dy) = (m[REFERENCE] - p[REFERENCE], m[REFERENCE + 1] - p[REFERENCE + 1]);
        let (sin, cos) = math::sin_cos(path.pose[k].yaw);
        residual[REFERENCE] = cos * dx + sin * dy;
        residual[REFERENCE + 1] = -sin * dx + cos * dy;
    }
    debug_assert_eq!(REFERENCE + 3, CHANNELS);
}

/// How far each wheel rolls per metre of the rear-axle centre on a circle of `curvature` \[1/m\], signed like the car's
/// way, and its slope \[m\].
#[must_use]
pub fn rolling(vehicle: &Vehicle, curvature: f64) -> [(f64, f64); 4] {
    WHEELS.map(|wheel| {
        let (x, y) = vehicle.wheel_position(wheel);
        let (along, across) = (1.0 - y * curvature, x * curvature);
        let length = (along * along + across * across).sqrt().max(1e-9);
        (length, (x * across - y * along) / length)
    })
}

/// Share of each wheel in the mean rotation of the driven ones.
#[must_use]
pub fn driven_share(vehicle: &Vehicle) -> [f64; 4] {
    WHEELS.map(|wheel: Wheel| match vehicle.drive {
        Drive::All => 0.25,
        Drive::Front if wheel.is_front() => 0.5,
        Drive::Rear if !wheel.is_front() => 0.5,
        Drive::Front | Drive::Rear => 0.0,
    })
}
