//! Levenberg-Marquardt over parameters and the start poses of all runs.

use kerbside_geometry::{Pose, angle, math};

use crate::chain::evaluate;
use crate::condense::Condensed;
use crate::error::CalibrationError;
use crate::known::Known;
use crate::noise::Settings;
use crate::normal::{Normal, Square};
use crate::parameters::{Parameters, Vector};
use crate::rows::{Rows, Used};

/// Steps after which a fit stops in any case.
const STEPS: usize = 60;
/// A step smaller than this share of every prior's deviation ends the fit.
const SMALL: f64 = 1e-6;
/// Share of the cost by which a step may raise it: the covariances depend on the parameters a little, and their
/// change is in the cost and not in the normal equations.
const TOLERATED: f64 = 1e-5;
/// Damping at first, and at most.
const DAMPING: f64 = 1e-3;
const LARGEST_DAMPING: f64 = 1e10;

/// What a fit holds on to where the runs say nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prior {
    pub(crate) mean: Vector,
    /// Inverse covariance.
    pub(crate) weight: Square,
    /// Standard deviations that make parameters of different units comparable.
    pub(crate) scale: Vector,
    /// Which parameters are fitted.
    pub(crate) free: [bool; crate::parameters::COUNT],
}

/// A fit: parameters, start poses, and the runs' normal equations there.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub(crate) parameters: Parameters,
    pub(crate) starts: Vec<Pose>,
    pub(crate) normals: Vec<Normal>,
    pub(crate) cost: f64,
    /// Which parameters were fitted; the others are where the prior has them.
    pub(crate) free: [bool; crate::parameters::COUNT],
}

impl Fit {
    /// The state at `parameters` and `starts`.
    pub(crate) fn at(
        runs: &[&Condensed],
        parameters: Parameters,
        starts: Vec<Pose>,
        prior: &Prior,
        settings: &Settings,
        limit: f64,
    ) -> Option<Self> {
        let normals: Option<Vec<Normal>> = runs
            .iter()
            .zip(&starts)
            .map(|(run, start)| evaluate(run, &parameters, start, settings, limit))
            .collect();
        let normals = normals?;
        let away = parameters.values - prior.mean;
        let cost = normals.iter().map(|normal| normal.cost).sum::<f64>()
            + away.dot(&(prior.weight * away));
        let free = prior.free;
        cost.is_finite().then_some(Self { parameters, starts, normals, cost, free })
    }

    /// Information of all runs on the parameters, without any prior.
    pub(crate) fn information(&self) -> Square {
        self.normals.iter().filter_map(Normal::reduced).map(|(information, _, _)| information).sum()
    }

    /// Change of parameters and start poses that the normal equations ask for.
    fn step(&self, prior: &Prior, damping: f64) -> Option<(Vector, Vec<Pose>)> {
        let reduced: Option<Vec<_>> = self.normals.iter().map(Normal::reduced).collect();
        let reduced = reduced?;
        let mut matrix = prior.weight;
        let mut right = prior.weight * (prior.mean - self.parameters.values);
        for (information, side, _) in &reduced {
            matrix += information;
            right += side;
        }
        for index in 0..matrix.nrows() {
            if prior.free[index] {
                // Marquardt's scaling, with the prior's where the runs say nothing.
                let scale = prior.scale[index];
                matrix[(index, index)] +=
                    damping * (matrix[(index, index)] + 1.0 / (scale * scale));
            } else {
                matrix.row_mut(index).fill(0.0);
                matrix.column_mut(index).fill(0.0);
                matrix[(index, index)] = 1.0;
                right[index] = 0.0;
            }
        }
        let change = scaled_solve(&matrix, &right, &prior.scale)?;
        Some((change, self.starts_after(&change)?))
    }

    /// The start poses that fit best once the parameters have moved by `change`.
    pub(crate) fn starts_after(&self, change: &Vector) -> Option<Vec<Pose>> {
        let moved = |(normal, start): (&Normal, &Pose)| {
            let (_, _, inverse) = normal.reduced()?;
            let moved = inverse * (normal.right_start - normal.mixed.transpose() * change);
            Some(Pose::new(start.x + moved[0], start.y + moved[1], start.yaw + moved[2]))
        };
        self.normals.iter().zip(&self.starts).map(moved).collect()
    }
}

/// Solution of a positive definite system whose unknowns have sizes `scale`.
fn scaled_solve(matrix: &Square, right: &Vector, scale: &Vector) -> Option<Vector> {
    let diagonal = Square::from_diagonal(scale);
    let solved = (diagonal * matrix * diagonal).cholesky()?.solve(&(diagonal * right));
    Some(diagonal * solved)
}

