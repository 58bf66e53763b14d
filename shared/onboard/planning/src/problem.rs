//! A request, checked, with what the vehicle makes of it.

use kerbside_geometry::{Bounds, ConvexPolygon, Footprint, Pose, Vehicle, math};
use kerbside_messages::{MAX_VERTICES, PlanRequest};

use crate::PlannerSettings;
use crate::failure::{PlanFailure, RequestFault, Shortfall};
use crate::pace::Pace;
use crate::world::{Obstacle, World};

/// Margin for the rounding of one sweep against another \[m\].
const TOUCH: f64 = 1e-9;
/// What a curvature gives away of its limit, so that the steering angle computed back from it
/// stays within its own.
const ROUNDING: f64 = 1e-12;

/// A parking problem that can be worked on: start and goal are free.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    pub(crate) world: World,
    pub(crate) footprint: Footprint,
    pub(crate) wheelbase: f64,
    pub(crate) start: Pose,
    pub(crate) goal: Pose,
    /// Direction of travel on arrival; 0 for either.
    pub(crate) gear: i8,
    pub(crate) gear_changes: u32,
    pub(crate) clearance: f64,
    /// What the search tries for first, and then: no more than start and goal have. The last is
    /// what was asked for or, where they have no more than that, a trifle less.
    pub(crate) attempts: [f64; 2],
    /// Greatest curvature \[1/m\], and the steering angle behind it \[rad\].
    pub(crate) curvature: f64,
    pub(crate) steering: f64,
    pub(crate) pace: Pace,
    pub(crate) search_nodes: u32,
}

impl Problem {
    pub(crate) fn new(
        vehicle: &Vehicle,
        settings: &PlannerSettings,
        start: Pose,
        request: &PlanRequest,
    ) -> Result<Self, PlanFailure> {
        let goal = Pose::new(request.x, request.y, request.yaw);
        check_limits(&start, &goal, request)?;
        let steering = request.steering.min(vehicle.limits.steering);
        let mut problem = Self {
            world: World { bounds: bounds(request)?, obstacles: obstacles(request)? },
            footprint: vehicle.footprint,
            wheelbase: vehicle.wheelbase,
            start,
            goal,
            gear: request.gear,
            gear_changes: request.gear_changes,
            clearance: request.clearance,
            attempts: [settings.comfort.max(1.0), 1.0]
                .map(|times| times * request.clearance + TOUCH),
            curvature: math::tan(steering) / vehicle.wheelbase * (1.0 - ROUNDING),
            steering,
            pace: Pace::new(vehicle, settings, request.speed),
            search_nodes: settings.search_nodes,
        };
        let at_start = problem.check_free(&start).map_err(PlanFailure::StartBlocked)?;
        let at_goal = problem.check_free(&goal).map_err(PlanFailure::GoalBlocked)?;
        let most = at_start.min(at_goal) - TOUCH;
        problem.attempts = problem.attempts.map(|needed| needed.min(most));
        Ok(problem)
    }

    /// The clearance at a pose, where it is enough.
    fn check_free(&self, pose: &Pose) -> Result<f64, Shortfall> {
        let (found, nearest) = self.world.clearance(&self.footprint.corners_at(pose));
        if found >= self.clearance && found > TOUCH {
            return Ok(found);
        }
        Err(Shortfall { nearest, found, needed: self.clearance })
    }
}

fn check_limits(start: &Pose, goal: &Pose, request: &PlanRequest) -> Result<(), RequestFault> {
    for (name, pose) in [("start", start), ("goal", goal)] {
        if !pose.is_finite() {
            return Err(RequestFault::Pose(name));
        }
    }
    let right_angle = core::f64::consts::FRAC_PI_2;
    let limit = |field, value: f64, fine: bool, allowed| {
        if fine && value.is_finite() {
            Ok(())
        } else {
            Err(RequestFault::Limit { field, value, allowed })
        }
    };
    let PlanRequest { clearance, speed, steering, gear, .. } = *request;
    limit("clearance", clearance, clearance >= 0.0, "0 or more")?;
    limit("speed", speed, speed > 0.0, "above 0")?;
    let steerable = steering > 0.0 && steering < right_angle;
    limit("steering", steering, steerable, "above 0 and below a right angle")?;
    limit("gear", f64::from(gear), (-1..=1).contains(&gear), "-1, 0 or 1")
}

fn bounds(request: &PlanRequest) -> Result<Bounds, RequestFault> {
    let [left, low, right, high] = request.bounds;
    if request.bounds.iter().all(|side| side.is_finite()) && left < right && low < high {
        return Ok(Bounds { min: [left, low], max: [right, high] });
    }
    Err(RequestFault::Bounds(request.bounds))
}

fn obstacles(request: &PlanRequest) -> Result<Vec<Obstacle>, RequestFault> {
    let announced = request.sizes.iter().take_while(|size| **size > 0);
    let corners: usize = announced.map(|size| usize::from(*size)).sum();
    if corners > MAX_VERTICES {
        return Err(RequestFault::Sizes { corners, most: MAX_VERTICES });
    }
    let polygon = |(index, corners): (usize, &[[f64; 2]])| {
        ConvexPolygon::new(corners.to_vec())
            .map(Obstacle::new)
            .map_err(|cause| RequestFault::Obstacle { index, cause })
    };
    request.obstacles().enumerate().map(polygon).collect()
}
