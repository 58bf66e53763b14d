//! Steering readings by the travel for which they hold.

use crate::noise::Settings;
use crate::run::Series;
use crate::travel::Base;

/// The steering readings within a block, weighed by travel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Reading {
    /// Mean \[rad\].
    pub(crate) mean: f64,
    /// How far the true angle strays from it within the block, standard deviation \[rad\].
    pub(crate) spread: f64,
    /// Variance of the mean over that of one reading.
    pub(crate) variance_factor: f64,
}

/// Steering readings, each holding for the travel nearest to it in time.
pub(crate) struct Cells {
    /// Travel at the cell's beginning and end \[m\], and the reading \[rad\].
    cells: Vec<(f64, f64, f64)>,
    at: usize,
}

impl Cells {
    pub(crate) fn new(series: &Series, base: &Base) -> Self {
        let count = series.len();
        let edge = |index: usize| match index {
            0 => 0.0,
            _ if index >= count => base.travel(),
            _ => base.rolled(0.5 * (series.t[index - 1] + series.t[index])),
        };
        let cells: Vec<_> =
            (0..count).map(|index| (edge(index), edge(index + 1), series.value[index])).collect();
        let cells = cells.into_iter().filter(|(from, to, _)| to > from).collect();
        Self { cells, at: 0 }
    }

    /// The readings between two travels, in ascending order of calls.
    pub(crate) fn read(&mut self, from: f64, to: f64, settings: &Settings) -> Reading {
        while self.at + 1 < self.cells.len() && self.cells[self.at].1 <= from {
            self.at += 1;
        }
        let (mut sum, mut first, mut second, mut error) = (0.0, 0.0, 0.0, 0.0);
        for (begin, end, reading) in &self.cells[self.at..] {
            if *begin >= to {
                break;
            }
            let weight = end.min(to) - begin.max(from);
            if weight <= 0.0 {
                continue;
            }
            sum += weight;
            first += weight * reading;
            second += weight * reading * reading;
            // Half a cell's error is the other half's too: counted so, the blocks' sum is right.
            error += weight * (end - begin);
        }
        if sum <= 0.0 {
            let mean = self.cells.get(self.at).map_or(0.0, |(_, _, reading)| *reading);
            return Reading { mean, spread: 0.0, variance_factor: 1.0 };
        }
        let mean = first / sum;
        let noise = settings.noise.steering * settings.noise.steering;
        let variance = second / sum - mean * mean - noise;
        let spread = if variance > 3.0 * noise { variance.sqrt() } else { 0.0 };
        Reading { mean, spread, variance_factor: error / (sum * sum) }
    }
}
