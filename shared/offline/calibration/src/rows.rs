//! What the wheels and the steering sensor say of a block: rows that are linear in the rear axle's distance and turn.
//!
//! Every row is z = h (D, T): a rear wheel R a = D -+ T b_r/2; a front wheel's longitudinal travel R a cos d = D -+
//! T b_f/2 (form b of section 2a); the lateral travel R a sin d = L T (form c), or tan(steering) D = L T where no
//! front wheel is counted; a gyro's turn = T, its bias taken off elsewhere. Rows are summed over blocks without loss, as h does not depend on the block.

use kerbside_geometry::math;
use nalgebra::{Matrix2, SMatrix, SVector};

use crate::ackermann::wheel_angle;
use crate::condense::{Block, Condensed};
use crate::noise::Noise;
use crate::parameters::{COUNT, Parameter, Parameters, Vector};

/// Rows: fl, fr, rl, rr, lateral, gyro.
pub(crate) const ROWS: usize = 6;
/// Row of the lateral travel; also the place of the steering sensor's noise among the raw noises.
const LATERAL: usize = 4;
/// Row of the gyro's turn, where it alone tells it; and the place of its noise.
pub(crate) const TURN: usize = 5;

const TRACK_FRONT: usize = Parameter::TrackFront.index();
const TRACK_REAR: usize = Parameter::TrackRear.index();
const WHEELBASE: usize = Parameter::Wheelbase.index();
const ZERO: usize = Parameter::SteeringZero.index();
const GAIN: usize = Parameter::SteeringGain.index();

/// Derivatives of rows by parameters.
pub(crate) type ByParameters = SMatrix<f64, ROWS, COUNT>;
type Square = SMatrix<f64, ROWS, ROWS>;

/// Which rows are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Used {
    pub(crate) rows: [bool; ROWS],
    /// Whether front wheels' angles come from a sensor.
    pub(crate) sensed: bool,
}

impl Used {
    /// All that the run offers.
    pub(crate) fn of(run: &Condensed) -> Self {
        let [fl, fr, rl, rr] = run.wheels;
        Self { rows: [fl, fr, rl, rr, run.steered, run.spun], sensed: run.steered }
    }

    /// Of these only the given wheels' rows, the lateral one where `lateral`.
    pub(crate) fn only(self, wheels: [bool; 4], lateral: bool) -> Self {
        let rows = core::array::from_fn(|row| {
            self.rows[row]
                && match row {
                    LATERAL => lateral,
                    TURN => true,
                    wheel => wheels[wheel],
                }
        });
        Self { rows, ..self }
    }

    pub(crate) fn count(&self) -> usize {
        self.rows.iter().filter(|used| **used).count()
    }
}

/// Rows of one block, or of several summed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows {
    pub(crate) z: SVector<f64, ROWS>,
    pub(crate) by_parameters: ByParameters,
    h: SMatrix<f64, ROWS, 2>,
    covariance: Square,
    used: Used,
}

/// Distance and turn that the rows agree on best.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    /// Distance \[m\].
    pub(crate) distance: f64,
    /// Turn \[rad\].
    pub(crate) turn: f64,
    pub(crate) by_parameters: SMatrix<f64, 2, COUNT>,
    pub(crate) covariance: Matrix2<f64>,
    /// Derivative of (distance, turn) by the rows.
    pub(crate) gain: SMatrix<f64, 2, ROWS>,
}

/// What the rows disagree on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Disagreement {
    pub(crate) residual: SVector<f64, ROWS>,
    pub(crate) by_parameters: ByParameters,
    /// Inverse covariance, of rank `freedom`.
    pub(crate) weight: Square,
    pub(crate) freedom: usize,
}

/// The centre wheel's angle, how it depends on the parameters, and on the raw noises (four wheels' travel \[m\], the
/// steering sensor's mean and the gyro's turn \[rad\]).
struct Steer {
    angle: f64,
    by_parameters: Vector,
    by_noise: SVector<f64, ROWS>,
}

impl Steer {
    fn sensed(reading: f64, p: &Parameters) -> Self {
        let (angle, gain) = (p.road_angle(reading), p.values[GAIN]);
        let mut by_parameters = Vector::zeros();
        by_parameters[ZERO] = -1.0 / gain;
        by_parameters[GAIN] = -angle / gain;
        let mut by_noise = SVector::zeros();
        by_noise[LATERAL] = 1.0 / gain;
        Self { angle, by_parameters, by_noise }
    }

