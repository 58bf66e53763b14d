//! Effects that a diagnosis may name.
use super::effect::{Definition, Link, Role, Unit, effect, of_wheel, other, size};
use core::f64::consts::PI;

/// The effects that a diagnosis may name, in the order of cause. Ranges are those of a sane search.
pub const LISTED: &[Definition] = &[
    effect("speed_gain", Link::SpeedActuation, &[size("gain", 1.0, 0.7, 1.3, Unit::Plain)], ""),
    effect("speed_delay", Link::SpeedActuation, &[size("delay", 0.0, 0.0, 0.4, Unit::Plain)], ""),
    effect("speed_lag", Link::SpeedActuation, &[size("lag", 0.0, 0.0, 0.6, Unit::Plain)], ""),
    effect(
        "speed_dead_zone",
        Link::SpeedActuation,
        &[size("width", 0.0, 0.0, 0.15, Unit::Speed)],
        "",
    ),
    effect(
        "acceleration_limit",
        Link::SpeedActuation,
        &[other("limit", 0.02, 0.3, Unit::Acceleration, Role::Limit)],
        "",
    ),
    effect(
        "steering_gain",
        Link::SteeringActuation,
        &[size("gain", 1.0, 0.7, 1.3, Unit::Plain)],
        "",
    ),
    effect(
        "steering_delay",
        Link::SteeringActuation,
        &[size("delay", 0.0, 0.0, 0.4, Unit::Plain)],
        "",
    ),
    effect("steering_lag", Link::SteeringActuation, &[size("lag", 0.0, 0.0, 0.5, Unit::Plain)], ""),
    effect(
        "steering_rate_limit",
        Link::SteeringActuation,
        &[other("limit", 0.05, 0.8, Unit::SteeringRate, Role::Limit)],
        "",
    ),
    effect(
        "steering_backlash",
        Link::SteeringActuation,
        &[size("width", 0.0, 0.0, 0.1, Unit::Plain)],
        "",
    ),
    effect("steering_offset", Link::Ground, &[size("offset", 0.0, -0.08, 0.08, Unit::Plain)], ""),
    effect(
        "steering_compliance",
        Link::Ground,
        &[size("rate", 0.0, 0.0, 0.5, Unit::PerAcceleration)],
        "",
    ),
    effect("wheelbase_scale", Link::Ground, &[size("scale", 1.0, 0.85, 1.15, Unit::Plain)], ""),
    effect(
        "track_scale",
        Link::Ground,
        &[size("front", 1.0, 0.85, 1.15, Unit::Plain), size("rear", 1.0, 0.85, 1.15, Unit::Plain)],
        "",
    ),
    effect("radius_scale", Link::Ground, &[size("scale", 1.0, 0.92, 1.08, Unit::Plain)], ""),
    effect(
        "radius_difference",
        Link::Ground,
        &[
            size("front", 0.0, -0.03, 0.03, Unit::Plain),
            size("rear", 0.0, -0.03, 0.03, Unit::Plain),
        ],
        "",
    ),
    effect("drive_slip", Link::Ground, &[size("ratio", 0.0, 0.0, 0.15, Unit::Plain)], ""),
    effect(
        "acceleration_slip",
        Link::Ground,
        &[size("rate", 0.0, 0.0, 0.5, Unit::PerAcceleration)],
        "",
    ),
    effect(
        "understeer",
        Link::Ground,
        &[size("gradient", 0.0, 0.0, 3.0, Unit::PerSpeedSquared)],
        "",
    ),
    effect("lateral_slip", Link::Ground, &[size("rate", 0.0, 0.0, 0.5, Unit::Passage)], ""),
    effect("lateral_drift", Link::Ground, &[size("rate", 0.0, -0.05, 0.05, Unit::Plain)], ""),
    effect(
        "floor_slope",
        Link::Ground,
        &[
            other("direction", -PI, PI, Unit::Plain, Role::Free),
            size("rate", 0.0, 0.0, 0.05, Unit::Plain),
        ],
        "",
    ),
    effect(
        "floor_patch",
        Link::Ground,
        &[
            other("x", -2.0, 2.0, Unit::Length, Role::Place),
            other("y", -2.0, 2.0, Unit::Length, Role::Place),
            other("radius", 0.3, 1.0, Unit::Length, Role::Free),
            size("ratio", 0.0, 0.0, 0.3, Unit::Plain),
        ],
        "",
    ),
    of_wheel("count_loss", &[size("fraction", 0.0, 0.0, 0.2, Unit::Plain)], Link::Sensing, ""),
    effect("encoder_delay", Link::Sensing, &[size("delay", 0.0, 0.0, 0.3, Unit::Plain)], ""),
    effect(
        "steering_sensor_offset",
        Link::Sensing,
        &[size("offset", 0.0, -0.08, 0.08, Unit::Plain)],
        "",
    ),
    effect("steering_sensor_gain", Link::Sensing, &[size("gain", 1.0, 0.8, 1.2, Unit::Plain)], ""),
    effect("gyro_bias", Link::Sensing, &[size("bias", 0.0, -0.05, 0.05, Unit::Plain)], ""),
    effect("gyro_gain", Link::Sensing, &[size("gain", 1.0, 0.9, 1.1, Unit::Plain)], ""),
    effect("reference_delay", Link::Reference, &[size("delay", 0.0, 0.0, 0.4, Unit::Plain)], ""),
    effect("reference_scale", Link::Reference, &[size("scale", 1.0, 0.95, 1.05, Unit::Plain)], ""),
    effect(
        "reference_marker",
        Link::Reference,
        &[
            size("x", 0.0, -0.1, 0.1, Unit::Length),
            size("y", 0.0, -0.1, 0.1, Unit::Length),
            size("yaw", 0.0, -0.1, 0.1, Unit::Plain),
        ],
        "",
    ),
    effect("clock_drift", Link::Reference, &[size("rate", 0.0, -0.005, 0.005, Unit::Plain)], ""),
];
