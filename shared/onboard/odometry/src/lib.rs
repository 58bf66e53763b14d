//! From wheel counts to a pose: ingest, clock mapping, odometry models, the EKF.

mod settings;

pub use settings::{EstimatorSettings, IngestSettings, InitialPose};
