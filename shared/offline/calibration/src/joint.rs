//! The joint fit: maximum likelihood over all runs and samples.

use kerbside_geometry::{Pose, Vehicle};

use crate::between::between;
use crate::condense::Condensed;
use crate::error::CalibrationError;
use crate::gyro::GyroBias;
use crate::information::{Information, only_where_open, prior};
use crate::kinds::kinds;
use crate::noise::Settings;
use crate::normal::{Normal, Square, Squares};
use crate::parameters::{COUNT, Parameters, Vector};
use crate::solve::{Fit, Prior, first_start, fit};

/// Why a run does not count.
#[derive(Clone, Debug, PartialEq)]
pub struct Rejected {
    /// The run.
    pub run: String,
    /// Why, with the evidence; a sentence for people.
    pub why: String,
}

/// Residuals of one run about the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct RunResiduals {
    /// The run.
    pub run: String,
    /// Travel by the nominal radii \[m\].
    pub travel: f64,
    /// Root mean square of the residuals of poses, distance and turn, in standard deviations (1 is as believed).
    pub truth: f64,
    /// How many of those there are.
    pub truth_count: usize,
    /// Root mean square of what front wheels, rear wheels and steering disagree on, in standard deviations.
    pub comparison: f64,
    /// How many of those there are.
    pub comparison_count: usize,
    /// By how much the reference's stamps are late at the end, where that was fitted \[s\].
    pub lag: Option<f64>,
    /// Estimated true pose at the start, reference frame.
    pub start: Pose,
}

/// A joint fit in numbers.
#[derive(Clone, Debug)]
pub(crate) struct JointFit {
    pub(crate) parameters: Parameters,
    pub(crate) information: Information,
    /// Includes what is left of the prior and the inflation.
    pub(crate) covariance: Square,
    /// Factor on the variances: 1 where residuals are no larger than believed.
    pub(crate) inflation: f64,
    /// Variances of the parameters from drive to drive; 0 where chance explains what differs.
    pub(crate) between: Vector,
    /// What the gyro reads at rest, where it tells of the turn.
    pub(crate) gyro_bias: Option<GyroBias>,
    /// Mean squares of the residuals of poses and of comparisons.
    pub(crate) truth: f64,
    pub(crate) comparison: f64,
    pub(crate) freedom: usize,
    pub(crate) residuals: Vec<RunResiduals>,
    pub(crate) rejected: Vec<Rejected>,
}

/// Fits all of `runs`, rejecting outliers, from `first`.
pub(crate) fn joint_fit(
    runs: &[&Condensed],
    vehicle: &Vehicle,
    first: &Parameters,
    settings: &Settings,
) -> Result<JointFit, CalibrationError> {
    if runs.is_empty() {
        return Err(CalibrationError::NoRuns);
    }
    let prior = prior(runs, vehicle, settings);
    let starts = runs.iter().map(|run| first_start(run, first, settings)).collect();
    // Least squares find the valley; only there do large residuals tell outliers from a bad start.
    let whole = fit(runs, *first, starts, &prior, settings, f64::INFINITY)?;
    let mut kept: Vec<&Condensed> = runs.to_vec();
    let mut state = robust(&kept, whole, &prior, settings)?;
    let mut rejected = Vec::new();
    while let Some((index, why)) = outlier(&state, &kept, runs.len(), settings) {
        rejected.push(Rejected { run: kept[index].name.clone(), why });
        kept.remove(index);
        state.starts.remove(index);
        state.normals.remove(index);
        state = robust(&kept, state, &prior, settings)?;
    }
    finish(&kept, state, &prior, settings, rejected)
}

/// Rounds in which the scale of the residuals settles.
const ROUNDS: usize = 3;

