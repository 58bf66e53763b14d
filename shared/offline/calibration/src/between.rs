//! What differs between runs: the variance of the parameters from drive to drive.
//!
//! Loads, pressures, tyres and what the model leaves out make every drive one of a slightly different vehicle. Each run, or
//! each kind of run (straights, circles to the left, circles to the right), is taken to have parameters of its own, p + u, u normal with a variance per parameter (random effects, as in the
//! meta-analysis of DerSimonian and Laird, 1986). Whether there is such a variance is asked of Cochran's Q; how large it is
//! comes by expectation and maximisation of the restricted likelihood, on the runs' normal equations. What is found widens
//! the covariance of the mean, and is what a calibration has to allow for in the next drive.

use nalgebra::SymmetricEigen;

use crate::normal::{Normal, Square};
use crate::parameters::{COUNT, Vector};
use crate::solve::Prior;

/// Runs below which nothing can be said of what differs between them.
const LEAST_RUNS: usize = 5;
/// Deviations of Q beyond which chance does not explain it.
const SIGNIFICANT: f64 = 2.0;
/// The same of kinds of drives, of which there are few: they differ by what the model leaves out, and that no calibration
/// is free of.
const KINDS_SIGNIFICANT: f64 = 1.0;
/// Variance that the search starts from, in weak priors.
const FIRST: f64 = 0.01;
/// Largest variance, in weak priors: a vehicle that differs more from drive to drive is no longer the same one, and
/// readings that say so err otherwise.
const LARGEST: f64 = 0.25;
/// Rounds of the search at most, and the share of a variance whose change ends it.
const ROUNDS: usize = 300;
const SMALL: f64 = 1e-4;
/// Precision, in weak priors, from which a run counts as telling a direction.
const TOLD: f64 = 4.0;

/// What differs between runs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Between {
    /// Variance per parameter.
    pub(crate) variance: Vector,
    /// Mean square of what is left within runs; at least 1.
    pub(crate) within: f64,
    /// What that variance adds to the variance of the normal equations' right-hand side.
    pub(crate) score: Square,
}

/// A run's normal equations in units of the weak priors.
struct Scaled {
    information: Square,
    right: Vector,
}

/// Finds what differs between the runs of `normals`, whose fit stands at `parameters`; none where chance explains it.
///
/// Where runs of one of the `kinds` agree among themselves and the kinds do not, what differs is a vehicle per kind, not
/// per run: it does not average out over the runs of a kind.
pub(crate) fn between(
    normals: &[Normal],
    kinds: &[usize],
    parameters: &Vector,
    identified: &[bool; COUNT],
    prior: &Prior,
) -> Option<Between> {
    if normals.len() < LEAST_RUNS {
        return None;
    }
    let scale = Square::from_diagonal(&prior.scale);
    let only = Vector::from_fn(|index, _| if prior.free[index] { prior.scale[index] } else { 0.0 });
    let only = Square::from_diagonal(&only);
    let mut runs = Vec::new();
    for normal in normals {
        let (information, right, _) = normal.reduced()?;
        runs.push(Scaled { information: only * information * only, right: only * right });
    }
    let (within, deviations) = heterogeneity(normals, &runs, identified);
    let by_kind = kinds_differ(&runs, kinds, within, identified) > KINDS_SIGNIFICANT;
    if deviations <= SIGNIFICANT && !by_kind {
        return None;
    }
    let own: Vec<usize> = (0..runs.len()).collect();
    let mut runs = merged(&runs, if by_kind { kinds } else { &own });
    for run in &mut runs {
        run.information /= within;
        run.right /= within;
    }
    // What the runs leave open is held by the prior, and what is not fitted stays.
    let mut held = scale * prior.weight * scale;
    let away = Vector::from_fn(|index, _| (prior.mean - parameters)[index] / prior.scale[index]);
    let pull = held * away;
    (0..COUNT).filter(|index| !prior.free[*index]).for_each(|index| held[(index, index)] = 1.0);
    let first = |index: usize, _| if identified[index] { FIRST } else { 0.0 };
    let mut variance = Vector::from_fn(first);
    let mut found = mean(&runs, &variance, &held, &pull)?;
    for _ in 0..ROUNDS {
        let next = pooled(&expected(&runs, &variance, &found)?, identified);
        let next = next.map(|variance| variance.min(LARGEST));
        let moved = (next - variance).component_div(&variance.map(|v| v.max(1e-12))).amax();
        variance = next;
        found = mean(&runs, &variance, &held, &pull)?;
        if moved < SMALL {
            break;
        }
    }
    #[allow(clippy::cast_precision_loss)] // runs
    let groups = runs.len() as f64;
    // What n groups tell of a variance is off by the share sqrt(2 / (n - 1)) of it: this much more is allowed for.
    let variance = variance * ((groups + 1.0) / (groups - 1.0));
    let variance = variance.component_mul(&prior.scale.component_mul(&prior.scale));
    let differs = Square::from_diagonal(&variance);
    let mut score = Square::zeros();
    for run in &runs {
        // Back from units of the weak priors, and of the noise within runs.
        let unscaled =
            Vector::from_fn(|i, _| if prior.free[i] { 1.0 / prior.scale[i] } else { 0.0 });
        let unscaled = Square::from_diagonal(&unscaled);
        let information = unscaled * run.information * unscaled * within;
        score += information * differs * information;
    }
    Some(Between { variance, within, score })
}

