//! A kinematic car on paper: exact Ackermann rolling, noisy sensors, known truth. SI units, radians.

#![allow(dead_code, unreachable_pub)] // every user takes a part

use core::f64::consts::{PI, TAU};

use kerbside_calibration::{
    Noise, Parameter, Parameters, ReferencePose, Run, Series, Settings, Vector,
};
use kerbside_geometry::{Pose, Vehicle};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Counts of a wheel's turn, and seconds between readings: those of all the project's simulations of the paper.
pub const COUNTS: f64 = 2000.0;
pub const STEP: f64 = 0.02;
/// Driving speed \[m/s\] and acceleration \[m/s^2\].
const SPEED: f64 = 0.25;
const ACCELERATION: f64 = 0.1;

/// Normal deviates (Marsaglia's polar method).
pub struct Normal {
    generator: Pcg64,
}

impl Normal {
    pub fn new(seed: u64) -> Self {
        Self { generator: Pcg64::seed_from_u64(seed) }
    }

    pub fn uniform(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 * 0.5_f64.powi(53)
    }

    pub fn sample(&mut self) -> f64 {
        loop {
            let (u, v) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let square = u * u + v * v;
            if square > 0.0 && square < 1.0 {
                return u * (-2.0 * square.ln() / square).sqrt();
            }
        }
    }
}

/// The car that drives, and how its sensors err.
#[derive(Clone, Debug)]
pub struct Car {
    pub truth: Parameters,
    /// Of a wheel's travel \[m/sqrt(m)\].
    pub wheel: f64,
    /// Of the steering sensor \[rad\].
    pub steering: f64,
    /// Of the reference's position \[m\] and yaw \[rad\].
    pub reference: (f64, f64),
    /// Seconds between readings of the reference; none: only start and end.
    pub track: Option<f64>,
    /// Reference stamps are late by this \[s\].
    pub reference_late: f64,
    pub has_steering: bool,
    pub wheels: [bool; 4],
}

/// Tables 1 and 2 as truth, the wheelbase as chosen in docs/reproduction.md.
pub fn tables() -> Parameters {
    let mut truth = Parameters::nominal(&nominal());
    for (index, value) in
        [0.07097, 0.07114, 0.069515, 0.069605, 0.285, 0.292, 0.5, 0.0, 1.0].into_iter().enumerate()
    {
        truth.values[index] = value;
    }
    truth
}

/// The paper's car as believed: 145 mm wheels, 310 mm tracks.
pub fn nominal() -> Vehicle {
    Vehicle::paper_car()
}

impl Car {
    pub fn new(position: f64, yaw: f64) -> Self {
        Self {
            truth: tables(),
            wheel: 0.001,
            steering: 0.2_f64.to_radians(),
            reference: (position, yaw),
            track: None,
            reference_late: 0.0,
            has_steering: true,
            wheels: [true; 4],
        }
    }

    /// Settings whose beliefs are the car's noise.
    pub fn settings(&self) -> Settings {
        let vehicle = nominal();
        let mut settings = Settings::of(&vehicle);
        settings.noise = Noise {
            wheel: self.wheel,
            quantum: vehicle.radius.map(|radius| TAU * radius / COUNTS),
            steering: self.steering,
            position: self.reference.0,
            yaw: self.reference.1,
            ..settings.noise
        };
        settings
    }

    /// Drives `legs` (reading of the steering sensor \[rad\], signed distance \[m\]), steering at standstill before
    /// each. The driver trusts the sensor: its zero error bends what should be straight.
    pub fn drive(&self, name: &str, manoeuvre: &str, legs: &[(f64, f64)], seed: u64) -> Run {
        let mut drive = Drive::new(self, seed);
        drive.stand(0.5);
        for (steering, distance) in legs {
            drive.leg(self.truth.road_angle(*steering), *distance);
        }
        drive.stand(0.5);
        drive.finish(name, manoeuvre)
    }

    pub fn straight(&self, name: &str, length: f64, seed: u64) -> Run {
        self.drive(name, "straight", &[(0.0, length)], seed)
    }

    /// A circle of `radius` \[m\], negative to the right, over `turn` \[rad\].
    pub fn circle(&self, name: &str, radius: f64, turn: f64, seed: u64) -> Run {
        let steering = (self.truth.get(Parameter::Wheelbase) / radius).atan();
        self.drive(name, "circle", &[(steering, radius.abs() * turn)], seed)
    }

    /// The plan of the acceptance rows: straights of 5 m and full circles of 1.5 m to both sides, as many of each.
    pub fn plan(&self, count: usize, seed: u64) -> Vec<Run> {
        let straight =
            |i: usize| self.straight(&format!("straight-{i}"), 5.0, seed * 1000 + i as u64);
        let circle = |i: usize| {
            let radius = if i.is_multiple_of(2) { 1.5 } else { -1.5 };
            self.circle(&format!("circle-{i}"), radius, TAU, seed * 1000 + 500 + i as u64)
        };
        (0..count).map(straight).chain((0..count).map(circle)).collect()
    }
}

struct Drive<'a> {
    car: &'a Car,
    normal: Normal,
    pose: Pose,
    t: f64,
    travel: [f64; 4],
    phase: [f64; 4],
    stamps: Vec<f64>,
    counts: [Vec<f64>; 4],
    steering: Vec<f64>,
    poses: Vec<(f64, Pose)>,
    last_steering: f64,
}

