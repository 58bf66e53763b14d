//! A stretch of path after which the parameters learn from what the sensors disagree about.
//!
//! All rows of a stretch share two unknowns, distance and turn; what m rows say beyond these are m
//! - 2 numbers that are free of the motion, and, since the motion was solved with the same weights,
//! free of its error: a measurement of the parameters alone. It corrects the pose through the
//! covariance that both have in common.

use kerbside_geometry::math;
use nalgebra::SVector;

use super::joint::{Gradient, Joint, Values};
use super::rows::{GYRO, Measures, ROWS, Row, STEERING};
use super::setup::Setup;
use crate::estimator::increment::Increment;
use crate::parameters::PARAMETERS;

/// A shorter stretch, as a share of the block, says less than its counts hide.
const SHORTEST: f64 = 0.3;

/// Linearisations of a stretch.
const ITERATIONS: usize = 2;

/// The sum of one sensor's rows.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sum {
    /// In every record of the stretch.
    live: bool,
    /// And part of every record's motion; else it is watched only.
    used: bool,
    residual: f64,
    /// The row, weighed by the way.
    of: [f64; 2],
    by_parameters: [(usize, f64); 3],
    variance: f64,
    reading: f64,
}

/// The stretch since the newest update.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Block {
    sums: [Sum; ROWS],
    pub(crate) way: f64,
    distance: f64,
    turn: f64,
    /// Number of the first record, and of records.
    pub(crate) first: u64,
    pub(crate) records: u32,
    /// Stretches before this one that ended where the next began.
    chain: u32,
}

/// What a stretch said.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Verdict {
    /// Squared innovation over its variance, per wheel; zero where nothing else tells.
    pub(crate) ratios: [f64; 4],
    /// Wheels of which there is a ratio.
    pub(crate) tested: [bool; 4],
    /// The parameters learnt.
    pub(crate) learnt: bool,
    /// The wheel beyond the gate, if one is.
    pub(crate) suspect: Option<usize>,
    /// Number of its first record.
    pub(crate) first: u64,
    /// Square sum of what the rows say beyond the motion, and how many numbers these are.
    pub(crate) square: f64,
    pub(crate) freedom: u8,
}

/// The rows of a stretch without the motion: unit variance, independent.
#[derive(Clone, Copy, Debug, Default)]
struct Projected {
    count: usize,
    residual: [f64; ROWS],
    by_parameters: [Values; ROWS],
    /// What a unit of each sensor's reading does.
    by_reading: [[f64; ROWS]; ROWS],
}

impl Block {
    /// A record whose rows gave `increment`.
    pub(crate) fn add(&mut self, number: u64, way: f64, rows: &[Row; ROWS], motion: &Increment) {
        if self.records == 0 {
            *self = Self { first: number, chain: self.chain, ..Self::default() };
        }
        for (sum, row) in self.sums.iter_mut().zip(rows) {
            let first = self.records == 0;
            sum.used = row.live && row.used && (first || sum.used);
            sum.live = row.live && (first || sum.live);
            if sum.live {
                sum.add(row, way, motion);
            }
        }
        self.records += 1;
        self.way += way;
        self.distance += motion.distance;
        self.turn += motion.turn;
    }

    /// Whether a record of `distance` turns the other way.
    pub(crate) fn reverses(&self, distance: f64) -> bool {
        self.distance * distance < 0.0
    }

    /// The believed parameters changed by `change` within the stretch.
    pub(crate) fn shift(&mut self, change: &Values) {
        for sum in &mut self.sums {
            for (parameter, slope) in sum.by_parameters {
                sum.residual -= slope * change[parameter];
            }
        }
    }

    /// The stretch is left without a word.
    pub(crate) fn clear(&mut self) {
        self.begin(0);
    }

    fn begin(&mut self, chain: u32) {
        self.records = 0;
        self.chain = chain;
        (self.way, self.distance, self.turn) = (0.0, 0.0, 0.0);
    }

    /// Ends the stretch: `joint` learns. A wheel beyond its gate is left out and named; with
    /// `hold`, `joint` then stays as it is.
    pub(crate) fn close(&mut self, setup: &Setup, joint: &mut Joint, hold: bool) -> Verdict {
        let mut verdict = Verdict::default();
        if self.records > 0 && self.way >= SHORTEST * setup.block {
            verdict = self.learn(setup, joint, hold);
            verdict.first = self.first;
            joint.drift(&setup.drift(self.way, 0.0));
        }
        self.begin(if verdict.learnt { self.chain.saturating_add(1) } else { 0 });
        verdict
    }

