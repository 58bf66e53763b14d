//! Pose and parameters with their joint covariance.

use kerbside_geometry::Pose;
use kerbside_messages::FilterState;
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector3};

use crate::estimator::increment::{Estimate, Increment, advance};
use crate::parameters::{PARAMETERS, ParameterCovariance, ParameterEstimate};

/// Derivatives of (distance, turn) by the parameters.
pub(crate) type Sensitivity = SMatrix<f64, 2, PARAMETERS>;

/// One number per parameter.
pub(crate) type Values = SVector<f64, PARAMETERS>;

/// A piece of path, and how it would change with the parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    /// Motion, and covariance of its random part.
    pub(crate) increment: Increment,
    /// What an error of the parameters does to it.
    pub(crate) by_parameters: Sensitivity,
}

impl Piece {
    /// The first `share` of it.
    pub(crate) fn part(&self, share: f64) -> Self {
        let whole = &self.increment;
        Self {
            increment: Increment {
                distance: share * whole.distance,
                turn: share * whole.turn,
                covariance: share * whole.covariance,
            },
            by_parameters: share * self.by_parameters,
        }
    }
}

/// Derivative of a scalar measurement by pose and parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gradient {
    pub(crate) pose: Vector3<f64>,
    pub(crate) parameters: Values,
}

/// Pose and parameters, jointly Gaussian: the covariance of (x, y, yaw, parameters) in blocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Joint {
    pub(crate) pose: Pose,
    pub(crate) deviation: Values,
    pose_pose: Matrix3<f64>,
    pose_parameters: SMatrix<f64, 3, PARAMETERS>,
    parameters: ParameterCovariance,
}

impl Joint {
    /// A pose of which nothing is known in common with the parameters.
    pub(crate) fn new(prior: ParameterCovariance) -> Self {
        Self {
            pose: Pose::default(),
            deviation: Values::zeros(),
            pose_pose: Matrix3::zeros(),
            pose_parameters: SMatrix::zeros(),
            parameters: prior,
        }
    }

    /// The pose is `estimate` now, whatever it was; the parameters stay.
    pub(crate) fn place(&mut self, estimate: &Estimate) {
        self.pose = estimate.pose;
        self.pose_pose = estimate.covariance;
        self.pose_parameters = SMatrix::zeros();
    }

    /// Writes down the parameters and what they have in common with the pose.
    pub(crate) fn save(&self, out: &mut FilterState) {
        out.parameters = self.deviation.into();
        let mut lower = out.parameter_covariance.iter_mut();
        for row in 0..PARAMETERS {
            for (column, entry) in (0..=row).zip(&mut lower) {
                *entry = self.parameters[(row, column)];
            }
        }
        for (row, entries) in out.shared_covariance.chunks_mut(PARAMETERS).enumerate() {
            for (column, entry) in entries.iter_mut().enumerate() {
                *entry = self.pose_parameters[(row, column)];
            }
        }
    }

    /// Takes them up again about the present pose; nothing, and false, where that is no covariance.
    pub(crate) fn load(&mut self, saved: &FilterState) -> bool {
        let mut loaded = Self { deviation: saved.parameters.into(), ..*self };
        let mut lower = saved.parameter_covariance.iter();
        for row in 0..PARAMETERS {
            for (column, entry) in (0..=row).zip(&mut lower) {
                loaded.parameters[(row, column)] = *entry;
                loaded.parameters[(column, row)] = *entry;
            }
        }
        loaded.pose_parameters = SMatrix::from_row_slice(&saved.shared_covariance);
        let good = loaded.is_covariance();
        if good {
            *self = loaded;
        }
        good
    }

    /// Finite, and no covariance beyond what its two variances allow.
    fn is_covariance(&self) -> bool {
        let pose = self.pose_pose.diagonal();
        let own = self.parameters.diagonal();
        let fits = |entry: f64, one: f64, other: f64| {
            one >= 0.0 && other >= 0.0 && entry * entry <= one * other * (1.0 + 1e-6)
        };
        let all = 0..PARAMETERS;
        all.clone().all(|row| {
            all.clone().all(|column| fits(self.parameters[(row, column)], own[row], own[column]))
                && (0..3).all(|axis| fits(self.pose_parameters[(axis, row)], pose[axis], own[row]))
        })
    }

    pub(crate) fn estimate(&self) -> Estimate {
        Estimate { pose: self.pose, covariance: self.pose_pose }
    }

    pub(crate) fn parameters(&self) -> ParameterEstimate {
        ParameterEstimate { deviation: self.deviation.into(), covariance: self.parameters }
    }

    pub(crate) fn covariance(&self) -> &ParameterCovariance {
        &self.parameters
    }

