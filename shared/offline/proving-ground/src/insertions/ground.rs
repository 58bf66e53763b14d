//! Linkage, wheels, tyres and floor.

use core::f64::consts::TAU;

use kerbside_geometry::{Limits, WHEELS, math};

use super::Effect;
use crate::chassis::Chassis;
use crate::contact::Motion;

/// Share of the shimmy's speed within which it has fallen to 1/e.
const SHIMMY_BAND: f64 = 0.3;
/// Rounds in which force and angle settle: each leaves less than a half.
const ROUNDS: usize = 16;

/// What is put in there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ground {
    offset: f64,
    compliance: f64,
    wheelbase: f64,
    track: [f64; 2],
    radius: f64,
    difference: [f64; 2],
    drive_slip: f64,
    acceleration_slip: f64,
    understeer: f64,
    lateral_slip: f64,
    lateral_drift: f64,
    slope: [f64; 2],
    /// x, y, radius, ratio.
    patch: [f64; 4],
    /// Amplitude, speed, frequency.
    shimmy: [f64; 3],
    offset_by_direction: f64,
    brake_pull: f64,
    /// Direction, ratio.
    nap: [f64; 2],
    out_of_round: [f64; 4],
    growth: f64,
    /// Rate, length.
    wave: [f64; 2],
    acceleration_limit: f64,
}

/// Where the car is and what motor and rack do, at one instant.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Present {
    /// \[s\].
    pub(crate) time: f64,
    /// Of the rear-axle centre \[m\].
    pub(crate) place: (f64, f64),
    /// Heading \[rad\].
    pub(crate) yaw: f64,
    /// Of the motor \[m/s\].
    pub(crate) speed: f64,
    /// Its rate \[m/s^2\].
    pub(crate) acceleration: f64,
    /// Of the wheels \[rad\].
    pub(crate) rotation: [f64; 4],
}

impl Ground {
    pub(crate) fn neutral(limits: &Limits, wheelbase: f64) -> Self {
        Self {
            offset: 0.0,
            compliance: 0.0,
            wheelbase: 1.0,
            track: [1.0; 2],
            radius: 1.0,
            difference: [0.0; 2],
            drive_slip: 0.0,
            acceleration_slip: 0.0,
            understeer: 0.0,
            lateral_slip: 0.0,
            lateral_drift: 0.0,
            slope: [0.0; 2],
            patch: [0.0; 4],
            shimmy: [0.0, 1.0, 0.0],
            offset_by_direction: 0.0,
            brake_pull: 0.0,
            nap: [0.0; 2],
            out_of_round: [0.0; 4],
            growth: 0.0,
            wave: [0.0, wheelbase],
            acceleration_limit: limits.acceleration,
        }
    }

    pub(crate) fn take(&mut self, effect: &Effect) {
        let wheel = effect.wheel.map_or(0, kerbside_geometry::Wheel::index);
        let get = |name: &str| effect.get(name);
        match effect.id {
            "steering_offset" => self.offset = get("offset"),
            "steering_compliance" => self.compliance = get("rate"),
            "wheelbase_scale" => self.wheelbase = get("scale"),
            "track_scale" => self.track = ["front", "rear"].map(get),
            "radius_scale" => self.radius = get("scale"),
            "radius_difference" => self.difference = ["front", "rear"].map(get),
            "drive_slip" => self.drive_slip = get("ratio"),
            "acceleration_slip" => self.acceleration_slip = get("rate"),
            "understeer" => self.understeer = get("gradient"),
            "lateral_slip" => self.lateral_slip = get("rate"),
            "lateral_drift" => self.lateral_drift = get("rate"),
            "floor_slope" => self.slope = ["direction", "rate"].map(get),
            "floor_patch" => self.patch = ["x", "y", "radius", "ratio"].map(get),
            "shimmy" => self.shimmy = ["amplitude", "speed", "frequency"].map(get),
            "offset_by_direction" => self.offset_by_direction = get("offset"),
            "brake_pull" => self.brake_pull = get("angle"),
            "carpet_nap" => self.nap = ["direction", "ratio"].map(get),
            "out_of_round" => self.out_of_round[wheel] = get("share"),
            "radius_growth" => self.growth = get("rate"),
            "floor_wave" => self.wave = ["rate", "length"].map(get),
            _ => {}
        }
    }

