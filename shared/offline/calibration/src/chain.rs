//! Dead reckoning of one run between what is known of its poses, with everything's dependence on the parameters.
//!
//! Wheel and steering noise are process noise, reference poses are measurements; the whitened innovations, taken
//! from a true start pose that is unknown too, are the run's likelihood (errors in variables).

use kerbside_geometry::{Pose, angle, math};
use nalgebra::{Matrix3, Matrix4, SMatrix, SVector};

use crate::condense::{Condensed, Event, Known};
use crate::noise::Settings;
use crate::parameters::{COUNT, Parameters, Vector};
use crate::rows::{Motion, Rows, Used};

/// Unknowns of a run: the parameters, then its start pose.
const UNKNOWNS: usize = COUNT + 3;

type Gradient = SVector<f64, UNKNOWNS>;

/// Square matrix of parameters.
pub type Square = SMatrix<f64, COUNT, COUNT>;

/// How many residuals there are, and their sum of squares, in standard deviations, those that are weighed down as
/// Huber's cost counts them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Squares {
    pub(crate) sum: f64,
    pub(crate) count: usize,
}

impl Squares {
    fn add(&mut self, square: f64, count: usize) {
        self.sum += square;
        self.count += count;
    }
}

/// The largest residual of a run, in standard deviations, and what it is of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Largest {
    pub(crate) deviations: f64,
    /// Travel by then \[m\].
    pub(crate) travel: f64,
    /// Residual in its own unit (m or rad); that of a comparison in deviations.
    pub(crate) value: f64,
}

/// Normal equations of one run, and how well it fits.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    pub(crate) parameters: Square,
    pub(crate) mixed: SMatrix<f64, COUNT, 3>,
    pub(crate) start: Matrix3<f64>,
    pub(crate) right: Vector,
    pub(crate) right_start: SVector<f64, 3>,
    /// Robust cost: half the sum is not taken.
    pub(crate) cost: f64,
    /// Of position, yaw, distance and turn.
    pub(crate) truth: Squares,
    /// Of rows that disagree.
    pub(crate) comparison: Squares,
    pub(crate) largest: [Largest; 2],
}

impl Normal {
    fn new() -> Self {
        Self {
            parameters: Square::zeros(),
            mixed: SMatrix::zeros(),
            start: Matrix3::zeros(),
            right: Vector::zeros(),
            right_start: SVector::zeros(),
            cost: 0.0,
            truth: Squares::default(),
            comparison: Squares::default(),
            largest: [Largest::default(); 2],
        }
    }

    fn add(&mut self, gradient: &Gradient, residual: f64, weight: f64) {
        let p = gradient.fixed_rows::<COUNT>(0).into_owned();
        let x = gradient.fixed_rows::<3>(COUNT).into_owned();
        self.parameters += p * p.transpose() * weight;
        self.mixed += p * x.transpose() * weight;
        self.start += x * x.transpose() * weight;
        self.right += p * (residual * weight);
        self.right_start += x * (residual * weight);
    }

    /// Information on the parameters and right-hand side once the start pose is eliminated; with the inverse that
    /// gives the start pose back.
    pub(crate) fn reduced(&self) -> Option<(Square, Vector, Matrix3<f64>)> {
        // A heading that nothing tells stays where it is.
        let start = self.start + Matrix3::identity() * 1e-4;
        let inverse = start.cholesky()?.inverse();
        let gain = self.mixed * inverse;
        let information = self.parameters - gain * self.mixed.transpose();
        Some((information, self.right - gain * self.right_start, inverse))
    }

    /// Residuals of either kind less the three that the start pose took.
    pub(crate) fn freedom(&self) -> usize {
        (self.truth.count + self.comparison.count).saturating_sub(3)
    }
}

/// Huber's weight and cost of a residual given in standard deviations.
fn huber(deviations: f64, limit: f64) -> (f64, f64) {
    let size = deviations.abs();
    if size <= limit {
        (1.0, size * size)
    } else {
        (limit / size, 2.0 * limit * size - limit * limit)
    }
}

/// The state (x, y, yaw, travelled distance), its covariance, and its derivative by the unknowns.
struct Chain<'a> {
    pose: Pose,
    distance: f64,
    covariance: Matrix4<f64>,
    by: SMatrix<f64, 4, UNKNOWNS>,
    normal: Normal,
    limit: f64,
    settings: &'a Settings,
    travel: f64,
    /// Heading at the start \[rad\].
    started: f64,
}