    /// Rolls along `piece`: one exact arc, whose error is random in part and in part that of the
    /// parameters.
    pub(crate) fn roll(&mut self, piece: &Piece) {
        let (pose, by_pose, by_piece) = advance(&self.pose, &piece.increment);
        let (along, across) = (by_pose[(0, 2)], by_pose[(1, 2)]);
        let motion = piece.by_parameters * self.parameters;
        let shared = piece.by_parameters * self.pose_parameters.transpose();
        let spread: Matrix2<f64> =
            motion * piece.by_parameters.transpose() + piece.increment.covariance;
        let carried = by_pose * self.pose_pose * by_pose.transpose();
        let crossed = by_piece * (shared * by_pose.transpose());
        let added = by_piece * spread * by_piece.transpose();
        self.pose = pose;
        self.pose_pose = symmetric(carried + crossed + crossed.transpose() + added);
        for column in 0..PARAMETERS {
            let yaw = self.pose_parameters[(2, column)];
            self.pose_parameters[(0, column)] += along * yaw;
            self.pose_parameters[(1, column)] += across * yaw;
        }
        self.pose_parameters += by_piece * motion;
    }

    /// Adds variance to the pose along and across the body, and to the heading \[m, m, rad\].
    pub(crate) fn blur(&mut self, along: f64, across: f64, yaw: f64) {
        let mut estimate = self.estimate();
        estimate.blur(along, across, yaw);
        self.pose_pose = estimate.covariance;
    }

    /// Everything is less sure than it was said to be: variances times `factor`.
    pub(crate) fn widen(&mut self, factor: f64) {
        self.pose_pose *= factor;
        self.pose_parameters *= factor;
        self.parameters *= factor;
    }

    /// Parameters change with time and distance: these variances are added.
    pub(crate) fn drift(&mut self, variances: &Values) {
        for index in 0..PARAMETERS {
            self.parameters[(index, index)] += variances[index];
        }
    }

    /// Covariance of the measurement `gradient` with pose and parameters, and its own variance.
    pub(crate) fn spread(&self, gradient: &Gradient) -> (Gradient, f64) {
        let pose = self.pose_pose * gradient.pose + self.pose_parameters * gradient.parameters;
        let parameters = self.pose_parameters.transpose() * gradient.pose
            + self.parameters * gradient.parameters;
        let own = gradient.pose.dot(&pose) + gradient.parameters.dot(&parameters);
        (Gradient { pose, parameters }, own)
    }

    /// The update by a measurement with that gradient, `residual` against the present estimate and
    /// random variance `variance`.
    pub(crate) fn update(&mut self, gradient: &Gradient, residual: f64, variance: f64) {
        let (spread, own) = self.spread(gradient);
        let total = own + variance;
        if total > 0.0 {
            let gain =
                Gradient { pose: spread.pose / total, parameters: spread.parameters / total };
            self.take(gradient, &gain, &spread, residual, variance);
        }
    }

    /// The update of one parameter alone; pose and other parameters are considered (Schmidt): they
    /// keep value and variance.
    pub(crate) fn consider(&mut self, index: usize, residual: f64, variance: f64) {
        let mut gradient = Gradient { pose: Vector3::zeros(), parameters: Values::zeros() };
        gradient.parameters[index] = 1.0;
        let (spread, own) = self.spread(&gradient);
        let mut gain = Gradient { pose: Vector3::zeros(), parameters: Values::zeros() };
        gain.parameters[index] = own / (own + variance);
        if own > 0.0 {
            self.take(&gradient, &gain, &spread, residual, variance);
        }
    }

    /// (I - K h') P (I - K h')' + r K K': Joseph's form, right for any gain.
    fn take(
        &mut self,
        gradient: &Gradient,
        gain: &Gradient,
        spread: &Gradient,
        residual: f64,
        variance: f64,
    ) {
        let (kp, kn) = (&gain.pose, &gain.parameters);
        let pose = self.pose_pose - kp * spread.pose.transpose();
        let cross = self.pose_parameters - kp * spread.parameters.transpose();
        let back = self.pose_parameters.transpose() - kn * spread.pose.transpose();
        let parameters = self.parameters - kn * spread.parameters.transpose();
        let left_pose = pose * gradient.pose + cross * gradient.parameters - variance * kp;
        let left = back * gradient.pose + parameters * gradient.parameters - variance * kn;
        self.pose_pose = symmetric(pose - left_pose * kp.transpose());
        self.pose_parameters = cross - left_pose * kn.transpose();
        self.parameters = symmetric(parameters - left * kn.transpose());
        let shift = kp * residual;
        let Pose { x, y, yaw } = self.pose;
        self.pose = Pose::new(x + shift.x, y + shift.y, yaw + shift.z);
        self.deviation += kn * residual;
    }
}

/// The matrix with the rounding between its two halves taken out.
fn symmetric<const N: usize>(matrix: SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    0.5 * (matrix + matrix.transpose())
}