    /// From the curvature that the rear wheels roll.
    fn rolled(block: &Block, p: &Parameters) -> Self {
        let v = &p.values;
        let (left, right) = (v[2] * block.rotation[2], v[3] * block.rotation[3]);
        let (track, base) = (v[TRACK_REAR], v[WHEELBASE]);
        let (distance, turn) = (0.5 * (left + right), (right - left) / track);
        let square = distance * distance + base * base * turn * turn;
        if square == 0.0 {
            return Self { angle: 0.0, by_parameters: Vector::zeros(), by_noise: SVector::zeros() };
        }
        let (by_turn, by_distance) = (base * distance / square, -base * turn / square);
        let by_left = 0.5 * by_distance - by_turn / track;
        let by_right = 0.5 * by_distance + by_turn / track;
        let mut by_parameters = Vector::zeros();
        by_parameters[2] = by_left * block.rotation[2];
        by_parameters[3] = by_right * block.rotation[3];
        by_parameters[TRACK_REAR] = -by_turn * turn / track;
        by_parameters[WHEELBASE] = distance * turn / square;
        let mut by_noise = SVector::zeros();
        by_noise[2] = by_left;
        by_noise[3] = by_right;
        Self { angle: math::atan(base * turn / distance), by_parameters, by_noise }
    }
}

/// Rows while they are put together; `by_noise` is their derivative by the raw noises.
struct Draft {
    rows: Rows,
    by_noise: Square,
}

impl Rows {
    /// The rows of a block.
    pub(crate) fn of_block(block: &Block, p: &Parameters, noise: &Noise, used: Used) -> Self {
        let mut draft = Draft { rows: Self::empty(p, used), by_noise: Square::zeros() };
        draft.rear(block, p);
        if let Some(turned) = block.turned_by_gyro.filter(|_| used.rows[TURN]) {
            draft.rows.z[TURN] = turned.turn;
            draft.by_noise[(TURN, TURN)] = 1.0;
        }
        if let Some(reading) = block.steering.filter(|_| used.sensed) {
            // Two points stand for an angle that strays within the block.
            let angles = [reading.mean - reading.spread, reading.mean + reading.spread];
            let count = if reading.spread > 0.0 { 2 } else { 1 };
            for angle in &angles[..count] {
                let share = if count == 2 { 0.5 } else { 1.0 };
                draft.front(block, p, &Steer::sensed(*angle, p), share);
            }
        } else if used.rows[0] || used.rows[1] {
            draft.front(block, p, &Steer::rolled(block, p), 1.0);
        }
        draft.finish(block, p, noise)
    }

    /// No motion at all; the start of a sum.
    pub(crate) fn empty(p: &Parameters, used: Used) -> Self {
        let (front, rear) = (0.5 * p.values[TRACK_FRONT], 0.5 * p.values[TRACK_REAR]);
        let mut h = SMatrix::<f64, ROWS, 2>::zeros();
        for (row, lever) in [-front, front, -rear, rear].into_iter().enumerate() {
            h[(row, 0)] = 1.0;
            h[(row, 1)] = lever;
        }
        h[(LATERAL, 1)] = p.values[WHEELBASE];
        h[(TURN, 1)] = 1.0;
        Self {
            z: SVector::zeros(),
            by_parameters: ByParameters::zeros(),
            h,
            covariance: Square::zeros(),
            used,
        }
    }

    /// Adds the rows of what was rolled next.
    pub(crate) fn add(&mut self, other: &Self) {
        self.z += other.z;
        self.by_parameters += other.by_parameters;
        self.covariance += other.covariance;
    }

    /// Adds what counting leaves between two readings, `quantum`^2/6 per wheel: bounded, not a random walk.
    pub(crate) fn add_quantisation(&mut self, quantum: &[f64; 4]) {
        for (row, quantum) in quantum.iter().enumerate() {
            self.covariance[(row, row)] += quantum * quantum / 6.0;
        }
    }