/// The run's normal equations about `parameters` and `start`; residuals beyond `limit` deviations are weighed down.
/// None where its rows leave distance or turn open.
pub(crate) fn evaluate(
    run: &Condensed,
    parameters: &Parameters,
    start: &Pose,
    settings: &Settings,
    limit: f64,
) -> Option<Normal> {
    let used = Used::of(run);
    let mut chain = Chain::new(*start, settings, limit);
    let mut events = run.events.iter().peekable();
    let mut sum = Rows::empty(parameters, used);
    let mut counted = None;
    for (index, block) in run.blocks.iter().enumerate() {
        let rows = Rows::of_block(block, parameters, &settings.noise, used);
        let motion = rows.motion()?;
        let bounded = *counted.get_or_insert_with(|| chain.begin(&motion));
        while let Some(event) = events.next_if(|event| event.after <= index) {
            chain.meet(event, run, bounded);
        }
        chain.roll(&motion, block.direction);
        chain.travel += block.travel;
        sum.add(&rows);
        let next = run.blocks.get(index + 1).map(|block| block.comparison);
        if next != Some(block.comparison) {
            chain.compare(&mut sum, parameters);
            sum = Rows::empty(parameters, used);
        }
    }
    for event in events {
        chain.meet(event, run, counted.unwrap_or_default());
    }
    Some(chain.normal)
}

impl<'a> Chain<'a> {
    fn new(start: Pose, settings: &'a Settings, limit: f64) -> Self {
        let mut by = SMatrix::<f64, 4, UNKNOWNS>::zeros();
        by.fixed_view_mut::<3, 3>(0, COUNT).fill_with_identity();
        Self {
            pose: start,
            distance: 0.0,
            covariance: Matrix4::zeros(),
            by,
            normal: Normal::new(),
            limit,
            settings,
            travel: 0.0,
            started: start.yaw,
        }
    }

    /// What counting leaves in (distance, turn) at any instant, and so at the first: variances, not a random walk.
    fn begin(&mut self, motion: &Motion) -> (f64, f64) {
        let (mut distance, mut turn) = (0.0, 0.0);
        for (wheel, quantum) in self.settings.noise.quantum.iter().enumerate() {
            let variance = quantum * quantum / 12.0;
            distance += motion.gain[(0, wheel)] * motion.gain[(0, wheel)] * variance;
            turn += motion.gain[(1, wheel)] * motion.gain[(1, wheel)] * variance;
        }
        let (sin, cos) = math::sin_cos(self.pose.yaw);
        self.covariance[(0, 0)] += cos * cos * distance;
        self.covariance[(0, 1)] += cos * sin * distance;
        self.covariance[(1, 0)] += cos * sin * distance;
        self.covariance[(1, 1)] += sin * sin * distance;
        self.covariance[(2, 2)] += turn;
        self.covariance[(3, 3)] += distance;
        (distance, turn)
    }

    fn roll(&mut self, motion: &Motion, direction: f64) {
        let chord = motion.distance * math::sinc(0.5 * motion.turn);
        let (sin, cos) = math::sin_cos(self.pose.yaw + 0.5 * motion.turn);
        let mut state = Matrix4::identity();
        state[(0, 2)] = -chord * sin;
        state[(1, 2)] = chord * cos;
        // The chord's own dependence on the turn is of second order in a block.
        let input = SMatrix::<f64, 4, 2>::new(
            cos,
            -0.5 * chord * sin,
            sin,
            0.5 * chord * cos,
            0.0,
            1.0,
            direction,
            0.0,
        );
        self.by = state * self.by;
        let mut by_parameters = self.by.fixed_columns_mut::<COUNT>(0);
        by_parameters += input * motion.by_parameters;
        self.covariance = state * self.covariance * state.transpose()
            + input * motion.covariance * input.transpose();
        self.pose = self.pose.advance(motion.distance, motion.turn);
        self.distance += direction * motion.distance;
    }

