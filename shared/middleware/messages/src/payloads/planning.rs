//! Goals, plans and their certificates.

use super::{FAR, codes, finite, known, within};
use crate::header::layout_version;
use crate::layout::{Text, layout};
use crate::{Header, Refusal};

/// Points of the longest plan.
pub const MAX_PLAN_POINTS: usize = 4096;
/// Obstacles of a request.
pub const MAX_OBSTACLES: usize = 32;
/// Vertices of all obstacles of a request together.
pub const MAX_VERTICES: usize = 128;

layout! {
    /// A goal among obstacles. The plan starts at the newest odometry.
    pub struct PlanRequest {
        /// Header.
        pub header: Header,
        /// Chosen by the client; the answer and the plan repeat it.
        pub id: u64,
        /// The count of arms the plan is for.
        pub arm: u64,
        /// Goal of the rear-axle centre \[m\].
        pub x: f64,
        /// Goal of the rear-axle centre \[m\].
        pub y: f64,
        /// Goal heading \[rad\].
        pub yaw: f64,
        /// Least distance of the footprint from every obstacle \[m\].
        pub clearance: f64,
        /// Largest steering angle a plan may use \[rad\].
        pub steering: f64,
        /// Largest speed of the plan \[m/s\].
        pub speed: f64,
        /// Space to stay in: least x, least y, greatest x, greatest y \[m\].
        pub bounds: [f64; 4],
        /// Corners of all obstacles, one obstacle after the other: x, y \[m\].
        pub vertices: [[f64; 2]; MAX_VERTICES],
        /// Corners of each obstacle, convex and counter-clockwise; 0 after the last obstacle.
        pub sizes: [u8; MAX_OBSTACLES],
        /// Most changes of the travel direction.
        pub gear_changes: u32,
        /// Direction of travel on arrival: 1 forward, -1 reverse, 0 either.
        pub gear: i8,
        /// Unused.
        pub reserved: [u8; 3],
    }
}

impl PlanRequest {
    /// The obstacles as slices of corners.
    pub fn obstacles(&self) -> impl Iterator<Item = &[[f64; 2]]> {
        let mut start = 0;
        self.sizes.iter().take_while(|size| **size > 0).map_while(move |size| {
            let end = start + usize::from(*size);
            let corners = self.vertices.get(start..end);
            start = end;
            corners
        })
    }

    /// Adds an obstacle; false where there is no room for it.
    #[must_use]
    pub fn push_obstacle(&mut self, corners: &[[f64; 2]]) -> bool {
        let used = self.sizes.iter().take_while(|size| **size > 0).count();
        let start: usize = self.sizes[..used].iter().map(|size| usize::from(*size)).sum();
        let Ok(size) = u8::try_from(corners.len()) else { return false };
        if used == MAX_OBSTACLES || size < 3 || start + corners.len() > MAX_VERTICES {
            return false;
        }
        self.vertices[start..start + corners.len()].copy_from_slice(corners);
        self.sizes[used] = size;
        true
    }

    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        within("goal", &[self.x, self.y, self.yaw], FAR)?;
        within("bounds", &self.bounds, FAR)?;
        finite("limits", &[self.clearance, self.steering, self.speed])?;
        if self.clearance < 0.0 || self.speed <= 0.0 || self.steering <= 0.0 {
            return Err(Refusal::OutOfRange { field: "limits" });
        }
        if !(-1..=1).contains(&self.gear) {
            return Err(Refusal::OutOfRange { field: "gear" });
        }
        let corners: usize = self.sizes.iter().map(|size| usize::from(*size)).sum();
        if corners > MAX_VERTICES || self.sizes.iter().any(|size| matches!(size, 1 | 2)) {
            return Err(Refusal::OutOfRange { field: "sizes" });
        }
        within("vertices", self.vertices[..corners].as_flattened(), FAR)
    }
}