    /// Inverse covariance of the rows, 0 for those that are not used.
    fn weight(&self) -> Option<Square> {
        let mut covariance = self.covariance;
        for (row, used) in self.used.rows.iter().enumerate() {
            if !used {
                covariance.row_mut(row).fill(0.0);
                covariance.column_mut(row).fill(0.0);
                covariance[(row, row)] = 1.0;
            }
        }
        let mut weight = covariance.cholesky()?.inverse();
        for (row, used) in self.used.rows.iter().enumerate() {
            if !used {
                weight[(row, row)] = 0.0;
            }
        }
        Some(weight)
    }

    /// The best agreement of the rows, by generalised least squares; none where they leave distance or turn open.
    pub(crate) fn motion(&self) -> Option<Motion> {
        let weight = self.weight()?;
        let projected = self.h.transpose() * weight;
        let covariance = (projected * self.h).try_inverse()?;
        let gain = covariance * projected;
        let motion = gain * self.z;
        let (distance, turn) = (motion[0], motion[1]);
        let by_parameters = gain * self.residual_by_parameters(turn);
        Some(Motion { distance, turn, by_parameters, covariance, gain })
    }

    /// Derivative of z - h (D, T) by the parameters; `turn` is T \[rad\].
    fn residual_by_parameters(&self, turn: f64) -> ByParameters {
        let mut by = self.by_parameters;
        for (row, (column, sign)) in
            [(TRACK_FRONT, 0.5), (TRACK_FRONT, -0.5), (TRACK_REAR, 0.5), (TRACK_REAR, -0.5)]
                .into_iter()
                .enumerate()
        {
            by[(row, column)] += sign * turn;
        }
        by[(LATERAL, WHEELBASE)] -= turn;
        by
    }

    /// These rows with the derivatives that they would have without noise: `residual` taken off.
    ///
    /// The travel that was read is noisy, and so is the derivative of a row by a radius. Left so, it goes along with
    /// the residual in every comparison, and the fit takes that for a wrong scale: 0.8 % of all lengths where a
    /// reference of 5 cm is all that holds the scale, as making everything small makes disagreement small.
    fn fitted(&self, residual: &SVector<f64, ROWS>, p: &Parameters) -> Self {
        let mut fitted = *self;
        let used = self.used.rows;
        for wheel in (0..4).filter(|wheel| used[*wheel]) {
            fitted.by_parameters[(wheel, wheel)] -= residual[wheel] / p.values[wheel];
        }
        let axle = if used[0] || used[1] { [0, 1] } else { [2, 3] };
        let share = if used[axle[0]] && used[axle[1]] { 0.5 } else { 1.0 };
        for wheel in axle.into_iter().filter(|wheel| used[*wheel] && used[LATERAL]) {
            fitted.by_parameters[(LATERAL, wheel)] -= share * residual[LATERAL] / p.values[wheel];
        }
        fitted
    }

    /// What is left of the rows after their best agreement; none where there is nothing left to disagree on.
    pub(crate) fn disagreement(&self, p: &Parameters) -> Option<Disagreement> {
        let freedom = self.used.count().checked_sub(2).filter(|freedom| *freedom > 0)?;
        let weight = self.weight()?;
        let motion = self.motion()?;
        let residual = self.z - self.h * SVector::<f64, 2>::new(motion.distance, motion.turn);
        let weight = weight - weight * self.h * motion.covariance * self.h.transpose() * weight;
        let by_parameters = -self.fitted(&residual, p).residual_by_parameters(motion.turn);
        Some(Disagreement { residual, by_parameters, weight, freedom })
    }
}

impl Draft {
    fn rear(&mut self, block: &Block, p: &Parameters) {
        for wheel in [2, 3].into_iter().filter(|wheel| self.rows.used.rows[*wheel]) {
            self.rows.z[wheel] = p.values[wheel] * block.rotation[wheel];
            self.rows.by_parameters[(wheel, wheel)] = block.rotation[wheel];
            self.by_noise[(wheel, wheel)] = 1.0;
        }
    }

    fn front(&mut self, block: &Block, p: &Parameters, steer: &Steer, share: f64) {
        let used = self.rows.used.rows;
        let lateral_share = if used[0] && used[1] { 0.5 * share } else { share };
        for wheel in [0, 1].into_iter().filter(|wheel| used[*wheel]) {
            self.front_wheel(wheel, block, p, steer, (share, lateral_share));
        }
        if used[LATERAL] && !(used[0] || used[1]) {
            self.lateral_of_rear(block, p, steer, share);
        }
    }

