//! What runs tell of the parameters: Fisher information, Cramer-Rao bound, and which parameters they leave open.

use kerbside_geometry::Vehicle;
use nalgebra::SymmetricEigen;

use crate::condense::Condensed;
use crate::error::CalibrationError;
use crate::noise::Settings;
use crate::normal::Square;
use crate::parameters::{COUNT, PARAMETERS, Parameter, Parameters, Vector};
use crate::run::Run;
use crate::solve::{Fit, Prior, first_start};

/// Precision of the faintest prior, in units of the weak one's: it lets a singular matrix be inverted and says
/// nothing.
const FAINT: f64 = 1e-6;

/// What a set of runs tells of the parameters, priors excluded.
#[derive(Clone, Debug, PartialEq)]
pub struct Information {
    /// Fisher information, in the order of [`PARAMETERS`], the runs' start poses eliminated; units are the
    /// parameters' to the power of -1 each.
    pub matrix: Square,
    /// Which parameters are asked for: a vehicle without a sensor has no zero of it.
    pub free: [bool; COUNT],
    /// Which of them the runs identify.
    pub identified: [bool; COUNT],
    /// Cramer-Rao bound: least standard deviation of an unbiased estimate, each in its parameter's unit; infinite
    /// where a parameter is not identified.
    pub bound: Vector,
    /// Ratio of the largest to the smallest eigenvalue of the matrix, scaled by the weak priors, of the free
    /// parameters.
    pub condition: f64,
}

/// The Fisher information that `runs` hold on the parameters, at the values `parameters`; no run is judged.
///
/// # Errors
/// What makes one of the runs useless, or [`CalibrationError::NoRuns`].
pub fn information(
    runs: &[Run],
    vehicle: &Vehicle,
    parameters: &Parameters,
    settings: &Settings,
) -> Result<Information, CalibrationError> {
    let condensed: Result<Vec<_>, _> =
        runs.iter().map(|run| Condensed::new(run, vehicle, settings)).collect();
    let condensed = condensed?;
    let runs: Vec<&Condensed> = condensed.iter().collect();
    let starts = runs.iter().map(|run| first_start(run, parameters, settings)).collect();
    let prior = prior(&runs, vehicle, settings);
    let fit = Fit::at(&runs, *parameters, starts, &prior, settings, f64::INFINITY)
        .filter(|fit| !fit.normals.is_empty())
        .ok_or(CalibrationError::NoRuns)?;
    Ok(Information::new(fit.information(), &prior, settings))
}

/// The weak prior about the nominal vehicle, for the parameters that the sensors of `runs` involve.
pub(crate) fn prior(runs: &[&Condensed], vehicle: &Vehicle, settings: &Settings) -> Prior {
    let mean = Parameters::nominal(vehicle).values;
    let free = free_of(runs, vehicle, settings);
    let weight = Vector::from_fn(|index, _| {
        let precision = 1.0 / (settings.prior[index] * settings.prior[index]);
        if free[index] { precision } else { 0.0 }
    });
    Prior { mean, weight: Square::from_diagonal(&weight), scale: settings.prior, free }
}

fn free_of(runs: &[&Condensed], vehicle: &Vehicle, settings: &Settings) -> [bool; COUNT] {
    let any = |has: fn(&Condensed) -> bool| runs.iter().any(|run| has(run));
    let steered = any(|run| run.steered);
    let front = any(|run| run.wheels[0] || run.wheels[1]);
    PARAMETERS.map(|parameter| match parameter {
        Parameter::RadiusFrontLeft => any(|run| run.wheels[0]),
        Parameter::RadiusFrontRight => any(|run| run.wheels[1]),
        Parameter::RadiusRearLeft => any(|run| run.wheels[2]),
        Parameter::RadiusRearRight => any(|run| run.wheels[3]),
        Parameter::TrackFront => front && vehicle.track_front > 0.0,
        Parameter::TrackRear => {
            any(|run| run.wheels[2] && run.wheels[3]) && vehicle.track_rear > 0.0
        }
        Parameter::Wheelbase => steered || front,
        Parameter::SteeringZero => steered,
        Parameter::SteeringGain => steered && settings.free_gain,
        Parameter::MarkerX | Parameter::MarkerY => settings.free_marker && any(|run| run.marked),
        Parameter::MarkerYaw => settings.free_marker && any(|run| run.headed),
    })
}

