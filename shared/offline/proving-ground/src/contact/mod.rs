//! The balance of forces between body, wheels and ground.
//!
//! At every instant the body moves such that the tyres' forces balance inertia and the
//! resistance to rolling: of all motions the one with the least dissipation in the contacts less the power of those
//! forces. Per unit of commanded speed the unknowns are the body's forward and lateral speed and its yaw rate, the
//! angle by which the linkage bends, and what each differential lets its two wheels differ by. A contact that slips by
//! s of the distance rolled passes on load / compliance * s, weakened by the brush model. Dissipation is proportional
//! to the distance, not to time, so the balance is regular down to rest.
//!
//! Without compliance the balance is the weighted least-squares compromise between wheels that cannot all roll.

use kerbside_geometry::{WHEELS, Wheel as Corner, math};

use crate::balance::{Balance, UNKNOWNS};
use crate::chassis::{Chassis, GRAVITY, UnitMotion};
use crate::physics::{Physics, brush, wheel_angle};

use wheel::{Contact, Wheel, split};

mod wheel;

/// Stands for a compliance of zero where others are not: it slips by a millionth under its own load.
const RIGID: f64 = 1e-6;
/// A wheel that stands still while the car turns about it grips like one that rolls so much of the car's distance.
const PIVOT: f64 = 0.05;
/// Rounds of the iteration, and the change of the unknowns that ends it.
const ROUNDS: usize = 40;
const SETTLED: f64 = 1e-10;
/// So much of the friction at most is asked of the tyres by the car's acceleration along and across.
const HELD: f64 = 0.95;
/// A tyre that slides keeps so much of its stiffness, lest nothing tells how fast.
const SLIDING: f64 = 1e-3;
/// Largest change of an unknown in a round. Far from a balance the tyres slide, and their stiffness says little.
const BOLDEST: f64 = 0.5;
/// From here on a differential counts as rigid.
const LOCKED: f64 = 1.0 - 1e-9;

const FORWARD: usize = 0;
const LATERAL: usize = 1;
const YAW: usize = 2;
const BEND: usize = 3;
const FRONT_SPLIT: usize = 4;
const REAR_SPLIT: usize = 5;
const CENTRE_SPLIT: usize = 6;

/// What motor and rack do at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Drivetrain {
    /// Speed that the motor is set to \[m/s\].
    pub speed: f64,
    /// Its rate \[m/s^2\].
    pub acceleration: f64,
    /// Angle of the rack \[rad\].
    pub steering: f64,
    /// Its rate \[rad/s\].
    pub steering_rate: f64,
}

/// Motion of body and wheels at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Motion {
    /// Of the rear-axle centre along x \[m/s\].
    pub forward: f64,
    /// Of the rear-axle centre along y \[m/s\].
    pub lateral: f64,
    /// \[rad/s\].
    pub yaw_rate: f64,
    /// Of the wheels \[rad/s\].
    pub rotation_rate: [f64; 4],
}

/// Body on four wheels.
#[derive(Clone, Debug)]
pub(crate) struct Contacts {
    chassis: Chassis,
    physics: Physics,
    ideal: bool,
    /// Whether the tyres yield to forces.
    yields: bool,
    /// Whether the linkage's bend is an unknown. Between rigid tyres it is given: the wheels' quarrel with one another
    /// knows no bounds there, and inertia alone bends.
    bends: bool,
    /// The largest compliance, by which the balance is scaled.
    scale: f64,
    wheels: [Contact; 4],
    /// Mean rotation rate of the driven wheels per unit of commanded speed \[rad/m\]; none: what ideal rolling needs.
    motor: Option<f64>,
    /// The last solution and its direction of travel: where the next one begins.
    last: Option<(f64, [f64; UNKNOWNS])>,
}

