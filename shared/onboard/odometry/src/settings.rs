//! What a configuration may set of ingest and estimator.

use kerbside_geometry::Pose;

/// Of the ingest stage.
#[derive(Clone, Debug, PartialEq)]
pub struct IngestSettings {
    /// A wheel may turn this many times faster than `limits.speed` allows before a reading is
    /// implausible.
    pub speed_margin: f64,
    /// Longest time without a reading that a counter may bridge \[s\]; beyond it a new counter
    /// epoch begins.
    pub longest_gap: f64,
    /// Time over which the vehicle's clock is compared with the host's \[s\].
    pub clock_window: f64,
    /// Largest drift of the vehicle's clock that is believed, as |rate - 1|.
    pub clock_drift: f64,
}

impl Default for IngestSettings {
    fn default() -> Self {
        Self { speed_margin: 3.0, longest_gap: 2.0, clock_window: 20.0, clock_drift: 5e-4 }
    }
}

/// How the estimator makes a pose of what the vehicle measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Filter {
    /// The vehicle's odometry model alone: with two rear wheels these and nothing else.
    Rear,
    /// The filter of Lee, Chung and Chang as published, the front pose taken from the last fused
    /// one; where there is no front axle, as `Rear`. Its covariance is far too small.
    Paper,
    /// The same, the front pose integrated on its own from the start: the other reading.
    PaperOwn,
    /// Every sensor a measurement of the motion with its own noise, what they have in common
    /// carried with its uncertainty.
    #[default]
    Fused,
}

/// Of the estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimatorSettings {
    /// The filter.
    pub filter: Filter,
    /// Random part of a wheel's travel, standard deviation \[m/sqrt(m)\], where the vehicle's file
    /// states none.
    pub wheel_noise: f64,
    /// Standard deviation of the steering angle \[rad\], where the vehicle's file states none.
    pub steering_noise: f64,
    /// Standard deviation of the gyro \[rad/s\], where the vehicle's file states none.
    pub gyro_noise: f64,
    /// Squared Mahalanobis length beyond which a correction is refused (chi-square, 3 degrees of
    /// freedom).
    pub gate: f64,
    /// Without a count for so long the vehicle stands \[s\].
    pub standstill_time: f64,
    /// Oldest fix that is judged \[s\].
    pub fix_age: f64,
    /// Pose at the start; none: a fix is awaited.
    pub initial_pose: Option<InitialPose>,
}

impl Default for EstimatorSettings {
    fn default() -> Self {
        Self {
            filter: Filter::default(),
            wheel_noise: 0.001,
            steering_noise: 0.0035,
            gyro_noise: 0.003,
            gate: 16.27,
            standstill_time: 0.3,
            fix_age: 1.0,
            initial_pose: None,
        }
    }
}

/// A pose given by configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialPose {
    /// The pose.
    pub pose: Pose,
    /// Standard deviation of the position, each axis \[m\].
    pub position_noise: f64,
    /// Standard deviation of the heading \[rad\].
    pub yaw_noise: f64,
}
