//! A stretch of path after which the parameters learn from what the sensors disagree about.
//!
//! All rows of a stretch share two unknowns, distance and turn. What they say beyond these is free
//! of the motion and, since the motion was solved with the same weights, of its error: a
//! measurement of the parameters alone. It corrects the pose through the covariance that both have
//! in common.

use kerbside_geometry::math;
use kerbside_messages::FilterState;

use super::algebra::{Factor, Projected, System, dot};
use super::joint::{Gradient, Joint, Values};
use super::rows::{Measures, PARAMETERS_OF, ROWS, Row};
use super::setup::Setup;
use crate::estimator::bits::{bits, of_bits};
use crate::estimator::increment::Increment;

/// A shorter stretch, as a share of the block, says less than its counts hide.
const SHORTEST: f64 = 0.3;

/// What a wheel may be off per metre for reasons that are not modelled, before it is gated.
const SLACK: f64 = 0.002;

/// Linearisations of a stretch.
const ITERATIONS: usize = 2;

/// The sum of one sensor's rows.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sum {
    /// In every record of the stretch.
    live: bool,
    /// And part of every record's motion; else it is watched only.
    used: bool,
    pub(crate) residual: f64,
    /// The row, weighed by the way.
    pub(crate) of: [f64; 2],
    pub(crate) by_parameters: [(usize, f64); 3],
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

/// What a stretch said. Only wheels are named: the steering and gyro rows break ties between
/// them.
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

    /// Writes the stretch down.
    pub(crate) fn save(&self, out: &mut FilterState) {
        for (index, sum) in self.sums.iter().enumerate() {
            out.block_residual[index] = sum.residual;
            out.block_by_motion[2 * index..2 * index + 2].copy_from_slice(&sum.of);
            let slopes = sum.by_parameters.map(|(_, slope)| slope);
            out.block_by_parameters[3 * index..3 * index + 3].copy_from_slice(&slopes);
            out.block_variance[index] = sum.variance;
            out.block_reading[index] = sum.reading;
        }
        out.block_live = bits(self.sums.map(|sum| sum.live));
        out.block_used = bits(self.sums.map(|sum| sum.used));
        (out.block_way, out.block_distance, out.block_turn) = (self.way, self.distance, self.turn);
        (out.block_records, out.block_chain) = (self.records, self.chain);
    }

    /// Goes on with a stretch that was written down.
    pub(crate) fn load(&mut self, saved: &FilterState) {
        let live: [bool; ROWS] = of_bits(saved.block_live);
        let used: [bool; ROWS] = of_bits(saved.block_used);
        self.sums = core::array::from_fn(|index| Sum {
            live: live[index],
            used: used[index],
            residual: saved.block_residual[index],
            of: core::array::from_fn(|entry| saved.block_by_motion[2 * index + entry]),
            by_parameters: core::array::from_fn(|entry| {
                (PARAMETERS_OF[index][entry], saved.block_by_parameters[3 * index + entry])
            }),
            variance: saved.block_variance[index],
            reading: saved.block_reading[index],
        });
        (self.way, self.distance, self.turn) =
            (saved.block_way, saved.block_distance, saved.block_turn);
        (self.records, self.chain) = (saved.block_records, saved.block_chain);
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
            let variances = core::array::from_fn(|row| self.variance(setup, row));
            let change = trial.deviation - before;
            let rows = self.project(setup, &before, &change, &variances, None);
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
        let rows = self.judged(setup, joint, None);
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
            let rows = self.judged(setup, joint, Some(wheel));
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
        if leverage > 1e-6 / self.spread(setup, wheel) {
            let residual = factor.solve(&rows.residual);
            verdict.ratios[wheel] = dot(&own, &residual).powi(2) / leverage;
            verdict.tested[wheel] = true;
        }
    }

    /// The rows as the gate sees them.
    fn judged(&self, setup: &Setup, joint: &Joint, watched: Option<usize>) -> Projected {
        let variances = core::array::from_fn(|row| self.spread(setup, row));
        self.project(setup, &joint.deviation, &Values::zeros(), &variances, watched)
    }

    /// Variance of a row, for the gate.
    fn spread(&self, setup: &Setup, row: usize) -> f64 {
        if row >= 4 {
            return self.sums[row].variance;
        }
        let slack = SLACK * self.way;
        self.sums[row].variance + setup.quantisation[row] + slack * slack
    }

    /// Variance of a row, for learning. What a count hides at the end of a stretch, it shows at the
    /// beginning of the next: over n stretches in a row counts add q^2/6 to the sum once, not n
    /// times. A share of 1/n for the n-th adds a little more than that.
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
        variances: &[f64; ROWS],
        watched: Option<usize>,
    ) -> Projected {
        let mut system = System::default();
        for (index, &variance) in variances.iter().enumerate() {
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