/// A robust fit whose prior holds only what the runs leave open.
///
/// What is weighed down is judged by the residuals that there are: where the noise is larger than believed
/// everywhere, a residual of three believed deviations is an ordinary one.
fn robust(
    runs: &[&Condensed],
    from: Fit,
    prior: &Prior,
    settings: &Settings,
) -> Result<Fit, CalibrationError> {
    let (mut state, mut scale) = (from, f64::INFINITY);
    for _ in 0..ROUNDS {
        let next = typical(&state).sqrt();
        if next > 0.9 * scale {
            break;
        }
        scale = next;
        state = fit(runs, state.parameters, state.starts, prior, settings, settings.huber * scale)?;
    }
    let open = held(prior, &state, settings);
    let state = fit(runs, state.parameters, state.starts, &open, settings, settings.huber * scale)?;
    without_strays(runs, state, &open, settings, settings.huber * scale)
}

/// Weak priors by which a parameter that the runs do not identify may be off its nominal value.
const STRAY: f64 = 2.0;

/// The fit again, with those parameters fixed at their nominal values that it does not identify and has yet drawn to where
/// nobody believes them: there they make up for what the model leaves out, and spoil the others.
fn without_strays(
    runs: &[&Condensed],
    state: Fit,
    open: &Prior,
    settings: &Settings,
    limit: f64,
) -> Result<Fit, CalibrationError> {
    let told = Information::new(state.information() / typical(&state), open, settings);
    let (mut fixed, mut parameters) = (*open, state.parameters);
    for index in 0..COUNT {
        let off = (parameters.values[index] - open.mean[index]).abs() / open.scale[index];
        if open.free[index] && !told.identified[index] && off > STRAY {
            fixed.free[index] = false;
            parameters.values[index] = open.mean[index];
        }
    }
    if fixed.free == open.free {
        return Ok(state);
    }
    fit(runs, parameters, state.starts, &fixed, settings, limit)
}

/// The prior as the runs leave it open, in the unit of their residuals: where these are larger than believed the runs tell
/// less, and what they leave open stays where the vehicle's file has it.
fn held(prior: &Prior, state: &Fit, settings: &Settings) -> Prior {
    let scale = typical(state);
    let open = only_where_open(prior, &(state.information() / scale), settings);
    Prior { weight: open.weight * scale, ..open }
}

/// Mean square of the residuals of the median run; 1 where they are as believed or smaller.
fn typical(fit: &Fit) -> f64 {
    median(fit.normals.iter().map(run_mean_square).collect()).max(1.0)
}

fn mean_square(squares: Squares, taken: f64) -> f64 {
    #[allow(clippy::cast_precision_loss)] // counts
    let freedom = squares.count as f64 - taken;
    if freedom > 0.0 { squares.sum / freedom } else { 1.0 }
}

fn run_mean_square(normal: &Normal) -> f64 {
    let sum = normal.truth.sum + normal.comparison.sum;
    #[allow(clippy::cast_precision_loss)] // counts
    let freedom = normal.freedom().max(1) as f64;
    sum / freedom
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(1.0)
}

/// The run that fits worst, where it fits so badly that chance does not explain it and enough runs stay.
fn outlier(
    fit: &Fit,
    runs: &[&Condensed],
    at_first: usize,
    settings: &Settings,
) -> Option<(usize, String)> {
    #[allow(clippy::cast_precision_loss)] // few runs
    let share = (at_first - runs.len() + 1) as f64 / at_first as f64;
    if runs.len() < 4 || share > settings.largest_rejected_share {
        return None;
    }
    // Where the noise is larger than believed in every run, none of them is an outlier for it.
    let typical = typical(fit);
    let deviations = |normal: &Normal| chi_square_deviations(normal, typical);
    let worst = (0..runs.len())
        .max_by(|a, b| deviations(&fit.normals[*a]).total_cmp(&deviations(&fit.normals[*b])))?;
    let normal = &fit.normals[worst];
    (deviations(normal) > settings.outlier).then(|| (worst, why(normal)))
}

/// Standard deviations by which a run's sum of squares exceeds its expectation (Wilson and Hilferty, 1931).
fn chi_square_deviations(normal: &Normal, typical: f64) -> f64 {
    #[allow(clippy::cast_precision_loss)] // counts
    let freedom = normal.freedom().max(1) as f64;
    let ratio = run_mean_square(normal) / typical;
    let spread = 2.0 / (9.0 * freedom);
    (kerbside_geometry::math::powf(ratio, 1.0 / 3.0) - 1.0 + spread) / spread.sqrt()
}

