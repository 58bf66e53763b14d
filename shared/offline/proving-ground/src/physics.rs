//! What makes the vehicle more than an ideal rolling one. Every term can be set to zero on its own.

use kerbside_geometry::math;

/// Grip of the tyres, per unit of their load: a wheel under the load N that passes on the force F slips by
/// compliance * F / N, relative to the distance it rolls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tyres {
    /// Slip angle per side force over load, front and rear axle \[rad\]; 0: no side slip.
    pub lateral_compliance: [f64; 2],
    /// Longitudinal slip per drive or brake force over load \[1\]; 0: none.
    pub longitudinal_compliance: f64,
    /// Largest force over load \[1\]; infinite: the tyre stays linear. It bounds the force of tyres that have a
    /// compliance; rigid ones hold whatever acts on them.
    pub friction: f64,
    /// Resistance to rolling over load \[1\].
    pub rolling_resistance: f64,
}

/// From the rack to the front wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linkage {
    /// 1: each front wheel points along its own circle; 0: both stand parallel.
    pub ackermann: f64,
    /// Angle by which the axle's side force, which acts behind the contact's centre as seen in the direction of travel,
    /// bends both front wheels alike \[rad/N\]. Between rigid
    /// tyres only the side force that balances inertia does so.
    pub compliance: f64,
    /// Angles that each wheel, the rear ones included, has beside that, left positive \[rad\].
    pub toe: [f64; 4],
}

/// From a command to motor and rack: a pure delay, a limit, a first-order lag whose rate is limited.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuators {
    /// Delay of the speed \[s\].
    pub speed_delay: f64,
    /// Time constant of the speed \[s\].
    pub speed_lag: f64,
    /// Largest rate of the speed \[m/s^2\]; may be infinite.
    pub acceleration_limit: f64,
    /// Speed lost per force that the motor has to bring up \[m/s per N\].
    pub droop: f64,
    /// Delay of the steering \[s\].
    pub steering_delay: f64,
    /// Time constant of the steering \[s\].
    pub steering_lag: f64,
    /// Largest rate of the steering \[rad/s\]; may be infinite.
    pub steering_rate_limit: f64,
    /// Largest angle of the rack in either direction \[rad\]; may be infinite.
    pub steering_limit: f64,
}

/// All of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Physics {
    /// Grip.
    pub tyres: Tyres,
    /// Wheel angles.
    pub linkage: Linkage,
    /// How far the differentials are locked: 0 open (both wheels of an axle get the same force), 1 rigid (both turn
    /// alike), in between a viscous coupling of lock / (1 - lock) times the tyres' own stiffness.
    pub differential_lock: f64,
    /// Response to commands.
    pub actuators: Actuators,
}

impl Tyres {
    /// Rolling without slip or resistance.
    pub const NEUTRAL: Self = Self {
        lateral_compliance: [0.0; 2],
        longitudinal_compliance: 0.0,
        friction: f64::INFINITY,
        rolling_resistance: 0.0,
    };

    /// Whether no force makes them slip.
    #[must_use]
    pub fn are_rigid(&self) -> bool {
        self.lateral_compliance == [0.0; 2] && self.longitudinal_compliance == 0.0
    }
}

impl Linkage {
    /// Ideal Ackermann angles.
    pub const NEUTRAL: Self = Self { ackermann: 1.0, compliance: 0.0, toe: [0.0; 4] };
}

impl Actuators {
    /// Commands act at once and in full.
    pub const NEUTRAL: Self = Self {
        speed_delay: 0.0,
        speed_lag: 0.0,
        acceleration_limit: f64::INFINITY,
        droop: 0.0,
        steering_delay: 0.0,
        steering_lag: 0.0,
        steering_rate_limit: f64::INFINITY,
        steering_limit: f64::INFINITY,
    };
}

impl Physics {
    /// The kinematic limit: exact ideal Ackermann rolling.
    pub const NEUTRAL: Self = Self {
        tyres: Tyres::NEUTRAL,
        linkage: Linkage::NEUTRAL,
        differential_lock: 0.0,
        actuators: Actuators::NEUTRAL,
    };

    /// A 1:6 car in ordinary order on a hard floor.
    ///
    /// The tyres' stiffness over load lies where small solid and pneumatic tyres do, 8 to 20 per rad (Pacejka, *Tire and
    /// Vehicle Dynamics*, section 1.2); the front axle is the softer one, as in cars made to understeer. The other
    /// figures are chosen, and are of a size that a builder would call good.
    #[must_use]
    pub fn ordinary() -> Self {
        Self {
            tyres: Tyres {
                lateral_compliance: [0.12, 0.10],
                longitudinal_compliance: 0.05,
                friction: 0.8,
                rolling_resistance: 0.02,
            },
            linkage: Linkage { ackermann: 0.95, compliance: 1e-4, toe: [-1e-3, 1e-3, 0.0, 0.0] },
            differential_lock: 0.02,
            actuators: Actuators {
                speed_delay: 0.02,
                speed_lag: 0.1,
                acceleration_limit: 0.5,
                droop: 5e-4,
                steering_delay: 0.02,
                steering_lag: 0.05,
                steering_rate_limit: 1.0,
                steering_limit: 0.65,
            },
        }
    }

