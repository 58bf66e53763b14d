//! Noise as the model has it.

use core::f64::consts::TAU;

use kerbside_geometry::math;
use rand::{Rng, RngExt};

use super::filter::Model;
use super::{Coefficients, Noise};
use crate::bins::Channels;

/// Draws the residuals of a run whose model is right.
pub(crate) fn draw(
    coefficients: &Coefficients,
    noise: &Noise,
    random: &mut impl Rng,
) -> Vec<Channels> {
    Model::new(coefficients, noise, true).draw(coefficients, || normal(random))
}

/// A normal deviate, by the formula of Box and Muller.
pub(crate) fn normal(random: &mut impl Rng) -> f64 {
    let (u, v): (f64, f64) = (random.random(), random.random());
    (-2.0 * math::ln(1.0 - u)).sqrt() * math::cos(TAU * v)
}