    /// Longitudinal and lateral travel of a front wheel.
    fn front_wheel(
        &mut self,
        wheel: usize,
        block: &Block,
        p: &Parameters,
        steer: &Steer,
        (share, lateral_share): (f64, f64),
    ) {
        let side = if wheel == 0 { 1.0 } else { -1.0 };
        let (track, base) = (p.values[TRACK_FRONT], p.values[WHEELBASE]);
        let angle = wheel_angle(steer.angle, side, track, base);
        let (rotation, travel) = (block.rotation[wheel], p.values[wheel] * block.rotation[wheel]);
        let mut by_angle = steer.by_parameters * angle.by_steering;
        by_angle[TRACK_FRONT] += angle.by_track;
        by_angle[WHEELBASE] += angle.by_wheelbase;
        let lateral = self.rows.used.rows[LATERAL].then_some((LATERAL, lateral_share));
        // (row, share, part of the travel, its derivative by the wheel's angle)
        let along = ((wheel, share), angle.cos, -angle.sin);
        let across = lateral.map(|row| (row, angle.sin, angle.cos));
        for ((row, share), part, slope) in core::iter::once(along).chain(across) {
            self.rows.z[row] += share * travel * part;
            self.rows.by_parameters[(row, wheel)] += share * rotation * part;
            for (column, by) in by_angle.iter().enumerate() {
                self.rows.by_parameters[(row, column)] += share * travel * slope * by;
            }
            self.by_noise[(row, wheel)] += share * part;
            for (raw, by) in steer.by_noise.iter().enumerate() {
                self.by_noise[(row, raw)] += share * travel * slope * angle.by_steering * by;
            }
        }
    }

    /// tan(steering) times the rear wheels' travel; a single wheel off the centre line shifts the lever instead.
    fn lateral_of_rear(&mut self, block: &Block, p: &Parameters, steer: &Steer, share: f64) {
        let used = self.rows.used.rows;
        let both = used[2] && used[3];
        let each = if both { 0.5 * share } else { share };
        let tangent = math::tan(steer.angle);
        let slope = 1.0 + tangent * tangent;
        for wheel in [2, 3].into_iter().filter(|wheel| used[*wheel]) {
            let travel = p.values[wheel] * block.rotation[wheel];
            self.rows.z[LATERAL] += each * tangent * travel;
            self.rows.by_parameters[(LATERAL, wheel)] += each * tangent * block.rotation[wheel];
            for (column, by) in steer.by_parameters.iter().enumerate() {
                self.rows.by_parameters[(LATERAL, column)] += each * slope * travel * by;
            }
            self.by_noise[(LATERAL, wheel)] += each * tangent;
            for (raw, by) in steer.by_noise.iter().enumerate() {
                self.by_noise[(LATERAL, raw)] += each * slope * travel * by;
            }
            if !both {
                let side = if wheel == 2 { -1.0 } else { 1.0 };
                self.rows.h[(LATERAL, 1)] += share * side * 0.5 * p.values[TRACK_REAR] * tangent;
            }
        }
    }

    fn finish(mut self, block: &Block, p: &Parameters, noise: &Noise) -> Rows {
        let mut raw = SVector::<f64, ROWS>::zeros();
        for (wheel, turned) in block.turned.iter().enumerate() {
            // The noise is in what is read, an angle: in metres it grows with the radius that is assumed, or a small
            // radius would make all disagreement small.
            let deviation = noise.wheel * p.values[wheel];
            raw[wheel] = deviation * deviation * turned;
        }
        let factor = block.steering.map_or(1.0, |reading| reading.variance_factor);
        raw[LATERAL] = noise.steering * noise.steering * factor;
        raw[TURN] = block.turned_by_gyro.map_or(0.0, |turned| turned.variance);
        self.rows.covariance =
            self.by_noise * Square::from_diagonal(&raw) * self.by_noise.transpose();
        // Counts without noise would make a row exact.
        for row in 0..ROWS {
            self.rows.covariance[(row, row)] += 1e-14;
        }
        self.rows
    }
}
