//! Whether a vehicle can stand at the start and at the goal, and do what a plan may ask.

use kerbside_geometry::{Pose, Vehicle, angle, convex_distance};

use super::{Scenario, ScenarioDraft};
use crate::declare::Reading;
use crate::problem::Cause;

/// Rounding of coordinates that touch by intention \[m\].
const ROUNDING: f64 = 1e-9;

/// Reports poses that are not free, and limits that the vehicle does not reach.
pub(super) fn check(
    reading: &mut Reading<'_, ScenarioDraft>,
    scenario: &Scenario,
    vehicle: &Vehicle,
) {
    check_limits(reading, scenario, vehicle);
    for (key, pose) in [("start", &scenario.start), ("goal", &scenario.goal)] {
        if let Some(cause) = blocked(scenario, vehicle, pose) {
            let value = format!("({}, {}, {} degrees)", pose.x, pose.y, angle::degrees(pose.yaw));
            let allowed = format!(
                "a footprint of {} ({} x {} m) at least plan.clearance = {} m from every obstacle \
                 and from the map's edge",
                vehicle.name,
                vehicle.footprint.length,
                vehicle.footprint.width,
                scenario.plan.clearance
            );
            reading.refuse(key, &value, cause, allowed);
        }
    }
}

fn check_limits(reading: &mut Reading<'_, ScenarioDraft>, scenario: &Scenario, vehicle: &Vehicle) {
    let limits = &vehicle.limits;
    if scenario.plan.steering > limits.steering {
        let degrees = angle::degrees(scenario.plan.steering);
        let most = angle::degrees(limits.steering);
        let allowed = format!("at most limits.steering of {}, {most:.2} degrees", vehicle.name);
        let value = format!("{degrees}");
        reading.refuse("plan.steering_degrees", &value, Cause::OutOfRange, allowed);
    }
    if scenario.plan.speed > limits.speed {
        let allowed = format!("at most limits.speed of {}, {} m/s", vehicle.name, limits.speed);
        let value = format!("{}", scenario.plan.speed);
        reading.refuse("plan.speed", &value, Cause::OutOfRange, allowed);
    }
}

/// Why a vehicle cannot stand at a pose; none where it can.
fn blocked(scenario: &Scenario, vehicle: &Vehicle, pose: &Pose) -> Option<Cause> {
    let corners = vehicle.footprint.corners_at(pose);
    let depth = scenario.bounds.depth(&corners);
    if depth < -ROUNDING {
        return Some(Cause::OutsideMap(-depth));
    }
    let obstacles = scenario.obstacles.iter();
    let distances = obstacles
        .map(|obstacle| (convex_distance(&corners, obstacle.outline.corners()), &*obstacle.name));
    let (distance, nearest) = distances
        .chain([(depth, "the map's edge")])
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(distance, _)| *distance < scenario.plan.clearance - ROUNDING)?;
    Some(Cause::Blocked(if distance <= 0.0 {
        format!("the footprint is inside or against {nearest}")
    } else {
        format!("the footprint is {distance:.3} m from {nearest}")
    }))
}