impl Contacts {
    /// The contacts of a vehicle.
    pub(crate) fn new(chassis: &Chassis, physics: &Physics) -> Self {
        let tyres = &physics.tyres;
        let lateral = tyres.lateral_compliance.map(|value| value.max(RIGID));
        let longitudinal = tyres.longitudinal_compliance.max(RIGID);
        let contact = |wheel: Corner| {
            let (x, y) = chassis.wheel_position(wheel);
            Contact {
                x,
                y,
                radius: chassis.radius[wheel.index()],
                load: chassis.load(wheel),
                driven: chassis.is_driven(wheel),
                lateral_compliance: lateral[usize::from(!wheel.is_front())],
                longitudinal_compliance: longitudinal,
                split: split(chassis.drive, wheel),
            }
        };
        Self {
            chassis: *chassis,
            physics: *physics,
            ideal: physics.rolls_ideally(),
            yields: !tyres.are_rigid(),
            bends: !tyres.are_rigid() && physics.linkage.compliance > 0.0,
            scale: lateral[0].max(lateral[1]).max(longitudinal),
            wheels: WHEELS.map(contact),
            motor: None,
            last: None,
        }
    }

    /// Lets the wheels roll on these radii \[m\] from now on, and the motor turn the driven ones by `motor` \[rad\] in the
    /// mean per metre of commanded speed, whatever the body makes of it.
    pub(crate) fn set_rolling(&mut self, radius: [f64; 4], motor: f64) {
        self.wheels.iter_mut().zip(radius).for_each(|(wheel, radius)| wheel.radius = radius);
        self.motor = Some(motor);
    }

    /// The motion that motor and rack bring about.
    pub(crate) fn motion(&mut self, drivetrain: &Drivetrain) -> Motion {
        if drivetrain.speed == 0.0 {
            return Motion::default();
        }
        let unit = self.chassis.unit_motion(drivetrain.steering);
        if self.ideal {
            let load = -self.inertia(drivetrain, unit, unit.forward, unit.yaw)[FORWARD];
            let speed = self.drooped(drivetrain, load);
            let needed = self.motor_rate(1.0, unit);
            return self.rolling(self.motor.map_or(speed, |motor| speed * motor / needed), unit);
        }
        self.balanced(drivetrain, unit)
    }

    /// Ideal rolling.
    fn rolling(&self, speed: f64, unit: UnitMotion) -> Motion {
        let travel = self.chassis.travel_of(unit);
        Motion {
            forward: speed * unit.forward,
            lateral: 0.0,
            yaw_rate: speed * unit.yaw,
            rotation_rate: core::array::from_fn(|i| speed * travel[i] / self.wheels[i].radius),
        }
    }

    /// What inertia puts on the body: force along x and along y \[N\], moment about the rear-axle centre \[N m\]. The
    /// body moves by `forward` and `yaw` per unit of speed; what changes that is taken from ideal rolling.
    fn inertia(
        &self,
        drivetrain: &Drivetrain,
        unit: UnitMotion,
        forward: f64,
        yaw: f64,
    ) -> [f64; 3] {
        let (speed, chassis) = (drivetrain.speed, &self.chassis);
        let yaw_rate = speed * yaw;
        let turning = chassis.unit_yaw_slope(drivetrain.steering) * drivetrain.steering_rate;
        let yaw_acceleration = drivetrain.acceleration * unit.yaw + speed * turning;
        let arm = chassis.centre_of_mass;
        // More than the ground holds would never come to a balance.
        let held = HELD * self.physics.tyres.friction * GRAVITY;
        let along = drivetrain.acceleration * unit.forward - arm * yaw_rate * yaw_rate;
        let along = along.clamp(-held, held);
        let across = (speed * forward * yaw_rate + arm * yaw_acceleration).clamp(-held, held);
        let moment = chassis.yaw_inertia * yaw_acceleration + arm * chassis.mass * across;
        [-chassis.mass * along, -chassis.mass * across, -moment]
    }

    /// Speed of the motor under `load`, the force it has to bring up beside the wheels' resistance to rolling \[N\].
    fn drooped(&self, drivetrain: &Drivetrain, load: f64) -> f64 {
        let (speed, droop) = (drivetrain.speed, self.physics.actuators.droop);
        let resistance = self.physics.tyres.rolling_resistance * self.weight() * speed.signum();
        let left = speed - droop * (load + resistance);
        // A motor that stalls stands still; it is not driven backwards.
        if left * speed > 0.0 { left } else { 0.0 }
    }

    fn weight(&self) -> f64 {
        self.wheels.iter().map(|wheel| wheel.load).sum()
    }

