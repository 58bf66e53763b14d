//! Small symmetric systems of linear equations.

/// Unknowns at most.
pub(crate) const UNKNOWNS: usize = 7;

/// A least-squares problem: the sum of weight * (row . z - target)^2 / 2, minus push . z, is to be smallest.
#[derive(Clone, Debug)]
pub(crate) struct Balance {
    normal: [[f64; UNKNOWNS]; UNKNOWNS],
    right: [f64; UNKNOWNS],
}

impl Balance {
    /// Without any row.
    pub(crate) fn new() -> Self {
        Self { normal: [[0.0; UNKNOWNS]; UNKNOWNS], right: [0.0; UNKNOWNS] }
    }

    /// Adds a row.
    pub(crate) fn add(&mut self, weight: f64, row: &[f64; UNKNOWNS], target: f64) {
        for (i, factor) in row.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
            let weighted = weight * factor;
            self.right[i] += weighted * target;
            (0..=i).for_each(|j| self.normal[i][j] += weighted * row[j]);
        }
    }

    /// Adds a linear term.
    pub(crate) fn push(&mut self, unknown: usize, push: f64) {
        self.right[unknown] += push;
    }

    /// Fixes an unknown, of which no row speaks, at zero.
    pub(crate) fn fix(&mut self, unknown: usize) {
        self.normal[unknown][unknown] = 1.0;
    }

    /// The minimum, by Cholesky's decomposition (Golub and Van Loan, *Matrix Computations*, section 4.2). Unknowns that
    /// the rows leave open give what is not a number.
    pub(crate) fn solve(mut self) -> [f64; UNKNOWNS] {
        let lower = &mut self.normal;
        for j in 0..UNKNOWNS {
            for i in j..UNKNOWNS {
                let sum: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
                let rest = lower[i][j] - sum;
                lower[i][j] = if i == j { rest.sqrt() } else { rest / lower[j][j] };
            }
        }
        let mut z = self.right;
        for i in 0..UNKNOWNS {
            let sum: f64 = (0..i).map(|k| lower[i][k] * z[k]).sum();
            z[i] = (z[i] - sum) / lower[i][i];
        }
        for i in (0..UNKNOWNS).rev() {
            let sum: f64 = (i + 1..UNKNOWNS).map(|k| lower[k][i] * z[k]).sum();
            z[i] = (z[i] - sum) / lower[i][i];
        }
        z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_minimum_has_no_slope() {
        let rows: Vec<[f64; UNKNOWNS]> = (0..9)
            .map(|k| core::array::from_fn(|i| f64::from((k * 7 + i as i32 * 3) % 5) - 1.5))
            .collect();
        let weight = |k: usize| 0.5 + k as f64;
        let mut balance = Balance::new();
        rows.iter().enumerate().for_each(|(k, row)| balance.add(weight(k), row, k as f64));
        (0..UNKNOWNS).for_each(|i| {
            balance.add(1e-3, &core::array::from_fn(|j| f64::from(u8::from(i == j))), 0.0)
        });
        balance.push(2, 0.7);
        let z = balance.solve();
        for i in 0..UNKNOWNS {
            let residual =
                |k: usize| (0..UNKNOWNS).map(|j| rows[k][j] * z[j]).sum::<f64>() - k as f64;
            let slope: f64 = (0..rows.len()).map(|k| weight(k) * rows[k][i] * residual(k)).sum();
            let pushed = if i == 2 { 0.7 } else { 0.0 };
            assert!((slope + 1e-3 * z[i] - pushed).abs() < 1e-8, "{i}: {slope}");
        }
    }
}
