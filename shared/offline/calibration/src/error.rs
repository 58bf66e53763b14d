//! Why a calibration is refused.

/// What stands against a calibration as a whole, or against condensing one run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// No run is left to calibrate with.
    #[error("no run is left to calibrate with")]
    NoRuns,
    /// No run can be used, each for its own reason.
    #[error("no run can be used:\n{}", reasons.join("\n"))]
    Unusable {
        /// Run and evidence, a sentence each.
        reasons: Vec<String>,
    },
    /// The run has no wheel with two readings or more.
    #[error("run {run}: no wheel was read twice")]
    NoWheels {
        /// The run.
        run: String,
    },
    /// The run's wheels never turn.
    #[error("run {run}: no wheel turns")]
    NoMotion {
        /// The run.
        run: String,
    },
    /// The sensors of the run do not say how the vehicle turned.
    #[error(
        "run {run}: its sensors do not say how the vehicle turned: \
         two rear wheels, or one wheel and a steering sensor or a gyro are needed"
    )]
    NoHeading {
        /// The run.
        run: String,
    },
    /// Nothing in the run says where it led: no reference, end pose, distance, net turn or gyro beside the wheels.
    #[error("run {run}: no reference, end pose, distance, net turn or gyro to compare with")]
    NoTruth {
        /// The run.
        run: String,
    },
    /// The fit met a number that is not finite: the runs and the nominal vehicle contradict each other grossly.
    #[error("the fit does not converge: the runs contradict the nominal vehicle")]
    Diverged,
    /// The closed form needs a straight run with its distance.
    #[error("the closed form needs a straight run whose distance or end position is known")]
    NoStraight,
    /// The closed form needs an arc with its net turn.
    #[error("the closed form needs an arc whose end heading is known")]
    NoArc,
    /// The heading of every arc is too uncertain for the closed form.
    #[error(
        "run {run}: its heading is known to {share:.1} % of its turn; the closed form takes 3 % at most: \
         drive more of a circle, or use the joint method"
    )]
    CoarseHeading {
        /// The run with the least uncertain heading.
        run: String,
        /// Uncertainty of its turn over its turn \[%\].
        share: f64,
    },
}
