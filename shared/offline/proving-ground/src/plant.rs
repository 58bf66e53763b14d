//! The vehicle in motion.

use std::collections::VecDeque;

use kerbside_geometry::Pose;

use crate::actuators::{Command, Servo, Setpoint, at_rest};
use crate::chassis::Chassis;
use crate::contact::{Contacts, Drivetrain, Motion};
use crate::physics::{Actuators, Physics};

/// Longest step of the integration \[s\].
pub const LONGEST_STEP: f64 = 0.005;
/// Steps of the integration per time constant of an actuator, at least.
const STEPS_PER_LAG: f64 = 4.0;
/// How far inside a step its first and last setpoints are taken \[s\], so that a jump at its end belongs to the next one.
/// Both ends move towards the middle: what is linear in between is not changed.
const INSIDE: f64 = 1e-9;
/// A remainder of a step below this share of it is rounding, not worth a step of its own.
const ROUNDING: f64 = 1e-6;

/// Truth at an instant. Arrays of four are in the order of [`kerbside_geometry::WHEELS`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Since the start \[s\].
    pub time: f64,
    /// Of the rear-axle centre, yaw not wrapped.
    pub pose: Pose,
    /// Of the rear-axle centre along the body's x axis, negative in reverse \[m/s\].
    pub speed: f64,
    /// Of the rear-axle centre along the body's y axis \[m/s\].
    pub lateral_speed: f64,
    /// \[rad/s\].
    pub yaw_rate: f64,
    /// Angle of the rack, as that of the equivalent centre front wheel, left positive \[rad\].
    pub steering: f64,
    /// That the rear-axle centre has covered along x, in either direction \[m\].
    pub distance: f64,
    /// Of the wheels since the start, negative in reverse \[rad\].
    pub rotation: [f64; 4],
    /// The same with every turn counted as positive \[rad\].
    pub turned: [f64; 4],
}

/// The integrated part of the state: x, y, yaw, distance, motor, rack, rotation, turned.
type Integrals = [f64; 14];
const MOTOR: usize = 4;
const RACK: usize = 5;

/// The second vehicle: a planar rigid body on four wheels, with the [`Physics`] it is given. In the kinematic limit every
/// held command is an exact arc; else the classical Runge-Kutta method of fourth order integrates it in steps of at
/// most [`LONGEST_STEP`].
#[derive(Clone, Debug)]
pub struct Plant {
    chassis: Chassis,
    physics: Physics,
    contacts: Contacts,
    motor: Servo,
    rack: Servo,
    exact: bool,
    step: f64,
    motor_speed: f64,
    state: State,
    /// What was commanded before the first command: nothing.
    rest: Command,
    /// Commands and when they were given, as far back as the delays reach.
    given: VecDeque<(f64, Command)>,
}

impl Plant {
    /// A vehicle standing at `start` with its rack at `steering` \[rad\].
    #[must_use]
    pub fn new(chassis: &Chassis, physics: &Physics, start: Pose, steering: f64) -> Self {
        let (motor, rack) = (Servo::speed(&physics.actuators), Servo::steering(&physics.actuators));
        let lags = [motor.lag(), rack.lag()].into_iter().filter(|lag| *lag > 0.0);
        let steering = rack.target(steering);
        Self {
            chassis: *chassis,
            physics: *physics,
            contacts: Contacts::new(chassis, physics),
            motor,
            rack,
            exact: physics.is_neutral(),
            step: lags.fold(LONGEST_STEP, |step, lag| step.min(lag / STEPS_PER_LAG)),
            motor_speed: 0.0,
            state: State { pose: start, steering, ..State::default() },
            rest: at_rest(steering).command,
            given: VecDeque::new(),
        }
    }

    /// The same, but integrated in the kinematic limit too: for the comparison of both.
    #[must_use]
    pub fn with_integration(mut self) -> Self {
        self.exact = false;
        self
    }

    /// Truth now.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The vehicle's measures.
    #[must_use]
    pub fn chassis(&self) -> &Chassis {
        &self.chassis
    }

    /// Drives on for `duration` \[s\] while `command` holds; what the delays hold back acts later. Nothing happens for a
    /// duration that is not positive, or on a command that is not finite.
    pub fn step(&mut self, duration: f64, command: Command) -> &State {
        let sane = command.speed.is_finite() && command.steering.is_finite();
        if !(duration > 0.0 && duration.is_finite() && sane) {
            return &self.state;
        }
        if self.exact {
            self.arc(duration, command);
            return &self.state;
        }
        self.given.push_back((self.state.time, command));
        let end = self.state.time + duration;
        while self.state.time < end {
            let until = self.next_switch().min(end);
            let held = self.held();
            self.integrate(until, |_| held);
        }
        self.forget();
        &self.state
    }

    /// Drives on until the time is `end` \[s\] while `setpoint` says what is commanded when; it has no kink in between,
    /// seen through the delays.
    pub(crate) fn follow(&mut self, end: f64, setpoint: impl Fn(f64) -> Setpoint) {
        let actuators = self.physics.actuators;
        self.integrate(end, |time| {
            let speed = setpoint(time - actuators.speed_delay);
            let steering = setpoint(time - actuators.steering_delay);
            Setpoint {
                command: Command {
                    speed: speed.command.speed,
                    steering: steering.command.steering,
                },
                acceleration: speed.acceleration,
                steering_rate: steering.steering_rate,
            }
        });
    }

