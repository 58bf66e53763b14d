//! A path in time: the car drives each segment from rest to rest and stands while it steers.

use kerbside_geometry::{Pose, angle};
use kerbside_messages::{MAX_PLAN_POINTS, TrajectoryPoint};

use crate::failure::PlanFailure;
use crate::pace::Pace;
use crate::profile::Profile;
use crate::segment::Segment;

/// Points are never farther apart than this unless the settings say so \[s\]: what a plan's
/// certificate says of the path then holds between them.
const LONGEST_INTERVAL: f64 = 0.05;

/// What happens for a while.
#[derive(Clone, Copy, Debug)]
enum Phase {
    /// Nothing.
    Wait { pose: Pose, steering: f64, duration: f64 },
    /// The steering moves, by the profile in the direction of `sign`.
    Steer { pose: Pose, from: f64, sign: f64, profile: Profile },
    /// The car moves.
    Drive { segment: Segment, steering: f64, profile: Profile },
}

impl Phase {
    fn duration(&self) -> f64 {
        match self {
            Self::Wait { duration, .. } => *duration,
            Self::Steer { profile, .. } | Self::Drive { profile, .. } => profile.duration(),
        }
    }

    /// The reference so long after the phase's beginning, the time left out.
    fn at(&self, time: f64) -> TrajectoryPoint {
        match self {
            Self::Wait { pose, steering, .. } => {
                TrajectoryPoint { steering: *steering, ..standing(pose) }
            }
            Self::Steer { pose, from, sign, profile } => {
                let motion = profile.at(time);
                TrajectoryPoint {
                    steering: from + sign * motion.distance,
                    steering_rate: sign * motion.speed,
                    ..standing(pose)
                }
            }
            Self::Drive { segment, steering, profile } => {
                let (motion, sign) = (profile.at(time), f64::from(segment.gear()));
                TrajectoryPoint {
                    speed: sign * motion.speed,
                    acceleration: sign * motion.acceleration,
                    steering: *steering,
                    ..standing(&segment.pose_at(sign * motion.distance))
                }
            }
        }
    }
}

fn standing(pose: &Pose) -> TrajectoryPoint {
    TrajectoryPoint { x: pose.x, y: pose.y, yaw: pose.yaw, ..TrajectoryPoint::default() }
}

/// The phases of a plan, each with the time at which it begins.
#[derive(Clone, Debug)]
pub(crate) struct Timeline {
    phases: Vec<(f64, Phase)>,
    duration: f64,
    goal: TrajectoryPoint,
}

impl Timeline {
    /// The segments in time, from rest at `start` with the steering straight ahead to rest at
    /// `goal`, which the last segment ends at up to rounding.
    pub(crate) fn new(pace: &Pace, start: Pose, goal: &Pose, segments: &[Segment]) -> Self {
        let mut timeline = Self { phases: Vec::new(), duration: 0.0, goal: standing(goal) };
        let (mut steering, mut gear, mut end) = (0.0, 0, start);
        for segment in segments {
            let next = pace.steering(segment.curvature);
            let changes = gear != 0 && gear != segment.gear();
            timeline.stand(pace, &segment.start, steering, next, changes);
            let profile = pace.drive(segment.length);
            timeline.push(Phase::Drive { segment: *segment, steering: next, profile });
            (steering, gear, end) = (next, segment.gear(), segment.end());
        }
        timeline.goal.steering = steering;
        timeline.goal.yaw = angle::unwrap(end.yaw, goal.yaw);
        timeline
    }

    fn stand(&mut self, pace: &Pace, pose: &Pose, from: f64, to: f64, gear_change: bool) {
        let (before, after) = pace.waits(to - from, gear_change);
        let (pose, sign) = (*pose, if to < from { -1.0 } else { 1.0 });
        self.push(Phase::Wait { pose, steering: from, duration: before });
        if after > 0.0 || to != from {
            self.push(Phase::Steer { pose, from, sign, profile: pace.steer(to - from) });
        }
        self.push(Phase::Wait { pose, steering: to, duration: after });
    }

    fn push(&mut self, phase: Phase) {
        let duration = phase.duration();
        if duration > 0.0 {
            self.phases.push((self.duration, phase));
            self.duration += duration;
        }
    }

    /// The reference at a time; the goal once the plan is over.
    fn at(&self, time: f64) -> TrajectoryPoint {
        let index = self.phases.partition_point(|(begin, _)| *begin <= time);
        let phase = index.checked_sub(1).and_then(|index| self.phases.get(index));
        match phase.filter(|_| time < self.duration) {
            Some((begin, phase)) => TrajectoryPoint { time, ..phase.at(time - begin) },
            None => TrajectoryPoint { time, ..self.goal },
        }
    }

    /// Points evenly spaced by `interval` \[s\] or, where a plan holds no more, by more; with the
    /// spacing used. The last is the first at or after the end, and at rest at the goal.
    ///
    /// # Errors
    /// [`PlanFailure::TooLong`].
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
    // counts up to MAX_PLAN_POINTS
    pub(crate) fn points(&self, interval: f64) -> Result<(f64, Vec<TrajectoryPoint>), PlanFailure> {
        let most = (MAX_PLAN_POINTS - 1) as f64;
        let longest = most * interval.max(LONGEST_INTERVAL);
        if self.duration > longest {
            return Err(PlanFailure::TooLong { duration: self.duration, longest });
        }
        let interval = interval.max(self.duration / most);
        let count = (self.duration / interval).ceil().clamp(1.0, most) as usize;
        let mut points: Vec<_> = (0..count).map(|i| self.at(i as f64 * interval)).collect();
        points.push(TrajectoryPoint { time: count as f64 * interval, ..self.goal });
        Ok((interval, points))
    }
}
