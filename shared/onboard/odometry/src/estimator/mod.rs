//! From travel to a pose.

mod bits;
mod fixes;
mod front;
mod fused;
mod fusing;
mod gyro;
mod increment;
mod kinematics;
mod model;
mod odometer;
mod output;
mod restore;
mod twist;
mod update;

use kerbside_geometry::{Pose, Vehicle};
use kerbside_messages::{
    EstimatorState, Fix, FixVerdict, Nanos, Odometry, ResetReason, Restore, Travel, WheelStatus,
};
use nalgebra::{Matrix3, Vector3};

use crate::parameters::{ParameterEstimate, ParameterPrior};
use crate::sensors::{NoModel, Sensors};
use crate::settings::{EstimatorSettings, Filter, InitialPose};
use crate::wheels::{self, elapsed};
use fixes::{Rest, Ruling};
use front::FrontCorrection;
use fused::{Fused, Setup};
use gyro::GyroIntegral;
pub use increment::{Estimate, Increment};
use model::{Aids, Model};
use odometer::{Brought, Gap, Odometer};
use twist::Twist;

/// What the estimator takes in a step.
#[derive(Clone, Copy, Debug)]
pub struct EstimatorInputs<'a> {
    /// The next travel.
    pub travel: &'a Travel,
    /// Travels lost on the way before it.
    pub missing: u64,
    /// A fix that came since the last step.
    pub fix: Option<&'a Fix>,
    /// What an earlier life of the estimator knew; may be given again in every step.
    pub restore: Option<&'a Restore>,
}

/// The stage that turns travel into a pose; one [`Odometry`] per [`Travel`].
///
/// # Motion
/// Increments are differences of cumulative travel between what was read and what the pose stands
/// for, so a lost sample or an unread wheel loses nothing: its motion comes with the next reading.
/// While one wheel of the model is awaited the pose waits, and the covariance published meanwhile
/// contains what the other wheels say has been rolled; the fused filter goes on without it after
/// 0.3 s, where the others tell the motion. An increment over a gap is one arc, its
/// covariance enlarged by how far a path of the vehicle's largest curvature can leave it.
///
/// # The pose's fate
/// Without an initial pose it is relative to the start (`Unset`). A fix at standstill makes it
/// `Valid`; the fused filter then takes further fixes in motion as well, each at its own time, late
/// and out of order as far back as the last 512 readings in which a wheel turned, and refuses what
/// its gate refuses. Five that it refuses in a row and that agree with one another say that it is too sure of itself: its
/// covariance is widened until the newest is an ordinary one, which then corrects pose and parameters, as a reset with
/// [`ResetReason::Contradicted`]. A fix that contradicts the pose of a vehicle that stands sets it. A new counter
/// epoch, or a gap over which no wheel can have turned so far, makes a valid pose `Lost`; it goes on
/// from where it was, without a jump, until a fix comes. [`Restore`] is taken up once, if this life
/// has no pose from a fix: its pose plus what rolled by since; from another counter epoch it is
/// lost.
///
/// With it comes what the filter knew besides: parameters, their covariance and what they have in
/// common with the pose, the open block of path, steering and gyro. Where the next travel follows on
/// the restored one, the estimates are those of a life without end; else what rolled by is a gap.
/// Not restored are the records to go through again (a fix from before the restart is too old, and a
/// slip of an axle must be found anew) and the twist, which is zero for 15 ms. Where vehicle or
/// prior are not those of the earlier life, the filter begins with the prior and twice the
/// covariance of the pose, which bounds what both had in common.
///
/// A life that is to be restored must not be given an initial pose: that would be published as
/// valid until the restore arrives.
///
/// # Standstill
/// No wheel that is read has turned for `standstill_time`. Speed and yaw rate are then zero, and a
/// gyro's turn is discarded: a car that does not roll does not turn.
#[derive(Clone, Debug)]
pub struct Estimator {
    model: Model,
    front: Option<FrontCorrection>,
    fused: Option<Fused>,
    settings: EstimatorSettings,
    limits: (f64, f64),
    curvature: f64,
    wheels: Odometer,
    gyro: GyroIntegral,
    uses_gyro: bool,
    steering: Option<f64>,
    twist: Twist,
    estimate: Estimate,
    epoch: Option<u32>,
    state: EstimatorState,
    resets: u32,
    reason: ResetReason,
    restorable: bool,
    distance: f64,
    unusable: u32,
    gap_pending: bool,
    /// Stamps of the newest roll, motion and reading of a wheel.
    rolled: Nanos,
    moved: Option<Nanos>,
    read: Nanos,
    /// Stamp of the newest travel.
    seen: Nanos,
    /// Since when some wheels were read and others are awaited.
    awaiting: Option<Nanos>,
    waiting: Option<Fix>,
    verdict: FixVerdict,
    fix_sequence: u64,
}

impl Estimator {
    /// A stage for `vehicle` with the sensors its file describes, [`Sensors::of`].
    ///
    /// # Errors
    /// [`NoModel`] where no pose can be computed from what it measures.
    pub fn new(vehicle: &Vehicle, settings: &EstimatorSettings) -> Result<Self, NoModel> {
        Self::with_sensors(vehicle, &Sensors::of(vehicle), settings)
    }