    /// The true measures with what is put in.
    pub(crate) fn chassis(&self, chassis: &Chassis) -> Chassis {
        let [front, rear] = self.difference.map(|difference| 0.5 * difference);
        let sides = [1.0 + front, 1.0 - front, 1.0 + rear, 1.0 - rear];
        Chassis {
            wheelbase: self.wheelbase * chassis.wheelbase,
            track_front: self.track[0] * chassis.track_front,
            track_rear: self.track[1] * chassis.track_rear,
            radius: core::array::from_fn(|i| self.radius * chassis.radius[i] * sides[i]),
            centre_of_mass: self.wheelbase * chassis.centre_of_mass,
            ..*chassis
        }
    }

    /// Angle of the front wheels that stand at `angle` \[rad\] under no force, on a car whose driven wheels' surfaces run at
    /// `speed` \[m/s\].
    ///
    /// The linkage is a spring: it yields in proportion to the side acceleration that there is in the end, which the
    /// yielding itself makes smaller. Understeer lets the axle follow a wider circle, by the square of the speed. Both see
    /// the force of inertia alone: tyres soft enough to understeer at parking speed, at some hundredths of g, would yield to
    /// the drag of their own rolling no less.
    pub(crate) fn under_force(&self, chassis: &Chassis, angle: f64, speed: f64) -> f64 {
        if self.compliance == 0.0 && self.understeer == 0.0 {
            return angle;
        }
        let mut bent = angle;
        for _ in 0..ROUNDS {
            let curvature = math::tan(bent) / chassis.wheelbase;
            let travel = chassis.travel_per_metre(curvature);
            let driven = WHEELS.into_iter().filter(|wheel| chassis.is_driven(*wheel));
            let (sum, count) = driven
                .fold((0.0, 0.0), |(sum, count), wheel| (sum + travel[wheel.index()], count + 1.0));
            let rolled = speed * count / sum;
            let yields = 1.0 + self.understeer * rolled * rolled;
            bent = math::atan(math::tan(angle) / yields)
                - self.compliance * rolled * rolled * curvature;
        }
        bent
    }

    /// How far the front wheels stand askew of the rack, the linkage's bend left out \[rad\].
    pub(crate) fn askew(&self, now: &Present) -> f64 {
        let mut angle = self.offset;
        if now.speed != 0.0 {
            angle += self.offset_by_direction * now.speed.signum();
        }
        let [amplitude, speed, frequency] = self.shimmy;
        if amplitude != 0.0 {
            let off = (now.speed.abs() - speed) / (SHIMMY_BAND * speed);
            angle += amplitude * math::exp(-off * off) * math::sin(TAU * frequency * now.time);
        }
        if now.acceleration * now.speed < 0.0 {
            angle += self.brake_pull * (now.acceleration / self.acceleration_limit).abs();
        }
        angle
    }

    /// What the driven wheels turn beyond rolling: 1 - the share of their rotation that moves the car.
    pub(crate) fn slip(&self, now: &Present) -> f64 {
        let mut grip = 1.0 - self.drive_slip;
        let gaining = now.acceleration * now.speed > 0.0;
        let creep = self.acceleration_slip * now.acceleration.abs();
        grip *= if gaining { 1.0 - creep } else { 1.0 + creep };
        let [x, y, radius, ratio] = self.patch;
        if math::hypot(now.place.0 - x, now.place.1 - y) < radius {
            grip *= 1.0 - ratio;
        }
        let [direction, ratio] = self.nap;
        if ratio != 0.0 {
            let course = if now.speed < 0.0 { -1.0 } else { 1.0 };
            grip *= 1.0 - ratio * course * math::cos(now.yaw - direction);
        }
        1.0 - grip
    }

    /// Radii on which the wheels roll now \[m\], of those that they have.
    pub(crate) fn radius(&self, radius: [f64; 4], now: &Present) -> [f64; 4] {
        core::array::from_fn(|i| {
            let wobble = match self.out_of_round[i] {
                0.0 => 0.0,
                share => share * math::cos(now.rotation[i]),
            };
            radius[i] * (1.0 + self.growth * now.time) * (1.0 + wobble)
        })
    }

    /// Velocity beside what the wheels roll: sideways in the body frame, and along x and y of the ground \[m/s\].
    pub(crate) fn sideways(&self, motion: &Motion, now: &Present) -> (f64, f64, f64) {
        let speed = motion.forward.abs();
        let mut side = -self.lateral_slip * motion.forward * motion.yaw_rate;
        side += self.lateral_drift * speed;
        let [rate, length] = self.wave;
        if rate != 0.0 {
            side += rate * speed * math::sin(TAU * now.place.0 / length);
        }
        let [direction, rate] = self.slope;
        let (sin, cos) = math::sin_cos(direction);
        (side, rate * speed * cos, rate * speed * sin)
    }
}
