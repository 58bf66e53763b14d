//! Geometry and mass of the vehicle: what is true of it, whatever anyone believes.

use kerbside_geometry::{Drive, WHEELS, Wheel, math};

/// Acceleration of free fall \[m/s^2\].
pub const GRAVITY: f64 = 9.806_65;

/// The vehicle's true measures. Arrays of four are in the order of [`WHEELS`]; the body frame sits at the centre of
/// the rear axle, x forward, y left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chassis {
    /// Axle to axle \[m\].
    pub wheelbase: f64,
    /// Between the contact points of the front wheels \[m\].
    pub track_front: f64,
    /// Between the contact points of the rear wheels \[m\].
    pub track_rear: f64,
    /// Rolling radii of the wheels \[m\].
    pub radius: [f64; 4],
    /// Which wheels the motor turns.
    pub drive: Drive,
    /// Of the whole vehicle \[kg\].
    pub mass: f64,
    /// About the vertical axis through the centre of mass \[kg m^2\].
    pub yaw_inertia: f64,
    /// Distance of the centre of mass from the rear axle, forward \[m\].
    pub centre_of_mass: f64,
}

/// Motion of the body per unit of commanded speed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UnitMotion {
    /// Speed of the rear-axle centre along x \[1\].
    pub forward: f64,
    /// Rate of the heading \[rad/m\].
    pub yaw: f64,
}

impl Chassis {
    /// Position of a wheel's contact point in the body frame: (x, y) \[m\].
    #[must_use]
    pub fn wheel_position(&self, wheel: Wheel) -> (f64, f64) {
        let (x, track) = if wheel.is_front() {
            (self.wheelbase, self.track_front)
        } else {
            (0.0, self.track_rear)
        };
        (x, if wheel.is_left() { 0.5 * track } else { -0.5 * track })
    }

    /// Whether the motor turns this wheel.
    #[must_use]
    pub fn is_driven(&self, wheel: Wheel) -> bool {
        match self.drive {
            Drive::All => true,
            Drive::Front => wheel.is_front(),
            Drive::Rear => !wheel.is_front(),
        }
    }

    /// Mean radius of the driven wheels \[m\].
    pub(crate) fn driven_radius(&self) -> f64 {
        let driven = WHEELS.into_iter().filter(|wheel| self.is_driven(*wheel));
        let (sum, count) =
            driven.fold((0.0, 0.0), |(sum, n), wheel| (sum + self.radius[wheel.index()], n + 1.0));
        sum / count
    }

    /// Force with which a wheel presses on the level ground at rest \[N\].
    #[must_use]
    pub fn load(&self, wheel: Wheel) -> f64 {
        let front_share = self.centre_of_mass / self.wheelbase;
        let share = if wheel.is_front() { front_share } else { 1.0 - front_share };
        0.5 * share * self.mass * GRAVITY
    }

    /// Distance that each wheel rolls per metre of the rear-axle centre on a circle of `curvature` \[1/m\], without
    /// slip and with ideal wheel angles: hypot(1 - y k, x k) for a wheel at (x, y).
    ///
    /// A rear wheel inside of which the car turns rolls backwards.
    #[must_use]
    pub fn travel_per_metre(&self, curvature: f64) -> [f64; 4] {
        self.travel_of(UnitMotion { forward: 1.0, yaw: curvature })
    }

    /// The same per unit of a motion.
    pub(crate) fn travel_of(&self, motion: UnitMotion) -> [f64; 4] {
        WHEELS.map(|wheel| {
            let (x, y) = self.wheel_position(wheel);
            let (along, across) = (motion.forward - y * motion.yaw, x * motion.yaw);
            if wheel.is_front() { (along * along + across * across).sqrt() } else { along }
        })
    }

    /// What a unit of commanded speed is while the equivalent centre wheel stands at `steering` \[rad\]: of the
    /// rear-axle centre, or, where only the front wheels are driven, of the front-axle centre, which still moves when
    /// they are turned by 90 degrees.
    pub(crate) fn unit_motion(&self, steering: f64) -> UnitMotion {
        if self.drive == Drive::Front {
            let (sin, cos) = math::sin_cos(steering);
            UnitMotion { forward: cos, yaw: sin / self.wheelbase }
        } else {
            UnitMotion { forward: 1.0, yaw: math::tan(steering) / self.wheelbase }
        }
    }

    /// Change of the unit motion's yaw with the steering \[1/m\].
    pub(crate) fn unit_yaw_slope(&self, steering: f64) -> f64 {
        let cos = math::cos(steering);
        let slope = if self.drive == Drive::Front { cos } else { 1.0 / (cos * cos) };
        slope / self.wheelbase
    }

    /// Commanded speed over the speed of the rear-axle centre on a circle of `curvature` \[1/m\].
    pub(crate) fn command_per_speed(&self, curvature: f64) -> f64 {
        if self.drive == Drive::Front { math::hypot(1.0, self.wheelbase * curvature) } else { 1.0 }
    }
}
