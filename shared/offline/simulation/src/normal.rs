//! Standard normal deviates whose bits depend on the seed alone.
//!
//! The crates made for this take logarithm and exponential from the C library, at least when some
//! other crate of the build asks for it, and so give other bits on another machine. Marsaglia's
//! polar method needs one logarithm and one square root for two deviates, and the logarithm comes
//! from the one door.

use kerbside_geometry::math;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// A seeded source of deviates.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    generator: Pcg64,
    spare: Option<f64>,
}

impl Normal {
    /// The stream of `seed`.
    pub(crate) fn new(seed: u64) -> Self {
        Self { generator: Pcg64::seed_from_u64(seed), spare: None }
    }

    /// Evenly distributed in 0..1.
    pub(crate) fn uniform(&mut self) -> f64 {
        let bits = self.generator.next_u64() >> 11;
        #[allow(clippy::cast_precision_loss)] // 53 bits are exact.
        let numerator = bits as f64;
        numerator * (0.5_f64).powi(53)
    }

    /// Normally distributed with mean 0 and standard deviation 1.
    ///
    /// G. Marsaglia, T. A. Bray, "A convenient method for generating normal variables", SIAM Review
    /// 6 (1964).
    pub(crate) fn sample(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        loop {
            let (u, v) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let square = u * u + v * v;
            if square > 0.0 && square < 1.0 {
                let factor = (-2.0 * math::ln(square) / square).sqrt();
                self.spare = Some(v * factor);
                return u * factor;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_and_tails_are_those_of_the_normal_distribution() {
        let mut normal = Normal::new(3);
        let count = 200_000;
        let (mut moments, mut beyond) = ([0.0; 4], 0);
        for _ in 0..count {
            let sample = normal.sample();
            let powers = [sample, sample.powi(2), sample.powi(3), sample.powi(4)];
            (0..4).for_each(|power| moments[power] += powers[power] / f64::from(count));
            beyond += i32::from(sample.abs() > 1.959_964);
        }
        // Five standard errors each.
        for (moment, (mean, error)) in
            moments.iter().zip([(0.0, 1.0), (1.0, 1.41), (0.0, 3.87), (3.0, 9.8)])
        {
            assert!((moment - mean).abs() < 5.0 * error / f64::from(count).sqrt(), "{moments:?}");
        }
        assert!((f64::from(beyond) / f64::from(count) - 0.05).abs() < 0.0025, "{beyond}");
    }

    #[test]
    fn the_stream_of_a_seed_is_the_same_everywhere() {
        let mut normal = Normal::new(42);
        let bits: [u64; 3] = core::array::from_fn(|_| normal.sample().to_bits());
        assert_eq!(bits, [0xbfe8_7ec6_7340_35e0, 0xbfe7_5e01_1a25_8895, 0x3ff9_8e4f_00e2_68a6]);
    }
}
