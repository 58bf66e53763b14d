//! The second vehicle as a case drives it: actuators, contacts and body under [`crate::insertions`] and disturbances.
//!
//! The motor's speed is that of the driven wheels' mean rotation on the believed radii, whatever the wheels truly are; so
//! a radius that is off shows in the motion and not in the counts. Motion is the balance of forces of
//! [`crate::Physics`], integrated by the classical Runge-Kutta method in steps that end where a command begins to act.

mod trajectory;

use kerbside_geometry::{Vehicle, WHEELS, math};

use crate::cases::{Disturbance, Drives, Signals, Specification, Task};
use crate::chassis::Chassis;
use crate::contact::{Contacts, Drivetrain, Motion};
use crate::insertions::{Insertions, Present};
use crate::library::Asked;
use crate::physics::{Actuators, Linkage, Physics, Tyres};

use trajectory::{COUNT, SERVO, Step, Trajectory, Values};

/// Longest step \[s\], and steps per time constant of an actuator at least.
const STEP: f64 = 0.005;
const STEPS_PER_LAG: f64 = 4.0;
/// Shortest time constant \[s\].
const SHORTEST_LAG: f64 = 0.005;
/// A reported wheel speed is the mean over so long \[s\].
const SPEED_WINDOW: f64 = 0.02;
/// Commands act just behind their time \[s\].
const INSIDE: f64 = 1e-9;

const YAW: usize = 2;
const MOTOR: usize = 3;
const WAY: usize = 5;
const ROTATION: usize = 6;

/// The second vehicle as one that drives cases.
#[derive(Clone, Copy, Debug, Default)]
pub struct SecondVehicle;

impl Drives for SecondVehicle {
    fn drive(&self, task: &Task<'_>) -> Signals {
        let insertions = Insertions::new(task.case, task.effects);
        let mut car = Car::new(task, &insertions);
        let trajectory = car.drive(task);
        car.signals(task, &trajectory)
    }
}

/// True measures of the vehicle of `case` in good order.
pub(crate) fn chassis(case: &Specification) -> Chassis {
    let (truth, build) = (&case.truth, &case.build);
    let gyration = build.gyration * truth.wheelbase;
    Chassis {
        wheelbase: truth.wheelbase,
        track_front: truth.track_front,
        track_rear: truth.track_rear,
        radius: truth.radius,
        drive: truth.drive,
        mass: build.mass,
        yaw_inertia: build.mass * gyration * gyration,
        centre_of_mass: build.centre_of_mass * truth.wheelbase,
    }
}

/// True physics of the vehicle of `case` in good order; its actuators are the car's own affair.
pub(crate) fn physics(case: &Specification) -> Physics {
    let build = &case.build;
    Physics {
        tyres: Tyres {
            lateral_compliance: build.lateral_compliance,
            longitudinal_compliance: build.longitudinal_compliance,
            friction: build.friction,
            rolling_resistance: build.rolling_resistance,
        },
        linkage: Linkage {
            ackermann: build.ackermann,
            compliance: build.linkage / (build.mass * build.centre_of_mass),
            toe: [-build.toe, build.toe, 0.0, 0.0],
        },
        differential_lock: 0.0,
        actuators: Actuators::NEUTRAL,
    }
}

/// The vehicle on its way.
struct Car<'a> {
    believed: &'a Vehicle,
    truth: &'a Vehicle,
    insertions: &'a Insertions,
    disturbance: &'a Disturbance,
    commands: &'a [Asked],
    contacts: Contacts,
    chassis: Chassis,
    driven: [bool; 4],
    /// Mean rotation of the driven wheels per metre of the motor \[rad/m\].
    motor: f64,
    /// Angle of the rack at the present step's beginning \[rad\], and whether the servo sticks.
    rack: f64,
    stuck: bool,
}

impl<'a> Car<'a> {
    fn new(task: &Task<'a>, insertions: &'a Insertions) -> Self {
        let plain = chassis(task.case);
        let chassis = insertions.ground.chassis(&plain);
        let believed = &task.case.vehicle;
        Self {
            believed,
            truth: &task.case.truth,
            insertions,
            disturbance: task.disturbance,
            commands: &task.plan.commands,
            contacts: Contacts::new(&chassis, &physics(task.case)),
            driven: WHEELS.map(|wheel| chassis.is_driven(wheel)),
            chassis,
            motor: 1.0 / believed.driven_radius(),
            rack: 0.0,
            stuck: false,
        }
    }

