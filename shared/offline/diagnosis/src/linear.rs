//! Least squares on whitened values, with everything that may differ besides integrated out.

use kerbside_geometry::math;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Whitened design of one run: a column per thing that may differ, in units of its prior's standard deviation.
pub(crate) type Design = DMatrix<f64>;

/// The runs' designs and the normal matrix of those that count, with unit priors.
#[derive(Clone, Debug)]
pub(crate) struct Projection {
    /// Which columns count.
    keep: Vec<usize>,
    /// Which runs count.
    runs: Vec<usize>,
    root: Cholesky<f64, Dyn>,
}

impl Projection {
    /// Over `runs`, leaving out the columns in `drop`.
    pub(crate) fn new(normals: &[DMatrix<f64>], runs: &[usize], drop: &[usize]) -> Option<Self> {
        let columns = normals.first().map_or(0, DMatrix::ncols);
        let keep: Vec<usize> = (0..columns).filter(|column| !drop.contains(column)).collect();
        let mut sum = DMatrix::<f64>::identity(keep.len(), keep.len());
        for run in runs {
            sum += normals[*run].select_rows(&keep).select_columns(&keep);
        }
        Some(Self { keep, runs: runs.to_vec(), root: sum.cholesky()? })
    }

    /// Half the logarithm of the normal matrix's determinant: what the columns cost an evidence.
    pub(crate) fn occam(&self) -> f64 {
        self.root.l_dirty().diagonal().iter().map(|d| math::ln(*d)).sum()
    }

    /// The runs that count.
    pub(crate) fn runs(&self) -> &[usize] {
        &self.runs
    }

    /// Inner products of `vectors` (`[vector][run]`) with the columns integrated out: `V' (I - X A^-1 X') V`.
    pub(crate) fn products(&self, designs: &[Design], vectors: &[&[DVector<f64>]]) -> DMatrix<f64> {
        let n = vectors.len();
        let mut plain = DMatrix::<f64>::zeros(n, n);
        let mut along = DMatrix::<f64>::zeros(self.keep.len(), n);
        for run in &self.runs {
            let design = &designs[*run];
            for (j, vector) in vectors.iter().enumerate() {
                for (i, other) in vectors.iter().enumerate().take(j + 1) {
                    plain[(i, j)] += other[*run].dot(&vector[*run]);
                }
                for (row, column) in self.keep.iter().enumerate() {
                    along[(row, j)] += design.column(*column).dot(&vector[*run]);
                }
            }
        }
        for j in 0..n {
            for i in 0..j {
                plain[(j, i)] = plain[(i, j)];
            }
        }
        plain - along.tr_mul(&self.root.solve(&along))
    }
}

/// A Gaussian group of columns on top of a projection: how much likelier it makes the residual.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    /// Logarithm of the evidence with the group over that without.
    pub log_evidence: f64,
    /// Twice the gain in log-likelihood at the most likely sizes, priors included.
    pub gain: f64,
}

/// `products` are those of the group's columns and, last, the residual.
pub(crate) fn group(products: &DMatrix<f64>) -> Option<Group> {
    let n = products.ncols() - 1;
    let mut normal = products.view((0, 0), (n, n)).into_owned();
    for i in 0..n {
        normal[(i, i)] += 1.0;
    }
    let right: DVector<f64> = products.view((0, n), (n, 1)).column(0).into_owned();
    let root = normal.cholesky()?;
    let sizes = root.solve(&right);
    let gain = right.dot(&sizes);
    let occam: f64 = root.l_dirty().diagonal().iter().map(|d| math::ln(*d)).sum();
    Some(Group { log_evidence: 0.5 * gain - occam, gain })
}
