//! The correction of the paper's filter: front odometry against the rear's prediction.

use kerbside_geometry::{Pose, Vehicle};
use nalgebra::{Matrix2, Matrix3, Vector3};

use super::increment::{Estimate, Increment, advance, symmetric};
use super::kinematics::FrontPair;
use super::odometer::Odometer;

/// Least variance of a front pose, each axis: its covariance has rank 2, and H = I asks for three
/// (0.01 mm)^2.
const FLOOR: f64 = 1e-10;

/// A correction is made each time this share of the wheelbase was rolled: 25 mm for the 1:6 car.
const BLOCK: f64 = 0.05;

/// Index of the front wheels.
const LEFT: usize = 0;
const RIGHT: usize = 1;

/// What the newest correction was.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Record {
    pub(crate) innovation: [f64; 3],
    pub(crate) test_ratio: f64,
    pub(crate) corrections: u32,
    pub(crate) gated: u32,
    /// This step corrected.
    pub(crate) corrected: bool,
}

/// Corrects a rear prediction by front odometry: the filter of Lee, Chung and Chang, eqs. (17) to
/// (19).
///
/// The paper leaves open whether the front pose is integrated on its own from the start, or from
/// the last fused pose. With `own` it is the former: successive measurements share all earlier
/// errors, which the filter takes as independent, and the estimate follows the front axle; they are
/// made at every reading, since what counts hide is small beside such a pose's variance. Without
/// it is the latter: each measurement z is the front axle's motion
/// applied to the last fused pose, H = I, the update in Joseph form. Front and prediction share
/// that pose's error, which the filter takes as independent: its estimate is nearly the best there
/// is, its covariance is far too small and stays bounded while the true error grows with distance.
/// Consumers must not take it for the whole truth.
///
/// The front wheels are integrated at every reading (per-wheel form, exact without slip); the
/// correction itself is made once per [`BLOCK`], since a count is as long as the wheels' noise over
/// some centimetres: compared at every reading, axles would differ by counts alone. What counts
/// leave in a block, q^2/6 per wheel of both axles, is bounded, not a random walk, and undone by
/// the next block: the gate allows for it, the gain does not.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrontCorrection {
    pair: FrontPair,
    gate: f64,
    block: f64,
    /// The front pose is integrated on its own from the start.
    own: bool,
    /// Variance of (distance, turn) that the counts of both axles leave in a block.
    quantisation: Matrix2<f64>,
    /// The last fused pose, and the front axle's way from there with its covariance.
    anchor: Option<Pose>,
    way: Estimate,
    applied: [f64; 2],
    rolled: f64,
    net: f64,
    /// Rolled, and in how many pieces, since the front wheels were read.
    unread: f64,
    pieces: u32,
    record: Record,
}

impl FrontCorrection {
    pub(crate) fn new(
        vehicle: &Vehicle,
        pair: FrontPair,
        metres_per_count: [f64; 4],
        gate: f64,
        own: bool,
    ) -> Self {
        Self {
            pair,
            gate,
            own,
            block: if own { 0.0 } else { BLOCK * vehicle.wheelbase },
            quantisation: quantisation(vehicle, metres_per_count),
            anchor: None,
            way: Estimate::default(),
            applied: [0.0; 2],
            rolled: 0.0,
            net: 0.0,
            unread: 0.0,
            pieces: 0,
            record: Record::default(),
        }
    }

    pub(crate) fn record(&self) -> &Record {
        &self.record
    }

    pub(crate) fn record_mut(&mut self) -> &mut Record {
        &mut self.record
    }

    /// The pose jumped, or the path to it is not known: a new block begins with the next reading.
    pub(crate) fn restart(&mut self) {
        self.anchor = None;
    }

    /// Follows the rear's `piece` that led to `estimate`. `steering`: the newest angle, if the
    /// front wheels were read together with the rear ones and an angle is known.
    pub(crate) fn follow(
        &mut self,
        piece: &Increment,
        steering: Option<f64>,
        wheels: &Odometer,
        estimate: &mut Estimate,
    ) {
        self.rolled += piece.distance.abs();
        self.net += piece.distance;
        self.unread += piece.distance.abs();
        self.pieces = self.pieces.saturating_add(1);
        let Some(steering) = steering else { return };
        match self.anchor {
            Some(anchor) if self.pieces == 1 || self.unread <= self.block => {
                self.integrate(steering, wheels);
                if self.rolled >= self.block {
                    self.correct(&anchor, estimate);
                    self.begin(&estimate.pose, wheels);
                }
            }
            _ => {
                self.anchor = None;
                self.begin(&estimate.pose, wheels);
            }
        }
    }

