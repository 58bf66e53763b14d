//! The keys of a scenario.

use std::sync::LazyLock;

use super::Gear;
use crate::declare::{Kind, Range, Schema};

/// A scenario as far as its file states it, in the units of the file.
pub(crate) struct ScenarioDraft {
    pub(super) vehicle: String,
    pub(super) stack: String,
    pub(super) map: [[f64; 2]; 2],
    pub(super) slot: [f64; 2],
    pub(super) depth: f64,
    pub(super) aisle: [f64; 2],
    pub(super) aisle_width: f64,
    pub(super) boxes: Vec<[f64; 4]>,
    pub(super) polygons: Vec<Vec<[f64; 2]>>,
    pub(super) start: PoseDraft,
    pub(super) goal: PoseDraft,
    pub(super) gear: Gear,
    pub(super) clearance: f64,
    pub(super) steering_degrees: f64,
    pub(super) speed: f64,
    pub(super) gear_changes: u32,
    pub(super) tolerance: f64,
    pub(super) tolerance_degrees: f64,
    pub(super) disturbance: f64,
    pub(super) disturbance_degrees: f64,
    pub(super) known: f64,
    pub(super) known_degrees: f64,
}

/// A pose, as the file states it.
#[derive(Clone, Copy)]
pub(super) struct PoseDraft {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) yaw_degrees: f64,
}

impl Default for ScenarioDraft {
    fn default() -> Self {
        const N: f64 = f64::NAN;
        let pose = PoseDraft { x: N, y: N, yaw_degrees: N };
        Self {
            vehicle: String::new(),
            stack: "stack".to_owned(),
            map: [[N; 2]; 2],
            slot: [N; 2],
            depth: N,
            aisle: [N; 2],
            aisle_width: N,
            boxes: Vec::new(),
            polygons: Vec::new(),
            start: pose,
            goal: pose,
            gear: Gear::Either,
            clearance: N,
            steering_degrees: N,
            speed: N,
            gear_changes: 0,
            tolerance: 0.03,
            tolerance_degrees: 1.5,
            disturbance: 0.05,
            disturbance_degrees: 5.0,
            known: 0.002,
            known_degrees: 0.1,
        }
    }
}

const COORDINATE: Kind = Kind::metres(Range::from(-10_000.0).to(10_000.0));
const LENGTH: Kind = Kind::metres(Range::above(0.0).to(10_000.0));
const DISTANCE: Kind = Kind::metres(Range::from(0.0).to(100.0));
const INTERVAL: Kind = Kind::List { of: &COORDINATE, least: 2, most: 2 };
const POINT: Kind = INTERVAL;
const BOX: Kind = Kind::List { of: &COORDINATE, least: 4, most: 4 };
const POLYGON: Kind = Kind::List { of: &POINT, least: 3, most: 32 };
const HEADING: Kind = Kind::degrees(Range::from(-360.0).to(360.0));
const TURN: Kind = Kind::degrees(Range::from(0.0).to(180.0));

static SCHEMA: LazyLock<Schema<ScenarioDraft>> = LazyLock::new(declare);

/// The keys of a scenario.
pub(crate) fn schema() -> &'static Schema<ScenarioDraft> {
    &SCHEMA
}

fn declare() -> Schema<ScenarioDraft> {
    let schema = Schema::new(
        "scenarios/NAME.toml",
        "A parking task. Lengths in metres, in a frame of your own; angles in degrees, \
         counter-clockwise from x, and their keys end in `_degrees`.",
        ScenarioDraft::default,
    )
    .required(
        "vehicle",
        Kind::Text,
        "The vehicle: a name to look for under `vehicles/`, or a path, relative to this file.",
        |s| &mut s.vehicle,
    )
    .key(
        "stack",
        Kind::Text,
        "The stack's file that suits the vehicle: a name, or a path, relative to this file.",
        |s| &mut s.stack,
    );
    declare_judgement(declare_task(declare_space(schema)))
}

