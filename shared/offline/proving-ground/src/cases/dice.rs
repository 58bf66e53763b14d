//! Chance.

use crate::normal::Normal;

/// A seeded source of decisions.
pub(super) struct Dice(Normal);

impl Dice {
    /// Stream number `stream` of `seed`.
    pub(super) fn new(seed: u64, stream: u64) -> Self {
        Self(Normal::new(seed, stream))
    }

    /// Evenly in `low`..`high`.
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.uniform()
    }

    /// In `low`..`high`, both positive, its logarithm evenly.
    pub(super) fn log_between(&mut self, low: f64, high: f64) -> f64 {
        use kerbside_geometry::math::{exp, ln};
        exp(self.between(ln(low), ln(high)))
    }

    /// True so often.
    pub(super) fn chance(&mut self, share: f64) -> bool {
        self.0.uniform() < share
    }

    /// A number below `count`; 0 where `count` is.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
    pub(super) fn below(&mut self, count: usize) -> usize {
        ((self.0.uniform() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// One of `choices`.
    pub(super) fn one<T: Copy>(&mut self, choices: &[T], otherwise: T) -> T {
        choices.get(self.below(choices.len())).copied().unwrap_or(otherwise)
    }

    /// A normal deviate of mean 0 that stays within twice its standard deviation.
    pub(super) fn within(&mut self, deviation: f64) -> f64 {
        loop {
            let value = self.0.sample();
            if value.abs() <= 2.0 {
                return deviation * value;
            }
        }
    }

    /// A seed for something else.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(super) fn seed(&mut self) -> u64 {
        (self.0.uniform() * 9.0e15) as u64
    }

    /// `count` different ones of `choices`, in any order.
    pub(super) fn several<T: Copy>(&mut self, choices: &[T], count: usize) -> Vec<T> {
        let mut left = choices.to_vec();
        let mut taken = Vec::new();
        while taken.len() < count && !left.is_empty() {
            let at = self.below(left.len());
            taken.push(left.swap_remove(at));
        }
        taken
    }
}