    fn balanced(&mut self, drivetrain: &Drivetrain, unit: UnitMotion) -> Motion {
        let direction = drivetrain.speed.signum();
        let force = |z: &[f64; UNKNOWNS]| {
            self.inertia(drivetrain, unit, direction * z[FORWARD], direction * z[YAW])
        };
        let motor = self.motor.map_or_else(|| self.motor_rate(direction, unit), |m| direction * m);
        let begin = [direction * unit.forward, 0.0, direction * unit.yaw, 0.0, 0.0, 0.0, 0.0];
        let mut z = self.last.filter(|last| last.0 == direction).map_or(begin, |last| last.1);
        let headings =
            self.headings(drivetrain.steering, self.given_bend(direction, force(&begin)));
        let mut wheels = self.wheels_at(&headings, motor, &z);
        for _ in 0..ROUNDS {
            let next = self.equations(direction, force(&z), motor, &z, &wheels).solve();
            let change = (0..UNKNOWNS).map(|i| (next[i] - z[i]).abs()).fold(0.0, f64::max);
            let damping = (BOLDEST / change).min(1.0);
            z = core::array::from_fn(|i| z[i] + damping * (next[i] - z[i]));
            wheels = self.wheels_at(&headings, motor, &z);
            if change < SETTLED {
                break;
            }
        }
        let speed = self.drooped(drivetrain, self.load(force(&z), direction, &wheels));
        self.last = Some((direction, z));
        self.scaled(speed.abs(), &z, &wheels)
    }

    /// Mean rotation rate of the driven wheels: what ideal rolling at the commanded speed needs \[rad/m\].
    fn motor_rate(&self, direction: f64, unit: UnitMotion) -> f64 {
        let travel = self.chassis.travel_of(unit);
        let driven = self.wheels.iter().zip(travel).filter(|(wheel, _)| wheel.driven);
        let (sum, count) =
            driven.fold((0.0, 0.0), |(sum, n), (wheel, way)| (sum + way / wheel.radius, n + 1.0));
        direction * sum / count
    }

    /// Bend of the linkage between rigid tyres: that of the side force that balances inertia's moment \[rad\].
    fn given_bend(&self, direction: f64, force: [f64; 3]) -> f64 {
        if self.yields {
            return 0.0;
        }
        let side_force = -force[YAW] / self.chassis.wheelbase;
        -direction * self.physics.linkage.compliance * side_force
    }

    /// Angle of each wheel with a given bend of the linkage, and the angle's sine and cosine \[rad\].
    fn headings(&self, steering: f64, bend: f64) -> [(f64, f64, f64); 4] {
        let (linkage, wheelbase) = (&self.physics.linkage, self.chassis.wheelbase);
        core::array::from_fn(|i| {
            let contact = &self.wheels[i];
            let rack = if contact.is_steered() {
                wheel_angle(steering, wheelbase, contact.y, linkage.ackermann) + bend
            } else {
                0.0
            };
            let angle = linkage.toe[i] + rack;
            let (sin, cos) = math::sin_cos(angle);
            (angle, sin, cos)
        })
    }

    fn wheels_at(
        &self,
        headings: &[(f64, f64, f64); 4],
        motor: f64,
        z: &[f64; UNKNOWNS],
    ) -> [Wheel; 4] {
        let tyres = &self.physics.tyres;
        core::array::from_fn(|i| {
            let contact = &self.wheels[i];
            let (angle, sin, cos) = headings[i];
            let bent = contact.is_steered() && z[BEND] != 0.0;
            let (sin, cos) = if bent { math::sin_cos(angle + z[BEND]) } else { (sin, cos) };
            let (vx, vy) = (z[FORWARD] - z[YAW] * contact.y, z[LATERAL] + z[YAW] * contact.x);
            let (along, across) = (cos * vx + sin * vy, cos * vy - sin * vx);
            let spin = if contact.driven { contact.surface(motor, z) - along } else { 0.0 };
            let rolled = along.abs().max(PIVOT);
            let (side, drive) = (contact.lateral_compliance, contact.longitudinal_compliance);
            let share = if tyres.friction.is_finite() {
                let (lateral, longitudinal) = (across / side, spin / drive);
                (lateral * lateral + longitudinal * longitudinal).sqrt() / (rolled * tyres.friction)
            } else {
                0.0
            };
            let stiffness = self.scale * contact.load * brush(share).max(SLIDING) / rolled;
            Wheel {
                sin,
                cos,
                along,
                spin,
                lateral_weight: stiffness / side,
                longitudinal_weight: stiffness / drive,
            }
        })
    }

