//! From the travel of some wheels to the motion of the rear-axle centre.

use kerbside_geometry::{Vehicle, Wheel, math};
use nalgebra::Matrix2;

use super::increment::Increment;
use crate::sensors::LEAST_LEVERAGE;

/// Variance of a wheel's travel: k^2 per metre rolled, in either direction.
fn rolled_variance(noise: f64, travel: f64) -> f64 {
    noise * noise * travel.abs()
}

/// Two wheels of the rear axle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RearPair {
    pub(crate) track: f64,
    /// Random part of a wheel's travel \[m/sqrt(m)\].
    pub(crate) noise: f64,
}

impl RearPair {
    /// The motion of travels `left` and `right` \[m\] (Lee, Chung, Chang, eq. (2)).
    ///
    /// Its covariance is M Q M' with M the derivative of (distance, turn) by (right, left) and Q of
    /// eq. (14).
    pub(crate) fn increment(&self, left: f64, right: f64) -> Increment {
        let variances = (rolled_variance(self.noise, left), rolled_variance(self.noise, right));
        pair_increment(self.track, left, right, variances)
    }
}

/// Motion from the longitudinal travels of an axle's ends and their variances.
fn pair_increment(track: f64, left: f64, right: f64, variances: (f64, f64)) -> Increment {
    let (of_left, of_right) = variances;
    let sum = of_left + of_right;
    let cross = 0.5 * (of_right - of_left) / track;
    Increment {
        distance: 0.5 * (left + right),
        turn: (right - left) / track,
        covariance: Matrix2::new(0.25 * sum, cross, cross, sum / (track * track)),
    }
}

/// Direction in which a front wheel rolls, for a steering angle.
///
/// The wheels turn about the instantaneous centre (0, L / tan(phi)). Written with sine and cosine
/// it stays regular to a quarter turn and beyond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Direction {
    /// Cosine and sine of the wheel's own angle.
    pub(crate) cos: f64,
    pub(crate) sin: f64,
    /// Derivative of the wheel's angle by the steering angle.
    slope: f64,
}

impl Direction {
    /// Of the front wheel at lateral place `y` \[m\], at the steering angle with this sine and
    /// cosine.
    pub(crate) fn new(wheelbase: f64, y: f64, sin: f64, cos: f64) -> Self {
        let (along, across) = (wheelbase * cos - y * sin, wheelbase * sin);
        let square = along * along + across * across;
        let length = square.sqrt();
        Self { cos: along / length, sin: across / length, slope: wheelbase * wheelbase / square }
    }
}

/// Two wheels of the front axle with the steering angle: the per-wheel form, exact without slip.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrontPair {
    wheelbase: f64,
    track: f64,
    noise: f64,
    steering_noise: f64,
    angle: f64,
    left: Direction,
    right: Direction,
}

impl FrontPair {
    pub(crate) fn new(vehicle: &Vehicle, noise: f64, steering_noise: f64) -> Self {
        let (wheelbase, track) = (vehicle.wheelbase, vehicle.track_front);
        let straight = Direction::new(wheelbase, 0.0, 0.0, 1.0);
        let mut pair = Self {
            wheelbase,
            track,
            noise,
            steering_noise,
            angle: f64::NAN,
            left: straight,
            right: straight,
        };
        pair.steer(0.0);
        pair
    }

    /// Sets the steering angle \[rad\].
    pub(crate) fn steer(&mut self, angle: f64) {
        if angle == self.angle {
            return;
        }
        let (sin, cos) = math::sin_cos(angle);
        self.angle = angle;
        self.left = Direction::new(self.wheelbase, 0.5 * self.track, sin, cos);
        self.right = Direction::new(self.wheelbase, -0.5 * self.track, sin, cos);
    }

    /// The motion of travels `left` and `right` \[m\]: each wheel's longitudinal part is its travel
    /// times the cosine of its own angle; these differ by track times turn.
    pub(crate) fn increment(&self, left: f64, right: f64) -> Increment {
        let (cos_left, cos_right) = (self.left.cos, self.right.cos);
        let variances = (
            cos_left * cos_left * rolled_variance(self.noise, left),
            cos_right * cos_right * rolled_variance(self.noise, right),
        );
        let mut increment =
            pair_increment(self.track, left * cos_left, right * cos_right, variances);
        increment.covariance += self.steering_covariance(left, right);
        increment
    }

    /// The steering sensor's share.
    fn steering_covariance(&self, left: f64, right: f64) -> Matrix2<f64> {
        let by_angle_left = -left * self.left.sin * self.left.slope;
        let by_angle_right = -right * self.right.sin * self.right.slope;
        let distance = 0.5 * (by_angle_left + by_angle_right) * self.steering_noise;
        let turn = (by_angle_right - by_angle_left) / self.track * self.steering_noise;
        Matrix2::new(distance * distance, distance * turn, distance * turn, turn * turn)
    }
}

