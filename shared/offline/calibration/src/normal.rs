//! What one run adds to the fit: its normal equations about the present parameters and start pose, and how well it fits.

use nalgebra::{Matrix3, SMatrix, SVector};

use crate::parameters::{COUNT, Vector};

/// Unknowns of a run: the parameters, then its start pose.
pub(crate) const UNKNOWNS: usize = COUNT + 3;

/// Derivative of a residual by the unknowns of its run.
pub(crate) type Gradient = SVector<f64, UNKNOWNS>;

/// Square matrix of parameters.
pub type Square = SMatrix<f64, COUNT, COUNT>;

/// How many residuals there are, and their sum of squares, in standard deviations, those that are weighed down as
/// Huber's cost counts them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Squares {
    pub(crate) sum: f64,
    pub(crate) count: usize,
}

impl Squares {
    pub(crate) fn add(&mut self, square: f64, count: usize) {
        self.sum += square;
        self.count += count;
    }
}

/// The largest residual of a run, in standard deviations, and what it is of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Largest {
    pub(crate) deviations: f64,
    /// Travel by then \[m\].
    pub(crate) travel: f64,
    /// Residual in its own unit (m or rad); that of a comparison in deviations.
    pub(crate) value: f64,
}

/// Normal equations of one run, and how well it fits.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    pub(crate) parameters: Square,
    pub(crate) mixed: SMatrix<f64, COUNT, 3>,
    pub(crate) start: Matrix3<f64>,
    pub(crate) right: Vector,
    pub(crate) right_start: SVector<f64, 3>,
    /// Robust cost: half the sum is not taken.
    pub(crate) cost: f64,
    /// Of position, yaw, distance and turn.
    pub(crate) truth: Squares,
    /// Of rows that disagree.
    pub(crate) comparison: Squares,
    pub(crate) largest: [Largest; 2],
    /// By how much the reference's stamps are late at the end, where that is asked for \[s\].
    pub(crate) lag: Option<f64>,
    /// The gyro's bias at the end and its variance, where the gyro tells of the turn \[rad/s\].
    pub(crate) bias: Option<(f64, f64)>,
}

impl Normal {
    pub(crate) fn empty() -> Self {
        Self {
            parameters: Square::zeros(),
            mixed: SMatrix::zeros(),
            start: Matrix3::zeros(),
            right: Vector::zeros(),
            right_start: SVector::zeros(),
            cost: 0.0,
            truth: Squares::default(),
            comparison: Squares::default(),
            largest: [Largest::default(); 2],
            lag: None,
            bias: None,
        }
    }

    pub(crate) fn add(&mut self, gradient: &Gradient, residual: f64, weight: f64) {
        let p = gradient.fixed_rows::<COUNT>(0).into_owned();
        let x = gradient.fixed_rows::<3>(COUNT).into_owned();
        self.parameters += p * p.transpose() * weight;
        self.mixed += p * x.transpose() * weight;
        self.start += x * x.transpose() * weight;
        self.right += p * (residual * weight);
        self.right_start += x * (residual * weight);
    }

    /// Information on the parameters and right-hand side once the start pose is eliminated; with the inverse that
    /// gives the start pose back.
    pub(crate) fn reduced(&self) -> Option<(Square, Vector, Matrix3<f64>)> {
        // A heading that nothing tells stays where it is.
        let start = self.start + Matrix3::identity() * 1e-4;
        let inverse = start.cholesky()?.inverse();
        let gain = self.mixed * inverse;
        let information = self.parameters - gain * self.mixed.transpose();
        Some((information, self.right - gain * self.right_start, inverse))
    }

    /// Residuals of either kind less the three that the start pose took.
    pub(crate) fn freedom(&self) -> usize {
        (self.truth.count + self.comparison.count).saturating_sub(3)
    }
}

/// Huber's weight and cost of a residual given in standard deviations.
pub(crate) fn huber(deviations: f64, limit: f64) -> (f64, f64) {
    let size = deviations.abs();
    if size <= limit {
        (1.0, size * size)
    } else {
        (limit / size, 2.0 * limit * size - limit * limit)
    }
}
