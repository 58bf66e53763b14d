//! The report of a soak with real processes.

mod charts;
mod data;
mod page;

pub use data::{SoakFault, SoakFigure, SoakReport, SoakSlope};
