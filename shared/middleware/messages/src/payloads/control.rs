//! From command to actuators.

use super::{codes, finite, known, within};
use crate::layout::{Text, layout};
use crate::{Header, Refusal};

codes! {
    /// Where the tracker is in its plan.
    pub enum TrackingPhase {
        /// Follows the plan.
        Tracking = 1 "tracking",
        /// The plan is over, the vehicle stands.
        Finished = 2 "finished",
        /// Gave up: see the reason.
        Stopped = 3 "stopped",
    }
}

codes! {
    /// Why the tracker gave up.
    pub enum TrackingStop {
        /// It did not.
        None = 0 "none",
        /// Too far from the plan.
        Corridor = 1 "left the corridor of the plan",
        /// The pose is too uncertain.
        Covariance = 2 "the pose is too uncertain",
        /// The estimator has no valid pose, or the pose jumped.
        Pose = 3 "the pose was lost or jumped",
        /// The end of the plan was reached, but not its goal.
        Goal = 4 "the goal was not reached in time",
    }
}

layout! {
    /// What the tracker asks of the actuators.
    pub struct Command {
        /// Header.
        pub header: Header,
        /// Speed of the rear-axle centre \[m/s\].
        pub speed: f64,
        /// Its rate \[m/s^2\].
        pub acceleration: f64,
        /// Road-wheel angle \[rad\].
        pub steering: f64,
        /// Its rate \[rad/s\].
        pub steering_rate: f64,
        /// Error along the reference's heading: reference minus estimate \[m\].
        pub error_along: f64,
        /// Error across it \[m\].
        pub error_across: f64,
        /// Heading error \[rad\].
        pub error_yaw: f64,
        /// Time of the plan \[s\].
        pub plan_time: f64,
        /// Distance from the estimate to the plan's end \[m\].
        pub to_goal: f64,
        /// The plan's id.
        pub plan: u64,
        /// The count of arms it acts under.
        pub arm: u64,
        /// [`TrackingPhase`].
        pub phase: u8 as TrackingPhase,
        /// [`TrackingStop`].
        pub stop: u8 as TrackingStop,
        /// Unused.
        pub reserved: [u8; 6],
    }
}

impl Command {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        within("speed", &[self.speed, self.acceleration], 1e3)?;
        within("steering", &[self.steering], core::f64::consts::PI)?;
        within("steering_rate", &[self.steering_rate], 1e3)?;
        let errors =
            [self.error_along, self.error_across, self.error_yaw, self.plan_time, self.to_goal];
        finite("errors", &errors)?;
        known("phase", TrackingPhase::from_code(self.phase))?;
        known("stop", TrackingStop::from_code(self.stop))
    }
}

layout! {
    /// The supervisor's leave to move until `expiry`.
    pub struct Permit {
        /// Header.
        pub header: Header,
        /// The count of arms it belongs to.
        pub arm: u64,
        /// When it ends \[ns\].
        pub expiry: u64,
        /// [`crate::Mode`].
        pub mode: u8 as super::Mode,
        /// 1: motion is permitted.
        pub granted: u8,
        /// Unused.
        pub reserved: [u8; 6],
    }
}

impl Permit {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        if self.granted > 1 {
            return Err(Refusal::OutOfRange { field: "granted" });
        }
        known("mode", super::Mode::from_code(self.mode))
    }
}

layout! {
    /// A demand to stop, in force until `expiry`.
    pub struct Inhibit {
        /// Header.
        pub header: Header,
        /// When it ends \[ns\].
        pub expiry: u64,
        /// Who asks: UTF-8, filled up with zeros.
        pub who: [u8; 32] as Text,
        /// Why: UTF-8, filled up with zeros.
        pub why: [u8; 96] as Text,
    }
}

impl Inhibit {
    #[allow(clippy::unnecessary_wraps, clippy::unused_self)] // every payload answers the same question
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        Ok(())
    }
}

codes! {
    /// Why the gate's output is not the command.
    pub enum AlterReason {
        /// It is the command.
        None = 0 "none",
        /// Cut to the vehicle's limits.
        Limited = 1 "limited",
        /// No permit has been seen for this arm.
        NoPermit = 2 "no permit",
        /// The permit ended.
        PermitExpired = 3 "permit expired",
        /// An inhibit is in force.
        Inhibited = 4 "inhibited",
        /// No command, or only old ones.
        CommandStale = 5 "command stale",
        /// The newest command is malformed.
        CommandInvalid = 6 "command invalid",
        /// Stopped before; waits for a permit of a newer arm.
        Latched = 7 "latched until the next arm",
        /// The tracker itself asked for the stop.
        TrackerStop = 8 "tracker stopped",
    }
}

layout! {
    /// What passed the gate and goes to the vehicle.
    pub struct Actuator {
        /// Header.
        pub header: Header,
        /// Speed of the rear-axle centre \[m/s\].
        pub speed: f64,
        /// Road-wheel angle \[rad\].
        pub steering: f64,
        /// The count of arms whose permit it acted under; 0 for none.
        pub arm: u64,
        /// Sequence of the command it follows; 0 for none.
        pub command: u64,
        /// [`AlterReason`] of this output.
        pub reason: u8 as AlterReason,
        /// [`AlterReason`] that latched the gate; `None` while it is open.
        pub latch: u8 as AlterReason,
        /// Unused.
        pub reserved: [u8; 6],
    }
}

impl Actuator {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        within("speed", &[self.speed], 1e3)?;
        within("steering", &[self.steering], core::f64::consts::PI)?;
        known("reason", AlterReason::from_code(self.reason))?;
        known("latch", AlterReason::from_code(self.latch))
    }
}