    fn begin(&mut self, fused: &Pose, wheels: &Odometer) {
        if !self.own || self.anchor.is_none() {
            self.way = Estimate { pose: *fused, covariance: Matrix3::zeros() };
        }
        self.anchor = Some(*fused);
        self.applied = [wheels.newest(LEFT), wheels.newest(RIGHT)];
        (self.rolled, self.net) = (0.0, 0.0);
        (self.unread, self.pieces) = (0.0, 0);
    }

    fn integrate(&mut self, steering: f64, wheels: &Odometer) {
        let left = wheels.since(LEFT, self.applied[LEFT]);
        let right = wheels.since(RIGHT, self.applied[RIGHT]);
        self.pair.steer(steering);
        self.way.roll(&self.pair.increment(left, right));
        self.applied = [wheels.newest(LEFT), wheels.newest(RIGHT)];
        (self.unread, self.pieces) = (0.0, 0);
    }

    /// Eqs. (17) to (19) with H = I.
    fn correct(&mut self, anchor: &Pose, estimate: &mut Estimate) {
        let (front, rear) = (self.way.pose, estimate.pose);
        let innovation = Vector3::new(front.x - rear.x, front.y - rear.y, front.yaw - rear.yaw);
        let noise = self.way.covariance + Matrix3::identity() * FLOOR;
        let spread = estimate.covariance + noise;
        let Some(test_ratio) = mahalanobis(&innovation, &(spread + self.counted(anchor))) else {
            return;
        };
        let Some(inverse) = spread.try_inverse() else { return };
        self.record.innovation = innovation.into();
        self.record.test_ratio = test_ratio;
        if test_ratio > self.gate {
            self.record.gated = self.record.gated.wrapping_add(1);
            return;
        }
        let gain = estimate.covariance * inverse;
        let change = gain * innovation;
        estimate.pose = Pose::new(rear.x + change.x, rear.y + change.y, rear.yaw + change.z);
        estimate.covariance = joseph(&gain, &estimate.covariance, &noise);
        self.record.corrections = self.record.corrections.wrapping_add(1);
        self.record.corrected = true;
    }

    /// Covariance that the counts of both axles leave in the block since `anchor`.
    fn counted(&self, anchor: &Pose) -> Matrix3<f64> {
        let turn = self.way.pose.yaw - anchor.yaw;
        let block = Increment { distance: self.net, turn, covariance: self.quantisation };
        let (_, _, by_piece) = advance(anchor, &block);
        symmetric(&(by_piece * self.quantisation * by_piece.transpose()))
    }
}

/// Squared length of `innovation` in units of `spread`; none where that is singular.
fn mahalanobis(innovation: &Vector3<f64>, spread: &Matrix3<f64>) -> Option<f64> {
    let inverse = spread.try_inverse()?;
    Some((innovation.transpose() * inverse * innovation).x.max(0.0))
}

/// (I - K) P (I - K)' + K R K'.
fn joseph(gain: &Matrix3<f64>, covariance: &Matrix3<f64>, noise: &Matrix3<f64>) -> Matrix3<f64> {
    let rest = Matrix3::identity() - gain;
    symmetric(&(rest * covariance * rest.transpose() + gain * noise * gain.transpose()))
}

/// A block's travel is the difference of two counts, each uniformly off within a count q: variance
/// q^2/6 per wheel.
fn quantisation(vehicle: &Vehicle, metres_per_count: [f64; 4]) -> Matrix2<f64> {
    let [fl, fr, rl, rr] = metres_per_count.map(|count| count * count / 6.0);
    let (front, rear) = (fl + fr, rl + rr);
    let turn = front / (vehicle.track_front * vehicle.track_front)
        + rear / (vehicle.track_rear * vehicle.track_rear);
    Matrix2::new(0.25 * (front + rear), 0.0, 0.0, turn)
}