fn declare_space(schema: Schema<ScenarioDraft>) -> Schema<ScenarioDraft> {
    schema
        .optional(
            "boxes",
            Kind::List { of: &BOX, least: 0, most: 32 },
            "none",
            "Solid rectangles along the axes: least x, least y, greatest x, greatest y.",
            |s| &mut s.boxes,
        )
        .optional(
            "polygons",
            Kind::List { of: &POLYGON, least: 0, most: 32 },
            "none",
            "Solid convex polygons: the corners of each in order.",
            |s| &mut s.polygons,
        )
        .optional_section(
            "map",
            "The free rectangle; everything outside is solid. Either this or [slot] is needed.",
        )
        .required("map.x", INTERVAL, "Least and greatest x.", |s| &mut s.map[0])
        .required("map.y", INTERVAL, "Least and greatest y.", |s| &mut s.map[1])
        .optional_section(
            "slot",
            "A slot beside an aisle: the aisle lies along x, its near side on y = 0; the slot \
             opens into it and lies below. Everything else is solid.",
        )
        .required("slot.x", INTERVAL, "From where to where along the aisle.", |s| &mut s.slot)
        .required("slot.depth", LENGTH, "From the aisle down.", |s| &mut s.depth)
        .required("slot.aisle_x", INTERVAL, "From where to where the aisle goes.", |s| &mut s.aisle)
        .required("slot.aisle_width", LENGTH, "Across the aisle.", |s| &mut s.aisle_width)
}

fn declare_task(schema: Schema<ScenarioDraft>) -> Schema<ScenarioDraft> {
    schema
        .section("start", "Pose of the rear-axle centre at the start.")
        .required("start.x", COORDINATE, "Position along x.", |s| &mut s.start.x)
        .required("start.y", COORDINATE, "Position along y.", |s| &mut s.start.y)
        .required("start.yaw_degrees", HEADING, "Heading.", |s| &mut s.start.yaw_degrees)
        .section("goal", "Pose of the rear-axle centre to park at.")
        .required("goal.x", COORDINATE, "Position along x.", |s| &mut s.goal.x)
        .required("goal.y", COORDINATE, "Position along y.", |s| &mut s.goal.y)
        .required("goal.yaw_degrees", HEADING, "Heading.", |s| &mut s.goal.yaw_degrees)
        .key("goal.gear", Kind::Choice(Gear::NAMES), "Direction of travel on arrival.", |s| {
            &mut s.gear
        })
        .section("plan", "What a plan may do.")
        .required(
            "plan.clearance",
            DISTANCE,
            "Least distance of the footprint from everything solid.",
            |s| &mut s.clearance,
        )
        .required(
            "plan.steering_degrees",
            Kind::degrees(Range::above(0.0).below(90.0)),
            "Largest steering angle; what the vehicle has beyond it is left to the tracker.",
            |s| &mut s.steering_degrees,
        )
        .required(
            "plan.speed",
            Kind::unit("m/s", Range::above(0.0).to(100.0)),
            "Largest speed.",
            |s| &mut s.speed,
        )
        .required(
            "plan.gear_changes",
            Kind::Integer { unit: "", low: 0, high: 20 },
            "Most changes of the travel direction.",
            |s| &mut s.gear_changes,
        )
}

fn declare_judgement(schema: Schema<ScenarioDraft>) -> Schema<ScenarioDraft> {
    schema
        .section("tolerance", "What counts as parked, in the goal's frame.")
        .key("tolerance.position", LENGTH, "Largest error of x and of y.", |s| &mut s.tolerance)
        .key("tolerance.yaw_degrees", TURN, "Largest error of the heading.", |s| {
            &mut s.tolerance_degrees
        })
        .section(
            "disturbance",
            "How far a simulated vehicle's true start is from the stated one, and how well it \
             is known.",
        )
        .key(
            "disturbance.position",
            DISTANCE,
            "Largest offset of x and of y, drawn uniformly.",
            |s| &mut s.disturbance,
        )
        .key(
            "disturbance.yaw_degrees",
            TURN,
            "Largest offset of the heading, drawn uniformly.",
            |s| &mut s.disturbance_degrees,
        )
        .key(
            "disturbance.known_position",
            Kind::metres(Range::above(0.0).to(100.0)),
            "Standard deviation of each coordinate in what the estimator is told.",
            |s| &mut s.known,
        )
        .key(
            "disturbance.known_yaw_degrees",
            Kind::degrees(Range::above(0.0).to(180.0)),
            "Standard deviation of the heading in what the estimator is told.",
            |s| &mut s.known_degrees,
        )
}