impl<'a> Drive<'a> {
    fn new(car: &'a Car, seed: u64) -> Self {
        let mut normal = Normal::new(seed);
        let pose = Pose::new(normal.uniform() * 4.0, normal.uniform() * 4.0, PI * normal.uniform());
        let phase = core::array::from_fn(|_| normal.uniform());
        let mut drive = Self {
            car,
            normal,
            pose,
            t: 0.0,
            travel: [0.0; 4],
            phase,
            stamps: Vec::new(),
            counts: Default::default(),
            steering: Vec::new(),
            poses: Vec::new(),
            last_steering: 0.0,
        };
        drive.read();
        drive
    }

    fn read(&mut self) {
        let truth = &self.car.truth.values;
        self.stamps.push(self.t);
        for wheel in 0..4 {
            let turns = self.travel[wheel] / truth[wheel] / TAU * COUNTS;
            self.counts[wheel].push((turns + self.phase[wheel]).floor());
        }
        let noise = self.car.steering * self.normal.sample();
        self.steering.push(truth[8] * self.last_steering + truth[7] + noise);
        self.poses.push((self.t, self.pose));
    }

    fn roll(&mut self, steering: f64, distance: f64) {
        let truth = &self.car.truth.values;
        let (front, rear, base) = (truth[4], truth[5], truth[6]);
        let turn = distance * steering.tan() / base;
        for (wheel, side) in [1.0, -1.0, 1.0, -1.0].into_iter().enumerate() {
            let half = 0.5 * if wheel < 2 { front } else { rear };
            let along = distance - side * half * turn;
            let across = if wheel < 2 { base * turn } else { 0.0 };
            let travel = along.hypot(across).copysign(along);
            let noise = self.car.wheel * travel.abs().sqrt() * self.normal.sample();
            self.travel[wheel] += travel + noise;
        }
        self.pose = self.pose.advance(distance, turn);
        self.last_steering = steering;
        self.t += STEP;
        self.read();
    }

    fn stand(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP) as usize {
            self.roll(self.last_steering, 0.0);
        }
    }

    fn leg(&mut self, steering: f64, distance: f64) {
        let before = self.last_steering;
        for share in 1..=20 {
            self.roll(before + (steering - before) * f64::from(share) / 20.0, 0.0);
        }
        let (mut gone, mut speed) = (0.0, 0.0_f64);
        let whole = distance.abs();
        while gone < whole {
            let braking = (2.0 * ACCELERATION * (whole - gone)).sqrt();
            speed = (speed + ACCELERATION * STEP).min(SPEED).min(braking).max(0.002);
            let step = (speed * STEP).min(whole - gone);
            gone = if whole - gone <= step { whole } else { gone + step };
            self.roll(steering, step.copysign(distance));
        }
    }

    fn finish(mut self, name: &str, manoeuvre: &str) -> Run {
        let last = self.poses.len() - 1;
        let mut kept = vec![0];
        if let Some(every) = self.car.track {
            let stride = (every / STEP).round() as usize;
            kept.extend((stride..last).step_by(stride));
        }
        kept.push(last);
        let (position, yaw) = self.car.reference;
        let mut reference = Vec::new();
        for index in kept {
            let (t, pose) = self.poses[index];
            reference.push(ReferencePose {
                t: t + self.car.reference_late,
                x: pose.x + position * self.normal.sample(),
                y: pose.y + position * self.normal.sample(),
                yaw: Some(kerbside_geometry::angle::wrap(pose.yaw + yaw * self.normal.sample())),
            });
        }
        let stamps = &self.stamps;
        let rotation = core::array::from_fn(|wheel| {
            let counts = &self.counts[wheel];
            self.car.wheels[wheel].then(|| Series::from_counts(stamps.clone(), counts, COUNTS))
        });
        let steering = Series { t: self.stamps.clone(), value: self.steering };
        Run {
            name: name.to_owned(),
            manoeuvre: manoeuvre.to_owned(),
            rotation,
            steering: self.car.has_steering.then_some(steering),
            reference,
            ..Run::default()
        }
    }
}

/// Errors of many estimates.
#[derive(Default)]
pub struct Errors {
    count: f64,
    sum: [f64; 9],
    squares: [f64; 9],
    covered: [f64; 9],
    worst: [f64; 9],
    worst_epsilon: [f64; 2],
}

impl Errors {
    /// Adds an estimate and the standard deviations that it states.
    pub fn add(&mut self, found: &Parameters, truth: &Parameters, deviations: &Vector) {
        self.count += 1.0;
        for (worst, front) in self.worst_epsilon.iter_mut().zip([true, false]) {
            *worst = worst.max((found.epsilon(front) - truth.epsilon(front)).abs());
        }
        for i in 0..9 {
            let error = found.values[i] - truth.values[i];
            self.sum[i] += error;
            self.worst[i] = self.worst[i].max(error.abs());
            self.squares[i] += error * error;
            self.covered[i] += f64::from(u8::from(error.abs() <= 1.96 * deviations[i]));
        }
    }

    /// Largest error.
    pub fn worst(&self, i: usize) -> f64 {
        self.worst[i]
    }

    /// Largest error of the front and of the rear epsilon \[m\].
    pub fn worst_epsilon(&self) -> [f64; 2] {
        self.worst_epsilon
    }

    pub fn bias(&self, i: usize) -> f64 {
        self.sum[i] / self.count
    }

    pub fn rms(&self, i: usize) -> f64 {
        (self.squares[i] / self.count).sqrt()
    }

    pub fn covered(&self, i: usize) -> f64 {
        self.covered[i] / self.count
    }
}
