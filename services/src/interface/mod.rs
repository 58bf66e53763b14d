//! The vehicle interface: one file a kind of line.

mod line;
mod replay;
pub mod serial;

pub use line::{LineStage, reading_to_raw};

use kerbside_settings::InterfaceSettings;

use crate::exit::{Exit, Failure};
use crate::life::Service;

/// Runs the interface of the configured kind.
///
/// # Errors
/// [`Failure`] where the process cannot take part, or its input cannot be read.
pub fn run(service: &Service) -> Result<Exit, Failure> {
    match service.stack.interface {
        InterfaceSettings::Line { .. } => line::run(service),
        InterfaceSettings::Replay => replay::run(service),
    }
}
