//! The plan that is followed.

use kerbside_geometry::Pose;
use kerbside_messages::{MAX_PLAN_POINTS, Plan, TrajectoryPoint};

/// Below this speed a plan means standing, not driving \[m/s\].
const STANDING: f64 = 1e-6;

/// Where a plan wants the vehicle at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reference {
    /// Of the rear-axle centre, yaw continuous.
    pub(crate) pose: Pose,
    /// Negative in reverse \[m/s\].
    pub(crate) speed: f64,
    /// Rate of the speed \[m/s^2\].
    pub(crate) acceleration: f64,
    /// Road-wheel angle \[rad\].
    pub(crate) steering: f64,
    /// Rate of the steering \[rad/s\].
    pub(crate) steering_rate: f64,
}

impl Reference {
    /// Direction of travel: 1, -1, or 0 while the plan stands.
    pub(crate) fn direction(&self) -> f64 {
        direction(self.speed)
    }
}

/// A copy of a plan, so that it can be completed whatever becomes of the planner and its memory.
#[derive(Clone, Debug)]
pub(crate) struct Trajectory {
    points: Vec<TrajectoryPoint>,
    interval: f64,
}

impl Trajectory {
    /// Without a plan, with room for the longest one.
    pub(crate) fn empty() -> Self {
        Self { points: Vec::with_capacity(MAX_PLAN_POINTS), interval: 1.0 }
    }

    /// Takes over a plan. False, and nothing changes, where head and points do not fit each other.
    pub(crate) fn load(&mut self, plan: &Plan, points: &[TrajectoryPoint]) -> bool {
        let sound = (2..=MAX_PLAN_POINTS).contains(&points.len())
            && plan.interval > 0.0
            && plan.validate_points(points).is_ok();
        if sound {
            self.points.clear();
            self.points.extend_from_slice(points);
            self.interval = plan.interval;
        }
        sound
    }

    /// When the plan is over \[s\].
    pub(crate) fn duration(&self) -> f64 {
        self.points.last().map_or(0.0, |last| last.time)
    }

    /// The reference at `time` \[s\]: linear between points, so that the rates are those of what is
    /// interpolated; the first point before the plan and the last one after it, at rest.
    pub(crate) fn at(&self, time: f64) -> Reference {
        let index = self.index(time);
        let (from, to) = (&self.points[index], &self.points[index + 1]);
        let span = to.time - from.time;
        let share = ((time - from.time) / span).clamp(0.0, 1.0);
        let within = if (from.time..to.time).contains(&time) { 1.0 } else { 0.0 };
        let mix = |a: f64, b: f64| a + share * (b - a);
        Reference {
            pose: Pose::new(mix(from.x, to.x), mix(from.y, to.y), mix(from.yaw, to.yaw)),
            speed: within * mix(from.speed, to.speed),
            acceleration: within * (to.speed - from.speed) / span,
            steering: mix(from.steering, to.steering),
            steering_rate: within * (to.steering - from.steering) / span,
        }
    }

    /// Direction of travel at `time` \[s\], or, while the plan stands, of the next motion; 0 after
    /// the last one.
    pub(crate) fn coming_direction(&self, time: f64) -> f64 {
        let now = self.at(time).direction();
        if now != 0.0 || time >= self.duration() {
            return now;
        }
        let coming = self.points[self.index(time) + 1..].iter();
        coming
            .map(|point| direction(point.speed))
            .find(|direction| *direction != 0.0)
            .unwrap_or(0.0)
    }

    /// The point before `time`, never the last one. Points are equally spaced, but for rounding.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` saturates: wanted.
    fn index(&self, time: f64) -> usize {
        let last = self.points.len() - 2;
        let mut index = ((time / self.interval) as usize).min(last);
        while index > 0 && self.points[index].time > time {
            index -= 1;
        }
        while index < last && self.points[index + 1].time <= time {
            index += 1;
        }
        index
    }
}

fn direction(speed: f64) -> f64 {
    if speed.abs() < STANDING { 0.0 } else { speed.signum() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(speeds: &[f64]) -> Trajectory {
        let mut x = 0.0;
        let points: Vec<TrajectoryPoint> = speeds
            .iter()
            .enumerate()
            .map(|(index, speed)| {
                x += speed;
                let time = 0.5 * index as f64;
                TrajectoryPoint { time, x, speed: *speed, steering: time, ..Default::default() }
            })
            .collect();
        let head = Plan { interval: 0.5, points: points.len() as u32, ..Plan::default() };
        let mut trajectory = Trajectory::empty();
        assert!(trajectory.load(&head, &points));
        trajectory
    }

    #[test]
    fn between_points_everything_is_linear_and_at_the_ends_at_rest() {
        let trajectory = plan(&[0.0, 1.0, 3.0]);
        let reference = trajectory.at(0.75);
        assert_eq!((reference.pose.x, reference.speed, reference.acceleration), (2.5, 2.0, 4.0));
        assert_eq!((reference.steering, reference.steering_rate), (0.75, 1.0));
        for (time, x, steering) in [(-1.0, 0.0, 0.0), (1.0, 4.0, 1.0), (7.0, 4.0, 1.0)] {
            let end = trajectory.at(time);
            assert_eq!((end.pose.x, end.speed, end.acceleration), (x, 0.0, 0.0));
            assert_eq!((end.steering, end.steering_rate), (steering, 0.0));
        }
    }

    #[test]
    fn the_coming_direction_looks_through_a_pause_and_not_beyond_the_end() {
        let trajectory = plan(&[0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0]);
        let directions =
            [0.0, 0.5, 1.2, 2.1, 2.7, 3.2, 9.0].map(|t| trajectory.coming_direction(t));
        assert_eq!(directions, [1.0, 1.0, -1.0, -1.0, -1.0, 0.0, 0.0]);
    }

    #[test]
    fn a_plan_that_contradicts_itself_is_not_taken() {
        let mut trajectory = plan(&[0.0, 1.0, 3.0]);
        let points = [TrajectoryPoint::default(); 2];
        let head = Plan { interval: 0.5, points: 2, ..Plan::default() };
        assert!(!trajectory.load(&head, &points), "times do not grow");
        assert!(!trajectory.load(&head, &points[..1]));
        assert_eq!(trajectory.duration(), 1.0);
    }
}
