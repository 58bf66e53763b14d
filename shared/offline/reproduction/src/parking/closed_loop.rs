//! The closed loop: vehicle, sensors, estimator, tracker.

use kerbside_geometry::Pose;
use kerbside_messages::{Command as Asked, Mode, Nanos, Permit, TrackingPhase};
use kerbside_proving_ground::{Chassis, Command, Instruments, Plant};
use kerbside_tracking::{Tracker, TrackerInputs, TrackerSettings};

use super::driver::Setting;
use super::plan::Given;
use super::{ARM, RATE, WAIT};
use crate::error::ReproductionError;
use crate::follower::{Follower, reading};

/// Longest drive beyond the plan's duration \[s\].
const LONGEST: f64 = 10.0;

/// The closed loop.
pub(super) struct Loop<'a> {
    pub(super) plant: Plant,
    instruments: Instruments,
    follower: Follower,
    tracker: Tracker,
    given: &'a Given,
    perfect: bool,
    mode: Mode,
    command: Asked,
    frame: u32,
}

impl<'a> Loop<'a> {
    pub(super) fn new(
        setting: &Setting,
        given: &'a Given,
        seed: u64,
    ) -> Result<Self, ReproductionError> {
        let chassis = Chassis::paper();
        let start = setting.belief.start;
        Ok(Self {
            plant: Plant::new(&chassis, &setting.physics, start, 0.0),
            instruments: Instruments::new(&chassis, &setting.sensors, &setting.slips, seed),
            follower: Follower::new(setting.contender, &setting.belief)?,
            tracker: Tracker::new(&setting.vehicle, &TrackerSettings::default()),
            given,
            perfect: setting.perfect,
            mode: Mode::Armed,
            command: Asked::default(),
            frame: 0,
        })
    }

    /// A period: drive, read, estimate, track. Whether the tracker is through.
    fn step(&mut self) -> bool {
        let asked = Command { speed: self.command.speed, steering: self.command.steering };
        self.frame += 1;
        let until = f64::from(self.frame) / RATE;
        let duration = until - self.plant.state().time;
        let state = *self.plant.step(duration, asked);
        let counts = self.instruments.counts(&state).unwrap_or_default();
        let steering = self.instruments.steering(&state);
        self.follower.feed(&reading(state.time, self.frame, &counts, steering));
        let mut odometry = self.follower.odometry;
        if self.perfect {
            (odometry.x, odometry.y, odometry.yaw) = (state.pose.x, state.pose.y, state.pose.yaw);
        }
        if state.time < WAIT {
            return false;
        }
        let now: Nanos = odometry.header.stamp;
        let permit = Permit {
            arm: ARM,
            expiry: now + 1_000_000_000,
            mode: self.mode.code(),
            granted: 1,
            ..Permit::default()
        };
        let inputs = TrackerInputs {
            odometry: &odometry,
            plan: Some((&self.given.head, &self.given.points)),
            permit: Some(&permit),
            now,
        };
        if self.tracker.step(inputs, &mut self.command) {
            self.mode = Mode::Driving;
        }
        self.mode == Mode::Driving && self.command.phase != TrackingPhase::Tracking.code()
    }

    /// Until it is through and at rest, or too late; whether it arrived. `path` takes the truth.
    pub(super) fn run(&mut self, mut path: Option<&mut Vec<Pose>>) -> bool {
        let longest = (WAIT + self.given.head.duration + LONGEST) * RATE;
        while f64::from(self.frame) < longest {
            let through = self.step();
            if let Some(path) = path.as_deref_mut() {
                path.push(self.plant.state().pose);
            }
            if through {
                // What the actuators still do.
                (0..50).for_each(|_| {
                    self.step();
                });
                break;
            }
        }
        self.command.phase == TrackingPhase::Finished.code()
    }
}
