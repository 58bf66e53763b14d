//! Errors that are remembered.

use kerbside_geometry::math;

use crate::normal::Normal;
use crate::sensors::Coloured;

/// A first-order Gauss-Markov process, read at rising times.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Process {
    process: Coloured,
    value: f64,
    time: Option<f64>,
}

impl Process {
    /// Not read yet.
    pub(crate) fn new(process: Coloured) -> Self {
        Self { process, value: 0.0, time: None }
    }

    /// The value at `time` \[s\], drawn from its distribution given the previous one.
    pub(crate) fn at(&mut self, time: f64, normal: &mut Normal) -> f64 {
        let Coloured { deviation, time_constant } = self.process;
        if deviation == 0.0 {
            return 0.0;
        }
        let kept = match self.time {
            Some(before) if time_constant > 0.0 => math::exp((before - time) / time_constant),
            _ => 0.0,
        };
        self.value = kept * self.value + normal.scaled(deviation * (1.0 - kept * kept).sqrt());
        self.time = Some(time);
        self.value
    }
}

/// The random part of a wheel's travel: the integral of white noise over the distance, or of a Gauss-Markov process with
/// the same density at long distances.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TravelNoise {
    density: f64,
    length: f64,
    /// Present value of the process \[1\]; none before the first metre.
    value: Option<f64>,
}

impl TravelNoise {
    /// `density` \[m/sqrt(m)\], remembered over `length` \[m\].
    pub(crate) fn new(density: f64, length: f64) -> Self {
        Self { density, length, value: None }
    }

    /// What is added over `travel` \[m\], not negative \[m\].
    ///
    /// Given the value at its beginning, the integral of the process and its value at the end are normal with the
    /// moments of Gillespie, "Exact numerical simulation of the Ornstein-Uhlenbeck process and its integral", Physical
    /// Review E 54 (1996).
    pub(crate) fn over(&mut self, travel: f64, normal: &mut Normal) -> f64 {
        if self.density == 0.0 || travel <= 0.0 {
            return 0.0;
        }
        if self.length <= 0.0 {
            return normal.scaled(self.density * travel.sqrt());
        }
        let (share, variance) =
            (travel / self.length, self.density * self.density / (2.0 * self.length));
        let value = self.value.unwrap_or_else(|| normal.scaled(variance.sqrt()));
        let lost = -math::expm1(-share);
        let kept = 1.0 - lost;
        let of_value = variance * lost * (1.0 + kept);
        let both = variance * self.length * lost * lost;
        let series = share * share * share * (2.0 / 3.0 - 0.5 * share);
        let closed = 2.0 * share - 2.0 * lost - lost * lost;
        let spread = if share < 1e-3 { series } else { closed };
        let of_integral = variance * self.length * self.length * spread;
        let [a, b] = normal.pair();
        let deviation = of_value.sqrt();
        let slope = both / deviation;
        self.value = Some(kept * value + deviation * a);
        let rest = (of_integral - slope * slope).max(0.0).sqrt();
        self.length * lost * value + slope * a + rest * b
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn variance(samples: &[f64]) -> f64 {
        samples.iter().map(|sample| sample * sample).sum::<f64>() / samples.len() as f64
    }

    /// Variance of the noise over `distance` in steps of `step`.
    fn travelled(length: f64, step: f64, steps: u32, trials: u64) -> f64 {
        let ends: Vec<_> = (0..trials)
            .map(|seed| {
                let mut normal = Normal::new(seed, 7);
                let mut noise = TravelNoise::new(1e-3, length);
                (0..steps).map(|_| noise.over(step, &mut normal)).sum::<f64>()
            })
            .collect();
        variance(&ends)
    }

    #[test]
    fn white_travel_noise_has_its_density_whatever_the_step() {
        for (step, steps) in [(0.01, 200), (0.5, 4)] {
            let ratio = travelled(0.0, step, steps, 3000) / 2e-6;
            assert!((ratio - 1.0).abs() < 5.0 * (2.0_f64 / 3000.0).sqrt(), "{ratio}");
        }
    }

    #[test]
    fn coloured_travel_noise_has_the_variance_of_the_integrated_process() {
        // Var = 2 s^2 l^2 (d - 1 + exp(-d)), d = distance / l, s^2 = density^2 / (2 l).
        for (length, step, steps) in [(0.3, 0.002, 300), (0.3, 0.6, 1), (1.0, 0.000_2, 500)] {
            let d: f64 = step * f64::from(steps) / length;
            let expected = 1e-6 * length * (d + math::expm1(-d));
            let ratio = travelled(length, step, steps, 3000) / expected;
            assert!((ratio - 1.0).abs() < 5.0 * (2.0_f64 / 3000.0).sqrt(), "{length}: {ratio}");
        }
    }

    #[test]
    fn a_process_keeps_its_variance_and_forgets_exponentially() {
        let mut normal = Normal::new(5, 0);
        let coloured = Coloured { deviation: 2.0, time_constant: 0.5 };
        let (mut process, count) = (Process::new(coloured), 100_000);
        let samples: Vec<_> =
            (0..count).map(|k| process.at(f64::from(k) * 0.1, &mut normal)).collect();
        assert!((variance(&samples) / 4.0 - 1.0).abs() < 0.05);
        let products = samples.iter().zip(&samples[5..]).map(|(a, b)| a * b).sum::<f64>();
        let correlation = products / f64::from(count) / 4.0;
        assert!((correlation - math::exp(-1.0)).abs() < 0.03, "{correlation}");
    }
}
