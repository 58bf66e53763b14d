//! Many drives along one path, each with its own noise and its own errors of the vehicle's numbers:
//! what a filter's end errors and covariances are worth.
//!
//! Kinematic: the wheels roll without slip, but for a spin that is asked for. Wheel travel has
//! Gaussian noise of variance k^2 per metre, counts are whole, the steering angle is read at the
//! end of each period with white noise. Truth is an arc per period.

use kerbside_geometry::{Pose, Vehicle, WHEELS};
use kerbside_messages::{Header, Raw, WheelUse};
use kerbside_odometry::{
    Estimator, EstimatorSettings, Filter, PARAMETERS, ParameterPrior, Sensors,
};
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

use super::{Chain, placed};

/// Standard deviation of the steering angle: 0.2 degrees.
pub(crate) const STEERING_NOISE: f64 = 0.2 * core::f64::consts::PI / 180.0;

/// Noise of the rear wheels \[m/sqrt(m)\].
pub(crate) const NOISE: f64 = 0.001;

/// A period of the path: signed distance, curvature in its middle and at its end \[m, 1/m\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leg {
    pub(crate) distance: f64,
    pub(crate) middle: f64,
    pub(crate) end: f64,
}

/// Residuals of a calibration as the filter expects them: radii 0.05 %, tracks 1 mm, wheelbase 2
/// mm, steering zero 0.3 degrees.
pub(crate) fn residuals() -> [f64; PARAMETERS] {
    let zero = 0.3 * core::f64::consts::PI / 180.0;
    [5e-4, 5e-4, 5e-4, 5e-4, 1e-3, 1e-3, 2e-3, zero, 0.0]
}

/// A spin of some wheels: share of the path at which it begins, travel of each wheel \[m\] over 0.3
/// s.
pub(crate) type Spin = Option<(f64, [f64; 4])>;

/// What is run.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) filter: Filter,
    pub(crate) sensors: Sensors,
    /// Variance of the front wheels' noise over that of the rear ones'.
    pub(crate) front: f64,
    /// Standard deviations of the true parameters, and what the filter believes of them.
    pub(crate) drawn: [f64; PARAMETERS],
    pub(crate) believed: [f64; PARAMETERS],
    pub(crate) spin: Spin,
    /// A wheel whose counter stands still.
    pub(crate) dead: Option<usize>,
    pub(crate) seed: u64,
    pub(crate) trials: u64,
    /// Readings a second \[Hz\].
    pub(crate) rate: f64,
}

impl Case {
    /// Known parameters, four wheels, steering, 50 Hz.
    pub(crate) fn new(filter: Filter, front: f64, trials: u64) -> Self {
        let seed = 20_240 + (100.0 * front) as u64;
        let sensors = super::sensors([true; 4], true, false);
        let none = [0.0; PARAMETERS];
        Self {
            filter,
            sensors,
            front,
            drawn: none,
            believed: none,
            spin: None,
            dead: None,
            seed,
            trials,
            rate: 50.0,
        }
    }

    /// With the residuals of a calibration, as believed.
    pub(crate) fn residual(self) -> Self {
        Self { drawn: residuals(), believed: residuals(), ..self }
    }
}

/// What came out: errors at the end.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outcome {
    pub(crate) errors: Vec<Vector3<f64>>,
    pub(crate) nees: Vec<f64>,
    pub(crate) flagged: u64,
    pub(crate) corrections: u64,
    pub(crate) gated: u64,
}

impl Outcome {
    /// Sum of the variances of x and y \[m^2\].
    pub(crate) fn variance(&self) -> f64 {
        let count = self.errors.len() as f64;
        let mean = self.errors.iter().sum::<Vector3<f64>>() / count;
        let square = |error: &Vector3<f64>| (error - mean).xy().norm_squared();
        self.errors.iter().map(square).sum::<f64>() / count
    }