impl Information {
    pub(crate) fn new(matrix: Square, prior: &Prior, settings: &Settings) -> Self {
        let free = prior.free;
        let scaled = scaled(&matrix, prior);
        let faint = regular(&scaled, &free, FAINT);
        let share = settings.identified_share;
        let deviation = |index: usize| {
            faint.map_or(f64::INFINITY, |covariance| covariance[(index, index)].max(0.0).sqrt())
        };
        let identified: [bool; COUNT] =
            core::array::from_fn(|index| free[index] && deviation(index) <= share);
        let bound = Vector::from_fn(|index, _| {
            if identified[index] { deviation(index) * prior.scale[index] } else { f64::INFINITY }
        });
        Self { matrix, free, identified, bound, condition: condition(&scaled, &free) }
    }

    /// Covariance that the runs alone give, parameters' units; directions that they leave open are as wide as a
    /// thousand weak priors. None where the matrix holds what is not a number.
    pub(crate) fn covariance(&self, scale: &Vector) -> Option<Square> {
        let diagonal = Square::from_diagonal(scale);
        let inverse = regular(&(diagonal * self.matrix * diagonal), &self.free, FAINT)?;
        Some(diagonal * inverse * diagonal)
    }
}

fn scaled(matrix: &Square, prior: &Prior) -> Square {
    let diagonal = Square::from_diagonal(&prior.scale);
    let mut scaled = diagonal * matrix * diagonal;
    for (index, free) in prior.free.iter().enumerate() {
        if !free {
            scaled.row_mut(index).fill(0.0);
            scaled.column_mut(index).fill(0.0);
        }
    }
    scaled
}

/// Inverse of the free part of a scaled matrix plus `faint` times the unit matrix; 0 elsewhere.
fn regular(scaled: &Square, free: &[bool; COUNT], faint: f64) -> Option<Square> {
    let mut matrix = *scaled + Square::identity() * faint;
    for (index, free) in free.iter().enumerate() {
        if !free {
            matrix.row_mut(index).fill(0.0);
            matrix.column_mut(index).fill(0.0);
            matrix[(index, index)] = 1.0;
        }
    }
    let mut inverse = matrix.cholesky()?.inverse();
    for (index, free) in free.iter().enumerate() {
        if !free {
            inverse[(index, index)] = 0.0;
        }
    }
    Some(inverse)
}

fn condition(scaled: &Square, free: &[bool; COUNT]) -> f64 {
    let eigen = SymmetricEigen::new(*scaled);
    let count = free.iter().filter(|free| **free).count();
    let mut values: Vec<f64> = eigen.eigenvalues.iter().copied().collect();
    values.sort_by(f64::total_cmp);
    let smallest = values.iter().rev().take(count).next_back().copied().unwrap_or(0.0);
    values.last().copied().unwrap_or(0.0) / smallest.max(f64::MIN_POSITIVE)
}

/// The weak prior, kept only in directions that the runs leave open: where they speak, it is no information.
pub(crate) fn only_where_open(prior: &Prior, matrix: &Square, settings: &Settings) -> Prior {
    let eigen = SymmetricEigen::new(scaled(matrix, prior));
    let least = 1.0 / (settings.identified_share * settings.identified_share);
    let mut open = Square::zeros();
    for (index, value) in eigen.eigenvalues.iter().enumerate() {
        if *value < least {
            let direction = eigen.eigenvectors.column(index);
            open += direction * direction.transpose();
        }
    }
    let diagonal = Square::from_diagonal(&prior.scale.map(|scale| 1.0 / scale));
    Prior { weight: diagonal * open * diagonal, ..*prior }
}
