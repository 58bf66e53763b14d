//! Parking paths of arcs and lines found by search, and their time parametrisation.
//!
//! [`plan`] answers a request. Behind it, in the order of use: the request is checked and becomes
//! a world of convex obstacles; a tree of arcs and lines grows from the goal until it can be
//! reached from the start in closed form; every piece is held against the obstacles over its
//! whole sweep, exactly; the path is put in time under the vehicle's limits and sampled.

mod bound;
mod connect;
mod cost;
mod failure;
mod pace;
mod plan;
mod problem;
mod profile;
mod search;
mod segment;
mod settings;
mod sweep;
mod timeline;
mod tree;
mod world;

pub use failure::{PlanFailure, RequestFault, Shortfall};
pub use plan::{Planned, plan};
pub use segment::Segment;
pub use settings::PlannerSettings;
pub use world::Nearest;