    /// Mean length of the position's error \[m\].
    pub(crate) fn mean(&self) -> f64 {
        self.errors.iter().map(|error| error.xy().norm()).sum::<f64>() / self.errors.len() as f64
    }

    /// Length of the mean error \[m\].
    pub(crate) fn bias(&self) -> f64 {
        (self.errors.iter().sum::<Vector3<f64>>() / self.errors.len() as f64).xy().norm()
    }

    /// Mean NEES over 3: 1 where the covariance is the truth.
    pub(crate) fn nees(&self) -> f64 {
        self.nees.iter().sum::<f64>() / self.nees.len() as f64 / 3.0
    }

    /// Share of runs in which an axle was said to slip.
    pub(crate) fn flags(&self) -> f64 {
        self.flagged as f64 / self.errors.len() as f64
    }
}

/// The S path, in periods of `period` seconds at up to `top` m/s with 0.1 m/s^2.
pub(crate) fn s_legs(top: f64, period: f64) -> Vec<Leg> {
    let (bend, ramp, quarter) = (1.0 / 1.2, 0.15, core::f64::consts::FRAC_PI_2 * 1.2);
    let pieces =
        [(1.0, 0.0), (quarter - ramp, bend), (0.5, 0.0), (quarter - ramp, -bend), (0.5, 0.0)];
    legs(&super::corners(&pieces, ramp), top, period)
}

/// A straight of `length` metres.
pub(crate) fn straight_legs(length: f64, top: f64, period: f64) -> Vec<Leg> {
    legs(&[(0.0, 0.0), (length, 0.0)], top, period)
}

fn legs(corners: &[(f64, f64)], top: f64, period: f64) -> Vec<Leg> {
    let length = corners.last().unwrap().0;
    let (mut way, mut speed, mut legs) = (0.0, 0.0_f64, Vec::new());
    while way < length - 1e-4 {
        let braking = (0.2 * (length - way)).sqrt();
        speed = (speed + 0.1 * period).min(top).min(braking.max(0.004));
        let distance = speed * period;
        let at = |share: f64| super::curvature(corners, way + share * distance);
        legs.push(Leg { distance, middle: at(0.5), end: at(1.0) });
        way += distance;
    }
    legs
}

/// The same backwards: in reverse from the start.
pub(crate) fn reversed(legs: &[Leg]) -> Vec<Leg> {
    legs.iter().map(|leg| Leg { distance: -leg.distance, ..*leg }).collect()
}

/// Runs a case along `legs`.
pub(crate) fn run(case: &Case, vehicle: &Vehicle, legs: &[Leg]) -> Outcome {
    let mut outcome = Outcome::default();
    let mut vehicle = vehicle.clone();
    if let Some(encoders) = &mut vehicle.encoders {
        encoders.rate = case.rate;
    }
    for trial in 0..case.trials {
        let random = Pcg64::seed_from_u64(case.seed.wrapping_mul(1_000_003) + trial);
        Drive::new(case, &vehicle, random).run(legs, &mut outcome);
    }
    outcome
}

/// One drive.
struct Drive<'a> {
    case: &'a Case,
    /// As the filter believes it, and as it is.
    vehicle: &'a Vehicle,
    true_vehicle: Vehicle,
    zero: f64,
    noise: [f64; 4],
    random: Pcg64,
    truth: Pose,
    rolled: [f64; 4],
    chain: Chain,
    time: u64,
    frame: u32,
}