/// One wheel and the steering angle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SteeredWheel {
    wheelbase: f64,
    y: f64,
    front: bool,
    noise: f64,
    steering_noise: f64,
}

impl SteeredWheel {
    pub(crate) fn new(vehicle: &Vehicle, wheel: Wheel, noise: f64, steering_noise: f64) -> Self {
        Self {
            wheelbase: vehicle.wheelbase,
            y: vehicle.wheel_position(wheel).1,
            front: wheel.is_front(),
            noise,
            steering_noise,
        }
    }

    /// The motion of `travel` \[m\] at the steering angle `angle` \[rad\].
    pub(crate) fn increment(&self, travel: f64, angle: f64) -> Increment {
        let (gain, slope) = self.gain(angle);
        let rolled = rolled_variance(self.noise, travel);
        let steered = travel * travel * self.steering_noise * self.steering_noise;
        let entry = |a: usize, b: usize| rolled * gain[a] * gain[b] + steered * slope[a] * slope[b];
        Increment {
            distance: travel * gain[0],
            turn: travel * gain[1],
            covariance: Matrix2::new(entry(0, 0), entry(0, 1), entry(0, 1), entry(1, 1)),
        }
    }

    /// (distance, turn) per metre of the wheel, and its derivative by the steering angle.
    fn gain(&self, angle: f64) -> ([f64; 2], [f64; 2]) {
        let (sin, cos) = math::sin_cos(angle);
        if self.front { self.front_gain(sin, cos) } else { self.rear_gain(sin, cos) }
    }

    /// A front wheel at (L, y) rolls along its own angle d: turn L = travel sin(d), distance =
    /// travel cos(d) + y turn.
    fn front_gain(&self, sin: f64, cos: f64) -> ([f64; 2], [f64; 2]) {
        let wheel = Direction::new(self.wheelbase, self.y, sin, cos);
        let turn = wheel.sin / self.wheelbase;
        let turn_slope = wheel.cos * wheel.slope / self.wheelbase;
        (
            [wheel.cos + self.y * turn, turn],
            [-wheel.sin * wheel.slope + self.y * turn_slope, turn_slope],
        )
    }

    /// A rear wheel at (0, y) rolls distance - y turn, and turn = distance tan(phi) / L. Near the
    /// angle at which the vehicle turns about the wheel the gain is held: such angles are beyond
    /// the limit, a sensor's error at most.
    fn rear_gain(&self, sin: f64, cos: f64) -> ([f64; 2], [f64; 2]) {
        let lever = self.wheelbase * cos - self.y * sin;
        let held = lever.max(LEAST_LEVERAGE * self.wheelbase);
        let gain = [self.wheelbase * cos / held, sin / held];
        let square = held * held;
        (gain, [self.wheelbase * self.y / square, self.wheelbase / square])
    }
}

/// One rear wheel and the turn that the gyro says.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GyroWheel {
    /// Lateral place of the wheel \[m\].
    pub(crate) y: f64,
    /// Random part of the wheel's travel \[m/sqrt(m)\].
    pub(crate) noise: f64,
}

