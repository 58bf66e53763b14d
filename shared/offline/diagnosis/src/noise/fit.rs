//! The noise that makes what was measured most likely.

use kerbside_geometry::math;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::level::{COUNT, Level, Noise};
use super::{Coefficients, Whitener};
use crate::bins::{self, Channels};
use crate::linear::gram;

/// Rounds of the search at most.
const ROUNDS: usize = 12;
/// Step of the numerical slope, in logarithms.
const PROBE: f64 = 0.02;
/// Longest step of a level in a round, in logarithms.
const LONGEST: f64 = 0.8;
/// A round that gains less than this in twice the log-likelihood is the last.
const ENOUGH: f64 = 0.5;

/// What one run says: residuals of a model, and their sensitivities to what may differ besides, each in units of one
/// standard deviation of its own prior.
#[derive(Clone, Debug)]
pub(crate) struct Evidence {
    pub coefficients: Coefficients,
    pub residuals: Vec<Channels>,
    pub columns: Vec<Vec<Channels>>,
    pub follows: bool,
}

impl Evidence {
    /// Its whitener.
    pub(crate) fn whitener(&self, noise: &Noise) -> Whitener {
        let noise = Noise { follows: self.follows, ..*noise };
        let steering = self.coefficients.present.iter().any(|bin| bin[bins::STEERING]);
        Whitener::new(&self.coefficients, &noise, steering)
    }
}

/// The restricted maximum-likelihood levels, with `prior` as log-normal prior of each (Patterson and Thompson 1971;
/// here the columns are integrated out with their own priors).
pub(crate) fn fit(evidence: &[Evidence], prior: &Noise, start: &Noise) -> Noise {
    let active = active(evidence);
    let mut noise = *start;
    let mut value = objective(evidence, prior, &noise);
    let mut inverse = DMatrix::<f64>::identity(active.len(), active.len()) * 0.05;
    let mut last: Option<(DVector<f64>, DVector<f64>)> = None;
    for _ in 0..ROUNDS {
        let slope = slope(evidence, prior, &noise, value, &active);
        if let Some((step, before)) = &last {
            update(&mut inverse, step, &(&slope - before));
        }
        let mut step = -(&inverse * &slope);
        let longest = step.amax();
        if longest > LONGEST {
            step *= LONGEST / longest;
        }
        let mut taken = false;
        for _ in 0..4 {
            let mut next = noise;
            for (i, level) in active.iter().enumerate() {
                next.log[*level as usize] += step[i];
            }
            let at = objective(evidence, prior, &next);
            if at < value {
                let gain = value - at;
                (noise, value) = (next, at);
                last = Some((step.clone(), slope.clone()));
                taken = gain > ENOUGH;
                break;
            }
            step *= 0.3;
        }
        if !taken {
            break;
        }
    }
    noise
}

/// The levels that the channels there are can tell anything about.
fn active(evidence: &[Evidence]) -> Vec<Level> {
    let any = |channel: usize| {
        evidence.iter().any(|run| run.coefficients.present.iter().any(|bin| bin[channel]))
    };
    let commanded = evidence.iter().any(|run| !run.follows);
    let (steering, gyro) = (any(bins::STEERING), any(bins::GYRO));
    let (position, yaw) = (any(bins::REFERENCE), any(bins::REFERENCE + 2));
    let several = (0..4).filter(|wheel| any(*wheel)).count() > 1;
    let turns = gyro || yaw || several;
    let many = evidence.len() > 1;
    let use_level = |level: &Level| match level {
        Level::SteeringWhite => steering,
        Level::GyroWhite | Level::GyroColour => gyro,
        Level::RunGyro => gyro && many,
        Level::PositionWhite | Level::PositionColour | Level::ReferenceTime => position,
        Level::YawWhite | Level::YawColour => yaw,
        Level::WheelWhite => false,
        Level::Speed | Level::SpeedTime => commanded,
        Level::RunSpeed => commanded && many,
        Level::Rack | Level::RackTime => commanded && (steering || turns),
        Level::RunRack => commanded && many && (steering || turns),
        Level::Slip | Level::GroundTime => position || several,
        Level::RunSlip => position && many,
        Level::Curvature => turns || position,
        Level::RunCurvature => (turns || position) && many,
        Level::Side => position,
        Level::RunSide => position && many,
        Level::Wheel => several,
    };
    Level::ALL.into_iter().filter(use_level).collect()
}

fn slope(
    evidence: &[Evidence],
    prior: &Noise,
    noise: &Noise,
    value: f64,
    active: &[Level],
) -> DVector<f64> {
    let slopes: Vec<f64> = active
        .par_iter()
        .map(|level| {
            let mut next = *noise;
            next.log[*level as usize] += PROBE;
            (objective(evidence, prior, &next) - value) / PROBE
        })
        .collect();
    DVector::from_vec(slopes)
}

/// The inverse of the curvature, by the formula of Broyden, Fletcher, Goldfarb and Shanno.
fn update(inverse: &mut DMatrix<f64>, step: &DVector<f64>, change: &DVector<f64>) {
    let along = step.dot(change);
    if along <= 1e-9 {
        return;
    }
    let identity = DMatrix::<f64>::identity(step.len(), step.len());
    let left = &identity - step * change.transpose() / along;
    *inverse = &left * &*inverse * left.transpose() + step * step.transpose() / along;
}

/// Twice the negative logarithm of the restricted posterior.
fn objective(evidence: &[Evidence], prior: &Noise, noise: &Noise) -> f64 {
    let columns = evidence.first().map_or(0, |run| run.columns.len());
    let terms: Vec<(f64, f64, DMatrix<f64>, DVector<f64>)> = evidence
        .par_iter()
        .map(|run| {
            let whitener = run.whitener(noise);
            let mut residual = Vec::with_capacity(whitener.values);
            whitener.apply(&run.residuals, &mut residual);
            let mut design = Vec::with_capacity(whitener.values * columns);
            for column in &run.columns {
                whitener.apply(column, &mut design);
            }
            let residual = DVector::from_vec(residual);
            let design = DMatrix::from_vec(residual.len(), columns, design);
            (
                whitener.log_determinant,
                residual.norm_squared(),
                gram(&design),
                design.tr_mul(&residual),
            )
        })
        .collect();
    let mut normal = DMatrix::<f64>::identity(columns, columns);
    let mut right = DVector::<f64>::zeros(columns);
    let mut value = 0.0;
    for (log_determinant, square, matrix, vector) in terms {
        value += log_determinant + square;
        normal += matrix;
        right += vector;
    }
    if columns > 0 {
        let Some(root) = normal.cholesky() else { return f64::INFINITY };
        value -= right.dot(&root.solve(&right));
        value += 2.0 * root.l_dirty().diagonal().iter().map(|d| math::ln(*d)).sum::<f64>();
    }
    for level in 0..COUNT {
        let off = (noise.log[level] - prior.log[level]) / Level::ALL[level].spread();
        value += off * off;
    }
    if value.is_finite() { value } else { f64::INFINITY }
}
