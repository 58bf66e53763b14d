//! A drive: what truly happens.

use kerbside_geometry::Pose;

use crate::chassis::Chassis;
use crate::manoeuvre::{Course, Manoeuvre, Path};
use crate::physics::Physics;
use crate::plant::{Plant, State};
use crate::record::{Driven, Moment, Recorded};
use crate::rolling::Rolling;
use crate::sensors::{Sensors, Slip};

/// Truth and commands are recorded so often where there are no encoders \[Hz\].
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

    /// Drives once and reads the sensors, whose errors `seed` draws. Many seeds of one drive are cheaper through
    /// [`TestDrive::driven`].
    #[must_use]
    pub fn record(&self, seed: u64) -> Recorded {
        self.driven().record(seed)
    }

    /// Drives once; a manoeuvre that never ends is not driven at all. In the kinematic limit a path is covered exactly, without integration in time.
    #[must_use]
    pub fn driven(&self) -> Driven<'_> {
        self.run(match self.manoeuvre.course() {
            Course::Path(path) if self.physics.is_neutral() => {
                let rolling = Rolling::new(&self.chassis, path, self.start);
                Mover::Exact(Box::new(rolling), path)
            }
            _ => self.integrated(false),
        })
    }

    /// The same, but integrated in time in the kinematic limit too: for the comparison of both.
    #[must_use]
    pub fn driven_integrated(&self) -> Driven<'_> {
        self.run(self.integrated(true))
    }

    fn integrated(&self, always: bool) -> Mover<'_> {
        // A path begins with its wheels turned; commands find them straight.
        let steering = match self.manoeuvre.course() {
            Course::Path(_) => self.manoeuvre.command(&self.chassis, 0.0).steering,
            Course::Commands { .. } => 0.0,
        };
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

    fn run(&self, mut mover: Mover<'_>) -> Driven<'_> {
        let sensors = &self.sensors;
        let rates = [
            Some(sensors.encoders.as_ref().map_or(RATE, |encoders| encoders.rate)),
            sensors.steering.map(|sensor| sensor.rate),
            sensors.gyro.map(|gyro| gyro.rate),
            sensors.reference.map(|reference| reference.rate),
        ];
        let mut ticks = rates.map(|rate| Ticks { rate: rate.unwrap_or(0.0), count: 0.0 });
        let (mut moments, end) = (Vec::new(), self.manoeuvre.duration());
        loop {
            let time = ticks.iter().map(Ticks::next).fold(f64::INFINITY, f64::min);
            // A last reading that rounding puts behind the end is still one of this drive.
            if !end.is_finite() || time > end * (1.0 + f64::EPSILON) {
                return Driven { drive: self, moments };
            }
            let state = self.advance(&mut mover, time);
            let due = ticks.each_mut().map(|ticks| ticks.take(time));
            moments.push(Moment { state, due });
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