    fn learn(&mut self, setup: &Setup, joint: &mut Joint, hold: bool) -> Verdict {
        let mut verdict = self.judge(setup, joint);
        if let Some(wheel) = verdict.suspect {
            if hold {
                return verdict;
            }
            self.sums[wheel].used = false;
            let rest = self.judge(setup, joint);
            (verdict.square, verdict.freedom) = (rest.square, rest.freedom);
        }
        let before = joint.deviation;
        let mut trial = *joint;
        for iteration in 1..=ITERATIONS {
            let rows = self.project(setup, &before, &(trial.deviation - before), None);
            trial = *joint;
            for index in 0..rows.count {
                let gradient = Gradient {
                    pose: nalgebra::Vector3::zeros(),
                    parameters: rows.by_parameters[index],
                };
                let expected = rows.by_parameters[index].dot(&(trial.deviation - before));
                trial.update(&gradient, rows.residual[index] - expected, 1.0);
            }
            if setup.steered || iteration == ITERATIONS {
                break;
            }
        }
        *joint = trial;
        verdict.learnt = true;
        verdict
    }

    /// Test ratio of each wheel: what its reading is off from all else, over the variance of that.
    fn judge(&self, setup: &Setup, joint: &Joint) -> Verdict {
        let mut verdict = Verdict::default();
        let rows = self.project(setup, &joint.deviation, &Values::zeros(), None);
        let Some(factor) = Factor::new(&rows, joint) else { return verdict };
        let residual = factor.solve(&rows.residual);
        verdict.square = dot(&residual, &residual);
        verdict.freedom = u8::try_from(rows.count).unwrap_or(0);
        for wheel in (0..4).filter(|wheel| self.sums[*wheel].used) {
            self.test(setup, wheel, &rows, &factor, &mut verdict);
        }
        let worst = (0..4).fold(0, |worst, wheel| {
            if verdict.ratios[wheel] > verdict.ratios[worst] { wheel } else { worst }
        });
        verdict.suspect = (verdict.ratios[worst] > setup.wheel_gate).then_some(worst);
        for wheel in (0..4).filter(|wheel| self.sums[*wheel].live && !self.sums[*wheel].used) {
            let rows = self.project(setup, &joint.deviation, &Values::zeros(), Some(wheel));
            if let Some(factor) = Factor::new(&rows, joint) {
                self.test(setup, wheel, &rows, &factor, &mut verdict);
            }
        }
        verdict
    }

    fn test(
        &self,
        setup: &Setup,
        wheel: usize,
        rows: &Projected,
        factor: &Factor,
        verdict: &mut Verdict,
    ) {
        let by_reading: [f64; ROWS] = core::array::from_fn(|row| rows.by_reading[row][wheel]);
        let own = factor.solve(&by_reading);
        let leverage = dot(&own, &own);
        if leverage > 1e-6 / self.variance(setup, wheel) {
            let residual = factor.solve(&rows.residual);
            verdict.ratios[wheel] = dot(&own, &residual).powi(2) / leverage;
            verdict.tested[wheel] = true;
        }
    }

    /// What a count hides at the end of a stretch, it shows at the beginning of the next: over n
    /// stretches in a row counts add q^2/6 to the sum once, not n times. A share of 1/n for the n-th
    /// adds a little more than that.
    fn variance(&self, setup: &Setup, row: usize) -> f64 {
        let share = 1.0 / f64::from(self.chain.saturating_add(1));
        let counted = if row < 4 { share * setup.quantisation[row] } else { 0.0 };
        self.sums[row].variance + counted
    }

    /// Whitens the rows and takes the motion out (two Householder reflections). Where no steering
    /// sensor tells the direction of front wheels, their way is that of the stretch's arc, anew
    /// about parameters changed by `change`.
    fn project(
        &self,
        setup: &Setup,
        deviation: &Values,
        change: &Values,
        watched: Option<usize>,
    ) -> Projected {
        let mut system = System::default();
        for index in 0..ROWS {
            let variance = self.variance(setup, index);
            let taken = self.sums[index].used || watched == Some(index);
            if taken && variance > 0.0 {
                let sum = if index < 2 && !setup.steered {
                    self.arc(index, setup, deviation, change)
                } else {
                    self.sums[index]
                };
                system.push(&sum, index, self.way, 1.0 / variance.sqrt());
            }
        }
        system.reduce()
    }

    /// Front wheel `wheel` over the whole stretch as one arc: hypot(distance - y turn, L turn).
    fn arc(&self, wheel: usize, setup: &Setup, deviation: &Values, change: &Values) -> Sum {
        let measures = Measures::new(setup, &(deviation + change));
        let length = math::hypot(self.distance, measures.wheelbase * self.turn);
        if length == 0.0 {
            return self.sums[wheel];
        }
        let side = if self.distance < 0.0 { -1.0 } else { 1.0 };
        let centre =
            (side * self.distance / length, side * measures.wheelbase * self.turn / length);
        let travel = self.sums[wheel].reading;
        let row = measures.wheel(wheel, travel, centre, 1.0);
        let mut sum = Sum { live: true, used: true, reading: travel, ..Sum::default() };
        sum.by_parameters = row.by_parameters(self.turn);
        sum.of = row.of.map(|entry| entry * self.way);
        sum.residual = row.residual(self.distance, self.turn);
        for (parameter, slope) in sum.by_parameters {
            sum.residual += slope * change[parameter];
        }
        sum
    }
}