/// Fits `runs` from `parameters`; residuals beyond `limit` deviations are weighed down.
///
/// # Errors
/// [`CalibrationError::Diverged`] where the numbers leave the finite.
pub(crate) fn fit(
    runs: &[&Condensed],
    parameters: Parameters,
    starts: Vec<Pose>,
    prior: &Prior,
    settings: &Settings,
    limit: f64,
) -> Result<Fit, CalibrationError> {
    let at = |parameters, starts| Fit::at(runs, parameters, starts, prior, settings, limit);
    let mut fit = at(parameters, starts).ok_or(CalibrationError::Diverged)?;
    let mut damping = DAMPING;
    for _ in 0..STEPS {
        let (change, starts) = fit.step(prior, damping).ok_or(CalibrationError::Diverged)?;
        let moved = Parameters { values: fit.parameters.values + change };
        let size = change.component_div(&prior.scale).amax();
        match at(moved, starts).filter(|next| next.cost <= fit.cost * (1.0 + TOLERATED)) {
            Some(next) => {
                fit = next;
                damping *= 0.1;
                if size < SMALL {
                    break;
                }
            }
            None if size < SMALL || damping > LARGEST_DAMPING => break,
            None => damping *= 100.0,
        }
    }
    Ok(fit)
}

/// A first guess of a run's start pose: dead reckoning by `parameters`, laid onto what is known of its poses.
pub(crate) fn first_start(run: &Condensed, parameters: &Parameters, settings: &Settings) -> Pose {
    let used = Used::of(run);
    let (mut pose, mut at) = (Pose::default(), 0);
    let mut pairs = Vec::new();
    let last = last_for_start(run);
    for event in run.events.iter().filter(|event| event.after <= last) {
        for block in &run.blocks[at..event.after] {
            let rows = Rows::of_block(block, parameters, &settings.noise, used);
            if let Some(motion) = rows.motion() {
                pose = pose.advance(motion.distance, motion.turn);
            }
        }
        at = event.after;
        if let Known::Pose { x, y, yaw, position_deviation, yaw_deviation } = event.known {
            let marker = pose.compose(&run.marker(parameters));
            pairs.push((
                marker,
                Pose::new(x, y, yaw.unwrap_or(f64::NAN)),
                position_deviation,
                yaw_deviation,
            ));
        }
    }
    lay_onto(&pairs)
}

/// Blocks up to which a first guess looks: the run's first tenth, or three known poses, before drift spoils it.
fn last_for_start(run: &Condensed) -> usize {
    let mut poses = run.events.iter().filter(|event| matches!(event.known, Known::Pose { .. }));
    let third = poses.nth(2).map_or(run.blocks.len(), |event| event.after);
    third.max(run.blocks.len() / 10)
}

/// A pose by dead reckoning, the same by the reference (yaw not a number where unknown), and the deviations of
/// position \[m\] and yaw \[rad\].
type Pair = (Pose, Pose, f64, f64);

/// The transform that takes the first of each pair onto the second, weighed by their deviations.
fn lay_onto(pairs: &[Pair]) -> Pose {
    let (mut weight, mut from, mut to) = (0.0, [0.0; 2], [0.0; 2]);
    for (odometry, reference, deviation, _) in pairs {
        let w = 1.0 / (deviation * deviation);
        weight += w;
        from = [from[0] + w * odometry.x, from[1] + w * odometry.y];
        to = [to[0] + w * reference.x, to[1] + w * reference.y];
    }
    if weight == 0.0 {
        return Pose::default();
    }
    let (from, to) = (from.map(|sum| sum / weight), to.map(|sum| sum / weight));
    // Sums of vectors along the rotation that each pair asks for, as long as the pair is sure of it.
    let (mut along, mut across) = (0.0, 0.0);
    for (odometry, reference, deviation, yaw_deviation) in pairs {
        let w = 1.0 / (deviation * deviation);
        let (a, b) = (odometry.x - from[0], odometry.y - from[1]);
        let (c, d) = (reference.x - to[0], reference.y - to[1]);
        along += w * (a * c + b * d);
        across += w * (a * d - b * c);
        if reference.yaw.is_finite() {
            let (sin, cos) = math::sin_cos(angle::wrap(reference.yaw - odometry.yaw));
            let w = 1.0 / (yaw_deviation * yaw_deviation);
            along += w * cos;
            across += w * sin;
        }
    }
    let yaw = math::atan2(across, along);
    let turned = Pose::new(0.0, 0.0, yaw).transform(from[0], from[1]);
    Pose::new(to[0] - turned.0, to[1] - turned.1, yaw)
}
