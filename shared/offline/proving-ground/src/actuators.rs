//! From commands to motor and rack.

use crate::chassis::Chassis;
use crate::physics::Actuators;

/// What the vehicle is asked to do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Speed of the rear-axle centre, negative in reverse \[m/s\]; of the front-axle centre where only the front wheels
    /// are driven.
    pub speed: f64,
    /// Angle of the equivalent centre front wheel, left positive \[rad\].
    pub steering: f64,
}

/// A command and how it changes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Setpoint {
    pub command: Command,
    /// \[m/s^2\].
    pub acceleration: f64,
    /// \[rad/s\].
    pub steering_rate: f64,
}

impl Setpoint {
    /// A command that holds.
    pub(crate) fn held(command: Command) -> Self {
        Self { command, acceleration: 0.0, steering_rate: 0.0 }
    }
}

/// A first-order lag with a limited rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Servo {
    lag: f64,
    rate_limit: f64,
    limit: f64,
}

/// Time constant of a servo that has a limit of its rate and no lag \[s\].
const SHORTEST_LAG: f64 = 0.005;

impl Servo {
    /// The servo of the motor. Its range is the command's own.
    pub(crate) fn speed(actuators: &Actuators) -> Self {
        Self::new(actuators.speed_lag, actuators.acceleration_limit, f64::INFINITY)
    }

    /// The servo of the rack.
    pub(crate) fn steering(actuators: &Actuators) -> Self {
        Self::new(actuators.steering_lag, actuators.steering_rate_limit, actuators.steering_limit)
    }

    fn new(lag: f64, rate_limit: f64, limit: f64) -> Self {
        let lag = if lag > 0.0 || rate_limit.is_finite() { lag.max(SHORTEST_LAG) } else { 0.0 };
        Self { lag, rate_limit, limit }
    }

    /// Time constant \[s\]; 0 of one that follows at once.
    pub(crate) fn lag(&self) -> f64 {
        self.lag
    }

    /// What the servo is told to reach.
    pub(crate) fn target(&self, asked: f64) -> f64 {
        asked.clamp(-self.limit, self.limit)
    }

    /// Value and rate while the servo stands at `value`, asked for `asked`, which changes by `asked_rate`.
    pub(crate) fn respond(&self, value: f64, asked: f64, asked_rate: f64) -> (f64, f64) {
        let target = self.target(asked);
        if self.lag == 0.0 {
            return (target, if target == asked { asked_rate } else { 0.0 });
        }
        let rate = ((target - value) / self.lag).clamp(-self.rate_limit, self.rate_limit);
        (value, rate)
    }
}

/// What a standing vehicle with its rack at `steering` \[rad\] is told before the first command.
pub(crate) fn at_rest(steering: f64) -> Setpoint {
    Setpoint::held(Command { speed: 0.0, steering })
}

/// The command for a motion of the rear-axle centre: `speed` \[m/s\], its rate \[m/s^2\], `curvature` \[1/m\] and its
/// rate \[1/(m s)\].
pub(crate) fn for_motion(
    chassis: &Chassis,
    speed: f64,
    acceleration: f64,
    curvature: f64,
    curvature_rate: f64,
) -> Setpoint {
    let factor = chassis.command_per_speed(curvature);
    let tangent = chassis.wheelbase * curvature;
    Setpoint {
        command: Command {
            speed: factor * speed,
            steering: kerbside_geometry::math::atan(tangent),
        },
        acceleration: factor * acceleration,
        steering_rate: chassis.wheelbase * curvature_rate / (1.0 + tangent * tangent),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_servo_lags_is_limited_and_can_be_ideal() {
        let ideal = Servo::new(0.0, f64::INFINITY, f64::INFINITY);
        assert_eq!(ideal.respond(3.0, 1.0, 0.5), (1.0, 0.5));
        let lagging = Servo::new(0.1, 2.0, 1.5);
        assert_eq!(lagging.respond(1.0, 1.1, 9.0).0, 1.0);
        assert!((lagging.respond(1.0, 1.1, 9.0).1 - 1.0).abs() < 1e-12);
        assert_eq!(lagging.respond(0.0, 9.0, 0.0), (0.0, 2.0), "limited rate");
        assert_eq!(lagging.target(9.0), 1.5, "limited range");
        assert_eq!(Servo::new(0.0, 2.0, 1.5).lag(), SHORTEST_LAG);
    }
}