impl Sum {
    fn add(&mut self, row: &Row, way: f64, motion: &Increment) {
        self.residual += row.residual(motion.distance, motion.turn);
        self.of[0] += way * row.of[0];
        self.of[1] += way * row.of[1];
        self.variance += row.variance;
        let added = row.by_parameters(motion.turn);
        for (sum, (parameter, slope)) in self.by_parameters.iter_mut().zip(added) {
            *sum = (parameter, sum.1 + slope);
        }
        if row.own.0 < 4 {
            self.reading -= row.own.1;
        }
    }
}

/// The whitened rows.
#[derive(Clone, Copy, Debug, Default)]
struct System {
    count: usize,
    of: [[f64; 2]; ROWS],
    rows: Projected,
}

impl System {
    fn push(&mut self, sum: &Sum, sensor: usize, way: f64, weight: f64) {
        let at = self.count;
        self.of[at] = sum.of.map(|entry| entry / way * weight);
        self.rows.residual[at] = sum.residual * weight;
        for (parameter, slope) in sum.by_parameters {
            self.rows.by_parameters[at][parameter] += slope * weight;
        }
        self.rows.by_reading[at][sensor] = weight;
        self.count += 1;
    }

    fn reduce(mut self) -> Projected {
        if self.count < 2 {
            return Projected::default();
        }
        self.reflect(0);
        self.reflect(1);
        let mut rows = self.rows;
        rows.count = self.count - 2;
        rows.residual.copy_within(2.., 0);
        rows.by_parameters.copy_within(2.., 0);
        rows.by_reading.copy_within(2.., 0);
        rows
    }

    /// Clears column `column` below the diagonal.
    fn reflect(&mut self, column: usize) {
        let mut mirror = [0.0; ROWS];
        for (row, entry) in mirror.iter_mut().enumerate().take(self.count).skip(column) {
            *entry = self.of[row][column];
        }
        let length = dot(&mirror, &mirror).sqrt();
        mirror[column] += length.copysign(mirror[column]);
        let square = dot(&mirror, &mirror);
        if square <= 0.0 {
            return;
        }
        let factor = 2.0 / square;
        for other in 0..2 {
            let entries = core::array::from_fn(|row| self.of[row][other]);
            let share = factor * dot(&mirror, &entries);
            (0..ROWS).for_each(|row| self.of[row][other] -= share * mirror[row]);
        }
        let share = factor * dot(&mirror, &self.rows.residual);
        (0..ROWS).for_each(|row| self.rows.residual[row] -= share * mirror[row]);
        self.reflect_rest(&mirror, factor);
    }

    fn reflect_rest(&mut self, mirror: &[f64; ROWS], factor: f64) {
        let mut parameters = Values::zeros();
        let mut readings = [0.0; ROWS];
        for row in 0..self.count {
            parameters += self.rows.by_parameters[row] * mirror[row];
            (0..ROWS).for_each(|sensor| {
                readings[sensor] += self.rows.by_reading[row][sensor] * mirror[row];
            });
        }
        for row in 0..self.count {
            let share = factor * mirror[row];
            self.rows.by_parameters[row] -= parameters * share;
            (0..ROWS).for_each(|sensor| {
                self.rows.by_reading[row][sensor] -= readings[sensor] * share;
            });
        }
    }
}

/// Cholesky factor of the projected rows' covariance, parameters included.
struct Factor {
    count: usize,
    lower: [[f64; ROWS]; ROWS],
}

impl Factor {
    fn new(rows: &Projected, joint: &Joint) -> Option<Self> {
        let mut lower = [[0.0; ROWS]; ROWS];
        for row in 0..rows.count {
            let spread: SVector<f64, PARAMETERS> = joint.covariance() * rows.by_parameters[row];
            for column in row..rows.count {
                let unit = if row == column { 1.0 } else { 0.0 };
                lower[column][row] = unit + rows.by_parameters[column].dot(&spread);
            }
        }
        for column in 0..rows.count {
            for row in column..rows.count {
                let mut entry = lower[row][column];
                (0..column).for_each(|inner| entry -= lower[row][inner] * lower[column][inner]);
                if row == column {
                    if entry.is_nan() || entry <= 0.0 {
                        return None;
                    }
                    lower[row][column] = entry.sqrt();
                } else {
                    lower[row][column] = entry / lower[column][column];
                }
            }
        }
        Some(Self { count: rows.count, lower })
    }

    /// The inverse of the factor times `right`.
    fn solve(&self, right: &[f64; ROWS]) -> [f64; ROWS] {
        let mut solution = [0.0; ROWS];
        for row in 0..self.count {
            let mut entry = right[row];
            (0..row).for_each(|inner| entry -= self.lower[row][inner] * solution[inner]);
            solution[row] = entry / self.lower[row][row];
        }
        solution
    }
}

fn dot(left: &[f64; ROWS], right: &[f64; ROWS]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}

// The steering and gyro rows are never named: they break ties between the wheels.
const _: () = assert!(STEERING >= 4 && GYRO >= 4);
