//! Systematic odometry errors, identified from recorded straight and arc runs.
//!
//! ```text
//! runs -> diagnose -> closed form -> joint fit -> identifiability, outliers, runs left out -> Calibrated
//! ```
//!
//! - `closed_form`: the paper's equations (7) to (13), from sums over whole runs.
//! - `condense` (of `travel`, `cells`, `known`), `rows`, `chain`, `normal`, `solve`, `joint`: maximum likelihood over all
//!   runs and samples. A run is cut into blocks of a few centimetres; each says by its wheels and its steering how far the rear axle went and turned; the
//!   increments are chained from a start pose that is an unknown of the fit, wheel noise as process noise, the
//!   reference's poses as measurements at both ends and along the way. What front wheels, rear wheels and steering
//!   disagree on over some wheelbases enters beside it.
//! - `between`, `kinds`: what differs from drive to drive, or from one kind of drive to another, and what a calibration
//!   therefore has to allow for.
//! - `information`, `missing`: what the runs tell, priors excluded, and which manoeuvre would tell the rest.
//! - `left_out`, `steering_check`: dead reckoning on runs that the fit has not seen; the steering sensor against the
//!   front wheels.
//! - `diagnose`: bad input, named with its evidence.
//!
//! Pure: runs come in as [`Run`]s, results go out as values; the same runs give the same bits on every machine.
//! Lengths are metres, angles radians. The paper's b is the track, its epsilon the left minus the right radius.

mod ackermann;
mod between;
mod calibrated;
mod cells;
mod chain;
mod closed_form;
mod condense;
mod diagnose;
mod error;
mod gyro;
mod information;
mod joint;
mod kinds;
mod known;
mod left_out;
mod measured;
mod missing;
mod noise;
mod normal;
mod parameters;
mod path;
mod rows;
mod run;
mod solve;
mod steering_check;
mod travel;

pub use ackermann::{
    LARGEST_STEERING_FREE, WheelAngle, rear_distance_centre_form, rear_from_front,
    rear_from_front_travel, wheel_angle,
};
pub use calibrated::{Calibrated, Derived, Estimate, calibrate};
pub use closed_form::{ClosedForm, closed_form};
pub use diagnose::{Finding, Problem, diagnose_runs};
pub use error::CalibrationError;
pub use gyro::GyroBias;
pub use information::{Information, information};
pub use joint::{Rejected, RunResiduals};
pub use left_out::{LeftOut, fold_of};
pub use missing::Missing;
pub use noise::{Noise, Settings};
pub use normal::Square;
pub use parameters::{COUNT, PARAMETERS, Parameter, Parameters, Vector};
pub use path::{EndError, Path, Source, dead_reckon};
pub use run::{ReferencePose, Run, Series};
pub use steering_check::{SteeringCheck, check_steering};
