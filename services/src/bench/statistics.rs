//! Percentiles of latencies, and intervals of what is made of them.

use hdrhistogram::Histogram;
use kerbside_messages::Nanos;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Resamples of a bootstrap interval.
const RESAMPLES: usize = 2000;
/// Longest latency that is told apart \[ns\].
const LONGEST: u64 = 60_000_000_000;

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Latencies in blocks, as they were measured.
#[derive(Clone, Debug, Default)]
pub struct Blocks(pub Vec<Vec<Nanos>>);

impl Blocks {
    /// Percentile `quantile` of all blocks together \[us\]; not a number where nothing was measured.
    #[must_use]
    pub fn percentile(&self, quantile: f64) -> f64 {
        percentile(self.0.iter().flatten(), quantile)
    }

    /// Percentile `quantile` of each block \[us\].
    fn each(&self, quantile: f64) -> Vec<f64> {
        self.0.iter().map(|block| percentile(block, quantile)).collect()
    }

    /// Percentile `quantile` of a block; the median over blocks \[us\]. A pause of the whole machine spoils the blocks
    /// it falls into, and no others.
    #[must_use]
    pub fn percentile_of_a_block(&self, quantile: f64) -> f64 {
        median(self.each(quantile))
    }

    /// The ratio of this one's medians to `rival`'s, block by block; the median over blocks.
    #[must_use]
    pub fn ratio(&self, rival: &Self) -> Estimate {
        let pairs = self.each(0.5).into_iter().zip(rival.each(0.5));
        median_of(&pairs.map(|(ours, rivals)| ours / rivals).collect::<Vec<_>>())
    }
}

fn percentile<'a>(latencies: impl IntoIterator<Item = &'a Nanos>, quantile: f64) -> f64 {
    let Ok(mut histogram) = Histogram::<u64>::new_with_bounds(1, LONGEST, 3) else {
        return f64::NAN;
    };
    latencies.into_iter().for_each(|latency| histogram.saturating_record((*latency).max(1)));
    if histogram.is_empty() {
        return f64::NAN;
    }
    #[allow(clippy::cast_precision_loss)] // latencies are far below 2^53 ns
    let nanos = histogram.value_at_quantile(quantile) as f64;
    nanos / 1e3
}

/// The median of `values` with its bootstrap interval (Efron and Tibshirani, 1993, chapter 13: percentiles).
#[must_use]
pub fn median_of(values: &[f64]) -> Estimate {
    bootstrap(values.len(), |pick| median(pick.iter().map(|index| values[*index]).collect()))
}

/// The ratio of the medians of `ours` and `rivals`, with the interval of both drawn anew.
#[must_use]
pub fn ratio_of_medians(ours: &[f64], rivals: &[f64]) -> Estimate {
    let count = ours.len().min(rivals.len());
    bootstrap(count, |pick| {
        let of = |values: &[f64]| median(pick.iter().map(|index| values[*index]).collect());
        of(ours) / of(rivals)
    })
}

/// `statistic` of all of `count` items, and the interval in which it lies for draws with replacement.
fn bootstrap(count: usize, statistic: impl Fn(&[usize]) -> f64) -> Estimate {
    let value = statistic(&(0..count).collect::<Vec<_>>());
    if count < 2 {
        return Estimate { value, low: value, high: value };
    }
    let mut random = Pcg64::seed_from_u64(0x000b_0075_7a90);
    let mut draw = || (0..count).map(|_| random.random_range(0..count)).collect::<Vec<_>>();
    let mut drawn: Vec<f64> = (0..RESAMPLES).map(|_| statistic(&draw())).collect();
    drawn.sort_by(f64::total_cmp);
    Estimate { value, low: drawn[RESAMPLES / 40], high: drawn[RESAMPLES - 1 - RESAMPLES / 40] }
}

/// The median; not a number where there is none.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => f64::NAN,
        even if even % 2 == 0 => f64::midpoint(values[middle - 1], values[middle]),
        _ => values[middle],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_percentiles_are_those_of_the_samples() {
        assert!((median(vec![3.0, 1.0, 2.0]) - 2.0).abs() < 1e-12);
        assert!((median(vec![4.0, 1.0, 2.0, 3.0]) - 2.5).abs() < 1e-12);
        assert!(median(Vec::new()).is_nan());
        let blocks = Blocks(vec![(1..=1000).map(|us| us * 1000).collect()]);
        assert!((blocks.percentile(0.5) - 500.0).abs() < 1.0);
        assert!((blocks.percentile(0.99) - 990.0).abs() < 1.5);
        assert!(Blocks::default().percentile(0.5).is_nan());
        let paused = Blocks(vec![vec![1_000; 9], vec![1_000; 9], vec![9_000_000; 9]]);
        assert!((paused.percentile_of_a_block(0.99) - 1.0).abs() < 0.01);
        assert!(paused.percentile(0.99) > 8_000.0);
    }

    #[test]
    fn an_interval_holds_its_value_and_narrows_with_the_noise() {
        let spread = |noise: f64| {
            let values: Vec<f64> =
                (0..40).map(|k| 1.1 + noise * (f64::from(k % 9) - 4.0)).collect();
            let estimate = median_of(&values);
            assert!(estimate.low <= estimate.value && estimate.value <= estimate.high);
            estimate.high - estimate.low
        };
        assert!(spread(0.01) > 5.0 * spread(0.001));
        let ours = Blocks(vec![vec![20_000; 9]; 20]);
        let rival = Blocks(vec![vec![10_000; 9]; 20]);
        let ratio = ours.ratio(&rival);
        assert!((ratio.value - 2.0).abs() < 0.01 && ratio.high - ratio.low < 1e-9);
    }
}
