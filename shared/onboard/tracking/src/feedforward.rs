//! What the actuators ask for in advance.
//!
//! An actuator of delay D and lag T follows a reference r exactly when it is commanded
//! r(t + D) + T r'(t + D), as long as its rate limit leaves room.

use kerbside_geometry::{Actuators, Drive, Vehicle, math};

/// The nominal actuators and the differential.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Feedforward {
    response: Actuators,
    drive: Drive,
    wheelbase: f64,
    /// Half the track of the front axle \[m\].
    half_front: f64,
    half_rear: f64,
    radius: [f64; 4],
}

impl Feedforward {
    /// Of `vehicle`; ideal actuators where it states none.
    pub(crate) fn new(vehicle: &Vehicle) -> Self {
        Self {
            response: vehicle.response(),
            drive: vehicle.drive,
            wheelbase: vehicle.wheelbase,
            half_front: 0.5 * vehicle.track_front,
            half_rear: 0.5 * vehicle.track_rear,
            radius: vehicle.radius,
        }
    }

    /// How far ahead of time the speed is commanded \[s\].
    pub(crate) fn speed_preview(&self) -> f64 {
        self.response.speed_delay
    }

    /// How far ahead of time the steering is commanded \[s\].
    pub(crate) fn steering_preview(&self) -> f64 {
        self.response.steering_delay
    }

    /// The command for a rear-axle centre that shall drive at `speed` \[m/s\], changing with
    /// `acceleration` \[m/s^2\], on `curvature` \[1/m\].
    pub(crate) fn speed(&self, speed: f64, acceleration: f64, curvature: f64) -> f64 {
        (speed + self.response.speed_lag * acceleration) * self.drive_ratio(curvature)
    }

    /// The command for a road-wheel angle that shall be `steering` \[rad\], changing with `rate`
    /// \[rad/s\].
    pub(crate) fn steering(&self, steering: f64, rate: f64) -> f64 {
        steering + self.response.steering_lag * rate
    }

    /// Speed of the motor, through the driven wheels' mean radius, over that of the rear-axle
    /// centre. The differential splits the motor's rotation: front wheels roll farther in a bend.
    fn drive_ratio(&self, curvature: f64) -> f64 {
        let [fl, fr, rl, rr] = self.radius;
        let front = || self.axle(self.wheelbase, self.half_front, curvature, fl, fr);
        let rear = || self.axle(0.0, self.half_rear, curvature, rl, rr);
        match self.drive {
            Drive::Front => 0.5 * (fl + fr) * front(),
            Drive::Rear => 0.5 * (rl + rr) * rear(),
            Drive::All => 0.125 * (fl + fr + rl + rr) * (front() + rear()),
        }
    }

    /// Mean rotation of an axle's wheels per metre of the rear-axle centre \[rad/m\].
    fn axle(&self, x: f64, half_track: f64, curvature: f64, left: f64, right: f64) -> f64 {
        let rolled = |y: f64| math::hypot(1.0 - y * curvature, x * curvature);
        0.5 * (rolled(half_track) / left + rolled(-half_track) / right)
    }
}
