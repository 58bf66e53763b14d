//! The simulated vehicle.

use kerbside_geometry::{Pose, Vehicle};

use crate::actuator::Actuator;
use crate::body::Body;
use crate::ground::{Ground, Motion};
use crate::noise::Noise;
use crate::sensing::{Sensing, SensorReading};
use crate::speed_actuator::speed_actuator;
use crate::steering_actuator::steering_actuator;

/// Longest step of the integration unless told otherwise \[s\].
pub const STEP: f64 = 0.005;

/// The nominal vehicle: it is exactly what its description says. Time is the vehicle's own, 0 when
/// it is made; until the first command acts both commands are 0.
#[derive(Clone, Debug)]
pub struct Simulator {
    time: f64,
    step: f64,
    drive: Actuator,
    rack: Actuator,
    ground: Ground,
    motion: Motion,
    body: Body,
    sensing: Sensing,
    marker: Option<Pose>,
}

impl Simulator {
    /// A `vehicle` standing at `start` with straight wheels, its sensors erring by `noise` as
    /// `seed` draws it.
    #[must_use]
    pub fn new(vehicle: &Vehicle, start: Pose, noise: &Noise, seed: u64) -> Self {
        Self {
            time: 0.0,
            step: STEP,
            drive: speed_actuator(vehicle),
            rack: steering_actuator(vehicle),
            ground: Ground::new(vehicle),
            motion: Motion::default(),
            body: Body::new(start),
            sensing: Sensing::new(vehicle, noise, seed),
            marker: vehicle.reference.map(|reference| reference.marker),
        }
    }

    /// The same with integration steps of at most `step` \[s\].
    ///
    /// # Panics
    /// On a step that is not positive: time would stand still.
    #[must_use]
    pub fn with_step(mut self, step: f64) -> Self {
        assert!(step > 0.0, "a step of {step} s never ends");
        self.step = step;
        self
    }

    /// The same with counters that begin at `counts` instead of 0.
    #[must_use]
    pub fn with_first_counts(mut self, counts: [i64; 4]) -> Self {
        self.sensing.set_first_counts(counts);
        self
    }

    /// Commands `speed` \[m/s\] and `steering` \[rad\] from `time` \[s\] plus the actuators' delays
    /// until the next command.
    ///
    /// Commands come in the order of their times; any number may be given ahead. One that is late
    /// acts at once. A command that is not finite is left out, as a vehicle would.
    pub fn command(&mut self, time: f64, speed: f64, steering: f64) {
        if time.is_finite() && speed.is_finite() && steering.is_finite() {
            self.drive.command(time, speed);
            self.rack.command(time, steering);
        }
    }

    /// Drives on until the time is `to` \[s\]; a time that is past changes nothing.
    pub fn advance(&mut self, to: f64) {
        while self.time < to {
            let jumped = self.drive.begin(self.time) | self.rack.begin(self.time);
            if jumped {
                self.motion = self.ground.motion(self.drive.lag().value(), self.rack.lag().value());
            }
            let until = to.min(self.drive.next()).min(self.rack.next());
            let smooth = self.drive.lag().smooth().min(self.rack.lag().smooth()).min(self.step);
            let left = until - self.time;
            // A remainder that is only rounding is not worth a step of its own.
            if left <= smooth || (smooth == self.step && left < smooth * 1.000_001) {
                self.roll(left);
                self.time = until;
            } else {
                self.roll(smooth);
                self.time += smooth;
            }
        }
    }

    fn roll(&mut self, step: f64) {
        let (speeds, angles) = (self.drive.lag().ahead(step), self.rack.lag().ahead(step));
        self.drive.move_to(speeds[1]);
        self.rack.move_to(angles[1]);
        let begin = self.motion;
        if begin.is_rest() && speeds[1] == 0.0 && speeds[0] == 0.0 {
            return;
        }
        let middle = self.ground.motion(speeds[0], angles[0]);
        self.motion = self.ground.motion(speeds[1], angles[1]);
        self.body.roll(step, &[begin, middle, self.motion]);
    }

    /// Time that was reached \[s\].
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// True pose of the rear-axle centre, yaw not wrapped.
    #[must_use]
    pub fn pose(&self) -> Pose {
        self.body.pose
    }

    /// True pose of the reference marker, yaw not wrapped; none where the vehicle has no reference.
    #[must_use]
    pub fn marker(&self) -> Option<Pose> {
        self.marker.map(|body_from_marker| self.body.pose.compose(&body_from_marker))
    }

    /// True speed of the rear-axle centre, negative in reverse \[m/s\].
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.motion.speed
    }

    /// True yaw rate \[rad/s\].
    #[must_use]
    pub fn yaw_rate(&self) -> f64 {
        self.motion.yaw_rate
    }

    /// True angle of the rack, which is that of the road wheels \[rad\].
    #[must_use]
    pub fn steering(&self) -> f64 {
        self.rack.lag().value()
    }

    /// True distance that the rear-axle centre has covered in either direction \[m\].
    #[must_use]
    pub fn distance(&self) -> f64 {
        self.body.distance
    }

    /// True rotation of fl, fr, rl, rr since the start \[rad\].
    #[must_use]
    pub fn rotation(&self) -> [f64; 4] {
        self.body.rotation
    }

    /// True rotation rates of fl, fr, rl, rr \[rad/s\].
    #[must_use]
    pub fn rotation_rate(&self) -> [f64; 4] {
        self.motion.rotation_rate
    }

    /// Reads every sensor now. Each call draws new noise: how often it is called is part of what a
    /// seed repeats.
    pub fn reading(&mut self) -> SensorReading {
        let rack = self.rack.lag().value();
        self.sensing.read(self.time, &self.body, &self.motion, rack)
    }
}
