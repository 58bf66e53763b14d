//! Dead reckoning of one run between what is known of its poses, with everything's dependence on the parameters.
//!
//! Wheel and steering noise are process noise, reference poses are measurements; the whitened innovations, taken
//! from a true start pose that is unknown too, are the run's likelihood (errors in variables). How late the reference's
//! clock is and what a gyro's bias is are states of the run beside the pose: each run has its own, and it may wander.

use kerbside_geometry::{Pose, angle, math};
use nalgebra::{SMatrix, SVector};

use crate::condense::{Block, Condensed, Event};
use crate::gyro::Turned;
use crate::known::Known;
use crate::noise::Settings;
use crate::normal::{Gradient, Largest, Normal, UNKNOWNS, huber};
use crate::parameters::{COUNT, Parameter, Parameters};
use crate::rows::{Motion, Rows, TURN, Used};

/// States of a run: x, y, yaw, distance, then these.
const STATES: usize = 7;
/// By how much the reference's stamps are late \[s\].
const LAG: usize = 4;
/// What the gyro reads at rest \[rad/s\].
const BIAS: usize = 5;
/// Heading when the gyro was last looked at \[rad\].
const LOOK: usize = 6;

type State = SVector<f64, STATES>;
type States = SMatrix<f64, STATES, STATES>;

/// The state, its covariance, and its derivative by the unknowns.
struct Chain<'a> {
    pose: Pose,
    distance: f64,
    lag: f64,
    bias: f64,
    /// Heading when the gyro was last looked at \[rad\].
    look: f64,
    covariance: States,
    by: SMatrix<f64, STATES, UNKNOWNS>,
    normal: Normal,
    limit: f64,
    settings: &'a Settings,
    marker: Pose,
    travel: f64,
    /// Heading at the start \[rad\].
    started: f64,
    /// Distance and turn per travel of the wheels, newest \[-, rad/m\].
    pace: (f64, f64),
    /// Stamp up to which the lag has wandered \[s\].
    wandered: f64,
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
    let mut chain = Chain::new(*start, run, parameters, settings, limit);
    let mut events = run.events.iter().peekable();
    let mut sum = Rows::empty(parameters, used);
    let mut counted = None;
    for (index, block) in run.blocks.iter().enumerate() {
        let rows = Rows::of_block(block, parameters, &settings.noise, used);
        let motion = rows.motion()?;
        let bounded = *counted.get_or_insert_with(|| chain.begin(&motion));
        while let Some(event) = events.next_if(|event| event.after <= index) {
            chain.meet(event, bounded);
        }
        chain.roll(&motion, block);
        chain.travel += block.travel;
        sum.add(&rows);
        let next = run.blocks.get(index + 1).map(|block| block.comparison);
        if next != Some(block.comparison) {
            chain.compare(&mut sum, parameters);
            sum = Rows::empty(parameters, used);
        }
    }
    for event in events {
        chain.meet(event, counted.unwrap_or_default());
    }
    if settings.noise.reference_lag > 0.0 {
        chain.normal.lag = Some(chain.lag);
    }
    if run.spun || run.events.iter().any(|event| matches!(event.known, Known::Gyro(_))) {
        chain.normal.bias = Some((chain.bias, chain.covariance[(BIAS, BIAS)].max(0.0)));
    }
    Some(chain.normal)
}

