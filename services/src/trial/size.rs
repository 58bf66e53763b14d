//! How large an effect is in a case, in standard deviations of the noise: d.
//!
//! The difference that the effect makes to every channel without noise, whitened by the plant's own noise; what start
//! poses, differences from run to run and the stated uncertainty could make of it is taken away: the first without a
//! prior, the others with theirs. Of two effects each is measured with the other present, and the smaller counts.
//!
//! Noise is modelled per channel: an autoregressive process of order [`ORDER`], fitted to what several seeds of noise
//! and disturbances do to each run, pooled over runs and seeds; the first rows of a run by their own scatter. That
//! noise of one channel is correlated with that of another is left out.

use kerbside_proving_ground::cases::{Case, Drives, Errors, Plan, Rows};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Order of the noise's model.
const ORDER: usize = 8;
/// Seeds of noise per run.
const SEEDS: u64 = 3;
/// Share of an uncertainty by which runs differ.
const VARIATION: f64 = 0.3;
/// What differs from run to run.
const VARIES: [&str; 3] = ["speed_gain.gain", "steering_offset.offset", "gyro_bias.bias"];
/// Standard deviation of a start that nobody knows \[m\], \[rad\].
const ANYWHERE: f64 = 10.0;
/// Channels: wheels, steering, gyro, x, y, yaw.
const CHANNELS: usize = 9;

/// Values of a run, channel by channel; a channel without rows is empty.
type Channels = [Vec<f64>; CHANNELS];

fn channels(rows: &Rows) -> Channels {
    let mut out: Channels = Default::default();
    for row in &rows.counts {
        for (wheel, count) in row.value.iter().enumerate() {
            out[wheel].extend(count);
        }
    }
    for row in &rows.speeds {
        for (wheel, speed) in row.value.iter().enumerate() {
            out[wheel].push(*speed);
        }
    }
    out[4].extend(rows.steering.iter().map(|row| row.value));
    out[5].extend(rows.yaw_rate.iter().map(|row| row.value));
    for row in &rows.reference {
        let (x, y, yaw) = row.value;
        out[6].push(x);
        out[7].push(y);
        out[8].extend(yaw);
    }
    out
}

fn minus(a: &Channels, b: &Channels) -> Channels {
    core::array::from_fn(|c| a[c].iter().zip(&b[c]).map(|(a, b)| a - b).collect())
}

/// The noise of one channel.
#[derive(Clone, Debug, Default)]
struct Colour {
    /// Of the rows before, the nearest first.
    weights: Vec<f64>,
    /// Of what they leave.
    deviation: f64,
    /// Of the first rows, each as it scatters.
    first: f64,
}

impl Colour {
    /// Fitted to what several drives show of it.
    fn fitted(series: &[&Vec<f64>]) -> Self {
        let mut normal = DMatrix::<f64>::zeros(ORDER, ORDER);
        let mut right = DVector::<f64>::zeros(ORDER);
        let (mut first, mut firsts) = (0.0, 0.0);
        let rows = || series.iter().flat_map(|values| values.windows(ORDER + 1));
        for window in rows() {
            let before = DVector::from_fn(ORDER, |i, _| window[ORDER - 1 - i]);
            normal += &before * before.transpose();
            right += before * window[ORDER];
        }
        for value in series.iter().flat_map(|values| values.iter().take(ORDER)) {
            first += value * value;
            firsts += 1.0;
        }
        // A little more than nothing, so that a silent channel is no division by zero.
        let small = 1e-9 * (normal.trace() / 8.0).max(1e-12);
        normal += DMatrix::identity(ORDER, ORDER) * small;
        let weights = normal
            .cholesky()
            .map_or_else(|| vec![0.0; ORDER], |root| root.solve(&right).as_slice().to_vec());
        let left = |window: &[f64]| rest(&weights, window);
        let (sum, count) = rows()
            .fold((0.0, 0.0), |(sum, count), window| (sum + left(window).powi(2), count + 1.0));
        let root = |sum: f64, count: f64| (sum / f64::max(count, 1.0)).sqrt().max(1e-9);
        let deviation = root(sum, count);
        Self { deviation, first: root(first, firsts).max(deviation), weights }
    }

    fn whitened(&self, values: &[f64], out: &mut Vec<f64>) {
        out.extend(values.iter().take(ORDER).map(|value| value / self.first));
        let later = values.windows(ORDER + 1);
        out.extend(later.map(|window| rest(&self.weights, window) / self.deviation));
    }
}

/// What the rows before do not say of the last.
fn rest(weights: &[f64], window: &[f64]) -> f64 {
    let order = weights.len();
    let said: f64 =
        weights.iter().enumerate().map(|(i, weight)| weight * window[order - 1 - i]).sum();
    window[order] - said
}

/// Everything that a case's effects are measured with.
struct Gauge<'a> {
    case: &'a Case,
    plant: &'a dyn Drives,
    with: Vec<Channels>,
    colours: Vec<Colour>,
}

