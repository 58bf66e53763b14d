//! Means, variances and their intervals.

use kerbside_geometry::math;

use crate::random::Random;

/// Resamples of a bootstrap.
const RESAMPLES: usize = 400;
/// Deviations of a 95 % interval.
const NORMAL: f64 = 1.959_964;

/// A count as a number.
#[allow(clippy::cast_precision_loss)] // counts of trials
pub(crate) fn number(count: usize) -> f64 {
    count as f64
}

/// Mean; not a number of nothing.
pub(crate) fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for value in values {
        (sum, count) = (sum + value, count + 1);
    }
    sum / number(count)
}

/// Root of the mean square.
pub(crate) fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    mean(values.into_iter().map(|value| value * value)).sqrt()
}

/// Value below which this share of `values` lies.
pub(crate) fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a share of a length
    let index = (share * number(values.len())) as usize;
    values.get(index.min(values.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}

/// 95 % interval of `statistic`, a function of indices of trials, by the percentiles of a bootstrap (Efron, Tibshirani,
/// *An Introduction to the Bootstrap*, chapter 13). What is computed from the same indices is resampled in pairs.
pub(crate) fn bootstrap(
    trials: usize,
    seed: u64,
    statistic: impl Fn(&[usize]) -> f64,
) -> (f64, f64) {
    let mut random = Random::new(seed);
    let mut indices = vec![0; trials];
    let mut values: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            indices.iter_mut().for_each(|index| *index = random.below(trials));
            statistic(&indices)
        })
        .collect();
    values.sort_by(f64::total_cmp);
    let at = |index: usize| values.get(index).copied().unwrap_or(f64::NAN);
    (at(RESAMPLES / 40), at(RESAMPLES - 1 - RESAMPLES / 40))
}

/// Mean and its bootstrap interval.
pub(crate) fn mean_between(values: &[f64], seed: u64) -> (f64, (f64, f64)) {
    let of = |indices: &[usize]| mean(indices.iter().map(|index| values[*index]));
    (mean(values.iter().copied()), bootstrap(values.len(), seed, of))
}

/// A share and its interval (Wilson, Journal of the American Statistical Association 22, 1927).
pub(crate) fn share(found: usize, of: usize) -> (f64, (f64, f64)) {
    let (n, p) = (number(of), number(found) / number(of));
    let square = NORMAL * NORMAL / n;
    let centre = (p + 0.5 * square) / (1.0 + square);
    let half = NORMAL * (p * (1.0 - p) / n + 0.25 * square / n).sqrt() / (1.0 + square);
    (p, ((centre - half).max(0.0), (centre + half).min(1.0)))
}

/// 95 % interval of a root mean square over `count` normal values (chi-square by Wilson and Hilferty, 1931).
pub(crate) fn rms_between(value: f64, count: usize) -> (f64, f64) {
    let spread = 2.0 / (9.0 * number(count));
    let quotient = |z: f64| {
        let root = (1.0 - spread + z * spread.sqrt()).max(1e-3);
        math::powf(root, 1.5)
    };
    (value / quotient(NORMAL), value / quotient(-NORMAL))
}

/// Variance of x plus variance of y of the errors with these indices \[m^2\].
pub(crate) fn variance(errors: &[[f64; 3]], indices: &[usize]) -> f64 {
    let (mut sum, mut square) = ([0.0; 2], 0.0);
    for index in indices {
        let [x, y, _] = errors[*index];
        (sum[0], sum[1], square) = (sum[0] + x, sum[1] + y, square + x * x + y * y);
    }
    let n = number(indices.len());
    (square - (sum[0] * sum[0] + sum[1] * sum[1]) / n) / (n - 1.0)
}

/// Mean of the squared distance \[m^2\].
pub(crate) fn mean_square(errors: &[[f64; 3]], indices: &[usize]) -> f64 {
    mean(indices.iter().map(|index| {
        let [x, y, _] = errors[*index];
        x * x + y * y
    }))
}

/// Length of the mean error \[m\].
pub(crate) fn bias(errors: &[[f64; 3]]) -> f64 {
    let of = |axis: usize| mean(errors.iter().map(|error| error[axis]));
    math::hypot(of(0), of(1))
}

/// Mean distance \[m\].
pub(crate) fn mean_distance(errors: &[[f64; 3]]) -> f64 {
    mean(errors.iter().map(|error| math::hypot(error[0], error[1])))
}

/// The indices below `count`.
pub(crate) fn all(count: usize) -> Vec<usize> {
    (0..count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_hold_what_they_should() {
        let mut random = Random::new(7);
        let values: Vec<f64> = (0..400).map(|_| 3.0 + random.normal()).collect();
        let (mean, (low, high)) = mean_between(&values, 1);
        assert!(low < mean && mean < high && (high - low - 0.196).abs() < 0.05, "{low} {high}");
        let (p, (low, high)) = share(400, 400);
        assert!(p == 1.0 && (low - 0.9905).abs() < 1e-3 && high == 1.0, "{low}");
        let (low, high) = rms_between(1.0, 100);
        // Quantiles 74.22 and 129.56 of chi-square with 100 degrees of freedom.
        assert!((low - (100.0_f64 / 129.56).sqrt()).abs() < 1e-3, "{low}");
        assert!((high - (100.0_f64 / 74.22).sqrt()).abs() < 1e-3, "{high}");
    }

    #[test]
    fn variance_is_about_the_mean() {
        let errors = [[1.0, 5.0, 0.0], [3.0, 5.0, 9.0]];
        assert!((variance(&errors, &all(2)) - 2.0).abs() < 1e-12);
        assert!((mean_square(&errors, &all(2)) - 30.0).abs() < 1e-12);
        assert!((bias(&errors) - 29.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(quantile(vec![3.0, 1.0, 2.0], 0.5), 2.0);
    }
}