impl<'a> Chain<'a> {
    fn new(
        start: Pose,
        run: &Condensed,
        parameters: &Parameters,
        settings: &'a Settings,
        limit: f64,
    ) -> Self {
        let mut by = SMatrix::<f64, STATES, UNKNOWNS>::zeros();
        by.fixed_view_mut::<3, 3>(0, COUNT).fill_with_identity();
        by[(LOOK, COUNT + 2)] = 1.0;
        let noise = &settings.noise;
        let mut covariance = States::zeros();
        covariance[(LAG, LAG)] = noise.reference_lag * noise.reference_lag;
        covariance[(BIAS, BIAS)] = noise.gyro_bias * noise.gyro_bias;
        Self {
            pose: start,
            distance: 0.0,
            lag: 0.0,
            bias: 0.0,
            look: start.yaw,
            covariance,
            by,
            normal: Normal::empty(),
            limit,
            settings,
            marker: run.marker(parameters),
            travel: 0.0,
            started: start.yaw,
            pace: (0.0, 0.0),
            wandered: run.begin,
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

    fn roll(&mut self, motion: &Motion, block: &Block) {
        // What a gyro's bias adds to the turn is taken off by what is known of it.
        let time = block.turned_by_gyro.map_or(0.0, |turned| turned.time);
        let by_bias = (-time * motion.gain[(0, TURN)], -time * motion.gain[(1, TURN)]);
        let (distance, turn) =
            (motion.distance + by_bias.0 * self.bias, motion.turn + by_bias.1 * self.bias);
        let chord = distance * math::sinc(0.5 * turn);
        let (sin, cos) = math::sin_cos(self.pose.yaw + 0.5 * turn);
        // The chord's own dependence on the turn is of second order in a block.
        let input = SMatrix::<f64, 4, 2>::new(
            cos,
            -0.5 * chord * sin,
            sin,
            0.5 * chord * cos,
            0.0,
            1.0,
            block.direction,
            0.0,
        );
        self.couple(0, 2, -chord * sin);
        self.couple(1, 2, chord * cos);
        if time > 0.0 {
            let by_bias = input * SVector::<f64, 2>::new(by_bias.0, by_bias.1);
            (0..4).for_each(|state| self.couple(state, BIAS, by_bias[state]));
        }
        let mut by_parameters = self.by.fixed_view_mut::<4, COUNT>(0, 0);
        by_parameters += input * motion.by_parameters;
        let mut covariance = self.covariance.fixed_view_mut::<4, 4>(0, 0);
        covariance += input * motion.covariance * input.transpose();
        self.pose = self.pose.advance(distance, turn);
        self.distance += block.direction * distance;
        if block.travel > 0.0 {
            self.pace = (distance / block.travel, turn / block.travel);
        }
    }

    /// What adding `share` of one state to another does to covariance and derivatives.
    fn couple(&mut self, to: usize, from: usize, share: f64) {
        let row = self.covariance.row(from) * share;
        let mut changed = self.covariance.row_mut(to);
        changed += row;
        let column = self.covariance.column(from) * share;
        let mut changed = self.covariance.column_mut(to);
        changed += column;
        let row = self.by.row(from) * share;
        let mut changed = self.by.row_mut(to);
        changed += row;
    }

    fn meet(&mut self, event: &Event, bounded: (f64, f64)) {
        match event.known {
            Known::Pose { x, y, yaw, position_deviation, yaw_deviation } => {
                self.wander(event.t);
                let position = position_deviation * position_deviation + bounded.0;
                self.meet_position(x, true, event.speed, position);
                self.meet_position(y, false, event.speed, position);
                if let Some(yaw) = yaw {
                    let variance = yaw_deviation * yaw_deviation + bounded.1;
                    self.meet_yaw(yaw, event.speed, variance);
                }
            }
            Known::Distance(distance, deviation) => {
                let sign = if self.distance < 0.0 { -1.0 } else { 1.0 };
                let mut row = State::zeros();
                row[3] = sign;
                let gradient = self.by.transpose() * row;
                let variance = deviation * deviation + bounded.0;
                self.measure(distance - self.distance.abs(), row, gradient, variance);
            }
            Known::Turn(turn, deviation) => self.meet_turn(turn, deviation, bounded),
            Known::Gyro(turned) => self.look_at(&turned),
        }
    }

    /// The lag's change since it was last asked for.
    fn wander(&mut self, t: f64) {
        let wander = self.settings.noise.reference_wander;
        self.covariance[(LAG, LAG)] += wander * wander * (t - self.wandered).max(0.0);
        self.wandered = t;
    }

    /// Where the body is by the time that the reference means, and the speeds there.
    fn seen(&self, speed: f64) -> (Pose, f64, f64) {
        let (along, turning) = (self.pace.0 * speed, self.pace.1 * speed);
        // Late stamps: what is said of now was so before.
        (self.pose.advance(-along * self.lag, -turning * self.lag), along, turning)
    }

    fn meet_position(&mut self, read: f64, is_x: bool, speed: f64, variance: f64) {
        let (seen, along, turning) = self.seen(speed);
        let (x, y) = seen.transform(self.marker.x, self.marker.y);
        let (sin, cos) = math::sin_cos(seen.yaw);
        let mut row = State::zeros();
        let (residual, by_marker) = if is_x {
            (row[0], row[2]) = (1.0, self.pose.y - y);
            row[LAG] = -(along * cos + turning * (seen.y - y));
            (read - x, (cos, -sin))
        } else {
            (row[1], row[2]) = (1.0, x - self.pose.x);
            row[LAG] = -(along * sin + turning * (x - seen.x));
            (read - y, (sin, cos))
        };
        let mut gradient = self.by.transpose() * row;
        gradient[Parameter::MarkerX.index()] += by_marker.0;
        gradient[Parameter::MarkerY.index()] += by_marker.1;
        self.measure(residual, row, gradient, variance);
    }

    fn meet_yaw(&mut self, read: f64, speed: f64, variance: f64) {
        let (seen, _, turning) = self.seen(speed);
        let mut row = State::zeros();
        (row[2], row[LAG]) = (1.0, -turning);
        let mut gradient = self.by.transpose() * row;
        gradient[Parameter::MarkerYaw.index()] += 1.0;
        let residual = angle::wrap(read - seen.yaw - self.marker.yaw);
        self.measure(residual, row, gradient, variance);
    }

    /// The turn since the start, which the pose there is part of.
    fn meet_turn(&mut self, turn: f64, deviation: f64, bounded: (f64, f64)) {
        let mut row = State::zeros();
        row[2] = 1.0;
        let mut gradient = self.by.transpose() * row;
        gradient[COUNT + 2] -= 1.0;
        let residual = turn - (self.pose.yaw - self.started);
        let variance = deviation * deviation + 2.0 * bounded.1;
        self.measure(residual, row, gradient, variance);
    }

    /// The turn since the last look, which that heading is part of, and the bias; then the heading is kept for the
    /// next.
    fn look_at(&mut self, turned: &Turned) {
        if turned.variance.is_finite() {
            let mut row = State::zeros();
            (row[2], row[LOOK], row[BIAS]) = (1.0, -1.0, turned.time);
            let gradient = self.by.transpose() * row;
            let residual = turned.turn - (self.pose.yaw - self.look) - self.bias * turned.time;
            self.update(residual, row, gradient, turned.variance, 1);
        }
        self.look = self.pose.yaw;
        let row = self.covariance.row(2).into_owned();
        self.covariance.set_row(LOOK, &row);
        let column = self.covariance.column(2).into_owned();
        self.covariance.set_column(LOOK, &column);
        let row = self.by.row(2).into_owned();
        self.by.set_row(LOOK, &row);
    }

    /// One reading of what is known of poses, distance or turn: `row` is its derivative by the state, `gradient` by the
    /// unknowns.
    fn measure(&mut self, residual: f64, row: State, gradient: Gradient, variance: f64) {
        self.update(residual, row, gradient, variance, 0);
    }

    /// One reading; `kind` 0 counts it to the truth, 1 to what the sensors disagree on.
    fn update(
        &mut self,
        residual: f64,
        row: State,
        gradient: Gradient,
        variance: f64,
        kind: usize,
    ) {
        let spread = self.covariance * row;
        let predicted = row.dot(&spread);
        let total = predicted + variance;
        let deviations = residual / total.sqrt();
        let (weight, cost) = huber(deviations, self.limit);
        self.normal.add(&gradient, residual, weight / total);
        self.normal.cost += cost;
        if kind == 0 {
            self.normal.truth.add(cost, 1);
        } else {
            self.normal.comparison.add(cost, 1);
        }
        let value = if kind == 0 { residual } else { deviations.abs() };
        self.note(kind, deviations.abs(), value);
        // Weighed down, the reading is as if it had a larger variance.
        let gain = spread * (weight / total);
        let change = gain * residual;
        self.pose =
            Pose::new(self.pose.x + change[0], self.pose.y + change[1], self.pose.yaw + change[2]);
        self.distance += change[3];
        self.lag += change[LAG];
        self.bias += change[BIAS];
        self.look += change[LOOK];
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