    /// A stage for `vehicle` with these sensors, as for recordings that have wheel speeds.
    ///
    /// # Errors
    /// [`NoModel`] where no pose can be computed from what it measures.
    pub fn with_sensors(
        vehicle: &Vehicle,
        sensors: &Sensors,
        settings: &EstimatorSettings,
    ) -> Result<Self, NoModel> {
        let prior = ParameterPrior::calibrated(vehicle);
        Self::with_prior(vehicle, sensors, settings, &prior)
    }

    /// A stage for `vehicle` whose calibration left open what `prior` says.
    ///
    /// # Errors
    /// [`NoModel`] where no pose can be computed from what it measures.
    pub fn with_prior(
        vehicle: &Vehicle,
        sensors: &Sensors,
        settings: &EstimatorSettings,
        prior: &ParameterPrior,
    ) -> Result<Self, NoModel> {
        let scales = wheels::scales(vehicle, sensors)?;
        let (model, front) = Model::new(vehicle, sensors, settings, prior, &scales)?;
        let fused = (settings.filter == Filter::Fused)
            .then(|| Fused::new(Setup::new(vehicle, sensors, settings, prior, &scales)));
        let uses_gyro = model.uses_gyro() || fused.is_some() && sensors.gyro;
        let limits = &vehicle.limits;
        let gyro_noise = vehicle.gyro.map_or(settings.gyro_noise, |gyro| gyro.noise);
        let mut estimator = Self {
            wheels: Odometer::new(scales, model.needed()),
            model,
            front,
            fused,
            uses_gyro,
            settings: settings.clone(),
            limits: (limits.speed, limits.acceleration.max(limits.deceleration)),
            curvature: wheels::largest_curvature(vehicle),
            gyro: GyroIntegral::new(gyro_noise),
            steering: None,
            twist: Twist::new(),
            estimate: Estimate::default(),
            epoch: None,
            state: EstimatorState::Unset,
            resets: 0,
            reason: ResetReason::None,
            restorable: true,
            distance: 0.0,
            unusable: 0,
            gap_pending: false,
            rolled: 0,
            moved: None,
            read: 0,
            seen: 0,
            awaiting: None,
            waiting: None,
            verdict: FixVerdict::None,
            fix_sequence: 0,
        };
        if let Some(initial) = &settings.initial_pose {
            estimator.jump(initial_estimate(initial), EstimatorState::Valid, ResetReason::Initial);
        }
        Ok(estimator)
    }

    /// Takes the next travel. `out` is overwritten, except for what the sender adds to its header.
    pub fn step(&mut self, inputs: EstimatorInputs<'_>, out: &mut Odometry) {
        let travel = inputs.travel;
        let gap = travel.gap == 1 || inputs.missing > 0;
        self.take_epoch(travel);
        if let Some(restore) = inputs.restore {
            self.take_restore(restore, travel, gap);
        }
        self.take_aids(travel);
        let brought = self.take_wheels(travel);
        self.gap_pending |= gap || brought.bridged;
        if brought.wheels {
            self.roll(travel);
        }
        self.unusable = self.unusable.wrapping_add(u32::from(brought.lacking));
        if self.standstill(travel.header.stamp) {
            self.rest(travel);
        }
        self.seen = travel.header.stamp;
        self.take_fix(inputs.fix, travel.header.stamp);
        self.write(travel, gap, out);
    }

    /// What the fused filter has learnt of the vehicle's parameters; none for other filters.
    #[must_use]
    pub fn parameters(&self) -> Option<ParameterEstimate> {
        self.fused.as_ref().map(Fused::parameters)
    }

    /// Another counter epoch: what rolled by since the last travel is not known.
    fn take_epoch(&mut self, travel: &Travel) {
        let before = self.epoch.replace(travel.counter_epoch);
        if before.is_some_and(|epoch| epoch != travel.counter_epoch) {
            self.wheels.forget();
            self.lose();
        }
    }

    /// The pose goes on from where it is, but no longer in the frame of the plan.
    fn lose(&mut self) {
        let state = match self.state {
            EstimatorState::Unset => EstimatorState::Unset,
            EstimatorState::Valid | EstimatorState::Lost => EstimatorState::Lost,
        };
        self.jump(self.estimate, state, ResetReason::CounterReset);
    }

    fn jump(&mut self, to: Estimate, state: EstimatorState, reason: ResetReason) {
        self.estimate = to;
        self.state = state;
        self.reason = reason;
        self.resets = self.resets.wrapping_add(1);
        self.gap_pending = false;
        if let Some(front) = &mut self.front {
            front.restart();
        }
        if let Some(fused) = &mut self.fused {
            fused.place(&self.estimate);
        }
    }