    /// What was sent by `time` \[s\].
    fn sent(&self, time: f64) -> Asked {
        let behind = self.commands.partition_point(|row| row.time <= time);
        behind.checked_sub(1).and_then(|at| self.commands.get(at)).copied().unwrap_or_default()
    }

    fn delays(&self) -> [f64; 2] {
        let response = self.truth.response();
        let (speed, steering) = (&self.insertions.speed, &self.insertions.steering);
        [response.speed_delay + speed.delay, response.steering_delay + steering.delay]
    }

    /// What motor and servo are told to reach at `time` \[s\].
    fn targets(&self, time: f64) -> (f64, f64) {
        let limits = &self.truth.limits;
        let [speed, steering] = self.delays().map(|delay| self.sent(time - delay));
        let speed = self.insertions.speed.asked(speed.speed, time);
        let steering = self.insertions.steering.asked(steering.steering);
        (
            speed.clamp(-limits.speed, limits.speed),
            steering.clamp(-limits.steering, limits.steering),
        )
    }

    /// Drives the whole plan.
    fn drive(&mut self, task: &Task<'_>) -> Trajectory {
        let start = task.plan.start;
        let mut y = [0.0; COUNT];
        y[..3].copy_from_slice(&[start.x, start.y, start.yaw]);
        let mut trajectory = Trajectory { start: y, steps: Vec::new() };
        let response = self.truth.response();
        let lag = response.speed_lag.min(response.steering_lag).max(SHORTEST_LAG);
        let longest = STEP.min(lag / STEPS_PER_LAG);
        let mut ends: Vec<f64> = self
            .delays()
            .into_iter()
            .flat_map(|delay| self.commands.iter().map(move |row| row.time + delay))
            .filter(|end| *end > 0.0 && *end < task.plan.duration)
            .collect();
        ends.push(task.plan.duration);
        ends.sort_by(f64::total_cmp);
        let mut time = 0.0;
        for end in ends {
            let whole = end - time;
            if whole <= INSIDE {
                continue;
            }
            let count = (whole / longest).ceil();
            let (begin, length) = (time, whole / count);
            let mut done = 0.0;
            while done < count {
                let step = self.step(begin + done * length, length, &y);
                y = step.values[1];
                trajectory.steps.push(step);
                done += 1.0;
            }
            time = end;
        }
        trajectory
    }

    /// A step of the classical Runge-Kutta method.
    fn step(&mut self, begin: f64, length: f64, y: &Values) -> Step {
        let targets = self.targets(begin + INSIDE);
        self.stuck = self.insertions.steering.sticks(self.stuck, y[SERVO], targets.1);
        let plus = |rates: &Values, length: f64| -> Values {
            core::array::from_fn(|i| y[i] + length * rates[i])
        };
        let half = 0.5 * length;
        let first = self.rates(begin, targets, y);
        let second = self.rates(begin + half, targets, &plus(&first, half));
        let third = self.rates(begin + half, targets, &plus(&second, half));
        let fourth = self.rates(begin + length, targets, &plus(&third, length));
        let end = core::array::from_fn(|i| {
            y[i] + length / 6.0 * (first[i] + 2.0 * (second[i] + third[i]) + fourth[i])
        });
        let last = self.rates(begin + length, targets, &end);
        let begun = self.rack;
        self.rack = self.insertions.steering.play(begun, end[SERVO]);
        let ahead = [begun - y[SERVO], self.rack - end[SERVO]];
        Step { begin, length, values: [*y, end], rates: [first, last], ahead }
    }

