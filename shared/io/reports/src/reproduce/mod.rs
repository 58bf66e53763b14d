//! The report on the paper's experiments.

mod data;
mod figures;
mod page;
mod remarks;
mod tables;

pub use data::{ReproductionReport, StackParking};
