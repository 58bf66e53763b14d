//! At which frequencies what is left of the runs swings: whitened residuals are as strong at one frequency as at any
//! other, unless something goes round and round.

use core::f64::consts::TAU;

use kerbside_geometry::math;
use rayon::prelude::*;

use crate::bench::{Bench, Whole};
use crate::bins::{CHANNELS, WIDTH, to_f64};
use crate::generic::Axis;

/// Lowest frequency \[Hz\]: slower swings are drifts.
const LOWEST: f64 = 0.2;
/// Frequencies that are looked at closely.
const MOST: usize = 3;

/// The strongest frequencies of `residuals`, and how many were compared.
pub(crate) fn strongest(bench: &Bench<'_>, residuals: &Whole) -> (Vec<Axis>, usize) {
    let grid = frequencies(bench);
    let power: Vec<f64> =
        grid.par_iter().map(|frequency| power(bench, residuals, *frequency)).collect();
    let is_peak = |i: &usize| {
        let beside = [i.checked_sub(1), Some(i + 1)];
        beside.iter().flatten().all(|j| power.get(*j).is_none_or(|other| *other <= power[*i]))
    };
    let mut peaks: Vec<usize> = (0..grid.len()).filter(is_peak).collect();
    peaks.sort_by(|a, b| power[*b].total_cmp(&power[*a]));
    peaks.truncate(MOST);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Less than 1 kHz.
    let axis = |i: usize| Axis::Oscillation { millihertz: (1e3 * grid[i]).round() as u32 };
    (peaks.into_iter().map(axis).collect(), grid.len())
}

/// A frequency in words \[mHz\]: within a bin nobody tells how often it goes round, so that faster ones look the same.
pub(crate) fn words(millihertz: u32) -> String {
    let (hertz, rate) = (1e-3 * f64::from(millihertz), 1.0 / WIDTH);
    if hertz < 0.25 * rate {
        format!("{hertz:.2} Hz")
    } else {
        format!("{hertz:.2} or {:.2} Hz", rate - hertz)
    }
}

/// Frequencies \[Hz\] that the longest run tells apart.
fn frequencies(bench: &Bench<'_>) -> Vec<f64> {
    let longest = bench.paths.iter().map(|path| path.pose.len()).max().unwrap_or(0);
    let width = bench.ready.runs.first().map_or(WIDTH, |run| run.binned.width);
    let (step, highest) = (0.5 / (width * to_f64(longest.max(2))), 0.5 / width);
    let next = |frequency: &f64| Some(frequency + step).filter(|next| *next <= highest);
    core::iter::successors(Some(LOWEST), next).collect()
}

/// How strongly whichever channel swings most does so at a frequency \[Hz\], over what noise does on average.
fn power(bench: &Bench<'_>, residuals: &Whole, frequency: f64) -> f64 {
    let mut sums = [0.0; CHANNELS];
    for (run, residual) in residuals.iter().enumerate() {
        let width = bench.ready.runs[run].binned.width;
        let (mut swing, mut count) = ([(0.0, 0.0); CHANNELS], [0.0_f64; CHANNELS]);
        for ((bin, channel), value) in bench.whiteners[run].places().zip(residual.iter()) {
            let (sin, cos) = math::sin_cos(TAU * frequency * width * to_f64(bin));
            swing[channel].0 += value * cos;
            swing[channel].1 += value * sin;
            count[channel] += 1.0;
        }
        for channel in 0..CHANNELS {
            let (cos, sin) = swing[channel];
            sums[channel] += (cos * cos + sin * sin) / count[channel].max(1.0);
        }
    }
    sums.into_iter().fold(0.0, f64::max)
}
