//! The report on a parking manoeuvre.

mod charts;
mod data;
mod errors;
mod page;
mod scene;
mod tables;

pub use data::{
    CommandSample, EstimateSample, Event, EventKind, Figures, JudgedOn, Latency, Outcome,
    ParkReport, Phase, Plan, ProcessFigures, Scene,
};
