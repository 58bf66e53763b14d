//! From wheel counts to a pose: ingest, clock mapping, odometry models, filters.
//!
//! Two stages, each a pure function of its samples. [`Ingest`] turns readings into travel: counters
//! unwrapped, the vehicle's clock mapped to the host's, every wheel marked valid or not, a gap left
//! a gap. [`Estimator`] turns travel into a pose with covariance, by the
//! [`OdometryModel`](kerbside_messages::OdometryModel) that the vehicle's [`Sensors`] allow.
//!
//! # Filters
//! [`Filter::Fused`] takes every wheel, the steering angle and the gyro for measurements of the
//! motion, each with its own noise, and carries what they have in common ([`Parameter`]: radii,
//! tracks, wheelbase, steering zero, gyro bias) with the uncertainty that the calibration left
//! ([`ParameterPrior`]). [`Filter::Paper`] is the filter of Lee, Chung and Chang as published, whose
//! covariance stays bounded while its error grows; [`Filter::PaperOwn`] the other reading of their
//! text; [`Filter::Rear`] one axle alone. The four are compared by `cargo run --release -p
//! kerbside-odometry --example filters`.
//!
//! Neither stage allocates, reads a clock or logs in `step`.
//!
//! # Who survives whom
//! While the vehicle's boot id stands, a counter is an absolute position: travel is the counter's
//! own value times metres per count, and the counter epoch is the boot id. A restarted ingest
//! therefore goes on with the very numbers its earlier life would have sent, up to a multiple of
//! the counter's range, which the estimator takes out of every difference. So the pose outlives
//! ingest, interface, estimator and any two of them; it is lost with the vehicle's restart, with a
//! gap that a counter cannot tell, and, where the vehicle reports speeds instead of counts, with
//! any of ingest's own restarts, since nothing says how far the wheels turned meanwhile.

mod clock;
mod estimator;
mod ingest;
mod parameters;
mod sensors;
mod settings;
mod wheels;

pub use clock::{ClockMap, Mapped};
pub use estimator::{Estimator, EstimatorInputs};
pub use ingest::Ingest;
pub use parameters::{
    PARAMETERS, Parameter, ParameterCovariance, ParameterEstimate, ParameterPrior,
};
pub use sensors::{NoModel, Sensors, WheelSignal, model_for};
pub use settings::{EstimatorSettings, Filter, IngestSettings, InitialPose};
