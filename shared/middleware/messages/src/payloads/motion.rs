//! From counts to a pose.

use super::{FAR, FilterState, codes, covariance, finite, known, within};
use crate::layout::{Text, layout};
use crate::{Header, Refusal};

codes! {
    /// What a travel says of one wheel.
    pub enum WheelStatus {
        /// The vehicle has no such encoder.
        Absent = 0 "absent",
        /// Read, and plausible.
        Valid = 1 "valid",
        /// The vehicle has it, this reading does not carry it.
        NotRead = 2 "not read",
        /// Read, but no wheel of this vehicle can have turned so far in the time.
        Implausible = 3 "implausible",
        /// First reading of an epoch: it sets the zero.
        Zeroed = 4 "zeroed",
    }
}

layout! {
    /// Each wheel's rolled distance. `header.stamp` is the reading's time on the host's clock.
    pub struct Travel {
        /// Header.
        pub header: Header,
        /// Travel of fl, fr, rl, rr since the counter epoch began \[m\].
        pub travel: [f64; 4],
        /// Travel since that wheel's previous valid reading \[m\]; 0 where the status is not `Valid`.
        pub increment: [f64; 4],
        /// Newest road-wheel angle, left positive \[rad\].
        pub steering: f64,
        /// Newest yaw rate \[rad/s\].
        pub yaw_rate: f64,
        /// Time since the previous travel of the epoch \[s\]; 0 for the first.
        pub interval: f64,
        /// Offset of the host's clock from the vehicle's, at the stamp \[ns\].
        pub clock_offset: i64,
        /// Drift of the vehicle's clock against the host's, as rate - 1.
        pub clock_drift: f64,
        /// How late this reading came beyond the fastest ones \[s\].
        pub transport_delay: f64,
        /// Readings missing before this one.
        pub missing: u32,
        /// Changes when counters restart or motion was lost beyond what a counter can tell.
        pub counter_epoch: u32,
        /// Readings refused since the start.
        pub refused: u32,
        /// [`WheelStatus`] of fl, fr, rl, rr.
        pub status: [u8; 4] as WheelStatus,
        /// 1: readings are missing before this one; the increment spans them.
        pub gap: u8,
        /// 1: the steering angle was read with or before this travel.
        pub has_steering: u8,
        /// 1: the yaw rate was read with or before this travel.
        pub has_yaw_rate: u8,
        /// 1: the newest steering angle was read with this very travel.
        pub steering_is_new: u8,
        /// 1: the newest yaw rate was read with this very travel.
        pub yaw_rate_is_new: u8,
        /// Unused.
        pub reserved: [u8; 3],
    }
}

impl Travel {
    /// Status of wheel `index`; a number that stands for none counts as implausible.
    #[must_use]
    pub fn wheel(&self, index: usize) -> WheelStatus {
        WheelStatus::from_code(self.status[index]).unwrap_or(WheelStatus::Implausible)
    }

    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        within("travel", &self.travel, FAR)?;
        within("increment", &self.increment, 1e4)?;
        within("steering", &[self.steering], core::f64::consts::PI)?;
        within("yaw_rate", &[self.yaw_rate], 1e3)?;
        finite("clock", &[self.interval, self.clock_drift, self.transport_delay])?;
        self.status.iter().try_for_each(|code| known("status", WheelStatus::from_code(*code)))
    }
}

codes! {
    /// What the estimate is worth.
    pub enum EstimatorState {
        /// No initial pose yet: the pose is relative to the start.
        Unset = 0 "no initial pose",
        /// A pose in the frame of the plan.
        Valid = 1 "valid",
        /// The pose was lost: a fix is needed.
        Lost = 2 "pose lost",
    }
}