impl<'a> Drive<'a> {
    fn new(case: &'a Case, vehicle: &'a Vehicle, mut random: Pcg64) -> Self {
        let drawn: [f64; PARAMETERS] =
            case.drawn.map(|deviation| deviation * random.sample::<f64, _>(StandardNormal));
        let mut true_vehicle = vehicle.clone();
        (0..4).for_each(|wheel| true_vehicle.radius[wheel] *= 1.0 + drawn[wheel]);
        true_vehicle.track_front += drawn[4];
        true_vehicle.track_rear += drawn[5];
        true_vehicle.wheelbase += drawn[6];
        let front = NOISE * case.front.sqrt();
        let noise = [front, front, NOISE, NOISE];
        let settings =
            EstimatorSettings { filter: case.filter, steering_noise: STEERING_NOISE, ..placed() };
        let mut prior = ParameterPrior::independent(case.believed);
        prior.wheel_noise = Some(noise);
        let mut chain = Chain::with(vehicle, &case.sensors, &settings);
        chain.estimator = Estimator::with_prior(vehicle, &case.sensors, &settings, &prior).unwrap();
        let rolled = core::array::from_fn(|_| random.random_range(0.0..0.01));
        Self {
            case,
            vehicle,
            true_vehicle,
            zero: drawn[7],
            noise,
            random,
            truth: Pose::default(),
            rolled,
            chain,
            time: 5_000_000_000,
            frame: 1,
        }
    }

    fn run(mut self, legs: &[Leg], outcome: &mut Outcome) {
        let mut flagged = false;
        let period = 1.0 / self.case.rate;
        let spin = self.case.spin.map(|(share, travel)| {
            let first = (share * legs.len() as f64) as usize;
            let count = (0.3 / period).round();
            (first..first + count as usize, travel.map(|travel| travel / count))
        });
        self.read(0.0);
        for (index, leg) in legs.iter().enumerate() {
            self.roll(leg);
            if let Some((_, travel)) = spin.as_ref().filter(|(when, _)| when.contains(&index)) {
                (0..4).for_each(|wheel| self.rolled[wheel] += travel[wheel]);
            }
            self.time += (period * 1e9) as u64;
            self.read(leg.end);
            flagged |= self.chain.odometry.wheel_use.contains(&WheelUse::Slipping.code());
        }
        self.conclude(flagged, outcome);
    }

    fn roll(&mut self, leg: &Leg) {
        for wheel in WHEELS {
            let (x, y) = self.true_vehicle.wheel_position(wheel);
            let clean = leg.distance * (1.0 - y * leg.middle).hypot(x * leg.middle);
            let random: f64 = self.random.sample(StandardNormal);
            let index = wheel.index();
            if self.case.dead != Some(index) {
                self.rolled[index] += clean + random * self.noise[index] * clean.abs().sqrt();
            }
        }
        self.truth = self.truth.advance(leg.distance, leg.distance * leg.middle);
    }

    fn read(&mut self, curvature: f64) {
        let angle = (curvature * self.true_vehicle.wheelbase).atan();
        let random: f64 = self.random.sample(StandardNormal);
        let per_turn = self.vehicle.encoders.unwrap().counts_per_revolution;
        let counts = core::array::from_fn(|wheel| {
            let turns =
                self.rolled[wheel] / (core::f64::consts::TAU * self.true_vehicle.radius[wheel]);
            (turns * per_turn[wheel].unwrap()).floor() as i64
        });
        self.frame += 1;
        let raw = Raw {
            header: Header::stamped(self.time, 0),
            vehicle_time: self.time,
            arrival: self.time,
            counts,
            steering: angle + self.zero + STEERING_NOISE * random,
            boot: 77,
            frame: self.frame,
            counts_mask: 0xf,
            has_steering: 1,
            ..Raw::default()
        };
        self.chain.feed(&raw);
    }

    fn conclude(self, flagged: bool, outcome: &mut Outcome) {
        let odometry = self.chain.odometry;
        let error = Vector3::new(
            odometry.x - self.truth.x,
            odometry.y - self.truth.y,
            odometry.yaw - self.truth.yaw,
        );
        let inverse = Matrix3::from_row_slice(&odometry.covariance).try_inverse();
        let nees = inverse.map_or(f64::INFINITY, |inverse| error.dot(&(inverse * error)));
        outcome.errors.push(error);
        outcome.nees.push(nees);
        outcome.flagged += u64::from(flagged);
        outcome.corrections += u64::from(odometry.corrections);
        outcome.gated += u64::from(odometry.gated);
    }
}