    fn meet(&mut self, event: &Event, run: &Condensed, bounded: (f64, f64)) {
        match event.known {
            Known::Pose { x, y, yaw, position_deviation, yaw_deviation } => {
                let position = position_deviation * position_deviation + bounded.0;
                self.meet_position(x, true, &run.marker, position);
                self.meet_position(y, false, &run.marker, position);
                if let Some(yaw) = yaw {
                    let residual = angle::wrap(yaw - self.pose.yaw - run.marker.yaw);
                    let row = SVector::<f64, 4>::new(0.0, 0.0, 1.0, 0.0);
                    let gradient = self.by.transpose() * row;
                    let variance = yaw_deviation * yaw_deviation + bounded.1;
                    self.measure(residual, row, gradient, variance);
                }
            }
            Known::Distance(distance, deviation) => {
                let sign = if self.distance < 0.0 { -1.0 } else { 1.0 };
                let row = SVector::<f64, 4>::new(0.0, 0.0, 0.0, sign);
                let gradient = self.by.transpose() * row;
                let variance = deviation * deviation + bounded.0;
                self.measure(distance - self.distance.abs(), row, gradient, variance);
            }
            Known::Turn(turn, deviation) => self.meet_turn(turn, deviation, bounded),
        }
    }

    fn meet_position(&mut self, read: f64, is_x: bool, marker: &Pose, variance: f64) {
        let (x, y) = self.pose.transform(marker.x, marker.y);
        let (residual, by_yaw) =
            if is_x { (read - x, self.pose.y - y) } else { (read - y, x - self.pose.x) };
        let mut row = SVector::<f64, 4>::new(0.0, 0.0, by_yaw, 0.0);
        row[usize::from(!is_x)] = 1.0;
        let gradient = self.by.transpose() * row;
        self.measure(residual, row, gradient, variance);
    }

    /// The turn since the start, which the pose there is part of.
    fn meet_turn(&mut self, turn: f64, deviation: f64, bounded: (f64, f64)) {
        let row = SVector::<f64, 4>::new(0.0, 0.0, 1.0, 0.0);
        let mut gradient = self.by.transpose() * row;
        gradient[COUNT + 2] -= 1.0;
        let residual = turn - (self.pose.yaw - self.started);
        let variance = deviation * deviation + 2.0 * bounded.1;
        self.measure(residual, row, gradient, variance);
    }

    /// One reading: `row` is its derivative by the state, `gradient` by the unknowns.
    fn measure(&mut self, residual: f64, row: SVector<f64, 4>, gradient: Gradient, variance: f64) {
        let spread = self.covariance * row;
        let predicted = row.dot(&spread);
        let total = predicted + variance;
        let deviations = residual / total.sqrt();
        let (weight, cost) = huber(deviations, self.limit);
        self.normal.add(&gradient, residual, weight / total);
        self.normal.cost += cost;
        self.normal.truth.add(cost, 1);
        self.note(0, deviations.abs(), residual);
        // Weighed down, the reading is as if it had a larger variance.
        let gain = spread * (weight / total);
        let change = gain * residual;
        self.pose =
            Pose::new(self.pose.x + change[0], self.pose.y + change[1], self.pose.yaw + change[2]);
        self.distance += change[3];
        self.by -= gain * gradient.transpose();
        self.covariance -= gain * spread.transpose();
    }

    fn note(&mut self, kind: usize, deviations: f64, value: f64) {
        if deviations > self.normal.largest[kind].deviations {
            self.normal.largest[kind] = Largest { deviations, travel: self.travel, value };
        }
    }

    /// What front wheels, rear wheels and steering disagree on over a stretch.
    fn compare(&mut self, sum: &mut Rows, parameters: &Parameters) {
        sum.add_quantisation(&self.settings.noise.quantum);
        let Some(found) = sum.disagreement(parameters) else { return };
        let square = found.residual.dot(&(found.weight * found.residual));
        #[allow(clippy::cast_precision_loss)] // three at most
        let deviations = (square / found.freedom as f64).max(0.0).sqrt();
        // Three residuals together stray less than one alone.
        let (weight, cost) = huber(deviations, self.limit);
        let projected = found.by_parameters.transpose() * found.weight * weight;
        self.normal.parameters += projected * found.by_parameters;
        self.normal.right += projected * found.residual;
        #[allow(clippy::cast_precision_loss)]
        let count = found.freedom as f64;
        self.normal.cost += cost * count;
        self.normal.comparison.add(cost * count, found.freedom);
        self.note(1, deviations, deviations);
    }
}