    /// An exact arc.
    fn arc(&mut self, duration: f64, command: Command) {
        let unit = self.chassis.unit_motion(command.steering);
        let way = command.speed * duration;
        let travel = self.chassis.travel_of(unit);
        let state = &mut self.state;
        state.pose = state.pose.advance(way * unit.forward, way * unit.yaw);
        state.distance += (way * unit.forward).abs();
        for (i, travel) in travel.into_iter().enumerate() {
            let turn = way * travel / self.chassis.radius[i];
            state.rotation[i] += turn;
            state.turned[i] += turn.abs();
        }
        state.time += duration;
        state.speed = command.speed * unit.forward;
        state.yaw_rate = command.speed * unit.yaw;
        state.steering = command.steering;
    }

    /// When the next command begins to act on motor or rack \[s\].
    fn next_switch(&self) -> f64 {
        let Actuators { speed_delay, steering_delay, .. } = self.physics.actuators;
        let switches =
            self.given.iter().flat_map(|given| [given.0 + speed_delay, given.0 + steering_delay]);
        switches.filter(|at| *at > self.state.time).fold(f64::INFINITY, f64::min)
    }

    /// What acts now, as far as the delays let it.
    fn held(&self) -> Setpoint {
        let (now, actuators) = (self.state.time, &self.physics.actuators);
        let acting = |delay: f64| {
            let newest = self.given.iter().rev().find(|given| given.0 + delay <= now);
            newest.map_or(self.rest, |given| given.1)
        };
        Setpoint::held(Command {
            speed: acting(actuators.speed_delay).speed,
            steering: acting(actuators.steering_delay).steering,
        })
    }

    /// Drops the commands that a newer one has replaced everywhere.
    fn forget(&mut self) {
        let actuators = &self.physics.actuators;
        let reach = self.state.time - actuators.speed_delay.max(actuators.steering_delay);
        while self.given.get(1).is_some_and(|second| second.0 <= reach) {
            self.given.pop_front();
        }
    }

    /// Integrates until `end` \[s\].
    fn integrate(&mut self, end: f64, setpoint: impl Fn(f64) -> Setpoint) {
        let (begin, whole) = (self.state.time, end - self.state.time);
        if whole <= 0.0 {
            return;
        }
        let count = (whole / self.step - ROUNDING).ceil().max(1.0);
        let (step, mut done) = (whole / count, 0.0);
        while done < count {
            let time = begin + done * step;
            self.runge_kutta(time, step, &setpoint);
            done += 1.0;
        }
        self.state.time = end;
    }

    /// A step of the classical Runge-Kutta method (Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*,
    /// section II.1).
    fn runge_kutta(&mut self, time: f64, step: f64, setpoint: impl Fn(f64) -> Setpoint) {
        let asked =
            [setpoint(time + INSIDE), setpoint(time + 0.5 * step), setpoint(time + step - INSIDE)];
        let y = self.integrals();
        let plus = |rates: &Integrals, step: f64| -> Integrals {
            core::array::from_fn(|i| y[i] + step * rates[i])
        };
        let first = self.rates(&y, &asked[0]).0;
        let second = self.rates(&plus(&first, 0.5 * step), &asked[1]).0;
        let third = self.rates(&plus(&second, 0.5 * step), &asked[1]).0;
        let fourth = self.rates(&plus(&third, step), &asked[2]).0;
        let next = core::array::from_fn(|i| {
            y[i] + step / 6.0 * (first[i] + 2.0 * (second[i] + third[i]) + fourth[i])
        });
        self.take(&next, &asked[2]);
    }

    fn integrals(&self) -> Integrals {
        let State { pose, distance, rotation, turned, steering, .. } = self.state;
        let mut y = [0.0; 14];
        y[..6].copy_from_slice(&[pose.x, pose.y, pose.yaw, distance, self.motor_speed, steering]);
        y[6..10].copy_from_slice(&rotation);
        y[10..].copy_from_slice(&turned);
        y
    }

    fn drivetrain(&self, y: &Integrals, asked: &Setpoint) -> Drivetrain {
        let Command { speed, steering } = asked.command;
        let (speed, acceleration) = self.motor.respond(y[MOTOR], speed, asked.acceleration);
        let (steering, steering_rate) = self.rack.respond(y[RACK], steering, asked.steering_rate);
        Drivetrain { speed, acceleration, steering, steering_rate }
    }

    fn rates(&mut self, y: &Integrals, asked: &Setpoint) -> (Integrals, Motion) {
        let drivetrain = self.drivetrain(y, asked);
        let motion = self.contacts.motion(&drivetrain);
        let Motion { forward, lateral, yaw_rate, rotation_rate } = motion;
        let (sin, cos) = kerbside_geometry::math::sin_cos(y[2]);
        let mut rates = [0.0; 14];
        rates[..6].copy_from_slice(&[
            forward * cos - lateral * sin,
            forward * sin + lateral * cos,
            yaw_rate,
            forward.abs(),
            // A servo without lag is set after the step; its rate says only what inertia feels.
            if self.motor.lag() > 0.0 { drivetrain.acceleration } else { 0.0 },
            if self.rack.lag() > 0.0 { drivetrain.steering_rate } else { 0.0 },
        ]);
        rates[6..10].copy_from_slice(&rotation_rate);
        rates[10..].copy_from_slice(&rotation_rate.map(f64::abs));
        (rates, motion)
    }

    /// Moves on to the integrals `y`.
    fn take(&mut self, y: &Integrals, asked: &Setpoint) {
        let drivetrain = self.drivetrain(y, asked);
        let motion = self.contacts.motion(&drivetrain);
        self.motor_speed = drivetrain.speed;
        let mut next = State {
            pose: Pose::new(y[0], y[1], y[2]),
            speed: motion.forward,
            lateral_speed: motion.lateral,
            yaw_rate: motion.yaw_rate,
            steering: drivetrain.steering,
            distance: y[3],
            ..self.state
        };
        next.rotation.copy_from_slice(&y[6..10]);
        next.turned.copy_from_slice(&y[10..]);
        self.state = next;
    }
}