codes! {
    /// How motion is computed from what the vehicle has.
    pub enum OdometryModel {
        /// Nothing can be computed.
        None = 0 "none",
        /// Rear and front wheels with the steering sensor.
        RearFront = 1 "rear and front wheels",
        /// Two rear wheels.
        Rear = 2 "rear wheels",
        /// Two front wheels and the steering sensor.
        Front = 3 "front wheels and steering",
        /// One wheel and the steering sensor.
        WheelSteering = 4 "one wheel and steering",
        /// One wheel and the gyro.
        WheelGyro = 5 "one wheel and gyro",
    }
}

codes! {
    /// Why a pose jumped.
    pub enum ResetReason {
        /// It did not.
        None = 0 "none",
        /// Configured initial pose.
        Initial = 1 "initial pose",
        /// A fix at standstill.
        Fix = 2 "fix",
        /// A restart that took up the newest odometry.
        Restored = 3 "restored",
        /// Counters started anew.
        CounterReset = 4 "counter reset",
        /// Fixes contradicted the pose again and again and agreed with one another: it was less sure than it said.
        Contradicted = 5 "contradicted by fixes",
    }
}

codes! {
    /// What became of the newest fix.
    pub enum FixVerdict {
        /// There was none.
        None = 0 "none",
        /// It set the pose, or corrected it.
        Accepted = 1 "accepted",
        /// The vehicle moves, and the fix contradicts its pose, or there is none to correct.
        Moving = 2 "refused: the vehicle moves",
        /// Too old.
        Late = 3 "refused: too old",
        /// From after the newest travel.
        Future = 4 "refused: stamp in the future",
        /// Not a covariance.
        Covariance = 5 "refused: covariance",
        /// It agrees with the refused ones before it: the filter was too sure of itself, its covariance was widened, and
        /// the fix corrected the pose.
        Widened = 6 "accepted: the covariance was widened",
    }
}

codes! {
    /// What the estimator does with a wheel at present.
    pub enum WheelUse {
        /// The vehicle has no such encoder, or it was not read.
        None = 0 "not read",
        /// Part of the pose.
        Used = 1 "used",
        /// It contradicts all others: beyond its gate.
        Gated = 2 "refused: contradicts the others",
        /// Rear and front axle differ, and it is this axle.
        Slipping = 3 "refused: its axle slips",
        /// This filter does without it.
        Unneeded = 4 "not needed",
    }
}

codes! {
    /// Which filter made the estimate.
    pub enum FilterKind {
        /// One axle or wheel, as the odometry model says.
        Rear = 0 "rear",
        /// The paper's: rear wheels predict, front wheels correct, from the last fused pose.
        Paper = 1 "paper",
        /// The paper's, the front pose integrated on its own from the start.
        PaperOwn = 2 "paper, front on its own",
        /// Every sensor a measurement of the motion.
        Fused = 3 "fused",
    }
}