impl<'a> Gauge<'a> {
    fn new(case: &'a Case, plant: &'a dyn Drives) -> Self {
        let with = silent(case, plant);
        let mut noises: Vec<Channels> = Vec::new();
        for (plan, silent) in case.specification.runs.iter().zip(&with) {
            // The silent drive with this run's own differences would be better; they are among the nuisances.
            let noisy = |seed| {
                channels(&case.record_by(plant, &unvaried(plan), true, Errors::Unwrapped(seed)))
            };
            let mut all: Vec<Channels> =
                (1..=SEEDS).map(|seed| minus(&noisy(seed), silent)).collect();
            all.iter_mut().for_each(counted_from_start);
            noises.extend(all);
        }
        let colour =
            |c: usize| Colour::fitted(&noises.iter().map(|noise| &noise[c]).collect::<Vec<_>>());
        Self { case, plant, with, colours: (0..CHANNELS).map(colour).collect() }
    }

    fn whitened(&self, run: &Channels) -> Vec<f64> {
        let mut out = Vec::new();
        for (values, colour) in run.iter().zip(&self.colours) {
            colour.whitened(values, &mut out);
        }
        out
    }

    /// By run, what the nuisances could do: columns of one standard deviation each, whitened.
    fn nuisances(&self) -> Vec<Nuisance> {
        let mut all = Vec::new();
        for (name, other) in self.case.deviations() {
            let runs = silent(&other, self.plant);
            let by_run: Vec<Vec<f64>> =
                runs.iter().zip(&self.with).map(|(a, b)| self.whitened(&minus(a, b))).collect();
            if VARIES.contains(&name.as_str()) {
                for (run, column) in by_run.iter().enumerate() {
                    let scaled = column.iter().map(|value| VARIATION * value).collect();
                    all.push(Nuisance { parts: vec![(run, scaled)] });
                }
            }
            all.push(Nuisance { parts: by_run.into_iter().enumerate().collect() });
        }
        for (run, plan) in self.case.specification.runs.iter().enumerate() {
            for direction in 0..3 {
                let column = self.whitened(&moved(&self.with[run], plan, direction));
                all.push(Nuisance { parts: vec![(run, column)] });
            }
        }
        all
    }
}

/// A column of the runs that it shows in.
struct Nuisance {
    parts: Vec<(usize, Vec<f64>)>,
}

impl Nuisance {
    fn times(&self, by_run: &[Vec<f64>]) -> f64 {
        self.parts.iter().map(|(run, column)| dot(column, &by_run[*run])).sum()
    }

    fn times_other(&self, other: &Self) -> f64 {
        let pairs = self.parts.iter().flat_map(|a| other.parts.iter().map(move |b| (a, b)));
        pairs.filter(|(a, b)| a.0 == b.0).map(|(a, b)| dot(&a.1, &b.1)).sum()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn silent(case: &Case, plant: &dyn Drives) -> Vec<Channels> {
    let runs = case.specification.runs.iter();
    runs.map(|plan| channels(&case.record_by(plant, plan, true, Errors::None))).collect()
}

fn unvaried(plan: &Plan) -> Plan {
    Plan { variation: Vec::new(), ..plan.clone() }
}

/// A counter's first fraction is no noise of the rows behind it.
fn counted_from_start(noise: &mut Channels) {
    for wheel in &mut noise[..4] {
        let mean = wheel.iter().take(ORDER).sum::<f64>() / ORDER as f64;
        wheel.iter_mut().for_each(|value| *value -= mean);
    }
}

/// What a start that is off by [`ANYWHERE`] in x, y or yaw does to a run: the last to first order.
fn moved(run: &Channels, plan: &Plan, direction: usize) -> Channels {
    let mut out: Channels = core::array::from_fn(|c| vec![0.0; run[c].len()]);
    let rows = run[6].len();
    match direction {
        0 => out[6] = vec![ANYWHERE; rows],
        1 => out[7] = vec![ANYWHERE; rows],
        _ => {
            out[6] = run[7].iter().map(|y| -ANYWHERE * (y - plan.start.y)).collect();
            out[7] = run[6].iter().map(|x| ANYWHERE * (x - plan.start.x)).collect();
            out[8] = vec![ANYWHERE; run[8].len()];
        }
    }
    out
}

/// Inner products in which noise is white, and what the nuisances can do counts for nothing.
pub(super) struct Measure<'a> {
    gauge: Gauge<'a>,
    nuisances: Vec<Nuisance>,
    root: Option<Cholesky<f64, Dyn>>,
}

/// What a change of the case does to all runs, whitened, and its inner products with the nuisances.
#[derive(Clone, Debug)]
pub(super) struct Change {
    by_run: Vec<Vec<f64>>,
    along: DVector<f64>,
}

impl Change {
    /// This one less `other`, times `factor`.
    pub(super) fn minus(&self, other: &Self, factor: f64) -> Self {
        let less = |(a, b): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
            a.iter().zip(b).map(|(a, b)| (a - b) * factor).collect()
        };
        Self {
            by_run: self.by_run.iter().zip(&other.by_run).map(less).collect(),
            along: (&self.along - &other.along) * factor,
        }
    }
}

