//! An absolute pose as a measurement.

use kerbside_geometry::{Pose, angle, math};
use kerbside_messages::{Fix, Nanos};
use nalgebra::{Matrix3, Vector3};

use super::joint::{Gradient, Joint, Values};
use crate::estimator::increment::symmetric;

/// A fix, as it is kept: the pose of a marker on the vehicle at a time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sighting {
    pub(crate) stamp: Nanos,
    /// It is still to be judged by the gate.
    pub(crate) judged: bool,
    pose: Pose,
    covariance: Matrix3<f64>,
    /// `body_from_marker`.
    marker: Pose,
}

/// What a fix says beyond the estimate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surprise {
    /// In x, y and yaw \[m, m, rad\].
    pub(crate) innovation: Vector3<f64>,
    /// Its squared Mahalanobis length.
    pub(crate) ratio: f64,
}

impl Sighting {
    pub(crate) fn new(fix: &Fix) -> Self {
        Self {
            stamp: fix.header.stamp,
            judged: true,
            pose: Pose::new(fix.x, fix.y, fix.yaw),
            covariance: symmetric(&Matrix3::from_row_slice(&fix.covariance)),
            marker: Pose::new(fix.marker_x, fix.marker_y, fix.marker_yaw),
        }
    }

    /// How far it is off the estimate; where nothing at all is uncertain, without limit.
    pub(crate) fn surprise(&self, joint: &Joint) -> Surprise {
        let innovation = self.innovation(joint);
        let inverse = self.spread(joint).try_inverse();
        let ratio = inverse.map_or(f64::MAX, |inverse| {
            (innovation.transpose() * inverse * innovation).x.clamp(0.0, f64::MAX)
        });
        Surprise { innovation, ratio }
    }

    /// Covariance of what it says beyond the estimate.
    pub(crate) fn spread(&self, joint: &Joint) -> Matrix3<f64> {
        let by_pose = self.by_pose(joint);
        by_pose * joint.estimate().covariance * by_pose.transpose() + self.covariance
    }

    /// Corrects pose and parameters.
    pub(crate) fn correct(&self, joint: &mut Joint) {
        let innovation = self.innovation(joint);
        let by_pose = self.by_pose(joint);
        let (lower, variances) = factor(&self.covariance);
        let before = joint.pose;
        let (mut rows, mut residual) = (by_pose, innovation);
        for row in 0..3 {
            for above in 0..row {
                let share = lower[(row, above)];
                let taken = rows.row(above) * share;
                let mut own = rows.row_mut(row);
                own -= taken;
                residual[row] -= share * residual[above];
            }
        }
        for row in 0..3 {
            let pose: Vector3<f64> = rows.row(row).transpose();
            let gradient = Gradient { pose, parameters: Values::zeros() };
            let now = joint.pose;
            let moved = Vector3::new(now.x - before.x, now.y - before.y, now.yaw - before.yaw);
            joint.update(&gradient, residual[row] - pose.dot(&moved), variances[row]);
        }
    }

    fn innovation(&self, joint: &Joint) -> Vector3<f64> {
        let (sin, cos) = math::sin_cos(joint.pose.yaw);
        let Pose { x, y, yaw } = self.marker;
        let turn = self.pose.yaw - joint.pose.yaw - yaw;
        Vector3::new(
            self.pose.x - joint.pose.x - cos * x + sin * y,
            self.pose.y - joint.pose.y - sin * x - cos * y,
            angle::wrap(turn),
        )
    }

    fn by_pose(&self, joint: &Joint) -> Matrix3<f64> {
        let (sin, cos) = math::sin_cos(joint.pose.yaw);
        let Pose { x, y, .. } = self.marker;
        let mut by_pose = Matrix3::identity();
        by_pose[(0, 2)] = -sin * x - cos * y;
        by_pose[(1, 2)] = cos * x - sin * y;
        by_pose
    }
}

/// R = L D L', L with ones on its diagonal; columns without variance are left empty.
fn factor(covariance: &Matrix3<f64>) -> (Matrix3<f64>, [f64; 3]) {
    let mut rest = *covariance;
    let mut lower = Matrix3::identity();
    let mut variances = [0.0; 3];
    for column in 0..3 {
        let variance = rest[(column, column)].max(0.0);
        variances[column] = variance;
        for row in column + 1..3 {
            lower[(row, column)] =
                if variance > 0.0 { rest[(row, column)] / variance } else { 0.0 };
        }
        for row in column + 1..3 {
            for other in column + 1..3 {
                rest[(row, other)] -= variance * lower[(row, column)] * lower[(other, column)];
            }
        }
    }
    (lower, variances)
}