codes! {
    /// What became of a plan request.
    pub enum PlanVerdict {
        /// A plan was found and stands.
        Found = 1 "found",
        /// The start touches an obstacle, leaves the bounds, or lacks the clearance.
        StartBlocked = 2 "the start is not free",
        /// The goal does.
        GoalBlocked = 3 "the goal is not free",
        /// The search ended without a path.
        NoPath = 4 "no path within the limits",
        /// The path needs more points than a plan has.
        TooLong = 5 "the plan is too long",
        /// No pose to start from.
        NoPose = 6 "no valid pose to start from",
        /// The vehicle moves.
        Moving = 7 "the vehicle moves",
        /// The request itself is malformed.
        Malformed = 8 "malformed request",
        /// Another request is being worked on.
        Busy = 9 "busy with another request",
    }
}

layout! {
    /// The planner's answer to a request.
    pub struct PlanAnswer {
        /// Header.
        pub header: Header,
        /// The request's id.
        pub id: u64,
        /// Time spent on the search \[s\].
        pub search_time: f64,
        /// Length of the path \[m\].
        pub length: f64,
        /// Duration of the plan \[s\].
        pub duration: f64,
        /// Least distance of the footprint from any obstacle along the plan \[m\].
        pub clearance: f64,
        /// Changes of the travel direction.
        pub gear_changes: u32,
        /// [`PlanVerdict`].
        pub verdict: u8 as PlanVerdict,
        /// Unused.
        pub reserved: [u8; 3],
        /// Details for people: UTF-8, filled up with zeros.
        pub text: [u8; 160] as Text,
    }
}

impl PlanAnswer {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        finite("figures", &[self.search_time, self.length, self.duration, self.clearance])?;
        known("verdict", PlanVerdict::from_code(self.verdict))
    }
}

layout! {
    /// The reference at one instant of a plan.
    pub struct TrajectoryPoint {
        /// Time since the plan's beginning \[s\].
        pub time: f64,
        /// Position of the rear-axle centre \[m\].
        pub x: f64,
        /// Position of the rear-axle centre \[m\].
        pub y: f64,
        /// Heading, continuous \[rad\].
        pub yaw: f64,
        /// Speed, negative in reverse \[m/s\].
        pub speed: f64,
        /// Its rate \[m/s^2\].
        pub acceleration: f64,
        /// Road-wheel angle \[rad\].
        pub steering: f64,
        /// Its rate \[rad/s\].
        pub steering_rate: f64,
    }
}

impl TrajectoryPoint {
    /// Name of its type in shared memory, with the version of the layouts.
    pub const TYPE_NAME: &'static str = concat!("kerbside.TrajectoryPoint.v", layout_version!());
}

layout! {
    /// A plan: this, followed by `points` points. The reference between points is their interpolation.
    pub struct Plan {
        /// Header; `stamp` is the odometry's it starts from.
        pub header: Header,
        /// The request it answers.
        pub id: u64,
        /// The count of arms it is for.
        pub arm: u64,
        /// Time between points \[s\].
        pub interval: f64,
        /// Duration \[s\].
        pub duration: f64,
        /// Length of the path, both directions added \[m\].
        pub length: f64,
        /// Certificate: least distance of the footprint from any obstacle along the plan \[m\].
        pub clearance: f64,
        /// Certificate: largest steering angle used \[rad\].
        pub steering: f64,
        /// Certificate: largest speed used \[m/s\].
        pub speed: f64,
        /// Changes of the travel direction.
        pub gear_changes: u32,
        /// Number of points.
        pub points: u32,
    }
}

impl Plan {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        finite(
            "figures",
            &[self.interval, self.duration, self.length, self.clearance, self.steering, self.speed],
        )?;
        if self.interval <= 0.0 || !(2..=MAX_PLAN_POINTS).contains(&(self.points as usize)) {
            return Err(Refusal::OutOfRange { field: "points" });
        }
        Ok(())
    }

    /// Whether `points` are what the head announces: as many, finite, in order of time.
    ///
    /// # Errors
    /// [`Refusal::NotFinite`] or [`Refusal::OutOfRange`].
    pub fn validate_points(&self, points: &[TrajectoryPoint]) -> Result<(), Refusal> {
        if points.len() != self.points as usize {
            return Err(Refusal::OutOfRange { field: "points" });
        }
        finite("points", bytemuck::cast_slice(points))?;
        if points.windows(2).any(|pair| pair[1].time <= pair[0].time) {
            return Err(Refusal::OutOfRange { field: "points.time" });
        }
        Ok(())
    }
}
