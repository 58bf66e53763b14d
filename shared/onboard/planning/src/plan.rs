//! From a request to a plan with its certificate.

use kerbside_geometry::{Pose, Vehicle, angle};
use kerbside_messages::{Plan, PlanRequest, TrajectoryPoint};

use crate::failure::PlanFailure;
use crate::problem::Problem;
use crate::search;
use crate::segment::{Segment, chain, gear_changes};
use crate::settings::PlannerSettings;
use crate::sweep::Sweep;
use crate::timeline::Timeline;

/// A plan that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Planned {
    /// The message's head: id, arm, figures and number of points; its header is left to the sender.
    pub head: Plan,
    /// The reference, from rest at the start to rest at the goal; yaw is continuous.
    pub points: Vec<TrajectoryPoint>,
    /// The path behind it, from start to goal.
    pub path: Vec<Segment>,
    /// Nodes the search opened.
    pub search_nodes: u32,
}

/// Plans the way of a standing vehicle, its steering straight ahead, from `start` to the goal of
/// `request`.
///
/// The path is a sequence of arcs and lines; the car stands wherever curvature or direction of
/// travel change. `progress` is told the number of nodes opened so far, at the beginning and at
/// least every few milliseconds of the search.
///
/// The same arguments give the same bits.
///
/// # Errors
/// [`PlanFailure`]: what in the request cannot be worked on, what blocks start or goal and how
/// much clearance they have, that no path was found, or that the plan is too long for a message.
pub fn plan(
    vehicle: &Vehicle,
    settings: &PlannerSettings,
    start: Pose,
    request: &PlanRequest,
    progress: &mut dyn FnMut(u32),
) -> Result<Planned, PlanFailure> {
    let problem = Problem::new(vehicle, settings, start, request)?;
    let found = search::find(&problem, progress).map_err(|end| PlanFailure::NoPath {
        steering: angle::degrees(problem.steering),
        gear_changes: problem.gear_changes,
        clearance: problem.clearance,
        nodes: end.nodes,
        exhausted: end.exhausted,
    })?;
    let path = chain(start, &found.pieces);
    let timeline = Timeline::new(&problem.pace, start, &problem.goal, &path);
    let (interval, points) = timeline.points(settings.interval)?;
    let head = head(&problem, request, &path, &points, interval);
    Ok(Planned { head, points, path, search_nodes: found.nodes })
}

#[allow(clippy::cast_possible_truncation)] // at most MAX_PLAN_POINTS
fn head(
    problem: &Problem,
    request: &PlanRequest,
    path: &[Segment],
    points: &[TrajectoryPoint],
    interval: f64,
) -> Plan {
    let most = |value: fn(&TrajectoryPoint) -> f64| {
        points.iter().fold(0.0, |most: f64, point| most.max(value(point).abs()))
    };
    Plan {
        id: request.id,
        arm: request.arm,
        interval,
        duration: points.last().map_or(0.0, |point| point.time),
        length: path.iter().map(|segment| segment.length.abs()).sum(),
        clearance: clearance(problem, path),
        steering: most(|point| point.steering),
        speed: most(|point| point.speed),
        gear_changes: gear_changes(path.iter().map(Segment::gear)),
        points: points.len() as u32,
        ..Plan::default()
    }
}

/// Least distance of the footprint from everything solid over the whole path \[m\], exact.
fn clearance(problem: &Problem, path: &[Segment]) -> f64 {
    let standing = Segment { start: problem.start, length: 0.0, curvature: 0.0 };
    path.iter().chain([&standing]).fold(f64::INFINITY, |least, segment| {
        least.min(Sweep::new(&problem.footprint, segment).clearance(&problem.world).0)
    })
}
