//! The tracker: when it begins, follows, finishes or gives up.

use kerbside_geometry::{Limits, Pose, Vehicle, math};
use kerbside_messages::{
    Command, Header, Mode, Nanos, Odometry, Permit, Plan, TrackingPhase, TrackingStop,
    TrajectoryPoint, seconds,
};

use crate::TrackerSettings;
use crate::feedforward::Feedforward;
use crate::guard;
use crate::kanayama::{Errors, Kanayama};
use crate::trajectory::{Reference, Trajectory};

/// Share of the greatest speed at which the end of a plan is approached.
const CREEP: f64 = 0.05;

/// What one step sees.
#[derive(Clone, Copy, Debug)]
pub struct TrackerInputs<'a> {
    /// The new estimate.
    pub odometry: &'a Odometry,
    /// The standing plan with its points.
    pub plan: Option<(&'a Plan, &'a [TrajectoryPoint])>,
    /// The newest permit, live or not.
    pub permit: Option<&'a Permit>,
    /// The present \[ns\]; the permit alone is judged by it.
    pub now: Nanos,
}

/// A plan under way.
#[derive(Clone, Copy, Debug)]
struct Run {
    arm: u64,
    plan: u64,
    /// Stamp of the odometry it began with.
    start: Nanos,
    /// Jumps of the pose until then.
    resets: u32,
    phase: TrackingPhase,
    stop: TrackingStop,
    /// The newest steering command \[rad\].
    steering: f64,
}

/// What is asked of the actuators.
#[derive(Clone, Copy, Debug)]
struct Demand {
    speed: f64,
    acceleration: f64,
    steering: f64,
    steering_rate: f64,
}

/// The trajectory tracker.
///
/// *Beginning.* A plan is begun with the first estimate that is valid and at a standstill while a
/// permit of the plan's arm is live and still says `armed`; that estimate's stamp is time 0 of the
/// plan. Each arm is driven once. A tracker that was restarted remembers nothing, but finds
/// `driving` in the permit (its earlier life's commands made it that), so it does not take up a
/// plan in the middle; and whoever begins far from the plan's first point stops for the corridor.
///
/// *Following.* The plan is copied as it begins and then completed, whatever the planner does. The
/// law of Kanayama corrects the estimate's errors against the reference of the same instant; what
/// is commanded is ahead of it by the actuators' delays and lags. Of the estimate only the pose is
/// used: its speed, quantised by the encoders, is not.
///
/// *Standing in between.* Where the plan stands the speed command is exactly zero and the steering
/// goes where the next motion needs it, its correction included. What is left of the error along
/// the path stays until then: the reference is absolute, so nothing adds up from stop to stop. The
/// error across cannot be corrected at rest.
///
/// *The end.* Beyond the plan's duration the error along is closed at a creep with the steering
/// held, until it is small and the vehicle stands: `Finished`. If that takes too long, or the
/// vehicle leaves the corridor, the pose becomes too uncertain, is lost, or jumps: `Stopped`. Both
/// are final: they are repeated with speed zero and the steering held while the permit lives.
#[derive(Clone, Debug)]
pub struct Tracker {
    settings: TrackerSettings,
    limits: Limits,
    wheelbase: f64,
    law: Kanayama,
    feedforward: Feedforward,
    trajectory: Trajectory,
    run: Option<Run>,
    /// The newest arm that was driven; 0 for none.
    spent: u64,
}

impl Tracker {
    /// A tracker for `vehicle` that has driven nothing yet. Allocates all it will ever need.
    #[must_use]
    pub fn new(vehicle: &Vehicle, settings: &TrackerSettings) -> Self {
        Self {
            settings: settings.clone(),
            limits: vehicle.limits,
            wheelbase: vehicle.wheelbase,
            law: Kanayama { along: settings.gain_along, across: settings.gain_across },
            feedforward: Feedforward::new(vehicle),
            trajectory: Trajectory::empty(),
            run: None,
            spent: 0,
        }
    }

    /// Takes in one estimate. True: `out` is a command to send; false: there is nothing to say, and
    /// `out` is untouched.
    ///
    /// The command's stamp and origin are the odometry's.
    pub fn step(&mut self, inputs: TrackerInputs<'_>, out: &mut Command) -> bool {
        let Some(permit) = inputs.permit.filter(|permit| is_live(permit, inputs.now)) else {
            self.run = None;
            return false;
        };
        self.run = self
            .run
            .filter(|run| run.arm == permit.arm)
            .or_else(|| self.begin(permit, inputs.odometry, inputs.plan));
        let Some(mut run) = self.run else { return false };
        *out = self.follow(&mut run, inputs.odometry);
        self.run = Some(run);
        true
    }

