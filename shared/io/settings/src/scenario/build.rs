//! From what a file states to a scenario.

use std::path::Path;

use kerbside_geometry::{Bounds, ConvexPolygon, PolygonError, Pose, angle};
use kerbside_messages::{MAX_OBSTACLES, MAX_VERTICES};

use super::keys::PoseDraft;
use super::{Disturbance, Obstacle, PlanLimits, Scenario, ScenarioDraft, Tolerance};
use crate::declare::{Field, Reading, SourceFile, Value};
use crate::problem::Cause;

/// Where the vehicle may be: bounds, and what is solid inside them.
pub(super) struct Space {
    bounds: Bounds,
    obstacles: Vec<Obstacle>,
}

/// The space that a file describes; none where it does not, and then the reading knows why.
pub(super) fn space(
    reading: &mut Reading<'_, ScenarioDraft>,
    draft: &ScenarioDraft,
) -> Option<Space> {
    let (map, slot) = (reading.has("map"), reading.has("slot"));
    if map == slot {
        report_space(reading, map);
        return None;
    }
    if !reading.is_sound() {
        return None;
    }
    check_intervals(reading, draft);
    let bounds = if map {
        Bounds { min: draft.map.map(|side| side[0]), max: draft.map.map(|side| side[1]) }
    } else {
        Bounds { min: [draft.aisle[0], -draft.depth], max: [draft.aisle[1], draft.aisle_width] }
    };
    let mut obstacles = Vec::new();
    if slot && reading.is_sound() {
        add_neighbours(draft, &mut obstacles);
    }
    add_stated(reading, draft, &mut obstacles);
    check_count(reading, &obstacles);
    reading.is_sound().then_some(Space { bounds, obstacles })
}

fn report_space(reading: &mut Reading<'_, ScenarioDraft>, both: bool) {
    if both {
        let cause = Cause::Conflict("[map] and [slot] both say where the free space is".to_owned());
        reading.refuse("map", "a table", cause, "either [map] or [slot]".to_owned());
    } else if reading.is_sound() {
        let cause = Cause::Conflict("nothing says where the free space is".to_owned());
        reading.refuse("map", "absent", cause, "either [map] or [slot]".to_owned());
    }
}

fn check_intervals(reading: &mut Reading<'_, ScenarioDraft>, draft: &ScenarioDraft) {
    let slot = reading.has("slot");
    let intervals: &[(&str, [f64; 2])] = match slot {
        true => &[("slot.x", draft.slot), ("slot.aisle_x", draft.aisle)],
        false => &[("map.x", draft.map[0]), ("map.y", draft.map[1])],
    };
    for (key, interval) in intervals {
        if interval[0] >= interval[1] {
            refuse(reading, key, interval, Cause::OutOfRange, "the lesser number first");
        }
    }
    let inside = draft.aisle[0] <= draft.slot[0] && draft.slot[1] <= draft.aisle[1];
    if slot && !inside && reading.is_sound() {
        let allowed = format!("within slot.aisle_x, {} to {} m", draft.aisle[0], draft.aisle[1]);
        refuse(reading, "slot.x", &draft.slot, Cause::OutOfRange, &allowed);
    }
}

fn refuse(
    reading: &mut Reading<'_, ScenarioDraft>,
    key: &str,
    value: &impl Field,
    cause: Cause,
    allowed: &str,
) {
    let value = value.show().as_ref().map_or_else(String::new, Value::to_string);
    reading.refuse(key, &value, cause, allowed.to_owned());
}

/// What is solid on both sides of the slot.
fn add_neighbours(draft: &ScenarioDraft, obstacles: &mut Vec<Obstacle>) {
    let sides = [
        ("the slot's neighbour towards -x", [draft.aisle[0], draft.slot[0]]),
        ("the slot's neighbour towards +x", [draft.slot[1], draft.aisle[1]]),
    ];
    for (name, [low, high]) in sides {
        let outline = rectangle([low, -draft.depth, high, 0.0]);
        // A slot at the end of the aisle has no neighbour there.
        if let Ok(outline) = ConvexPolygon::new(outline) {
            obstacles.push(Obstacle { name: name.to_owned(), outline });
        }
    }
}

