//! The plotting kit: figures as SVG text.
//!
//! Colours, widths and letter sizes live in `templates/figure.css`, which the page carries along,
//! so that a figure follows light, dark, print and narrow screens without being drawn again. Lines
//! keep their width at any zoom.

mod axes;
mod band;
mod canvas;
mod chart;
mod decimate;
mod figure;
mod latency;
mod map;
mod range;
mod rows;
mod scale;
mod style;

pub use band::Band;
pub use chart::{Chart, Cloud, Mark, Span, Trace};
pub use decimate::{envelope, simplify};
pub use figure::{Figure, Legend};
pub use latency::{latency_histogram, latency_tail};
pub use map::Map;
pub use range::Range;
pub use rows::{Bar, BarRow, Cell, Panel, RowWeight, Rows};
pub use scale::{Scale, Tick, Ticks};
pub use style::{Area, Dash, Ink, Line, Tone, Weight};

/// The style sheet that all figures need.
pub const STYLE: &str = include_str!("../../templates/figure.css");