impl<'a> Measure<'a> {
    /// About a case that holds at least one effect.
    pub(super) fn new(case: &'a Case, plant: &'a dyn Drives) -> Self {
        let gauge = Gauge::new(case, plant);
        let nuisances = gauge.nuisances();
        let count = nuisances.len();
        let mut normal = DMatrix::<f64>::identity(count, count);
        for i in 0..count {
            for j in 0..=i {
                let value = nuisances[i].times_other(&nuisances[j]);
                normal[(i, j)] += value;
                if i != j {
                    normal[(j, i)] += value;
                }
            }
        }
        Self { gauge, nuisances, root: normal.cholesky() }
    }

    /// What sets the case as it is apart from `other`.
    pub(super) fn change(&self, other: &Case) -> Change {
        let without = silent(other, self.gauge.plant);
        let pairs = self.gauge.with.iter().zip(&without);
        let by_run: Vec<Vec<f64>> = pairs.map(|(a, b)| self.gauge.whitened(&minus(a, b))).collect();
        let along = self.nuisances.iter().map(|nuisance| nuisance.times(&by_run));
        let along = DVector::from_iterator(self.nuisances.len(), along);
        Change { by_run, along }
    }

    /// The inner product of two changes.
    pub(super) fn product(&self, one: &Change, other: &Change) -> f64 {
        let whole: f64 = one.by_run.iter().zip(&other.by_run).map(|(a, b)| dot(a, b)).sum();
        let taken = self.root.as_ref().map_or(0.0, |root| one.along.dot(&root.solve(&other.along)));
        whole - taken
    }

    /// How far apart they are, in standard deviations.
    pub(super) fn length(&self, change: &Change) -> f64 {
        self.product(change, change).max(0.0).sqrt()
    }
}

/// The size of each effect of a case, with the others present, in their order; of a plant that does not know the effects
/// it is 0.
#[must_use]
pub(super) fn sizes(case: &Case, measure: &Measure<'_>) -> Vec<f64> {
    let size = |index: usize| measure.length(&measure.change(&lacking(case, index)));
    (0..case.specification.effects.len()).map(size).collect()
}

/// The case without one of its effects; its parameters then have no deviation either.
pub(super) fn lacking(case: &Case, index: usize) -> Case {
    let mut case = case.clone();
    let gone = case.specification.effects.remove(index);
    case.specification.habits.retain(|habit| habit.id != gone.id);
    case
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::Simulated;
    use kerbside_proving_ground::cases::{Kind, Request};

    fn case(id: &'static str, share: f64) -> Case {
        let kind = Kind::Single;
        let request =
            Request { ids: vec![id], share: Some(share), duration: 8.0, ..Request::new(kind) };
        (0..50).find_map(|seed| Case::of(seed, &request)).unwrap()
    }

    /// The only size.
    fn of(case: &Case) -> f64 {
        sizes(case, &Measure::new(case, &Simulated))[0]
    }

    #[test]
    fn size_grows_with_the_effect_and_stays_below_what_all_rows_could_say() {
        let case = case("gyro_bias", 0.1);
        let mut twice = case.clone();
        let bias = twice.specification.effects[0].get("bias");
        twice.specification.effects[0].values[0].1 = 2.0 * bias;
        let (one, two) = (of(&case), of(&twice));
        assert!((two / one - 2.0).abs() < 0.05, "{one} {two}");
        let rows: usize = case.specification.runs.iter().map(|plan| plan.stamps.gyro.len()).sum();
        let most = bias.abs() / case.specification.floor.gyro * (rows as f64).sqrt();
        assert!(one > 0.02 * most && one < most, "{one} of at most {most}");
    }

    #[test]
    fn what_the_description_may_be_wrong_by_hides_an_effect() {
        let case = case("gyro_gain", 0.3);
        let mut sure = case.clone();
        sure.specification.uncertainty.fields.clear();
        sure.specification.uncertainty.effects.clear();
        assert!(of(&case) < of(&sure), "{} {}", of(&case), of(&sure));
    }

    #[test]
    fn an_effect_that_a_vehicle_in_good_order_may_have_is_no_larger_than_its_allowance_says() {
        let mut case = case("gyro_bias", 0.1);
        let bias = case.specification.effects[0].get("bias").abs();
        case.specification.uncertainty.effects = vec![("gyro_bias", "bias", bias / 3.0)];
        let size = of(&case);
        assert!(size > 2.0 && size <= 3.0 + 1e-6, "{size}");
    }

    #[test]
    fn an_effect_that_acts_nowhere_has_no_size_to_speak_of() {
        let mut case = case("floor_patch", 0.3);
        let effect = &mut case.specification.effects[0];
        effect.values.iter_mut().filter(|known| known.0 == "x").for_each(|known| known.1 = 1e3);
        assert!(of(&case) < 0.01, "{}", of(&case));
    }
}