    fn take_aids(&mut self, travel: &Travel) {
        if travel.has_steering == 1 {
            self.steering = Some(travel.steering);
        }
        if let Some(front) = &mut self.front {
            front.record_mut().corrected = false;
        }
        if let Some(fused) = &mut self.fused {
            fused.look(travel);
        }
        if self.uses_gyro {
            let rate = (travel.yaw_rate_is_new == 1).then_some(travel.yaw_rate);
            self.gyro.advance(travel.header.stamp, rate);
        }
    }

    fn take_wheels(&mut self, travel: &Travel) -> Brought {
        let stamp = travel.header.stamp;
        let brought = self.wheels.read(travel);
        if brought.wheels {
            self.read = stamp;
        }
        if brought.motion || self.moved.is_none() {
            self.moved = Some(stamp);
        }
        brought
    }

    /// Brings what the wheels have rolled into the pose, if all that the model needs is there.
    fn roll(&mut self, travel: &Travel) {
        let stamp = travel.header.stamp;
        if !self.wheels.ready() && !self.goes_without(stamp) {
            return;
        }
        if self.gap_pending && self.wheels.beyond_belief(&self.gap(stamp)) {
            self.lose();
            self.applied(stamp, 0.0, 0.0);
            return;
        }
        if self.fused.is_some() {
            self.fuse(travel);
            return;
        }
        let aids = Aids { steering: self.steering, gyro: &self.gyro };
        let Some(piece) = self.model.increment(&self.wheels, &aids) else {
            self.unusable = self.unusable.wrapping_add(1);
            return;
        };
        self.estimate.roll(&piece);
        if std::mem::take(&mut self.gap_pending) {
            self.blur(&piece);
        } else {
            self.correct(&piece, travel);
        }
        if piece.distance != 0.0 {
            self.gyro.clear();
        }
        self.distance += piece.distance.abs();
        self.applied(stamp, piece.distance, piece.turn);
    }

    fn gap(&self, stamp: Nanos) -> Gap {
        let (top_speed, acceleration) = self.limits;
        let elapsed = elapsed(stamp, self.rolled);
        Gap { elapsed, speed: self.twist.speed(), top_speed, acceleration }
    }

    fn applied(&mut self, stamp: Nanos, distance: f64, turn: f64) {
        self.wheels.apply();
        self.awaiting = None;
        self.rolled = stamp;
        self.twist.push(stamp, distance, turn);
    }

    /// The path over a gap is known by its ends only: a vehicle that steers to full lock one way
    /// and the other leaves the arc between them by up to curvature D^2/8 across and curvature^2
    /// D^3/24 along; where the heading does not come from the wheels, that is unknown as well.
    fn blur(&mut self, piece: &Increment) {
        let distance = piece.distance.abs();
        let bend = self.curvature * distance;
        let across = (bend / 8.0).min(1.0) * distance;
        let along = (bend * bend / 24.0).min(1.0) * distance;
        let yaw = if self.model.heading_from_wheels() { 0.0 } else { 0.5 * bend };
        self.estimate.blur(along, across, yaw);
        if let Some(front) = &mut self.front {
            front.restart();
        }
    }

    fn correct(&mut self, piece: &Increment, travel: &Travel) {
        let Some(front) = &mut self.front else { return };
        let read = |index| matches!(travel.wheel(index), WheelStatus::Valid | WheelStatus::Zeroed);
        let steering = self.steering.filter(|_| read(0) && read(1));
        front.follow(piece, steering, &self.wheels, &mut self.estimate);
    }

    /// Whether the wheels that are read have not turned for long enough.
    fn standstill(&self, stamp: Nanos) -> bool {
        let time = self.settings.standstill_time;
        self.moved.is_some_and(|moved| elapsed(self.read, moved) >= time)
            && elapsed(stamp, self.read) <= time
    }

    /// Judges a new fix, or one that waited for the wheels to catch up with its stamp.
    fn take_fix(&mut self, fix: Option<&Fix>, now: Nanos) {
        let Some(fix) = fix.copied().or(self.waiting) else { return };
        let rest = Rest { standstill: self.standstill(now), moved: self.moved.unwrap_or(now) };
        match fixes::judge(&fix, now, &rest, self.settings.fix_age) {
            Ruling::Wait => self.waiting = Some(fix),
            Ruling::Said(ruled) => {
                self.waiting = None;
                let verdict = self.corrected(&fix, ruled);
                (self.verdict, self.fix_sequence) = (verdict, fix.header.sequence);
            }
        }
    }

    fn accept(&mut self, fix: &Fix) {
        let estimate = Estimate {
            pose: Pose::new(fix.x, fix.y, fix.yaw),
            covariance: increment::symmetric(&Matrix3::from_row_slice(&fix.covariance)),
        };
        self.jump(estimate, EstimatorState::Valid, ResetReason::Fix);
        self.wheels.apply();
        self.restorable = false;
    }
}

fn initial_estimate(initial: &InitialPose) -> Estimate {
    let (position, yaw) = (initial.position_noise, initial.yaw_noise);
    let variances = Vector3::new(position * position, position * position, yaw * yaw);
    Estimate { pose: initial.pose, covariance: Matrix3::from_diagonal(&variances) }
}