layout! {
    /// The estimate. Pose of the rear-axle centre in the frame of the initial pose; `header.stamp` is its time.
    pub struct Odometry {
        /// Header.
        pub header: Header,
        /// Position \[m\].
        pub x: f64,
        /// Position \[m\].
        pub y: f64,
        /// Heading, not wrapped \[rad\].
        pub yaw: f64,
        /// Speed of the rear-axle centre, negative in reverse \[m/s\].
        pub speed: f64,
        /// Yaw rate \[rad/s\].
        pub yaw_rate: f64,
        /// Road-wheel angle used \[rad\].
        pub steering: f64,
        /// Covariance of (x, y, yaw), row by row \[m^2, m rad, rad^2\].
        pub covariance: [f64; 9],
        /// Newest innovation (x, y, yaw): of the front pose, or of a fix where the filter is `Fused` \[m, m, rad\].
        pub innovation: [f64; 3],
        /// Squared Mahalanobis length of that innovation.
        pub test_ratio: f64,
        /// Squared innovation over its variance of fl, fr, rl, rr in the newest block of path; 0 where nothing else tells.
        pub wheel_ratio: [f64; 4],
        /// What the sensors disagree about in the newest block, squared and per degree of freedom: 1 on average.
        pub block_ratio: f64,
        /// Distance rolled in either direction since the start \[m\].
        pub distance: f64,
        /// The cumulative travel of fl, fr, rl, rr this pose stands for \[m\].
        pub travel: [f64; 4],
        /// The counter epoch of that travel.
        pub counter_epoch: u32,
        /// How often the pose jumped.
        pub resets: u32,
        /// Corrections taken.
        pub corrections: u32,
        /// Corrections refused by the gate.
        pub gated: u32,
        /// Travels without usable wheels.
        pub unusable: u32,
        /// [`EstimatorState`].
        pub state: u8 as EstimatorState,
        /// [`OdometryModel`].
        pub model: u8 as OdometryModel,
        /// [`ResetReason`] of the newest jump.
        pub reset_reason: u8 as ResetReason,
        /// [`FixVerdict`] of the newest fix.
        pub fix_verdict: u8 as FixVerdict,
        /// 1: no wheel has turned for the configured time.
        pub standstill: u8,
        /// 1: this step corrected.
        pub corrected: u8,
        /// 1: the travel behind this step had a gap.
        pub gap: u8,
        /// [`FilterKind`].
        pub filter: u8 as FilterKind,
        /// [`WheelUse`] of fl, fr, rl, rr.
        pub wheel_use: [u8; 4] as WheelUse,
        /// Sequence of the newest fix judged, 0 for none.
        pub fix_sequence: u64,
        /// What the filter knows besides, for a later life of the estimator.
        pub filter_state: FilterState,
    }
}

impl Odometry {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        within("pose", &[self.x, self.y, self.yaw], FAR)?;
        within("twist", &[self.speed, self.yaw_rate, self.steering], 1e3)?;
        covariance("covariance", &self.covariance)?;
        finite("innovation", &self.innovation)?;
        finite("test_ratio", &[self.test_ratio, self.block_ratio, self.distance])?;
        finite("wheel_ratio", &self.wheel_ratio)?;
        known("filter", FilterKind::from_code(self.filter))?;
        self.wheel_use
            .iter()
            .try_for_each(|code| known("wheel_use", WheelUse::from_code(*code)))?;
        within("travel", &self.travel, FAR)?;
        known("state", EstimatorState::from_code(self.state))?;
        known("model", OdometryModel::from_code(self.model))?;
        known("reset_reason", ResetReason::from_code(self.reset_reason))?;
        known("fix_verdict", FixVerdict::from_code(self.fix_verdict))?;
        self.filter_state.check_fields()
    }
}

layout! {
    /// The newest valid odometry of an earlier life of the estimator.
    pub struct Restore {
        /// Header.
        pub header: Header,
        /// What that life published.
        pub odometry: Odometry,
    }
}

impl Restore {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        self.odometry.check_fields()
    }
}

layout! {
    /// An absolute pose, of the rear-axle centre or of a marker on the vehicle, true at `header.stamp`.
    pub struct Fix {
        /// Header.
        pub header: Header,
        /// Position \[m\].
        pub x: f64,
        /// Position \[m\].
        pub y: f64,
        /// Heading \[rad\].
        pub yaw: f64,
        /// Covariance of (x, y, yaw), row by row \[m^2, m rad, rad^2\].
        pub covariance: [f64; 9],
        /// Where on the vehicle that is, `body_from_marker`; zeros for the rear-axle centre \[m\].
        pub marker_x: f64,
        /// The same, to the left \[m\].
        pub marker_y: f64,
        /// Heading of the marker in the body frame \[rad\].
        pub marker_yaw: f64,
        /// Who says so: UTF-8, filled up with zeros.
        pub source: [u8; 32] as Text,
    }
}

impl Fix {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        within("pose", &[self.x, self.y, self.yaw], FAR)?;
        within("marker", &[self.marker_x, self.marker_y, self.marker_yaw], 1e3)?;
        covariance("covariance", &self.covariance)
    }
}