fn rectangle([left, low, right, high]: [f64; 4]) -> Vec<[f64; 2]> {
    vec![[left, low], [right, low], [right, high], [left, high]]
}

fn add_stated(
    reading: &mut Reading<'_, ScenarioDraft>,
    draft: &ScenarioDraft,
    obstacles: &mut Vec<Obstacle>,
) {
    for (index, sides) in draft.boxes.iter().enumerate() {
        let name = format!("boxes[{index}]");
        match ConvexPolygon::new(rectangle(*sides)) {
            Ok(outline) if sides[0] < sides[2] => obstacles.push(Obstacle { name, outline }),
            _ => {
                let cause = Cause::Conflict(format!("{name} is {} and has no area", show(sides)));
                let allowed = "[least x, least y, greatest x, greatest y]";
                refuse(reading, "boxes", &draft.boxes, cause, allowed);
            }
        }
    }
    for (index, corners) in draft.polygons.iter().enumerate() {
        let name = format!("polygons[{index}]");
        match either_way_round(corners) {
            Ok(outline) => obstacles.push(Obstacle { name, outline }),
            Err(error) => {
                let cause = Cause::Conflict(format!("{name}: {error}"));
                let allowed = "convex polygons, their corners in order";
                refuse(reading, "polygons", &draft.polygons, cause, allowed);
            }
        }
    }
}

fn show(value: &impl Field) -> String {
    value.show().as_ref().map_or_else(String::new, Value::to_string)
}

/// People write corners in either order.
fn either_way_round(corners: &[[f64; 2]]) -> Result<ConvexPolygon, PolygonError> {
    match ConvexPolygon::new(corners.to_vec()) {
        Err(PolygonError::Clockwise) => ConvexPolygon::new(corners.iter().rev().copied().collect()),
        result => result,
    }
}

/// A plan request has room for so many.
fn check_count(reading: &mut Reading<'_, ScenarioDraft>, obstacles: &[Obstacle]) {
    let corners: usize = obstacles.iter().map(|obstacle| obstacle.outline.corners().len()).sum();
    if obstacles.len() > MAX_OBSTACLES || corners > MAX_VERTICES {
        let key = if reading.has("polygons") { "polygons" } else { "boxes" };
        let found = format!("{} obstacles with {corners} corners", obstacles.len());
        let allowed = format!(
            "at most {MAX_OBSTACLES} obstacles with {MAX_VERTICES} corners together, those of \
             the slot included"
        );
        reading.refuse(key, &found, Cause::OutOfRange, allowed);
    }
}

/// The scenario of a complete draft.
pub(super) fn scenario(file: &SourceFile, draft: ScenarioDraft, space: Space) -> Scenario {
    let radians = angle::radians;
    let name = Path::new(&file.name).file_stem().unwrap_or_default();
    Scenario {
        name: name.to_string_lossy().into_owned(),
        file: file.name.clone(),
        vehicle: draft.vehicle,
        stack: draft.stack,
        bounds: space.bounds,
        obstacles: space.obstacles,
        start: pose(draft.start),
        goal: pose(draft.goal),
        gear: draft.gear,
        plan: PlanLimits {
            clearance: draft.clearance,
            steering: radians(draft.steering_degrees),
            speed: draft.speed,
            gear_changes: draft.gear_changes,
        },
        tolerance: Tolerance { position: draft.tolerance, yaw: radians(draft.tolerance_degrees) },
        disturbance: Disturbance {
            position: draft.disturbance,
            yaw: radians(draft.disturbance_degrees),
            known_position: draft.known,
            known_yaw: radians(draft.known_degrees),
        },
    }
}

fn pose(draft: PoseDraft) -> Pose {
    Pose::new(draft.x, draft.y, angle::radians(draft.yaw_degrees))
}
