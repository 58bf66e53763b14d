//! The experiments of Lee, Chung and Chang, "Improvement of odometry accuracy and Parking Control for a Car-Like Mobile
//! Robot", run on the proving ground and held against the nine rows of acceptance in docs/reproduction.md.
//!
//! ```text
//! proving ground -> readings -> calibration | ingest -> estimator -> tracker -> figures with what is accepted
//! ```
//!
//! Pure: an experiment is a function of the number of trials and the seed, and the same both give the same bits.
//! SI units, radians; figures say their own unit.

mod belief;
mod calibrations;
mod conversion;
mod ends;
mod error;
mod figure;
mod follower;
mod parking;
mod progress;
mod random;
mod run;
mod scatter;
mod slips;
mod statistics;
mod tables;
mod truthful;
mod yard;

pub use belief::Knowledge;
pub use calibrations::{Calibrations, Ends as RunEnds, Found};
pub use ends::{Ends, NOISE_CASES, SPEEDS};
pub use error::ReproductionError;
pub use figure::{Accept, Figure, Verdict};
pub use follower::Contender;
pub use parking::{Driver, Parkings, Scene};
pub use progress::Watcher;
pub use run::{Asked, FULL, ROWS, Reproduction, reproduce};
pub use scatter::Spread;
pub use slips::Slipped;
pub use truthful::{Circumstance, Growth, LENGTHS, STRENGTHS};