    fn equations(
        &self,
        direction: f64,
        force: [f64; 3],
        motor: f64,
        z: &[f64; UNKNOWNS],
        wheels: &[Wheel; 4],
    ) -> Balance {
        let mut balance = Balance::new();
        for (contact, wheel) in self.wheels.iter().zip(wheels) {
            let (row, target) = contact.lateral_row(wheel, z[BEND], self.bends);
            balance.add(wheel.lateral_weight, &row, target);
            if contact.driven {
                let (row, target) = contact.longitudinal_row(wheel, motor);
                balance.add(wheel.longitudinal_weight, &row, target);
            }
        }
        self.add_couplings(&mut balance);
        if self.yields {
            for (unknown, push) in self.pushes(direction, force, wheels).into_iter().enumerate() {
                balance.push(unknown, self.scale * push);
            }
        }
        balance
    }

    /// The linkage's spring, and the locks of the differentials.
    fn add_couplings(&self, balance: &mut Balance) {
        let single =
            |unknown: usize| core::array::from_fn(|i| if i == unknown { 1.0 } else { 0.0 });
        if self.bends {
            balance.add(self.scale / self.physics.linkage.compliance, &single(BEND), 0.0);
        } else {
            balance.fix(BEND);
        }
        let lock = self.physics.differential_lock;
        for unknown in [FRONT_SPLIT, REAR_SPLIT, CENTRE_SPLIT] {
            let mut coupled = self.wheels.iter().filter(|wheel| wheel.split[unknown] != 0.0);
            let Some(wheel) = coupled.next() else {
                balance.fix(unknown);
                continue;
            };
            let stiffness =
                2.0 * wheel.load * wheel.radius * wheel.radius / wheel.longitudinal_compliance;
            if unknown == CENTRE_SPLIT || lock == 0.0 {
                continue;
            }
            let weight = if lock < LOCKED { lock / (1.0 - lock) } else { 1.0 / RIGID };
            balance.add(self.scale * stiffness * weight, &single(unknown), 0.0);
        }
    }

    /// Forces and moment that the tyres have to balance: inertia, and the resistance of the wheels that only roll.
    fn pushes(&self, direction: f64, force: [f64; 3], wheels: &[Wheel; 4]) -> [f64; 3] {
        let mut total = force;
        for (contact, wheel) in self.wheels.iter().zip(wheels).filter(|pair| !pair.0.driven) {
            let drag = -direction * self.physics.tyres.rolling_resistance * contact.load;
            let (fx, fy) = (drag * wheel.cos, drag * wheel.sin);
            total[FORWARD] += fx;
            total[LATERAL] += fy;
            total[YAW] += contact.x * fy - contact.y * fx;
        }
        total
    }

    /// Force that the motor brings up beside the resistance to rolling \[N\].
    fn load(&self, force: [f64; 3], direction: f64, wheels: &[Wheel; 4]) -> f64 {
        if !self.yields {
            return -force[FORWARD];
        }
        let driven = self.wheels.iter().zip(wheels).filter(|(contact, _)| contact.driven);
        let pull: f64 =
            driven.map(|(_, wheel)| wheel.longitudinal_weight * wheel.spin / self.scale).sum();
        let rolling = self.wheels.iter().filter(|contact| !contact.driven);
        let drag: f64 = rolling.map(|contact| contact.load).sum();
        pull - direction * self.physics.tyres.rolling_resistance * drag
    }

    fn scaled(&self, speed: f64, z: &[f64; UNKNOWNS], wheels: &[Wheel; 4]) -> Motion {
        let tyres = &self.physics.tyres;
        let lag = 1.0 - tyres.longitudinal_compliance * tyres.rolling_resistance;
        let rotation_rate = core::array::from_fn(|i| {
            let (contact, wheel) = (&self.wheels[i], &wheels[i]);
            let surface = if contact.driven { wheel.along + wheel.spin } else { wheel.along * lag };
            speed * surface / contact.radius
        });
        Motion {
            forward: speed * z[FORWARD],
            lateral: speed * z[LATERAL],
            yaw_rate: speed * z[YAW],
            rotation_rate,
        }
    }
}

#[cfg(test)]
mod tests;
