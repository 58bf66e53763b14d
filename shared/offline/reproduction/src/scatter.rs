//! Many drives of one course, each with its own noise: where every contender believes to be.

use kerbside_geometry::Pose;
use kerbside_messages::{Odometry, WheelUse};
use kerbside_proving_ground::{
    Chassis, Driven, Manoeuvre, Physics, Recorded, Sensors, Slip, TestDrive,
};
use nalgebra::{Matrix3, Vector3};

use crate::error::ReproductionError;
use crate::follower::{Belief, Contender, Follower, readings};
use crate::progress::Progress;
use crate::random::seed_of;

/// What is driven, many times.
#[derive(Debug)]
pub(crate) struct Course<'a> {
    pub(crate) driven: &'a Driven<'a>,
    pub(crate) sensors: &'a Sensors,
    pub(crate) slips: &'a [Slip],
    /// Distances at which errors are taken, beside the end \[m\].
    pub(crate) stations: &'a [f64],
    /// Seed and number of the case.
    pub(crate) seed: (u64, u64),
    pub(crate) trials: usize,
}

/// What is true and what is believed in one trial.
#[derive(Debug)]
pub(crate) struct Trial {
    pub(crate) belief: Belief,
    /// Added to what the steering sensor reads \[rad\].
    pub(crate) steering_zero: f64,
}

/// Errors of one contender.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// Whose.
    pub contender: Contender,
    /// Estimate minus truth (x, y, yaw) per station and trial, the end last \[m, m, rad\].
    pub errors: Vec<Vec<[f64; 3]>>,
    /// Their normalised squares (NEES); 3 on average where the covariance is the truth.
    pub nees: Vec<Vec<f64>>,
    /// Per trial: whether a wheel of the front axle, and of the rear axle, was said to slip.
    pub flagged: Vec<[bool; 2]>,
    /// Per trial: mean of what the sensors disagree on, squared and per degree of freedom; 1 where they err as believed.
    pub disagreement: Vec<f64>,
    /// Travel per step of the first trial, for figures: estimate at each reading.
    pub path: Vec<Pose>,
}

impl Spread {
    fn new(contender: Contender, stations: usize) -> Self {
        let none = || (0..=stations).map(|_| Vec::new()).collect();
        Self {
            contender,
            errors: none(),
            nees: (0..=stations).map(|_| Vec::new()).collect(),
            flagged: Vec::new(),
            disagreement: Vec::new(),
            path: Vec::new(),
        }
    }

    /// Errors at the end.
    #[must_use]
    pub fn end(&self) -> &[[f64; 3]] {
        self.errors.last().map_or(&[], Vec::as_slice)
    }

    /// NEES at the end.
    #[must_use]
    pub fn end_nees(&self) -> &[f64] {
        self.nees.last().map_or(&[], Vec::as_slice)
    }

    /// In how many drives a wheel was said to slip.
    #[must_use]
    pub fn flags(&self) -> usize {
        self.flagged.iter().filter(|axles| axles.contains(&true)).count()
    }

    /// Mean NEES at the end over 3.
    #[must_use]
    pub fn nees_share(&self) -> f64 {
        crate::statistics::mean(self.end_nees().iter().copied()) / 3.0
    }
}

/// A drive of the car without errors of its own.
pub(crate) fn drive(physics: Physics, sensors: &Sensors, manoeuvre: Manoeuvre) -> TestDrive {
    TestDrive::new(Chassis::paper(), physics, sensors.clone(), manoeuvre)
}

/// Drives `course` and lets every one of `contenders` follow; `trial` says what is true and believed in each trial.
pub(crate) fn scatter(
    course: &Course<'_>,
    contenders: &[Contender],
    trial: &dyn Fn(u64) -> Trial,
    progress: &mut Progress<'_>,
) -> Result<Vec<Spread>, ReproductionError> {
    let mut spreads: Vec<Spread> =
        contenders.iter().map(|contender| Spread::new(*contender, course.stations.len())).collect();
    for number in 0..course.trials {
        let seed = seed_of(course.seed.0, course.seed.1, number as u64);
        let Trial { belief, steering_zero } = trial(seed);
        let mut sensors = course.sensors.clone();
        if let Some(steering) = &mut sensors.steering {
            steering.offset += steering_zero;
        }
        let recorded = course.driven.record_with(&sensors, course.slips, seed);
        let raws = readings(&recorded);
        let stops = stops(&recorded, course.stations);
        for spread in &mut spreads {
            let mut follower = Follower::new(spread.contender, &belief)?;
            let mut watch = Watch::default();
            for (index, raw) in raws.iter().enumerate() {
                watch.see(follower.feed(raw));
                for station in stops.iter().enumerate().filter(|stop| *stop.1 == index) {
                    take(spread, station.0, &follower, &recorded.truth[index].pose);
                }
                if number == 0 {
                    spread.path.push(follower.pose());
                }
            }
            spread.flagged.push(watch.flagged);
            spread.disagreement.push(watch.ratio / watch.blocks.max(1.0));
        }
        progress.step()?;
    }
    Ok(spreads)
}

/// Reading at which each station is passed, and the last one.
fn stops(recorded: &Recorded, stations: &[f64]) -> Vec<usize> {
    let last = recorded.counts.len().saturating_sub(1);
    let passed = |station: &f64| {
        let index = recorded.truth.partition_point(|state| state.distance < *station);
        index.min(last)
    };
    stations.iter().map(passed).chain([last]).collect()
}

fn take(spread: &mut Spread, station: usize, follower: &Follower, truth: &Pose) {
    let estimate = follower.pose();
    let error = [estimate.x - truth.x, estimate.y - truth.y, estimate.yaw - truth.yaw];
    let vector = Vector3::from(error);
    let inverse = Matrix3::from_row_slice(&follower.odometry.covariance).try_inverse();
    let nees = inverse.map_or(f64::INFINITY, |inverse| vector.dot(&(inverse * vector)));
    let usable = follower.is_valid() && nees.is_finite();
    spread.errors[station].push(error);
    spread.nees[station].push(if usable { nees } else { f64::INFINITY });
}

/// What the estimator says of its sensors on the way.
#[derive(Debug, Default)]
struct Watch {
    flagged: [bool; 2],
    before: f64,
    ratio: f64,
    blocks: f64,
}

impl Watch {
    fn see(&mut self, odometry: &Odometry) {
        let refused = [WheelUse::Slipping.code(), WheelUse::Gated.code()];
        for (axle, flagged) in self.flagged.iter_mut().enumerate() {
            let wheels = &odometry.wheel_use[2 * axle..2 * axle + 2];
            *flagged |= wheels.iter().any(|code| refused.contains(code));
        }
        // A block's ratio stands until the next block closes.
        if odometry.block_ratio != self.before && odometry.block_ratio > 0.0 {
            self.before = odometry.block_ratio;
            self.ratio += odometry.block_ratio;
            self.blocks += 1.0;
        }
    }
}
