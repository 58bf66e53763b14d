//! Seeds, and what is drawn from them.

use kerbside_geometry::math;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// The seed of one trial of one case: differs for every trial, case and seed of the whole.
///
/// The finaliser of SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
#[must_use]
pub(crate) fn seed_of(seed: u64, case: u64, trial: u64) -> u64 {
    let mut z = seed;
    for part in [case, trial] {
        z = z
            .wrapping_add(0x9e37_79b9_7f4a_7c15)
            .wrapping_add(part.wrapping_mul(0xd134_2543_de82_ef95));
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
    }
    z
}

/// A seeded source.
#[derive(Clone, Debug)]
pub(crate) struct Random {
    generator: Pcg64,
}

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self { generator: Pcg64::seed_from_u64(seed) }
    }

    /// Evenly distributed in 0..1.
    #[allow(clippy::cast_precision_loss)] // 53 bits are exact.
    fn uniform(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 * (0.5_f64).powi(53)
    }

    /// A whole number below `count`, which is positive.
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((self.uniform() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// A deviate with mean 0 and standard deviation 1 (Marsaglia, Bray, SIAM Review 6, 1964).
    pub(crate) fn normal(&mut self) -> f64 {
        loop {
            let (u, v) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let square = u * u + v * v;
            if square > 0.0 && square < 1.0 {
                return u * (-2.0 * math::ln(square) / square).sqrt();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_differ_and_deviates_have_their_moments() {
        let mut seeds: Vec<u64> =
            (0..30).flat_map(|case| (0..30).map(move |trial| seed_of(1, case, trial))).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 900);
        let (mut random, count) = (Random::new(3), 40_000);
        let (mut mean, mut square) = (0.0, 0.0);
        for _ in 0..count {
            let deviate = random.normal();
            (mean, square) = (mean + deviate, square + deviate * deviate);
        }
        let count = f64::from(count);
        assert!((mean / count).abs() < 0.025 && (square / count - 1.0).abs() < 0.04);
        assert!((0..1000).all(|_| random.below(7) < 7));
    }
}