    /// These physics weakened (below 1) or strengthened in proportion: 0 is the neutral vehicle, 1 this one.
    #[must_use]
    pub fn at_strength(&self, strength: f64) -> Self {
        let (tyres, linkage, actuators) = (&self.tyres, &self.linkage, &self.actuators);
        Self {
            tyres: Tyres {
                lateral_compliance: tyres.lateral_compliance.map(|value| strength * value),
                longitudinal_compliance: strength * tyres.longitudinal_compliance,
                friction: tyres.friction / strength,
                rolling_resistance: strength * tyres.rolling_resistance,
            },
            linkage: Linkage {
                ackermann: 1.0 + strength * (linkage.ackermann - 1.0),
                compliance: strength * linkage.compliance,
                toe: linkage.toe.map(|value| strength * value),
            },
            differential_lock: (strength * self.differential_lock).min(1.0),
            actuators: Actuators {
                speed_delay: strength * actuators.speed_delay,
                speed_lag: strength * actuators.speed_lag,
                acceleration_limit: actuators.acceleration_limit / strength,
                droop: strength * actuators.droop,
                steering_delay: strength * actuators.steering_delay,
                steering_lag: strength * actuators.steering_lag,
                steering_rate_limit: actuators.steering_rate_limit / strength,
                steering_limit: actuators.steering_limit / strength,
            },
        }
    }

    /// Whether the wheels roll ideally, whatever the actuators do.
    #[must_use]
    pub fn rolls_ideally(&self) -> bool {
        self.tyres.are_rigid() && self.linkage == Linkage::NEUTRAL && self.differential_lock == 0.0
    }

    /// Whether all of it is neutral. Resistance to rolling alone moves nothing.
    #[must_use]
    pub fn is_neutral(&self) -> bool {
        self.rolls_ideally() && self.actuators == Actuators::NEUTRAL
    }
}

/// Secant stiffness of the brush model over its stiffness at rest, at `load_share` = the linear force over the largest
/// one: F/F_max = 3r - 3r^2 + r^3 with r = `load_share` / 3, and 1 beyond r = 1.
///
/// Source: Pacejka, *Tire and Vehicle Dynamics*, section 3.2, for pure and for combined slip.
pub(crate) fn brush(load_share: f64) -> f64 {
    let r = load_share / 3.0;
    if r < 1.0 { 1.0 - r + r * r / 3.0 } else { 1.0 / (3.0 * r) }
}

/// Angle of a front wheel at (`wheelbase`, `y`) that the rack's angle `steering` asks of it \[rad\], with `ackermann`
/// of the way from parallel to its own circle.
///
/// Source: geometry of one centre of rotation: tan d = L t / (L - y t) with t = tan(steering), in a form that is regular at
/// 90 degrees.
pub(crate) fn wheel_angle(steering: f64, wheelbase: f64, y: f64, ackermann: f64) -> f64 {
    let (sin, cos) = math::sin_cos(steering);
    let ideal = math::atan2(wheelbase * sin, wheelbase * cos - y * sin);
    steering + ackermann * (ideal - steering)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_brush_is_linear_at_first_and_slides_in_the_end() {
        assert_eq!(brush(0.0), 1.0);
        assert!((brush(1e-3) - (1.0 - 1e-3 / 3.0)).abs() < 1e-6);
        for share in [3.0, 5.0, 100.0_f64] {
            assert!((brush(share) * share - 1.0).abs() < 1e-12, "slides at its largest force");
        }
        let force = |share: f64| brush(share) * share;
        let rising = (0..300).map(|k| force(f64::from(k) * 0.01));
        assert!(rising.clone().zip(rising.skip(1)).all(|(a, b)| a < b + 1e-15));
    }

    #[test]
    fn strength_zero_is_neutral() {
        assert!(Physics::ordinary().at_strength(0.0).is_neutral());
        assert_eq!(Physics::ordinary().at_strength(1.0), Physics::ordinary());
        assert!(!Physics::ordinary().at_strength(0.01).rolls_ideally());
    }

    #[test]
    fn each_wheel_points_along_its_own_circle() {
        for steering in [-0.6, -0.1, 0.3, 0.6_f64] {
            for y in [-0.15, 0.0, 0.15] {
                let radius = 0.5 / math::tan(steering);
                let angle = wheel_angle(steering, 0.5, y, 1.0);
                assert!((math::tan(angle) - 0.5 / (radius - y)).abs() < 1e-12);
                assert_eq!(wheel_angle(steering, 0.5, y, 0.0), steering);
            }
        }
    }
}