    fn begin(
        &mut self,
        permit: &Permit,
        odometry: &Odometry,
        plan: Option<(&Plan, &[TrajectoryPoint])>,
    ) -> Option<Run> {
        let (plan, points) = plan?;
        let begins = plan.arm == permit.arm
            && permit.arm != self.spent
            && permit.mode == Mode::Armed.code()
            && guard::is_valid(odometry)
            && odometry.standstill == 1;
        if !begins || !self.trajectory.load(plan, points) {
            return None;
        }
        self.spent = permit.arm;
        Some(Run {
            arm: permit.arm,
            plan: plan.id,
            start: odometry.header.stamp,
            resets: odometry.resets,
            phase: TrackingPhase::Tracking,
            stop: TrackingStop::None,
            steering: odometry.steering,
        })
    }

    fn follow(&self, run: &mut Run, odometry: &Odometry) -> Command {
        let time = seconds(odometry.header.stamp.saturating_sub(run.start));
        let estimate = Pose::new(odometry.x, odometry.y, odometry.yaw);
        let errors = Errors::new(&self.trajectory.at(time).pose, &estimate);
        if run.phase == TrackingPhase::Tracking {
            self.judge(run, odometry, time, &errors);
        }
        let demand = match run.phase {
            TrackingPhase::Tracking => self.demand(time, &errors),
            TrackingPhase::Finished | TrackingPhase::Stopped => hold(run.steering),
        };
        run.steering = demand.steering;
        let goal = self.trajectory.at(self.trajectory.duration()).pose;
        Command {
            header: Header::stamped(odometry.header.stamp, odometry.header.origin),
            speed: demand.speed,
            acceleration: demand.acceleration,
            steering: demand.steering,
            steering_rate: demand.steering_rate,
            error_along: errors.along,
            error_across: errors.across,
            error_yaw: errors.yaw,
            plan_time: time,
            to_goal: estimate.distance(&goal),
            plan: run.plan,
            arm: run.arm,
            phase: run.phase.code(),
            stop: run.stop.code(),
            ..Command::default()
        }
    }

    /// Whether the run goes on, is finished, or has to stop.
    fn judge(&self, run: &mut Run, odometry: &Odometry, time: f64, errors: &Errors) {
        let over = time - self.trajectory.duration();
        run.stop = guard::objection(&self.settings, odometry, run.resets, errors);
        if run.stop != TrackingStop::None {
            run.phase = TrackingPhase::Stopped;
        } else if over >= 0.0 && self.arrived(errors) && odometry.standstill == 1 {
            run.phase = TrackingPhase::Finished;
        } else if over > self.settings.goal_time {
            (run.phase, run.stop) = (TrackingPhase::Stopped, TrackingStop::Goal);
        }
    }

    fn arrived(&self, errors: &Errors) -> bool {
        errors.along.abs() <= self.settings.goal_distance
    }

    fn demand(&self, time: f64, errors: &Errors) -> Demand {
        let speed_reference = self.trajectory.at(time + self.feedforward.speed_preview());
        let preview = time + self.feedforward.steering_preview();
        let steering_reference = self.trajectory.at(preview);
        let speed = if time >= self.trajectory.duration() {
            self.creep(errors)
        } else {
            self.speed(&speed_reference, errors)
        };
        let direction = self.trajectory.coming_direction(preview);
        Demand {
            speed: speed.clamp(-self.limits.speed, self.limits.speed),
            acceleration: speed_reference.acceleration,
            steering: self.steering(&steering_reference, direction, errors),
            steering_rate: steering_reference.steering_rate,
        }
    }

    fn speed(&self, reference: &Reference, errors: &Errors) -> f64 {
        if reference.direction() == 0.0 {
            return 0.0;
        }
        let speed = self.law.speed(reference.speed, errors);
        let curvature = math::tan(reference.steering) / self.wheelbase;
        self.feedforward.speed(speed, reference.acceleration, curvature)
    }

    /// Closes what is left along the path, in either direction.
    fn creep(&self, errors: &Errors) -> f64 {
        let limit = CREEP * self.limits.speed;
        if self.arrived(errors) {
            0.0
        } else {
            (self.settings.gain_along * errors.along).clamp(-limit, limit)
        }
    }

    /// The steering command; without a `direction` there is nothing to correct any more.
    fn steering(&self, reference: &Reference, direction: f64, errors: &Errors) -> f64 {
        let mut steering = reference.steering;
        if direction != 0.0 {
            let planned = math::tan(steering) / self.wheelbase;
            let curvature = self.law.curvature(planned, direction, errors);
            steering = math::atan(self.wheelbase * curvature);
        }
        let limit = self.limits.steering;
        self.feedforward.steering(steering, reference.steering_rate).clamp(-limit, limit)
    }
}

fn is_live(permit: &Permit, now: Nanos) -> bool {
    permit.granted == 1 && permit.expiry > now
}

fn hold(steering: f64) -> Demand {
    Demand { speed: 0.0, acceleration: 0.0, steering, steering_rate: 0.0 }
}
