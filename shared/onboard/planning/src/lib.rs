//! Parking paths of arcs and lines found by search, and their time parametrisation.

mod settings;

pub use settings::PlannerSettings;
