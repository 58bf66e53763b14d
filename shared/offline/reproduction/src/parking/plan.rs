//! The two manoeuvres, as plans.

use kerbside_geometry::{Pose, angle, math};
use kerbside_messages::{Plan, TrajectoryPoint};
use kerbside_proving_ground::{
    Chassis, Leg, Manoeuvre, Pace, Physics, Section, Sensors, TestDrive,
};

use super::{ARM, RATE};

/// How the plans are driven.
const PACE: Pace = Pace { speed: 0.1, acceleration: 0.1 };

/// A manoeuvre of Figure 10.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    /// Forward 35 degrees and in reverse 55 degrees at 0.9 m, then 0.7 m straight; 2.63 m.
    Garage,
    /// A reverse S at 0.9 m with an offset of 0.55 m; 1.86 m.
    Parallel,
}

impl Scene {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Garage, Self::Parallel];

    /// Name, for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Garage => "garage",
            Self::Parallel => "parallel",
        }
    }

    /// What the paper's Table 3 prints for x, y and heading.
    pub(super) const fn paper(self) -> [&'static str; 3] {
        match self {
            Self::Garage => ["-1.24 cm", "-2.38 cm", "1.22 deg"],
            Self::Parallel => ["-1.75 cm", "+1.12 cm", "0.62 deg"],
        }
    }

    /// The path. Nothing says how long the straights are in which the curvature rises and falls over 0.15 m:
    /// they are what makes its length that of docs/reproduction.md.
    fn manoeuvre(self) -> Manoeuvre {
        const RADIUS: f64 = 0.9;
        const RAMP: f64 = 0.15;
        let arc = |radius: f64, degrees: f64| Section::arc(radius, angle::radians(degrees));
        let legs = match self {
            Self::Garage => {
                let (there, back) = (arc(RADIUS, 35.0), arc(-RADIUS, 55.0));
                let lead = Section::straight((2.63 - 0.7 - there.length - back.length) / 3.0);
                let forward = Leg::new(true, &[lead, there, lead], RAMP);
                vec![forward, Leg::new(false, &[lead, back, Section::straight(0.7)], RAMP)]
            }
            Self::Parallel => {
                // 2 R (1 - cos a) is the offset, but for the ramps.
                let turn = angle::degrees(math::acos(1.0 - 0.55 / (2.0 * RADIUS)));
                let bends = [arc(RADIUS, turn), arc(-RADIUS, turn)];
                let last = Section::straight(0.1 + 0.5 * RAMP);
                let lead = Section::straight(1.86 - 2.0 * bends[0].length - last.length);
                vec![Leg::new(false, &[lead, bends[0], bends[1], last], RAMP)]
            }
        };
        Manoeuvre::path(legs, PACE)
    }
}

/// A plan and its goal.
pub(super) struct Given {
    pub(super) head: Plan,
    pub(super) points: Vec<TrajectoryPoint>,
    pub(super) goal: Pose,
}

impl Given {
    /// The path of `scene` as a plan: what an ideal car of the paper's measures drives.
    pub(super) fn new(scene: Scene) -> Self {
        let ideal = TestDrive::new(
            Chassis::paper(),
            Physics::NEUTRAL,
            Sensors::paper(1.0).without_errors(),
            scene.manoeuvre(),
        );
        let states = ideal.record(0).truth;
        let interval = 1.0 / RATE;
        let mut points: Vec<TrajectoryPoint> = states
            .iter()
            .map(|state| TrajectoryPoint {
                time: state.time,
                x: state.pose.x,
                y: state.pose.y,
                yaw: state.pose.yaw,
                speed: state.speed,
                steering: state.steering,
                ..TrajectoryPoint::default()
            })
            .collect();
        for index in 1..points.len() {
            let (before, now) = (points[index - 1], &mut points[index]);
            now.acceleration = (now.speed - before.speed) / interval;
            now.steering_rate = (now.steering - before.steering) / interval;
        }
        let duration = points.last().map_or(0.0, |point| point.time);
        let head = Plan {
            id: 1,
            arm: ARM,
            interval,
            duration,
            points: u32::try_from(points.len()).unwrap_or(0),
            ..Plan::default()
        };
        let goal = states.last().map_or(Pose::default(), |state| state.pose);
        Self { head, points, goal }
    }
}