/// The normal equations of the runs of each group.
fn merged(runs: &[Scaled], groups: &[usize]) -> Vec<Scaled> {
    let count = groups.iter().max().map_or(0, |last| last + 1);
    let nothing = || Scaled { information: Square::zeros(), right: Vector::zeros() };
    let mut sums: Vec<Scaled> = (0..count).map(|_| nothing()).collect();
    for (run, group) in runs.iter().zip(groups) {
        sums[*group].information += run.information;
        sums[*group].right += run.right;
    }
    sums
}

/// What a run alone tells: in how many directions, and the square of what it says there over its noise.
fn told(run: &Scaled) -> (f64, f64) {
    let eigen = SymmetricEigen::new(run.information);
    let (mut square, mut count) = (0.0, 0.0);
    for (value, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > TOLD {
            let along = direction.dot(&run.right);
            square += along * along / value;
            count += 1.0;
        }
    }
    (square, count)
}

/// Deviations by which kinds differ more from one another than the runs of a kind do.
fn kinds_differ(runs: &[Scaled], kinds: &[usize], within: f64, identified: &[bool; COUNT]) -> f64 {
    let sum = |runs: &[Scaled]| {
        runs.iter().map(told).fold((0.0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1))
    };
    let (single, of_kinds) = (sum(runs), sum(&merged(runs, kinds)));
    let freedom = single.1 - of_kinds.1;
    let own = if freedom < 1.0 { 0.0 } else { (single.0 - of_kinds.0) / freedom };
    let taken = identified.iter().filter(|identified| **identified).count();
    #[allow(clippy::cast_precision_loss)] // few
    let freedom = of_kinds.1 - taken as f64;
    chi_square_deviations(of_kinds.0 / own.max(within), freedom)
}

/// Standard deviations by which a sum of squares exceeds its expectation (Wilson and Hilferty, 1931); 0 without freedom.
fn chi_square_deviations(square: f64, freedom: f64) -> f64 {
    if freedom < 1.0 {
        return 0.0;
    }
    let spread = 2.0 / (9.0 * freedom);
    let ratio = kerbside_geometry::math::powf(square.max(0.0) / freedom, 1.0 / 3.0);
    (ratio - 1.0 + spread) / spread.sqrt()
}

/// Parameters of one nature, which differ alike: what is seen of one is too little to tell it from the next.
const ALIKE: [&[usize]; 2] = [&[0, 1, 2, 3], &[4, 5]];

/// Variances with those of one nature alike, in weak priors, as far as they are identified.
fn pooled(variance: &Vector, identified: &[bool; COUNT]) -> Vector {
    let mut pooled = *variance;
    for alike in ALIKE {
        let of: Vec<usize> = alike.iter().copied().filter(|index| identified[*index]).collect();
        let sum: f64 = of.iter().map(|index| variance[*index]).sum();
        #[allow(clippy::cast_precision_loss)] // four at most
        let mean = sum / of.len().max(1) as f64;
        of.iter().for_each(|index| pooled[*index] = mean);
    }
    pooled
}

/// Mean square within runs, once each may have parameters of its own, and the deviations by which Cochran's Q exceeds its
/// expectation.
fn heterogeneity(normals: &[Normal], runs: &[Scaled], identified: &[bool; COUNT]) -> (f64, f64) {
    let (mut own, mut own_count) = (0.0, 0.0);
    let (mut sum, mut count) = (0.0, 0);
    for (normal, run) in normals.iter().zip(runs) {
        let (square, directions) = told(run);
        own += square;
        own_count += directions;
        sum += normal.truth.sum + normal.comparison.sum;
        count += normal.freedom();
    }
    let common = identified.iter().filter(|identified| **identified).count();
    #[allow(clippy::cast_precision_loss)] // counts
    let (left, freedom) = (count as f64 - own_count, own_count - common as f64);
    if freedom < 1.0 {
        return (1.0, 0.0);
    }
    let within = if left > 0.0 { ((sum - own) / left).max(1.0) } else { 1.0 };
    (within, chi_square_deviations(own / within, freedom))
}

/// The parameters' mean for given variances.
struct Mean {
    covariance: Square,
    change: Vector,
}

