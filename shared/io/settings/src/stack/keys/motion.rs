//! Keys of the stages from counts to commands.

use core::f64::consts::PI;

use kerbside_odometry::Filter;

use super::StackDraft;
use crate::declare::{Field, Kind, Range, Schema, Value};

const SHARE: Kind = Kind::number(Range::above(0.0).to(1.0));
const LENGTH: Kind = Kind::metres(Range::above(0.0).to(100.0));
const ANGLE: Kind = Kind::radians(Range::above(0.0).to(PI));

/// The filters that files may name. The paper's other reading is for comparisons alone.
const FILTERS: &[&str] = &["rear", "paper", "fused"];

impl Field for Filter {
    fn take(value: &Value) -> Option<Self> {
        match value {
            Value::Text(text) => match text.as_str() {
                "rear" => Some(Self::Rear),
                "paper" => Some(Self::Paper),
                "fused" => Some(Self::Fused),
                _ => None,
            },
            _ => None,
        }
    }

    fn show(&self) -> Option<Value> {
        let name = match self {
            Self::Rear => "rear",
            Self::Paper | Self::PaperOwn => "paper",
            Self::Fused => "fused",
        };
        Some(Value::Text(name.to_owned()))
    }
}

/// `[ingest]`, `[estimator]`, `[initial_pose]`, `[planner]` and `[tracker]`.
pub(super) fn declare(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    let schema = declare_initial_pose(declare_estimator(declare_ingest(schema)));
    declare_tracker(declare_planner(schema))
}

fn declare_ingest(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section("ingest", "From counts to travel.")
        .key(
            "ingest.speed_margin",
            Kind::number(Range::from(1.0).to(100.0)),
            "A wheel may turn this many times faster than limits.speed allows before a reading \
             is implausible.",
            |s| &mut s.ingest.speed_margin,
        )
        .key(
            "ingest.longest_gap",
            Kind::seconds(Range::above(0.0).to(60.0)),
            "Longest time without a reading that a counter may bridge; beyond it a new counter \
             epoch begins.",
            |s| &mut s.ingest.longest_gap,
        )
        .key(
            "ingest.clock_window",
            Kind::seconds(Range::from(0.1).to(3600.0)),
            "Time over which the vehicle's clock is compared with the host's.",
            |s| &mut s.ingest.clock_window,
        )
        .key(
            "ingest.clock_drift",
            Kind::number(Range::from(0.0).to(0.01)),
            "Largest drift of the vehicle's clock that is believed, as |rate - 1|.",
            |s| &mut s.ingest.clock_drift,
        )
}

fn declare_estimator(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section("estimator", "From travel to a pose.")
        .key(
            "estimator.filter",
            Kind::Choice(FILTERS),
            "One axle alone, the paper's filter as published, or every sensor weighed by its own \
             noise.",
            |s| &mut s.estimator.filter,
        )
        .key(
            "estimator.wheel_noise",
            Kind::unit("m/sqrt(m)", Range::above(0.0).to(1.0)),
            "Random part of a wheel's travel, standard deviation, where the vehicle's file \
             states none.",
            |s| &mut s.estimator.wheel_noise,
        )
        .key(
            "estimator.steering_noise",
            ANGLE,
            "Standard deviation of the steering angle, where the vehicle's file states none.",
            |s| &mut s.estimator.steering_noise,
        )
        .key(
            "estimator.gyro_noise",
            Kind::unit("rad/s", Range::above(0.0).to(10.0)),
            "Standard deviation of the gyro, where the vehicle's file states none.",
            |s| &mut s.estimator.gyro_noise,
        )
        .key(
            "estimator.gate",
            Kind::number(Range::above(0.0).to(1000.0)),
            "Squared Mahalanobis length beyond which a correction is refused (chi-square, 3 \
             degrees of freedom).",
            |s| &mut s.estimator.gate,
        )
        .key(
            "estimator.standstill_time",
            Kind::seconds(Range::from(0.01).to(10.0)),
            "Without a count for so long the vehicle stands.",
            |s| &mut s.estimator.standstill_time,
        )
        .key(
            "estimator.fix_age",
            Kind::seconds(Range::above(0.0).to(60.0)),
            "Oldest fix that is judged.",
            |s| &mut s.estimator.fix_age,
        )
}