    fn rates(&mut self, time: f64, targets: (f64, f64), y: &Values) -> Values {
        let (response, limits) = (self.truth.response(), &self.truth.limits);
        let (speed, steering) = (&self.insertions.speed, &self.insertions.steering);
        let lags = [response.speed_lag, response.steering_lag].map(|lag| lag.max(SHORTEST_LAG));
        let acceleration = speed.rate(y[MOTOR], targets.0, lags[0], limits.acceleration);
        let servo_rate =
            steering.rate(y[SERVO], targets.1, self.stuck, lags[1], limits.steering_rate);
        let rack = steering.play(self.rack, y[SERVO]);
        let now = Present {
            time,
            place: (y[0], y[1]),
            yaw: y[YAW],
            speed: y[MOTOR],
            acceleration,
            rotation: core::array::from_fn(|i| y[ROTATION + i]),
        };
        let [noise_slip, noise_angle, noise_side] = self.disturbance.at(time);
        let ground = &self.insertions.ground;
        let free = rack + ground.askew(&now) + noise_angle;
        let surface = y[MOTOR] * self.motor * self.chassis.driven_radius();
        let drivetrain = Drivetrain {
            speed: y[MOTOR],
            acceleration,
            steering: ground.under_force(&self.chassis, free, surface),
            steering_rate: if rack == self.rack { 0.0 } else { servo_rate },
        };
        let motion = self.motion(&now, noise_slip, &drivetrain);
        let (side, east, north) = self.insertions.ground.sideways(&motion, &now);
        let lateral = motion.lateral + side + noise_side * motion.forward.abs();
        let (sin, cos) = math::sin_cos(y[YAW]);
        let mut rates = [0.0; COUNT];
        rates[..ROTATION].copy_from_slice(&[
            motion.forward * cos - lateral * sin + east,
            motion.forward * sin + lateral * cos + north,
            motion.yaw_rate,
            acceleration,
            servo_rate,
            motion.forward,
        ]);
        rates[ROTATION..].copy_from_slice(&motion.rotation_rate);
        rates
    }

    fn motion(&mut self, now: &Present, noise_slip: f64, drivetrain: &Drivetrain) -> Motion {
        let grip = (1.0 - self.insertions.ground.slip(now)) * (1.0 - noise_slip);
        let mut radius = self.insertions.ground.radius(self.chassis.radius, now);
        for (radius, driven) in radius.iter_mut().zip(self.driven) {
            *radius *= if driven { grip } else { 1.0 };
        }
        self.contacts.set_rolling(radius, self.motor);
        self.contacts.motion(drivetrain)
    }

    /// What the sensors show.
    fn signals(&self, task: &Task<'_>, trajectory: &Trajectory) -> Signals {
        let (plan, sensing, sight) =
            (task.plan, &self.insertions.sensing, &self.insertions.reference);
        let rotation = |time: f64| {
            let values = trajectory.at(time - sensing.encoder_delay).values;
            sensing.rotation(core::array::from_fn(|i| values[ROTATION + i]))
        };
        let speeds = |time: f64| {
            let (before, now) = (rotation(time - SPEED_WINDOW), rotation(time));
            let radius = &self.believed.radius;
            core::array::from_fn(|i| (now[i] - before[i]) * radius[i] / SPEED_WINDOW)
        };
        let counts = self.believed.encoders.is_some();
        let wheels = |time: &f64| if counts { rotation(*time) } else { speeds(*time) };
        let yaw_rate = |time: &f64| {
            let rates = trajectory.at(*time - task.case.build.gyro_latency).rates;
            sensing.yaw_rate(rates[YAW], rates[WAY], *time)
        };
        let marker = self.believed.reference.map(|reference| sight.marker(&reference.marker));
        let reference = |stamp: &f64| {
            let time = sight.taken(*stamp);
            let [x, y, yaw, ..] = trajectory.at(time).values;
            let body = kerbside_geometry::Pose::new(x, y, yaw);
            sight.shown(&body.compose(&marker.unwrap_or_default()), time)
        };
        Signals {
            wheels: plan.stamps.encoders.iter().map(wheels).collect(),
            steering: plan
                .stamps
                .steering
                .iter()
                .map(|time| sensing.steering(trajectory.at(*time).rack))
                .collect(),
            yaw_rate: plan.stamps.gyro.iter().map(yaw_rate).collect(),
            reference: plan.stamps.reference.iter().map(reference).collect(),
            distance: trajectory.at(plan.duration).values[WAY],
        }
    }
}