impl GyroWheel {
    /// The motion of `travel` \[m\] while the heading turned by `turn` \[rad\] with that variance.
    pub(crate) fn increment(&self, travel: f64, turn: f64, turn_variance: f64) -> Increment {
        let cross = self.y * turn_variance;
        let along = rolled_variance(self.noise, travel) + self.y * cross;
        Increment {
            distance: travel + self.y * turn,
            turn,
            covariance: Matrix2::new(along, cross, cross, turn_variance),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wheels::tests::car;
    use kerbside_geometry::WHEELS;
    use proptest::prelude::*;

    /// What the wheels roll when the rear-axle centre rolls `distance` at steering angle `angle`.
    fn rolled(vehicle: &Vehicle, distance: f64, angle: f64) -> [f64; 4] {
        let curvature = angle.tan() / vehicle.wheelbase;
        WHEELS.map(|wheel| {
            let (x, y) = vehicle.wheel_position(wheel);
            distance * (1.0 - y * curvature).hypot(x * curvature)
        })
    }

    fn close(found: f64, expected: f64, scale: f64) -> bool {
        (found - expected).abs() <= 1e-9 * scale
    }

    #[test]
    fn every_form_is_exact_to_35_degrees_both_ways() {
        let vehicle = car();
        for degrees in -350..=350 {
            let angle = (f64::from(degrees) * 0.1).to_radians();
            for distance in [0.01, -0.01] {
                let [fl, fr, rl, rr] = rolled(&vehicle, distance, angle);
                let turn = distance * angle.tan() / vehicle.wheelbase;
                let mut front = FrontPair::new(&vehicle, 0.001, 0.0035);
                front.steer(angle);
                let single = |wheel, travel| {
                    SteeredWheel::new(&vehicle, wheel, 0.001, 0.0035).increment(travel, angle)
                };
                for found in [
                    RearPair { track: vehicle.track_rear, noise: 0.001 }.increment(rl, rr),
                    front.increment(fl, fr),
                    single(Wheel::FrontLeft, fl),
                    single(Wheel::FrontRight, fr),
                    single(Wheel::RearLeft, rl),
                    single(Wheel::RearRight, rr),
                    GyroWheel { y: 0.5 * vehicle.track_rear, noise: 0.001 }
                        .increment(rl, turn, 0.0),
                ] {
                    assert!(close(found.distance, distance, 0.01), "{degrees}: {found:?}");
                    assert!(close(found.turn, turn, 0.01), "{degrees}: {found:?}");
                }
            }
        }
    }

    #[test]
    fn the_centre_form_is_off_by_the_known_term() {
        let vehicle = car();
        let ratio = vehicle.track_front / vehicle.wheelbase;
        for degrees in [10.0_f64, 20.0, 30.0, 35.0] {
            let angle = degrees.to_radians();
            let [fl, fr, ..] = rolled(&vehicle, 1.0, angle);
            let centre = 0.5 * (fl + fr) * angle.cos();
            let known = ratio * ratio / 8.0 * angle.sin().powi(4);
            assert!((centre - 1.0 - known).abs() < 0.05 * known, "{degrees}");
        }
    }

    #[test]
    fn a_steered_wheel_on_the_centre_line_turns_the_vehicle_on_the_spot() {
        let mut vehicle = car();
        vehicle.track_front = 0.0;
        let wheel = SteeredWheel::new(&vehicle, Wheel::FrontLeft, 0.001, 0.0035);
        let found = wheel.increment(0.1, core::f64::consts::FRAC_PI_2);
        assert!(found.distance.abs() < 1e-16);
        assert!((found.turn - 0.1 / vehicle.wheelbase).abs() < 1e-15);
        let oblique = wheel.increment(0.1, 1.0);
        assert!((oblique.distance - 0.1 * 1.0_f64.cos()).abs() < 1e-15);
        assert!((oblique.turn - 0.1 * 1.0_f64.sin() / vehicle.wheelbase).abs() < 1e-15);
    }

    #[test]
    fn signs_are_those_of_the_frame() {
        let pair = RearPair { track: 0.292, noise: 0.001 };
        assert!(pair.increment(0.1, 0.11).turn > 0.0, "the right wheel rolls farther: left turn");
        assert!(pair.increment(-0.1, -0.11).turn < 0.0, "the same in reverse");
        assert!((pair.increment(-0.146, 0.146).turn - 1.0).abs() < 1e-15, "the track is b");
    }

    /// Covariance that finite differences of `motion` by its inputs give, for these input
    /// variances.
    fn numeric(
        motion: impl Fn([f64; 3]) -> Increment,
        at: [f64; 3],
        variances: [f64; 3],
    ) -> Matrix2<f64> {
        let step = 1e-6;
        let mut sum = Matrix2::zeros();
        for (index, variance) in variances.iter().enumerate() {
            let (mut up, mut down) = (at, at);
            up[index] += step;
            down[index] -= step;
            let (up, down) = (motion(up), motion(down));
            let slope = nalgebra::Vector2::new(up.distance - down.distance, up.turn - down.turn)
                / (2.0 * step);
            sum += slope * slope.transpose() * *variance;
        }
        sum
    }

    proptest! {
        #[test]
        fn covariances_are_those_of_finite_differences(
            left in -0.2..0.2_f64, right in -0.2..0.2_f64, angle in -0.6..0.6_f64
        ) {
            let vehicle = car();
            let (noise, steering_noise) = (0.001, 0.0035);
            let rolled = |travel: f64| noise * noise * f64::abs(travel);
            let steered = steering_noise * steering_noise;
            let front_of = |[left, right, angle]: [f64; 3]| {
                let mut front = FrontPair::new(&vehicle, noise, steering_noise);
                front.steer(angle);
                front.increment(left, right)
            };
            let single_of = |wheel| {
                let single = SteeredWheel::new(&vehicle, wheel, noise, steering_noise);
                move |[travel, _, angle]: [f64; 3]| single.increment(travel, angle)
            };
            let front_left = single_of(Wheel::FrontLeft);
            let rear_right = single_of(Wheel::RearRight);
            let at = [left, right, angle];
            let pair = [rolled(left), rolled(right), steered];
            let alone = [rolled(left), 0.0, steered];
            for (found, expected) in [
                (front_of(at).covariance, numeric(front_of, at, pair)),
                (front_left(at).covariance, numeric(front_left, at, alone)),
                (rear_right(at).covariance, numeric(rear_right, at, alone)),
            ] {
                let bound = 1e-6 * expected.norm() + 1e-16;
                prop_assert!((found - expected).norm() < bound, "{found} {expected}");
            }
        }
    }
}
