//! What a gyro says of a run's turn: over windows, its bias left open.

use crate::noise::Noise;
use crate::run::Series;

/// Readings farther apart leave a gap that nothing is said of \[s\].
const LONGEST_GAP: f64 = 0.5;
/// Share of a turn by which a gyro's scale may be off: it is taken as 1.
const SCALE: f64 = 0.01;

/// A gyro's turn over some time; its bias is in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Turned {
    /// Turn \[rad\].
    pub(crate) turn: f64,
    /// Time over which it adds up, by which a bias counts \[s\].
    pub(crate) time: f64,
    /// Variance by the readings' noise and the scale \[rad^2\].
    pub(crate) variance: f64,
}

/// What a gyro reads at rest, over the runs of a calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroBias {
    /// Mean over the runs \[rad/s\].
    pub value: f64,
    /// Standard deviation of the next run's about it, by what the runs differ \[rad/s\]; none of one run alone.
    pub deviation: Option<f64>,
}

impl GyroBias {
    /// Of biases with their variances, one a run: weighed by these and by the variance from run to run, which is that of
    /// DerSimonian and Laird (1986). None without a run.
    pub(crate) fn of(runs: &[(f64, f64)]) -> Option<Self> {
        let mean = |between: f64| {
            let weights = runs.iter().map(|run| 1.0 / (run.1 + between).max(LEAST_VARIANCE));
            let (sum, total) = weights.zip(runs).fold((0.0, 0.0), |(sum, total), (weight, run)| {
                (sum + weight * run.0, total + weight)
            });
            (sum / total, total)
        };
        let weights = || runs.iter().map(|run| 1.0 / run.1.max(LEAST_VARIANCE));
        let [_, ..] = runs else { return None };
        let (alone, total) = mean(0.0);
        if runs.len() == 1 {
            return Some(Self { value: alone, deviation: None });
        }
        let apart: f64 = weights().zip(runs).map(|(w, run)| w * (run.0 - alone).powi(2)).sum();
        let squares: f64 = weights().map(|weight| weight * weight).sum();
        #[allow(clippy::cast_precision_loss)] // runs
        let freedom = (runs.len() - 1) as f64;
        let between = ((apart - freedom) / (total - squares / total)).max(0.0);
        let (value, total) = mean(between);
        Some(Self { value, deviation: Some((between + 1.0 / total).sqrt()) })
    }
}

/// A gyro that is known exactly would leave nothing to weigh \[rad^2/s^2\].
const LEAST_VARIANCE: f64 = 1e-14;

/// A gyro's readings, ready for windows.
#[derive(Clone, Debug)]
pub(crate) struct Gyro<'a> {
    series: &'a Series,
    /// Turn by each reading since the first \[rad\].
    sums: Vec<f64>,
    /// Mean time between readings \[s\].
    step: f64,
}

impl<'a> Gyro<'a> {
    /// None of a series with less than two readings.
    pub(crate) fn new(series: &'a Series) -> Option<Self> {
        let (from, to) = series.span()?;
        if series.len() < 2 {
            return None;
        }
        let mut sums = vec![0.0];
        let mut sum = 0.0;
        for index in 1..series.len() {
            let mean = 0.5 * (series.value[index] + series.value[index - 1]);
            sum += mean * (series.t[index] - series.t[index - 1]);
            sums.push(sum);
        }
        #[allow(clippy::cast_precision_loss)] // readings
        let step = (to - from) / (series.len() - 1) as f64;
        Some(Self { series, sums, step })
    }

    /// The turn between two stamps \[s\] by the trapezoidal rule; none where the gyro was silent.
    pub(crate) fn turned(&self, from: f64, to: f64, noise: &Noise) -> Option<Turned> {
        let (begin, end) = self.series.span()?;
        if from < begin - self.step || to > end + self.step || self.gap(from, to) {
            return None;
        }
        let (turn, time) = (self.sum(to) - self.sum(from), to - from);
        let read = noise.gyro * noise.gyro * self.step * time.max(self.step);
        let scale = SCALE * turn;
        Some(Turned { turn, time, variance: read + scale * scale })
    }

    fn gap(&self, from: f64, to: f64) -> bool {
        let t = &self.series.t;
        let first = t.partition_point(|stamp| *stamp <= from).saturating_sub(1);
        let last = t.partition_point(|stamp| *stamp < to).min(t.len() - 1);
        let longest = LONGEST_GAP.max(3.0 * self.step);
        t[first..=last].windows(2).any(|pair| pair[1] - pair[0] > longest)
    }

    /// Turn by `t` since the first reading \[rad\]; the rate is held beyond both ends.
    fn sum(&self, t: f64) -> f64 {
        let stamps = &self.series.t;
        let last = self.sums.len() - 1;
        let before = stamps.partition_point(|stamp| *stamp <= t).saturating_sub(1).min(last);
        let rate = 0.5 * (self.series.value[before] + self.series.at(t));
        self.sums[before] + rate * (t - stamps[before])
    }
}

#[cfg(test)]
mod tests {
    use kerbside_geometry::Vehicle;

    use super::*;

    #[test]
    fn windows_add_up_to_the_whole() {
        let noise = Noise::of(&Vehicle::paper_car());
        let t: Vec<f64> = (0..=100).map(|index| 0.01 * f64::from(index)).collect();
        let series = Series { value: t.iter().map(|t| 2.0 * t).collect(), t };
        let gyro = Gyro::new(&series).unwrap();
        let turn = |from, to| gyro.turned(from, to, &noise).unwrap().turn;
        assert!((turn(0.0, 1.0) - 1.0).abs() < 1e-12);
        assert!((turn(0.0, 0.503) - 0.503 * 0.503).abs() < 1e-12);
        assert!((turn(0.0, 0.503) + turn(0.503, 1.0) - 1.0).abs() < 1e-12);
        assert!(gyro.turned(0.5, 1.5, &noise).is_none(), "it ends before");
    }

    #[test]
    fn nothing_is_said_over_a_gap() {
        let noise = Noise::of(&Vehicle::paper_car());
        let series = Series { t: vec![0.0, 0.1, 0.2, 2.0, 2.1], value: vec![0.1; 5] };
        let gyro = Gyro::new(&series).unwrap();
        assert!(gyro.turned(0.1, 2.05, &noise).is_none());
        assert!(gyro.turned(0.0, 0.15, &noise).is_some());
    }

    #[test]
    fn biases_are_weighed_and_their_scatter_is_told() {
        assert_eq!(GyroBias::of(&[]), None);
        assert_eq!(GyroBias::of(&[(0.01, 1e-8)]), Some(GyroBias { value: 0.01, deviation: None }));
        // Apart by far more than they are uncertain: the mean, and how they scatter.
        let found = GyroBias::of(&[(0.001, 1e-10), (0.003, 1e-10), (0.005, 1e-10)]).unwrap();
        assert!((found.value - 0.003).abs() < 1e-6, "{found:?}");
        let deviation = found.deviation.unwrap();
        assert!((deviation - (4e-6_f64 * (1.0 + 1.0 / 3.0)).sqrt()).abs() < 1e-5, "{deviation}");
        // As chance puts them: the better known one counts more.
        let found = GyroBias::of(&[(0.0, 1e-6), (0.0005, 4e-6)]).unwrap();
        assert!((found.value - 0.0001).abs() < 1e-9, "{found:?}");
        assert!((found.deviation.unwrap() - 8e-7_f64.sqrt()).abs() < 1e-9);
    }
}
