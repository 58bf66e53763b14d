//! Rows of a stretch without its motion, and what is left of them as a measurement.

use super::block::Sum;
use super::joint::{Joint, Values};
use super::rows::ROWS;

/// The rows of a stretch without the motion: unit variance, independent.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Projected {
    pub(crate) count: usize,
    pub(crate) residual: [f64; ROWS],
    pub(crate) by_parameters: [Values; ROWS],
    /// What a unit of each sensor's reading does.
    pub(crate) by_reading: [[f64; ROWS]; ROWS],
}

/// The whitened rows.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct System {
    count: usize,
    of: [[f64; 2]; ROWS],
    rows: Projected,
}

impl System {
    /// Adds the row of `sensor` over a stretch of that way, times `weight`.
    pub(crate) fn push(&mut self, sum: &Sum, sensor: usize, way: f64, weight: f64) {
        let at = self.count;
        self.of[at] = sum.of.map(|entry| entry / way * weight);
        self.rows.residual[at] = sum.residual * weight;
        for (parameter, slope) in sum.by_parameters {
            self.rows.by_parameters[at][parameter] += slope * weight;
        }
        self.rows.by_reading[at][sensor] = weight;
        self.count += 1;
    }

    /// Takes the motion out: two Householder reflections.
    pub(crate) fn reduce(mut self) -> Projected {
        if self.count < 2 {
            return Projected::default();
        }
        self.reflect(0);
        self.reflect(1);
        let mut rows = self.rows;
        rows.count = self.count - 2;
        rows.residual.copy_within(2.., 0);
        rows.by_parameters.copy_within(2.., 0);
        rows.by_reading.copy_within(2.., 0);
        rows
    }

    /// Clears column `column` below the diagonal.
    fn reflect(&mut self, column: usize) {
        let mut mirror = [0.0; ROWS];
        for (row, entry) in mirror.iter_mut().enumerate().take(self.count).skip(column) {
            *entry = self.of[row][column];
        }
        let length = dot(&mirror, &mirror).sqrt();
        mirror[column] += length.copysign(mirror[column]);
        let square = dot(&mirror, &mirror);
        if square <= 0.0 {
            return;
        }
        let factor = 2.0 / square;
        for other in 0..2 {
            let entries = core::array::from_fn(|row| self.of[row][other]);
            let share = factor * dot(&mirror, &entries);
            (0..ROWS).for_each(|row| self.of[row][other] -= share * mirror[row]);
        }
        let share = factor * dot(&mirror, &self.rows.residual);
        (0..ROWS).for_each(|row| self.rows.residual[row] -= share * mirror[row]);
        self.reflect_rest(&mirror, factor);
    }

    fn reflect_rest(&mut self, mirror: &[f64; ROWS], factor: f64) {
        let rows = &mut self.rows;
        let mut parameters = Values::zeros();
        let mut readings = [0.0; ROWS];
        for (row, entry) in mirror.iter().enumerate() {
            parameters += rows.by_parameters[row] * *entry;
            (0..ROWS).for_each(|sensor| readings[sensor] += rows.by_reading[row][sensor] * entry);
        }
        for (row, entry) in mirror.iter().enumerate() {
            let share = factor * entry;
            rows.by_parameters[row] -= parameters * share;
            (0..ROWS).for_each(|sensor| rows.by_reading[row][sensor] -= readings[sensor] * share);
        }
    }
}

/// Cholesky factor of the projected rows' covariance, parameters included.
pub(crate) struct Factor {
    count: usize,
    lower: [[f64; ROWS]; ROWS],
}

impl Factor {
    pub(crate) fn new(rows: &Projected, joint: &Joint) -> Option<Self> {
        let spread: [Values; ROWS] =
            core::array::from_fn(|row| joint.covariance() * rows.by_parameters[row]);
        let mut lower: [[f64; ROWS]; ROWS] = core::array::from_fn(|row| {
            core::array::from_fn(|column| {
                let unit = if row == column { 1.0 } else { 0.0 };
                unit + rows.by_parameters[row].dot(&spread[column])
            })
        });
        for column in 0..rows.count {
            for row in column..rows.count {
                let mut entry = lower[row][column];
                (0..column).for_each(|inner| entry -= lower[row][inner] * lower[column][inner]);
                if row == column {
                    if entry.is_nan() || entry <= 0.0 {
                        return None;
                    }
                    lower[row][column] = entry.sqrt();
                } else {
                    lower[row][column] = entry / lower[column][column];
                }
            }
        }
        Some(Self { count: rows.count, lower })
    }

    /// The inverse of the factor times `right`.
    pub(crate) fn solve(&self, right: &[f64; ROWS]) -> [f64; ROWS] {
        let mut solution = [0.0; ROWS];
        for row in 0..self.count {
            let mut entry = right[row];
            (0..row).for_each(|inner| entry -= self.lower[row][inner] * solution[inner]);
            solution[row] = entry / self.lower[row][row];
        }
        solution
    }
}

pub(crate) fn dot(left: &[f64; ROWS], right: &[f64; ROWS]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}
