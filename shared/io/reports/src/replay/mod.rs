//! The report on a replayed drive.

mod charts;
mod data;
mod page;

pub use data::{Drift, Gap, Model, RefusalCount, ReplayReport, WheelTravel};