fn declare_initial_pose(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .optional_section(
            "initial_pose",
            "Pose of the rear-axle centre when the stack starts. Absent: a fix is awaited.",
        )
        .required("initial_pose.x", Kind::metres(Range::ANY), "Position along x.", |s| {
            &mut s.initial.x
        })
        .required("initial_pose.y", Kind::metres(Range::ANY), "Position along y.", |s| {
            &mut s.initial.y
        })
        .required(
            "initial_pose.yaw_degrees",
            Kind::degrees(Range::from(-360.0).to(360.0)),
            "Heading, counter-clockwise from x.",
            |s| &mut s.initial.yaw_degrees,
        )
        .key(
            "initial_pose.position_noise",
            Kind::metres(Range::above(0.0).to(100.0)),
            "Standard deviation of each coordinate.",
            |s| &mut s.initial.position_noise,
        )
        .key(
            "initial_pose.yaw_noise_degrees",
            Kind::degrees(Range::above(0.0).to(180.0)),
            "Standard deviation of the heading.",
            |s| &mut s.initial.yaw_noise_degrees,
        )
}

fn declare_planner(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section("planner", "From a goal to a trajectory.")
        .key(
            "planner.acceleration_share",
            SHARE,
            "Share of limits.acceleration a plan uses to speed up.",
            |s| &mut s.planner.acceleration_share,
        )
        .key(
            "planner.deceleration_share",
            Kind::number(Range::above(0.0).to(0.5)),
            "Share of limits.deceleration a plan uses to slow down; at most half, so that a \
             late stop ramp fits.",
            |s| &mut s.planner.deceleration_share,
        )
        .key(
            "planner.steering_rate_share",
            SHARE,
            "Share of limits.steering_rate a plan uses.",
            |s| &mut s.planner.steering_rate_share,
        )
        .key(
            "planner.interval",
            Kind::seconds(Range::from(0.001).to(1.0)),
            "Time between the points of a plan; longer where a plan would need too many.",
            |s| &mut s.planner.interval,
        )
        .key(
            "planner.pause",
            Kind::seconds(Range::from(0.0).to(10.0)),
            "Pause at each change of direction, besides the steering's own time.",
            |s| &mut s.planner.pause,
        )
        .key(
            "planner.smoothing",
            Kind::seconds(Range::from(0.0).to(10.0)),
            "Window over which speed and steering ramps are averaged, so that their rates do \
             not jump.",
            |s| &mut s.planner.smoothing,
        )
        .key(
            "planner.comfort",
            Kind::number(Range::from(1.0).to(10.0)),
            "Clearance that the search tries for first, in multiples of the scenario's; 1 tries \
             for no more.",
            |s| &mut s.planner.comfort,
        )
        .key(
            "planner.search_nodes",
            Kind::Integer { unit: "", low: 100, high: 100_000_000 },
            "Nodes the search may open before it gives up.",
            |s| &mut s.planner.search_nodes,
        )
}

fn declare_tracker(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section(
            "tracker",
            "From pose and trajectory to commands. Defaults of lengths and of the spatial gain \
             scale with the vehicle's wheelbase over 0.5 m.",
        )
        .key(
            "tracker.gain_along",
            Kind::unit("1/s", Range::above(0.0).to(20.0)),
            "Gain of the error along the path.",
            |s| &mut s.tracker.gain_along,
        )
        .key(
            "tracker.gain_across",
            Kind::unit("1/m", Range::above(0.0).to(200.0)),
            "Spatial gain of the errors across the path and of heading: both decay like \
             exp(-gain * distance).",
            |s| &mut s.tracker.gain_across,
        )
        .key(
            "tracker.corridor",
            LENGTH,
            "Greatest distance from the plan before the tracker stops.",
            |s| &mut s.tracker.corridor,
        )
        .key(
            "tracker.corridor_yaw",
            ANGLE,
            "Greatest heading error before the tracker stops.",
            |s| &mut s.tracker.corridor_yaw,
        )
        .key(
            "tracker.position_noise",
            LENGTH,
            "Greatest standard deviation of the position before the tracker stops.",
            |s| &mut s.tracker.position_noise,
        )
        .key(
            "tracker.yaw_noise",
            ANGLE,
            "Greatest standard deviation of the heading before the tracker stops.",
            |s| &mut s.tracker.yaw_noise,
        )
        .key(
            "tracker.goal_distance",
            LENGTH,
            "Error along the path at the end that is left alone.",
            |s| &mut s.tracker.goal_distance,
        )
        .key(
            "tracker.goal_time",
            Kind::seconds(Range::above(0.0).to(60.0)),
            "Longest time for the end of the plan beyond its duration.",
            |s| &mut s.tracker.goal_time,
        )
}
