//! What comes from the vehicle.

use super::{FAR, finite, within};
use crate::layout::layout;
use crate::{Header, Refusal};

/// Names of the wheels, in the order of every array; bit i of a mask is wheel i.
pub const WHEELS: [&str; 4] = ["fl", "fr", "rl", "rr"];

layout! {
    /// A reading as the vehicle reported it. `header.stamp` is the arrival at the host.
    pub struct Raw {
        /// Header.
        pub header: Header,
        /// The vehicle's own time of the reading \[ns since its start\].
        pub vehicle_time: u64,
        /// When the reading was complete at the host \[ns\].
        pub arrival: u64,
        /// Cumulative counts of fl, fr, rl, rr as read: the counter's bits, sign-extended.
        pub counts: [i64; 4],
        /// Wheel surface speeds of fl, fr, rl, rr \[m/s\], of vehicles that report these instead of counts.
        pub speeds: [f64; 4],
        /// Road-wheel angle of the steering sensor, left positive \[rad\].
        pub steering: f64,
        /// Yaw rate of the gyro \[rad/s\].
        pub yaw_rate: f64,
        /// Identity of the vehicle's present life: a new one means that its counters started anew.
        pub boot: u32,
        /// Sequence of the reading on the line.
        pub frame: u32,
        /// Bytes or frames that the line refused since the previous reading.
        pub line_errors: u32,
        /// Bit i: wheel i has a count.
        pub counts_mask: u8,
        /// Bit i: wheel i has a speed.
        pub speeds_mask: u8,
        /// 1: the steering angle is valid.
        pub has_steering: u8,
        /// 1: the yaw rate is valid.
        pub has_yaw_rate: u8,
    }
}

impl Raw {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        finite("speeds", &self.speeds)?;
        within("speeds", &self.speeds, 1e3)?;
        within("steering", &[self.steering], core::f64::consts::PI)?;
        within("yaw_rate", &[self.yaw_rate], 1e3)?;
        if self.counts_mask > 0xf {
            return Err(Refusal::OutOfRange { field: "counts_mask" });
        }
        if self.speeds_mask > 0xf {
            return Err(Refusal::OutOfRange { field: "speeds_mask" });
        }
        Ok(())
    }
}

layout! {
    /// The simulated vehicle's true state. `header.stamp` is the host's time at which it held.
    pub struct Truth {
        /// Header.
        pub header: Header,
        /// Position of the rear-axle centre \[m\].
        pub x: f64,
        /// Position of the rear-axle centre \[m\].
        pub y: f64,
        /// Heading, not wrapped \[rad\].
        pub yaw: f64,
        /// Speed of the rear-axle centre \[m/s\].
        pub speed: f64,
        /// Road-wheel angle \[rad\].
        pub steering: f64,
        /// Distance rolled in either direction since the start \[m\].
        pub distance: f64,
        /// The vehicle's own time \[ns since its start\].
        pub vehicle_time: u64,
        /// 1: the vehicle stops because commands stayed away.
        pub silent: u8,
        /// Unused.
        pub reserved: [u8; 7],
    }
}

impl Truth {
    pub(crate) fn check_fields(&self) -> Result<(), Refusal> {
        within("pose", &[self.x, self.y, self.yaw], FAR)?;
        within("motion", &[self.speed, self.steering], 1e3)?;
        finite("distance", &[self.distance])
    }
}
