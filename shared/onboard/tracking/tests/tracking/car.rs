//! A kinematic car of its own: delays, rate-limited lags, rolling without slip, in steps of 1 ms.

use std::collections::VecDeque;

use kerbside_geometry::{Drive, Pose, Vehicle, math};

const STEP: f64 = 0.001;

/// The 1:6 car.
pub(crate) fn vehicle() -> Vehicle {
    Vehicle::paper_car()
}

#[derive(Clone, Debug)]
pub(crate) struct Car {
    vehicle: Vehicle,
    commands: VecDeque<(f64, f64, f64)>,
    pub(crate) time: f64,
    pub(crate) pose: Pose,
    /// Of the motor, through the driven wheels' radius.
    pub(crate) drive: f64,
    pub(crate) steering: f64,
    /// Of the rear-axle centre.
    pub(crate) speed: f64,
}

impl Car {
    pub(crate) fn new(vehicle: &Vehicle, pose: Pose) -> Self {
        let commands = VecDeque::from([(-1.0, 0.0, 0.0)]);
        let vehicle = vehicle.clone();
        Self { vehicle, commands, time: 0.0, pose, drive: 0.0, steering: 0.0, speed: 0.0 }
    }

    pub(crate) fn command(&mut self, speed: f64, steering: f64) {
        self.commands.push_back((self.time, speed, steering));
        while self.commands.len() > 2 && self.commands[1].0 < self.time - 0.5 {
            self.commands.pop_front();
        }
    }

    pub(crate) fn advance(&mut self, to: f64) {
        while self.time < to - 0.5 * STEP {
            self.step();
        }
    }

    fn step(&mut self) {
        let (response, limits) = (self.vehicle.response(), self.vehicle.limits);
        let speed = self.delayed(response.speed_delay).1.clamp(-limits.speed, limits.speed);
        let angle =
            self.delayed(response.steering_delay).2.clamp(-limits.steering, limits.steering);
        let rate = |target: f64, value: f64, lag: f64, limit: f64| {
            ((target - value) / lag.max(STEP)).clamp(-limit, limit)
        };
        let drive_rate = rate(speed, self.drive, response.speed_lag, limits.acceleration);
        let turn_rate = rate(angle, self.steering, response.steering_lag, limits.steering_rate);
        let middle = self.steering + 0.5 * STEP * turn_rate;
        let curvature = math::tan(middle) / self.vehicle.wheelbase;
        self.speed = (self.drive + 0.5 * STEP * drive_rate) / self.ratio(curvature);
        let distance = STEP * self.speed;
        self.pose = self.pose.advance(distance, distance * curvature);
        self.drive += STEP * drive_rate;
        self.steering += STEP * turn_rate;
        self.time += STEP;
    }

    /// How much farther than the rear-axle centre the driven wheels roll, on average.
    fn ratio(&self, curvature: f64) -> f64 {
        let rolled =
            |x: f64, y: f64| ((1.0 - y * curvature).powi(2) + (x * curvature).powi(2)).sqrt();
        match self.vehicle.drive {
            Drive::Rear => 1.0,
            Drive::Front => {
                let (x, y) = (self.vehicle.wheelbase, 0.5 * self.vehicle.track_front);
                0.5 * (rolled(x, y) + rolled(x, -y))
            }
            Drive::All => panic!("no test drives all wheels"),
        }
    }

    fn delayed(&self, delay: f64) -> (f64, f64, f64) {
        let due = self.time - delay + 1e-9;
        *self.commands.iter().rev().find(|command| command.0 <= due).unwrap_or(&self.commands[0])
    }
}
