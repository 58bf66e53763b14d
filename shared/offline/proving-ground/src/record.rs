//! What is recorded of a drive.

use kerbside_geometry::Pose;

use crate::actuators::Command;
use crate::drive::TestDrive;
use crate::instruments::Instruments;
use crate::plant::State;
use crate::sensors::{Sensors, Slip};

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

/// Truth when something is read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    pub state: State,
    /// Whether encoders, steering sensor, gyro and reference are read now.
    pub due: [bool; 4],
}

/// A drive that was driven, and can be recorded with many seeds.
#[derive(Clone, Debug)]
pub struct Driven<'a> {
    pub(crate) drive: &'a TestDrive,
    pub(crate) moments: Vec<Moment>,
}

impl Driven<'_> {
    /// What the sensors made of it, their errors drawn by `seed`.
    #[must_use]
    pub fn record(&self, seed: u64) -> Recorded {
        self.record_with(&self.drive.sensors, &self.drive.slips, seed)
    }

    /// What other sensors, read at the same times, or other slips would have made of it. A sensor that the drive had not
    /// got is not read.
    #[must_use]
    pub fn record_with(&self, sensors: &Sensors, slips: &[Slip], seed: u64) -> Recorded {
        let mut instruments = Instruments::new(&self.drive.chassis, sensors, slips, seed);
        let mut recorded = Recorded::default();
        for Moment { state, due } in &self.moments {
            let time = state.time;
            if due[0] {
                self.record_counts(state, &mut instruments, &mut recorded);
            }
            if due[1] {
                recorded.steering.extend(stamped(time, instruments.steering(state)));
            }
            if due[2] {
                recorded.yaw_rate.extend(stamped(time, instruments.yaw_rate(state)));
            }
            if due[3] {
                let seen = instruments.reference(state);
                recorded.reference.extend(seen.map(|(time, value)| Stamped { time, value }));
            }
        }
        recorded
    }

    fn record_counts(&self, state: &State, instruments: &mut Instruments, recorded: &mut Recorded) {
        let time = state.time;
        recorded.truth.push(*state);
        let value = self.drive.manoeuvre.command(&self.drive.chassis, time);
        recorded.commands.push(Stamped { time, value });
        if let Some(value) = instruments.counts(state) {
            recorded.counts.push(Stamped { time, value });
        }
    }
}

fn stamped(time: f64, value: Option<f64>) -> Option<Stamped<f64>> {
    value.map(|value| Stamped { time, value })
}
