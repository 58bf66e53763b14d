//! What a filter knows besides its pose.

use super::{FAR, finite, within};
use crate::Refusal;
use crate::layout::layout;

layout! {
    /// What the estimator's next life needs besides pose, covariance and travel in order to go on as this one would.
    ///
    /// Parameters, in this order: relative radius of fl, fr, rl, rr; front track, rear track, wheelbase \[m\]; steering
    /// zero \[rad\]; gyro bias \[rad/s\]. Rows of a block: fl, fr, rl, rr, steering, gyro. All zero but for wheels and
    /// gyro where the filter is not the fused one.
    pub struct FilterState {
        /// What was learnt of the parameters: deviations from what the vehicle's file states.
        pub parameters: [f64; 9],
        /// Their covariance: lower triangle, row by row.
        pub parameter_covariance: [f64; 45],
        /// Covariance of x, y, yaw (rows) with the parameters (columns).
        pub shared_covariance: [f64; 27],
        /// Open block of path: what each row says beyond the motion.
        pub block_residual: [f64; 6],
        /// Derivatives of each row by distance and turn, weighed by the way.
        pub block_by_motion: [f64; 12],
        /// Derivatives of each row by up to three parameters.
        pub block_by_parameters: [f64; 18],
        /// Variance of each row.
        pub block_variance: [f64; 6],
        /// Travel of each wheel's row \[m\].
        pub block_reading: [f64; 6],
        /// Way of the block \[m\].
        pub block_way: f64,
        /// Its distance \[m\].
        pub block_distance: f64,
        /// Its turn \[rad\].
        pub block_turn: f64,
        /// Way that no weight has taken up yet \[m\].
        pub pending: f64,
        /// Smoothed distance and wheelbase times turn \[m\].
        pub course: [f64; 2],
        /// Way over which the course was seen \[m\].
        pub seen: f64,
        /// What the pose rolled of the way of fl, fr, rl, rr that the counter has not told yet \[m\].
        pub owed_travel: [f64; 4],
        /// Way meanwhile \[m\].
        pub owed_way: [f64; 4],
        /// Road-wheel angle before the newest one \[rad\].
        pub steering_before: f64,
        /// Way since the newest angle was read \[m\].
        pub steering_way: f64,
        /// Newest yaw rate of the gyro \[rad/s\].
        pub gyro_rate: f64,
        /// What it was held for since \[rad\].
        pub gyro_held: f64,
        /// Turn since the last motion \[rad\].
        pub gyro_turn: f64,
        /// Its variance \[rad^2\].
        pub gyro_variance: f64,
        /// Stamp of the newest motion or fix in the pose \[ns\].
        pub time: u64,
        /// Stamp of the newest angle \[ns\].
        pub steering_stamp: u64,
        /// Stamp of the newest yaw rate \[ns\].
        pub gyro_stamp: u64,
        /// Stamp up to which the gyro is integrated \[ns\].
        pub gyro_reached: u64,
        /// Stamp since which it is \[ns\].
        pub gyro_since: u64,
        /// What vehicle and prior the deviations are of, as a number; 0: there are none.
        pub basis: u64,
        /// Records of the open block.
        pub block_records: u32,
        /// Blocks before it that ended where the next began.
        pub block_chain: u32,
        /// Travels in a row with a new angle.
        pub steering_run: u32,
        /// Bit per row: in every record of the block.
        pub block_live: u8,
        /// Bit per row: part of every record's motion.
        pub block_used: u8,
        /// Bit per wheel: it contradicted the others.
        pub distrusted: u8,
        /// Bit per wheel: a travel of this counter epoch is known.
        pub based: u8,
        /// Bit per wheel: the pose went on without it.
        pub lost: u8,
        /// Bit per wheel: read when the pose was rolled last.
        pub read: u8,
        /// 1: an angle was read.
        pub has_steering: u8,
        /// 1: a yaw rate was read.
        pub has_gyro: u8,
        /// Unused.
        pub reserved: [u8; 4],
    }
}

impl FilterState {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        let numbers = [
            self.block_way,
            self.block_distance,
            self.block_turn,
            self.pending,
            self.seen,
            self.steering_before,
            self.steering_way,
            self.gyro_rate,
            self.gyro_held,
            self.gyro_turn,
            self.gyro_variance,
        ];
        finite("filter_state", &numbers)?;
        within("parameters", &self.parameters, 1e3)?;
        finite("parameter_covariance", &self.parameter_covariance)?;
        finite("shared_covariance", &self.shared_covariance)?;
        finite("block_residual", &self.block_residual)?;
        finite("block_by_motion", &self.block_by_motion)?;
        finite("block_by_parameters", &self.block_by_parameters)?;
        finite("block_variance", &self.block_variance)?;
        finite("block_reading", &self.block_reading)?;
        finite("course", &self.course)?;
        within("owed_travel", &self.owed_travel, FAR)?;
        within("owed_way", &self.owed_way, FAR)
    }
}
