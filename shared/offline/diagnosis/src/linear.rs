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

    /// Inner products of a run's columns with the columns that count.
    pub(crate) fn along(&self, designs: &[Design], run: usize, own: &DMatrix<f64>) -> DMatrix<f64> {
        designs[run].tr_mul(own).select_rows(&self.keep)
    }

    /// What integrating the columns out takes from inner products of vectors whose products with them are `one` and `other`.
    pub(crate) fn taken(&self, one: &DMatrix<f64>, other: &DMatrix<f64>) -> DMatrix<f64> {
        one.tr_mul(&self.root.solve(other))
    }

    /// Inner products of `vectors` (`[vector][run]`) with the columns integrated out: `V' (I - X A^-1 X') V`.
    pub(crate) fn products(&self, designs: &[Design], vectors: &[&[DVector<f64>]]) -> DMatrix<f64> {
        let n = vectors.len();
        let mut plain = DMatrix::<f64>::zeros(n, n);
        let mut along = DMatrix::<f64>::zeros(self.keep.len(), n);
        for run in &self.runs {
            let own: Vec<DVector<f64>> =
                vectors.iter().map(|vector| vector[*run].clone()).collect();
            let own = DMatrix::from_columns(&own);
            plain += gram(&own);
            along += self.along(designs, *run, &own);
        }
        plain - self.taken(&along, &along)
    }
}

/// Inner products of a matrix's columns with one another.
pub(crate) fn gram(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let n = columns.ncols();
    let mut products = DMatrix::zeros(n, n);
    for j in 0..n {
        for i in 0..=j {
            let product = dot(columns.column(i).as_slice(), columns.column(j).as_slice());
            products[(i, j)] = product;
            products[(j, i)] = product;
        }
    }
    products
}

/// In eight sums beside each other, which a processor adds at once.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (mut sums, pairs) = ([0.0; 8], (a.chunks_exact(8), b.chunks_exact(8)));
    let rest: f64 = pairs.0.remainder().iter().zip(pairs.1.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in pairs.0.zip(pairs.1) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    rest + sums.iter().sum::<f64>()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bins::to_f64;

    #[test]
    fn inner_products_are_those_of_the_columns() {
        // Longer than a multiple of eight.
        let columns = DMatrix::from_fn(21, 3, |i, j| math::sin(to_f64(i) + 2.0 * to_f64(j)));
        let products = gram(&columns);
        let plain = columns.transpose() * &columns;
        assert!((products - plain).norm() < 1e-12);
    }
}
