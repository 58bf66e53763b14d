//! Standard normal deviates whose bits depend on seed and stream alone.
//!
//! Every sensor draws from a stream of its own: one that is left out, or read at another rate, does not change what
//! the others draw, so runs with and without it are compared in pairs.

use kerbside_geometry::math;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// A seeded source of deviates.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    generator: Pcg64,
}

impl Normal {
    /// Stream number `stream` of `seed`.
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        // Weyl's sequence moves the streams far apart; the generator's own seeding mixes the bits.
        let seed = seed ^ stream.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(17);
        Self { generator: Pcg64::seed_from_u64(seed) }
    }

    /// Evenly distributed in 0..1.
    pub(crate) fn uniform(&mut self) -> f64 {
        let bits = self.generator.next_u64() >> 11;
        #[allow(clippy::cast_precision_loss)] // 53 bits are exact.
        let numerator = bits as f64;
        numerator * (0.5_f64).powi(53)
    }

    /// Two independent deviates with mean 0 and standard deviation 1.
    ///
    /// G. Marsaglia, T. A. Bray, "A convenient method for generating normal variables", SIAM Review 6 (1964).
    pub(crate) fn pair(&mut self) -> [f64; 2] {
        loop {
            let (u, v) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let square = u * u + v * v;
            if square > 0.0 && square < 1.0 {
                let factor = (-2.0 * math::ln(square) / square).sqrt();
                return [u * factor, v * factor];
            }
        }
    }

    /// A deviate with mean 0 and standard deviation 1.
    pub(crate) fn sample(&mut self) -> f64 {
        self.pair()[0]
    }

    /// A deviate with mean 0 and this standard deviation; nothing is drawn for 0.
    pub(crate) fn scaled(&mut self, deviation: f64) -> f64 {
        if deviation == 0.0 { 0.0 } else { deviation * self.sample() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_normal_distribution_and_streams_are_independent() {
        let (mut one, mut other) = (Normal::new(3, 0), Normal::new(3, 1));
        let count = 100_000;
        let (mut moments, mut product) = ([0.0; 4], 0.0);
        for _ in 0..count {
            let [a, b] = one.pair();
            for sample in [a, b] {
                let powers = [sample, sample.powi(2), sample.powi(3), sample.powi(4)];
                (0..4).for_each(|power| moments[power] += powers[power] / f64::from(2 * count));
            }
            product += a * other.sample() / f64::from(count);
        }
        // Five standard errors each.
        let errors = [(0.0, 1.0), (1.0, 1.41), (0.0, 3.87), (3.0, 9.8)];
        for (moment, (mean, error)) in moments.iter().zip(errors) {
            assert!(
                (moment - mean).abs() < 5.0 * error / f64::from(2 * count).sqrt(),
                "{moments:?}"
            );
        }
        assert!(product.abs() < 5.0 / f64::from(count).sqrt(), "{product}");
    }
}
