//! The wheels' common travel over time: what a run is cut by.

use kerbside_geometry::{Vehicle, WHEELS};

use crate::run::{Run, Series};

/// Share of the wheels' travel below which the vehicle turns on the spot.
const SPIN: f64 = 0.2;
/// Time to either side over which a speed is taken \[s\].
const ABOUT: f64 = 0.2;

/// The wheels' common travel over time, by nominal radii.
pub(crate) struct Base {
    t: Vec<f64>,
    /// Travel, reverse counted like forward \[m\].
    rolled: Vec<f64>,
    /// Travel, reverse negative \[m\].
    net: Vec<f64>,
}

impl Base {
    /// None without a wheel that was read twice.
    pub(crate) fn new(run: &Run, vehicle: &Vehicle) -> Option<Self> {
        let used = run.wheels();
        let (from, to) = run.span()?;
        let wheels: Vec<(&Series, f64)> = WHEELS
            .iter()
            .filter(|wheel| used[wheel.index()])
            .filter_map(|wheel| {
                Some((run.rotation[wheel.index()].as_ref()?, vehicle.radius[wheel.index()]))
            })
            .collect();
        let clock = wheels.iter().max_by_key(|(series, _)| series.len())?.0;
        let inside = |t: &f64| (from..=to).contains(t);
        let t: Vec<f64> = clock.t.iter().copied().filter(inside).collect();
        if t.len() < 2 {
            return None;
        }
        #[allow(clippy::cast_precision_loss)] // four at most
        let share = 1.0 / wheels.len() as f64;
        let mean =
            |t: f64| wheels.iter().map(|(wheel, radius)| wheel.at(t) * radius).sum::<f64>() * share;
        let net: Vec<f64> = t.iter().map(|t| mean(*t)).collect();
        let mut rolled = vec![0.0; net.len()];
        // Wheel by wheel: a vehicle that turns on the spot rolls, too.
        for (wheel, radius) in &wheels {
            let (mut before, mut sum) = (wheel.at(from), 0.0);
            for (rolled, t) in rolled.iter_mut().zip(&t) {
                let now = wheel.at(*t);
                sum += (now - before).abs() * radius * share;
                *rolled += sum;
                before = now;
            }
        }
        Some(Self { t, rolled, net })
    }

    pub(crate) fn travel(&self) -> f64 {
        self.rolled.last().copied().unwrap_or(0.0)
    }

    /// Travel with its direction, reverse against forward, without sign \[m\].
    pub(crate) fn net(&self) -> f64 {
        (self.net[self.net.len() - 1] - self.net[0]).abs()
    }

    pub(crate) fn span(&self) -> (f64, f64) {
        (self.t[0], self.t[self.t.len() - 1])
    }

    fn interpolate(&self, values: &[f64], t: f64) -> f64 {
        let after = self.t.partition_point(|stamp| *stamp <= t);
        if after == 0 {
            return values[0];
        }
        if after == self.t.len() {
            return values[after - 1];
        }
        let share = (t - self.t[after - 1]) / (self.t[after] - self.t[after - 1]);
        values[after - 1] + share * (values[after] - values[after - 1])
    }

    /// Travel by `t` \[m\].
    pub(crate) fn rolled(&self, t: f64) -> f64 {
        self.interpolate(&self.rolled, t)
    }

    /// Speed of the common travel about `t`, without sign \[m/s\].
    pub(crate) fn speed(&self, t: f64) -> f64 {
        let (begin, end) = self.span();
        let (from, to) = ((t - ABOUT).max(begin), (t + ABOUT).min(end));
        if to > from { (self.rolled(to) - self.rolled(from)) / (to - from) } else { 0.0 }
    }

    pub(crate) fn direction(&self, from: f64, to: f64) -> f64 {
        let net = self.interpolate(&self.net, to) - self.interpolate(&self.net, from);
        if net < 0.0 { -1.0 } else { 1.0 }
    }

    /// Ends of blocks of about `length` \[m\], and every change of the direction of travel.
    pub(crate) fn boundaries(&self, length: f64) -> Vec<f64> {
        let mut times = Vec::new();
        let (mut begun, mut direction) = (0.0, 0.0);
        for index in 1..self.t.len() {
            let step = self.net[index] - self.net[index - 1];
            // On the spot there is no direction of travel to change.
            let spins = step.abs() < SPIN * (self.rolled[index] - self.rolled[index - 1]);
            let step = if spins { 0.0 } else { step };
            if step * direction < 0.0 && self.rolled[index - 1] > begun {
                times.push(self.t[index - 1]);
                begun = self.rolled[index - 1];
            }
            direction = if step == 0.0 { direction } else { step };
            if self.rolled[index] - begun >= length {
                times.push(self.t[index]);
                begun = self.rolled[index];
            }
        }
        times.push(self.t[self.t.len() - 1]);
        times
    }
}
