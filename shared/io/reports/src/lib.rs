//! Self-contained HTML reports with SVG.
//!
//! A report is one file: no script, no style sheet, no font and no picture from elsewhere, so that
//! it still opens in ten years and on a machine without a network. The same input gives the same
//! bytes.
//!
//! Three layers, each usable alone:
//!
//! - [`svg`]: figures. A [`svg::Map`] in metres with equal scales, a [`svg::Chart`] of traces over
//!   a common axis, [`svg::latency_histogram`] and [`svg::latency_tail`] on logarithmic axes.
//! - [`page`]: what a page is made of: a verdict, sections, key figures, tables, facts, figures.
//! - [`ParkReport`], [`ReplayReport`], [`CalibrateReport`], [`DiagnoseReport`], [`ReproductionReport`] and
//!   [`SoakReport`]: plain data in, a page out.
//!
//! Lengths are metres, angles radians, times seconds since the run's start, unless a name says
//! else. Figures that are not finite are shown as a dash; they never reach the drawing.

mod calibrate;
mod diagnose;
mod error;
pub mod format;
pub mod page;
mod park;
mod provenance;
mod replay;
mod reproduce;
mod soak;
pub mod svg;
mod track;

pub use calibrate::{
    CalibrateReport, CalibratedParameter, DerivedFigure, EndErrors, ReckonedPath, RunNote,
    RunPaths, RunResidual,
};
pub use diagnose::DiagnoseReport;
pub use error::ReportError;
pub use park::{
    CommandSample, EstimateSample, Event, EventKind, Figures, JudgedOn, Latency, Outcome,
    ParkReport, Phase, Plan, ProcessFigures, Scene,
};
pub use provenance::Provenance;
pub use replay::{Drift, Gap, Model, RefusalCount, ReplayReport, WheelTravel};
pub use reproduce::{ReproductionReport, StackParking};
pub use soak::{SoakFault, SoakFigure, SoakReport, SoakSlope};
pub use track::Motion;
