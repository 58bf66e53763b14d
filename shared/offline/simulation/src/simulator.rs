//! The simulated vehicle, driven live.

use std::collections::VecDeque;

use kerbside_geometry::{Pose, Vehicle};

use crate::effects::Effects;
use crate::noise::Noise;
use crate::plant::Plant;
use crate::sensing::{Sensing, SensorReading};
use crate::stepper::{Knot, Stepper};
use crate::train::{Actuators, Train};

/// Longest step of the integration unless told otherwise \[s\].
pub const STEP: f64 = 0.005;

/// The vehicle: exactly what its description says, and the effects that are added to it. Time is
/// the vehicle's own, 0 when it is made; until the first command acts both commands are 0.
#[derive(Clone, Debug)]
pub struct Simulator {
    stepper: Stepper<Actuators>,
    sensing: Sensing,
    past: Past,
    marker: Option<Pose>,
}

/// What delayed sensors still have to show.
#[derive(Clone, Debug)]
struct Past {
    /// How far back \[s\]; nothing is kept where no sensor is late.
    span: f64,
    knots: VecDeque<Knot>,
}

impl Past {
    fn push(&mut self, knot: Knot) {
        // One knot before the span's beginning stays.
        while self.knots.get(1).is_some_and(|second| second.time <= knot.time - self.span) {
            self.knots.pop_front();
        }
        self.knots.push_back(knot);
    }

    /// The state at `time` \[s\], if that is past.
    fn state(&self, time: f64) -> Option<Knot> {
        let after = self.knots.iter().rposition(|knot| knot.time <= time).map_or(0, |at| at + 1);
        let next = self.knots.get(after)?;
        let Some(before) = after.checked_sub(1) else { return Some(*next) };
        Some(Knot::between(&self.knots[before], next, time))
    }
}

impl Simulator {
    /// A nominal `vehicle` standing at `start` with straight wheels, its sensors erring by `noise`
    /// as `seed` draws it.
    #[must_use]
    pub fn new(vehicle: &Vehicle, start: Pose, noise: &Noise, seed: u64) -> Self {
        Self::with_effects(vehicle, &Effects::NEUTRAL, start, noise, seed)
    }

    /// A `vehicle` with `effects`, otherwise as [`Self::new`].
    #[must_use]
    pub fn with_effects(
        vehicle: &Vehicle,
        effects: &Effects,
        start: Pose,
        noise: &Noise,
        seed: u64,
    ) -> Self {
        let plant = Plant::new(vehicle, effects);
        let stepper = Stepper::new(&plant, Actuators::new(&plant), start, STEP);
        let span = plant.sensors.encoder_delay;
        let mut past = Past { span, knots: VecDeque::new() };
        if span > 0.0 {
            past.push(stepper.knot());
        }
        Self {
            sensing: Sensing::new(vehicle, &plant.sensors, noise, seed),
            marker: vehicle.reference.map(|_| plant.sensors.marker),
            stepper,
            past,
        }
    }

    /// The same with integration steps of at most `step` \[s\].
    ///
    /// # Panics
    /// On a step that is not positive: time would stand still.
    #[must_use]
    pub fn with_step(mut self, step: f64) -> Self {
        assert!(step > 0.0, "a step of {step} s never ends");
        self.stepper.set_step(step);
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
        self.stepper.train.command(time, speed, steering);
    }

    /// Commands to stop from `time` \[s\] plus the actuators' delays, the steering held where it stands now.
    pub fn halt(&mut self, time: f64) {
        self.command(time, 0.0, self.stepper.train.holding());
    }

    /// Drives on until the time is `to` \[s\]; a time that is past changes nothing.
    pub fn advance(&mut self, to: f64) {
        if self.past.span > 0.0 {
            self.stepper.advance(to, |stepper| self.past.push(stepper.knot()));
        } else {
            self.stepper.advance(to, |_| ());
        }
    }

    /// Time that was reached \[s\].
    #[must_use]
    pub fn time(&self) -> f64 {
        self.stepper.time
    }

    /// True pose of the rear-axle centre, yaw not wrapped.
    #[must_use]
    pub fn pose(&self) -> Pose {
        self.stepper.body.pose
    }

    /// True pose of the reference marker, yaw not wrapped; none where the vehicle has no reference.
    #[must_use]
    pub fn marker(&self) -> Option<Pose> {
        self.marker.map(|body_from_marker| self.pose().compose(&body_from_marker))
    }

    /// True speed of the rear-axle centre, negative in reverse \[m/s\].
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.stepper.motion.speed
    }

    /// True yaw rate \[rad/s\].
    #[must_use]
    pub fn yaw_rate(&self) -> f64 {
        self.stepper.motion.yaw_rate
    }

    /// True angle of the rack, which nominally is that of the road wheels \[rad\].
    #[must_use]
    pub fn steering(&self) -> f64 {
        self.stepper.train.rack()
    }

    /// True distance that the rear-axle centre has covered in either direction \[m\].
    #[must_use]
    pub fn distance(&self) -> f64 {
        self.stepper.body.distance
    }

    /// True rotation of fl, fr, rl, rr since the start \[rad\].
    #[must_use]
    pub fn rotation(&self) -> [f64; 4] {
        self.stepper.body.rotation
    }

    /// True rotation rates of fl, fr, rl, rr \[rad/s\].
    #[must_use]
    pub fn rotation_rate(&self) -> [f64; 4] {
        self.stepper.motion.rotation_rate
    }

    /// Reads every sensor now. Each call draws new noise: how often it is called is part of what a
    /// seed repeats.
    pub fn reading(&mut self) -> SensorReading {
        let now = self.stepper.knot();
        let encoders = self.past.state(now.time - self.past.span).unwrap_or(now);
        self.sensing.read(&now, &encoders, self.stepper.body.turned)
    }
}
