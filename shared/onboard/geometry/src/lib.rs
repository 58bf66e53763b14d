//! Poses, polygons, the vehicle's shape, and the one door to transcendental functions.
//!
//! Frames are right-handed: x forward, y left, yaw counter-clockwise. The body frame sits at the centre of the
//! rear axle, on the ground. Lengths are metres, angles radians.

pub mod angle;
mod footprint;
pub mod math;
mod paper_car;
mod polygon;
mod pose;
mod vehicle;

pub use polygon::{Bounds, ConvexPolygon, PolygonError, convex_distance};
pub use pose::Pose;
pub use vehicle::{
    Actuators, Drive, Encoders, Footprint, Gyro, Limits, Reference, SteeringSensor, Vehicle,
    WHEELS, Wheel,
};
