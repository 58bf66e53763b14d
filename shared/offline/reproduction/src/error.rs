//! Why an experiment cannot be run.

/// What stands against an experiment.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReproductionError {
    /// The vehicle's sensors give no motion.
    #[error(transparent)]
    NoModel(#[from] kerbside_odometry::NoModel),
    /// A calibration was refused.
    #[error(transparent)]
    Calibration(#[from] kerbside_calibration::CalibrationError),
    /// Means and intervals need trials.
    #[error("{0} trials are too few: at least 2 are needed")]
    FewTrials(usize),
    /// Somebody asked to stop.
    #[error("interrupted")]
    Interrupted,
}