/// Covariance of a run's own deviation given its readings and the mean.
fn own(run: &Scaled, variance: &Vector) -> Option<Square> {
    let root = Square::from_diagonal(&variance.map(f64::sqrt));
    let inverse = (Square::identity() + root * run.information * root).cholesky()?.inverse();
    Some(root * inverse * root)
}

fn mean(runs: &[Scaled], variance: &Vector, held: &Square, pull: &Vector) -> Option<Mean> {
    let (mut weight, mut right) = (*held, *pull);
    for run in runs {
        let taken = run.information * own(run, variance)?;
        weight += run.information - taken * run.information;
        right += run.right - taken * run.right;
    }
    let covariance = weight.cholesky()?.inverse();
    Some(Mean { covariance, change: covariance * right })
}

/// The variances that the runs' deviations show, those being known as well as `variance` lets them be.
fn expected(runs: &[Scaled], variance: &Vector, found: &Mean) -> Option<Vector> {
    let mut sum = Vector::zeros();
    for run in runs {
        let own = own(run, variance)?;
        let deviation = own * (run.right - run.information * found.change);
        let gain = own * run.information;
        let spread = own + gain * found.covariance * gain.transpose();
        sum += deviation.component_mul(&deviation) + spread.diagonal();
    }
    #[allow(clippy::cast_precision_loss)] // runs
    let count = runs.len() as f64;
    Some(sum / count)
}

#[cfg(test)]
mod tests {
    use nalgebra::SMatrix;

    use super::*;

    /// Runs that each tell the first parameter to one thousandth of its prior, off by `apart` of these.
    fn runs(apart: &[f64]) -> Vec<Normal> {
        let precise = 1e6;
        let run = |off: &f64| {
            let mut normal = Normal::empty();
            normal.parameters[(0, 0)] = precise;
            normal.right[0] = precise * off * 1e-3;
            // The start pose is told by itself.
            normal.mixed = SMatrix::zeros();
            normal.start.fill_with_identity();
            normal.truth = crate::normal::Squares { sum: 10.0 + off * off, count: 14 };
            normal
        };
        apart.iter().map(run).collect()
    }

    fn found(apart: &[f64]) -> Option<Between> {
        let kinds: Vec<usize> = (0..apart.len()).collect();
        found_of(apart, &kinds)
    }

    fn found_of(apart: &[f64], kinds: &[usize]) -> Option<Between> {
        let mut free = [false; COUNT];
        free[0] = true;
        let (scale, weight) = (Vector::repeat(1.0), Square::zeros());
        let prior = Prior { mean: Vector::zeros(), weight, scale, free };
        between(&runs(apart), kinds, &Vector::zeros(), &free, &prior)
    }

    #[test]
    fn what_chance_explains_is_no_difference() {
        assert!(found(&[0.9, -1.1, 0.4, -0.5, 1.2, -0.9, 0.1, -0.1]).is_none());
        assert!(found(&[9.0, -11.0, 4.0]).is_none(), "of so few runs nothing is said");
        let kinds = [0, 1, 0, 1, 0, 1, 0, 1];
        assert!(found_of(&[0.9, -1.1, 0.4, -0.5, -1.2, 0.9, 0.1, -0.1], &kinds).is_none());
    }

    #[test]
    fn a_difference_is_found_in_its_size() {
        // Scattered by 10 noises: a variance of (10^2 - 1) noises, of mean 0; of ten, 11/9 of that is allowed for.
        let apart = [9.0, -11.0, 12.0, -8.0, 10.0, -10.0, 11.0, -13.0, 9.0, -9.0];
        let found = found(&apart).unwrap();
        let deviation = found.variance[0].sqrt();
        assert!((0.0105..0.0133).contains(&deviation), "{deviation}");
        assert!((found.within - 1.0).abs() < 1e-9);
        // 10 runs, each of weight 1e6, whose variance adds up.
        let score = 10.0 * 1e12 * found.variance[0];
        assert!((found.score[(0, 0)] / score - 1.0).abs() < 1e-9);
        assert_eq!(found.variance[1], 0.0);
    }

    #[test]
    fn what_differs_by_kind_does_not_average_out() {
        // Two kinds that agree within themselves, apart by 20 noises.
        let apart = [9.5, 10.5, 10.0, 9.0, 11.0, -9.5, -10.5, -10.0, -9.0, -11.0];
        let kinds = [0, 0, 0, 0, 0, 1, 1, 1, 1, 1];
        let found = found_of(&apart, &kinds).unwrap();
        // The variance of two values at a distance of 20 about their mean is 200; of two, three times that is allowed for.
        let deviation = found.variance[0].sqrt();
        assert!((0.0230..0.0255).contains(&deviation), "{deviation}");
        // Two kinds, each of five runs of weight 1e6.
        let score = 2.0 * 25.0 * 1e12 * found.variance[0];
        assert!((found.score[(0, 0)] / score - 1.0).abs() < 1e-9);
    }
}