fn why(normal: &Normal) -> String {
    let [truth, comparison] = normal.largest;
    if comparison.deviations > truth.deviations {
        format!(
            "front wheels, rear wheels and steering disagree by {:.0} standard deviations about {:.1} m: \
             slip, or a reading that is wrong there",
            comparison.deviations, comparison.travel
        )
    } else {
        format!(
            "what is known of its pose at {:.1} m is {:.3} (m or rad), {:.0} standard deviations, off what its \
             wheels say: slip, or a wrong reading of the reference",
            truth.travel,
            truth.value.abs(),
            truth.deviations
        )
    }
}

fn finish(
    runs: &[&Condensed],
    fit: Fit,
    prior: &Prior,
    settings: &Settings,
    rejected: Vec<Rejected>,
) -> Result<JointFit, CalibrationError> {
    let mut information = Information::new(fit.information(), prior, settings);
    let told = Information::new(information.matrix / typical(&fit), prior, settings);
    information.identified = core::array::from_fn(|i| told.identified[i] && fit.free[i]);
    let open = held(prior, &fit, settings);
    let values = &fit.parameters.values;
    let kinds = kinds(runs, &fit.parameters, settings);
    let differs = between(&fit.normals, &kinds, values, &information.identified, &open);
    let held = Information { matrix: information.matrix + open.weight, ..information.clone() };
    let covariance = held.covariance(&prior.scale).ok_or(CalibrationError::Diverged)?;
    let (truth, comparison) = totals(&fit);
    let identified = information.identified.iter().filter(|identified| **identified).count();
    #[allow(clippy::cast_precision_loss)] // few
    let (taken, poses) = (identified as f64, 3.0 * runs.len() as f64);
    // The start poses take three of each run's readings; the parameters take from both kinds, counted where
    // they come from mostly.
    let (truth_mean, comparison_mean) =
        (mean_square(truth, poses + 0.5 * taken), mean_square(comparison, 0.5 * taken));
    let freedom = (truth.count + comparison.count).saturating_sub(3 * runs.len() + identified);
    let inflation = truth_mean.max(comparison_mean).max(1.0);
    // What differs from drive to drive is no noise of the readings: it adds by runs, not by readings.
    let covariance = match &differs {
        Some(differs) => covariance * differs.within + covariance * differs.score * covariance,
        None => covariance * inflation,
    };
    let biases: Vec<(f64, f64)> = fit.normals.iter().filter_map(|normal| normal.bias).collect();
    let residuals = runs.iter().zip(&fit.normals).zip(&fit.starts);
    let residuals = residuals.map(|((run, normal), start)| residuals_of(run, normal, start));
    Ok(JointFit {
        parameters: fit.parameters,
        information,
        covariance,
        inflation,
        between: differs.map_or_else(Vector::zeros, |differs| differs.variance),
        gyro_bias: GyroBias::of(&biases),
        truth: truth_mean,
        comparison: comparison_mean,
        freedom,
        residuals: residuals.collect(),
        rejected,
    })
}

fn totals(fit: &Fit) -> (Squares, Squares) {
    let mut totals = (Squares::default(), Squares::default());
    for normal in &fit.normals {
        totals.0.sum += normal.truth.sum;
        totals.0.count += normal.truth.count;
        totals.1.sum += normal.comparison.sum;
        totals.1.count += normal.comparison.count;
    }
    totals
}

fn residuals_of(run: &Condensed, normal: &Normal, start: &Pose) -> RunResiduals {
    let rms = |squares: Squares, taken: f64| mean_square(squares, taken).sqrt();
    RunResiduals {
        run: run.name.clone(),
        travel: run.travel,
        truth: rms(normal.truth, 3.0),
        truth_count: normal.truth.count,
        comparison: rms(normal.comparison, 0.0),
        comparison_count: normal.comparison.count,
        lag: normal.lag,
        start: *start,
    }
}

impl JointFit {
    /// Standard deviations, each in its parameter's unit.
    pub(crate) fn deviations(&self) -> Vector {
        self.covariance.diagonal().map(|variance| variance.max(0.0).sqrt())
    }
}
