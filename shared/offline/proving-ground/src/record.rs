//! A drive and what is recorded of it.

use kerbside_geometry::Pose;

use crate::actuators::Command;
use crate::chassis::Chassis;
use crate::instruments::Instruments;
use crate::manoeuvre::{Course, Manoeuvre, Path};
use crate::physics::Physics;
use crate::plant::{Plant, State};
use crate::rolling::Rolling;
use crate::sensors::{Sensors, Slip};

/// Truth and commands are recorded as often as this where there are no encoders \[Hz\].
const RATE: f64 = 50.0;

/// A drive: who drives what, where and how.
#[derive(Clone, Debug)]
pub struct TestDrive {
    /// True measures.
    pub chassis: Chassis,
    /// True physics.
    pub physics: Physics,
    /// What is read.
    pub sensors: Sensors,
    /// What is driven.
    pub manoeuvre: Manoeuvre,
    /// When wheels turn and do not roll.
    pub slips: Vec<Slip>,
    /// Where the rear-axle centre is at the start.
    pub start: Pose,
}

/// A value and its stamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamped<T> {
    /// \[s\].
    pub time: f64,
    /// What was read then.
    pub value: T,
}

/// What a run's folder would hold, and the truth beside it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recorded {
    /// What was asked, at the encoders' stamps.
    pub commands: Vec<Stamped<Command>>,
    /// Counts of fl, fr, rl, rr; none of a wheel that was not read.
    pub counts: Vec<Stamped<[Option<i64>; 4]>>,
    /// Angle \[rad\].
    pub steering: Vec<Stamped<f64>>,
    /// \[rad/s\].
    pub yaw_rate: Vec<Stamped<f64>>,
    /// Pose of the marker by the reference's own clock, yaw not wrapped.
    pub reference: Vec<Stamped<Pose>>,
    /// Truth at the encoders' stamps. Its rotation is that of rolling, without slips.
    pub truth: Vec<State>,
}

/// How the body moves.
enum Mover<'a> {
    Exact(Box<Rolling>, &'a Path),
    Integrated(Box<Plant>, Vec<f64>),
}

impl TestDrive {
    /// A drive from the origin without slips.
    #[must_use]
    pub fn new(chassis: Chassis, physics: Physics, sensors: Sensors, manoeuvre: Manoeuvre) -> Self {
        Self { chassis, physics, sensors, manoeuvre, slips: Vec::new(), start: Pose::default() }
    }

    /// Drives once; `seed` draws the errors of the sensors. In the kinematic limit a path is covered exactly, without
    /// integration in time.
    #[must_use]
    pub fn record(&self, seed: u64) -> Recorded {
        let mover = match self.manoeuvre.course() {
            Course::Path(path) if self.physics.is_neutral() => {
                let rolling = Rolling::new(&self.chassis, path, self.start);
                Mover::Exact(Box::new(rolling), path)
            }
            _ => self.integrated(false),
        };
        self.run(mover, seed)
    }

    /// The same, but integrated in time in the kinematic limit too: for the comparison of both.
    #[must_use]
    pub fn record_integrated(&self, seed: u64) -> Recorded {
        self.run(self.integrated(true), seed)
    }

    fn integrated(&self, always: bool) -> Mover<'_> {
        let steering = self.manoeuvre.command(&self.chassis, 0.0).steering;
        let plant = Plant::new(&self.chassis, &self.physics, self.start, steering);
        let plant = if always { plant.with_integration() } else { plant };
        let actuators = &self.physics.actuators;
        let delays = [actuators.speed_delay, actuators.steering_delay];
        let kinks = self.manoeuvre.kinks();
        let delayed = |kink: f64| delays.map(|delay| kink + delay);
        let mut kinks: Vec<_> = match self.manoeuvre.course() {
            Course::Path(_) => kinks.into_iter().flat_map(delayed).collect(),
            // The plant delays the commands that it is given.
            Course::Commands { .. } => kinks,
        };
        kinks.sort_by(f64::total_cmp);
        kinks.reverse();
        Mover::Integrated(Box::new(plant), kinks)
    }

    fn run(&self, mut mover: Mover<'_>, seed: u64) -> Recorded {
        let mut instruments = Instruments::new(&self.chassis, &self.sensors, &self.slips, seed);
        let sensors = &self.sensors;
        let rates = [
            Some(sensors.encoders.as_ref().map_or(RATE, |encoders| encoders.rate)),
            sensors.steering.map(|sensor| sensor.rate),
            sensors.gyro.map(|gyro| gyro.rate),
            sensors.reference.map(|reference| reference.rate),
        ];
        let mut due = rates.map(|rate| Ticks { rate: rate.unwrap_or(0.0), count: 0.0 });
        let (mut recorded, end) = (Recorded::default(), self.manoeuvre.duration());
        loop {
            let time = due.iter().map(Ticks::next).fold(f64::INFINITY, f64::min);
            // A last reading that rounding puts behind the end is still one of this drive.
            if time > end * (1.0 + f64::EPSILON) {
                return recorded;
            }
            let state = self.advance(&mut mover, time);
            if due[0].take(time) {
                self.take_counts(&state, &mut instruments, &mut recorded);
            }
            if due[1].take(time) {
                recorded.steering.extend(stamped(time, instruments.steering(&state)));
            }
            if due[2].take(time) {
                recorded.yaw_rate.extend(stamped(time, instruments.yaw_rate(&state)));
            }
            if due[3].take(time) {
                let seen = instruments.reference(&state);
                recorded.reference.extend(seen.map(|(time, value)| Stamped { time, value }));
            }
        }
    }

    fn take_counts(&self, state: &State, instruments: &mut Instruments, recorded: &mut Recorded) {
        let time = state.time;
        recorded.truth.push(*state);
        let value = self.manoeuvre.command(&self.chassis, time);
        recorded.commands.push(Stamped { time, value });
        if self.sensors.encoders.is_some() {
            recorded.counts.push(Stamped { time, value: instruments.counts(state) });
        }
    }

    /// Truth at `time` \[s\].
    fn advance(&self, mover: &mut Mover<'_>, time: f64) -> State {
        match mover {
            Mover::Exact(rolling, path) => {
                rolling.advance(path, time);
                *rolling.state()
            }
            Mover::Integrated(plant, kinks) => {
                while plant.state().time < time {
                    while kinks.last().is_some_and(|kink| *kink <= plant.state().time) {
                        kinks.pop();
                    }
                    let until = kinks.last().map_or(time, |kink| kink.min(time));
                    self.integrate(plant, until);
                }
                State { time, ..*plant.state() }
            }
        }
    }

    /// Drives on to `until` \[s\], without a kink in between.
    fn integrate(&self, plant: &mut Plant, until: f64) {
        let now = plant.state().time;
        match self.manoeuvre.course() {
            Course::Path(_) => {
                plant.follow(until, |time| self.manoeuvre.setpoint(&self.chassis, time));
            }
            Course::Commands { .. } => {
                plant.step(until - now, self.manoeuvre.command(&self.chassis, now));
            }
        }
    }
}

/// Readings at a rate, from 0 on.
struct Ticks {
    /// \[Hz\]; 0 never.
    rate: f64,
    count: f64,
}

impl Ticks {
    fn next(&self) -> f64 {
        if self.rate > 0.0 { self.count / self.rate } else { f64::INFINITY }
    }

    fn take(&mut self, time: f64) -> bool {
        let due = self.next() <= time;
        self.count += f64::from(u8::from(due));
        due
    }
}

fn stamped(time: f64, value: Option<f64>) -> Option<Stamped<f64>> {
    value.map(|value| Stamped { time, value })
}
