//! The report on a calibration.

mod charts;
mod data;
mod page;

pub use data::{
    CalibrateReport, CalibratedParameter, DerivedFigure, EndErrors, ReckonedPath, RunNote,
    RunPaths, RunResidual,
};
