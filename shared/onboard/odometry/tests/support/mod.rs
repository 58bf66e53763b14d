//! A car that rolls without slip, and its readings.

#![allow(dead_code)] // Each test takes what it needs.
#![allow(clippy::unwrap_used)] // Helpers of tests are tests.

pub(crate) mod scatter;

use kerbside_geometry::{Encoders, Gyro, Limits, Pose, Vehicle, WHEELS};
use kerbside_messages::{Header, Odometry, Raw, Travel};
use kerbside_odometry::{
    Estimator, EstimatorInputs, EstimatorSettings, Ingest, IngestSettings, Sensors, WheelSignal,
};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// The 1:6 car of the paper with the wheels and tracks of its Tables 1 and 2, and 2000 counts
/// a turn.
pub(crate) fn car() -> Vehicle {
    Vehicle {
        track_front: 0.285,
        track_rear: 0.292,
        radius: [0.07097, 0.07114, 0.069515, 0.069605],
        limits: Limits { steering: 0.6109, ..Vehicle::paper_car().limits },
        actuators: None,
        encoders: Some(Encoders {
            counts_per_revolution: [Some(2000.0); 4],
            counter_bits: 32,
            noise_per_distance: None,
            rate: 200.0,
        }),
        gyro: Some(Gyro { noise: 0.003, rate: 200.0, bias: 0.0 }),
        reference: None,
        ..Vehicle::paper_car()
    }
}

/// The same with counts so fine that they do not show.
pub(crate) fn fine_car(counter_bits: u32) -> Vehicle {
    let mut vehicle = car();
    if let Some(encoders) = &mut vehicle.encoders {
        encoders.counts_per_revolution = [Some(2e8); 4];
        encoders.counter_bits = counter_bits;
    }
    vehicle
}

/// The car on its way: truth, wheels, clock.
pub(crate) struct Car {
    pub(crate) vehicle: Vehicle,
    pub(crate) truth: Pose,
    pub(crate) rolled: [f64; 4],
    pub(crate) angle: f64,
    pub(crate) speed: f64,
    pub(crate) time: u64,
    pub(crate) frame: u32,
    pub(crate) boot: u32,
    pub(crate) period: u64,
    random: Pcg64,
    noise: [f64; 4],
    steering_noise: f64,
}

impl Car {
    pub(crate) fn new(vehicle: Vehicle) -> Self {
        Self {
            vehicle,
            truth: Pose::default(),
            // Each counter has its own zero.
            rolled: [0.3, -0.2, -1.1, 0.1],
            angle: 0.0,
            speed: 0.0,
            time: 5_000_000_000,
            frame: 1,
            boot: 77,
            period: 5_000_000,
            random: Pcg64::seed_from_u64(1),
            noise: [0.0; 4],
            steering_noise: 0.0,
        }
    }

    /// Wheel noise per axle \[m/sqrt(m)\] and steering noise \[rad\].
    pub(crate) fn noisy(mut self, seed: u64, front: f64, rear: f64, steering: f64) -> Self {
        self.random = Pcg64::seed_from_u64(seed);
        self.noise = [front, front, rear, rear];
        self.steering_noise = steering;
        self
    }

    /// It already steers by `angle` \[rad\] and rolls at `speed` \[m/s\] when it is first read: the
    /// sensors see between readings what was at both ends.
    pub(crate) fn rolling(mut self, speed: f64, angle: f64) -> Self {
        (self.speed, self.angle) = (speed, angle);
        self
    }

    /// Rolls for a period at `speed` \[m/s\] and steering angle `angle` \[rad\].
    pub(crate) fn roll(&mut self, speed: f64, angle: f64) {
        let distance = speed * self.period as f64 * 1e-9;
        let curvature = angle.tan() / self.vehicle.wheelbase;
        for wheel in WHEELS {
            let (x, y) = self.vehicle.wheel_position(wheel);
            let clean = distance * (1.0 - y * curvature).hypot(x * curvature);
            let random: f64 = self.random.sample(StandardNormal);
            let index = wheel.index();
            self.rolled[index] += clean + random * self.noise[index] * clean.abs().sqrt();
        }
        self.truth = self.truth.advance(distance, distance * curvature);
        (self.angle, self.speed) = (angle, speed);
        self.tick();
    }

    /// Time goes on.
    pub(crate) fn tick(&mut self) {
        self.time += self.period;
        self.frame = self.frame.wrapping_add(1);
    }

    /// The reading of now: counts of all wheels, steering, yaw rate.
    pub(crate) fn raw(&mut self) -> Raw {
        let encoders = self.vehicle.encoders;
        let counts = WHEELS.map(|wheel| {
            let Some(encoders) = encoders else { return 0 };
            let index = wheel.index();
            let per_turn = encoders.counts_per_revolution[index].unwrap_or(0.0);
            let turns = self.rolled[index] / (core::f64::consts::TAU * self.vehicle.radius[index]);
            let unused = 64 - encoders.counter_bits;
            (((turns * per_turn).floor() as i64) << unused) >> unused
        });
        let curvature = self.angle.tan() / self.vehicle.wheelbase;
        let speeds = WHEELS.map(|wheel| {
            let (x, y) = self.vehicle.wheel_position(wheel);
            self.speed * (1.0 - y * curvature).hypot(x * curvature)
        });
        let random: f64 = self.random.sample(StandardNormal);
        Raw {
            header: Header::stamped(self.time, 0),
            vehicle_time: self.time,
            arrival: self.time,
            counts,
            speeds,
            steering: self.angle + random * self.steering_noise,
            yaw_rate: self.speed * curvature,
            boot: self.boot,
            frame: self.frame,
            counts_mask: if encoders.is_some() { 0xf } else { 0 },
            speeds_mask: if encoders.is_some() { 0 } else { 0xf },
            has_steering: 1,
            has_yaw_rate: 1,
            ..Raw::default()
        }
    }
}

/// Ingest and estimator in a row.
pub(crate) struct Chain {
    pub(crate) ingest: Ingest,
    pub(crate) estimator: Estimator,
    pub(crate) travel: Travel,
    pub(crate) odometry: Odometry,
}

impl Chain {
    pub(crate) fn new(vehicle: &Vehicle, settings: &EstimatorSettings) -> Self {
        Self::with(vehicle, &Sensors::of(vehicle), settings)
    }

    pub(crate) fn with(vehicle: &Vehicle, sensors: &Sensors, settings: &EstimatorSettings) -> Self {
        Self {
            ingest: Ingest::with_sensors(vehicle, sensors, &IngestSettings::default()).unwrap(),
            estimator: Estimator::with_sensors(vehicle, sensors, settings).unwrap(),
            travel: Travel::default(),
            odometry: Odometry::default(),
        }
    }

    pub(crate) fn feed(&mut self, raw: &Raw) {
        self.ingest.step(raw, 0, false, &mut self.travel);
        self.estimate();
    }

    pub(crate) fn estimate(&mut self) {
        let inputs = EstimatorInputs { travel: &self.travel, missing: 0, fix: None, restore: None };
        self.estimator.step(inputs, &mut self.odometry);
    }

    pub(crate) fn pose(&self) -> Pose {
        Pose::new(self.odometry.x, self.odometry.y, self.odometry.yaw)
    }
}

/// Sensors with these wheels.
pub(crate) fn sensors(wheels: [bool; 4], steering: bool, gyro: bool) -> Sensors {
    Sensors { wheels, signal: WheelSignal::Counts, steering, gyro }
}

/// Settings under which the pose is valid from the start, at the origin.
pub(crate) fn placed() -> EstimatorSettings {
    let initial = kerbside_odometry::InitialPose {
        pose: Pose::default(),
        position_noise: 0.0,
        yaw_noise: 0.0,
    };
    EstimatorSettings { initial_pose: Some(initial), ..EstimatorSettings::default() }
}

/// Speed and steering of the S path: 1 m straight, a quarter left at 1.2 m, 0.5 m, a quarter right,
/// 0.5 m, curvature ramps of 0.15 m, 0.1 m/s^2 at both ends; per period, until it stands.
pub(crate) fn s_path(vehicle: &Vehicle, top: f64, period: f64) -> Vec<(f64, f64)> {
    let (bend, ramp, quarter) = (1.0 / 1.2, 0.15, core::f64::consts::FRAC_PI_2 * 1.2);
    let pieces =
        [(1.0, 0.0), (quarter - ramp, bend), (0.5, 0.0), (quarter - ramp, -bend), (0.5, 0.0)];
    let corners: Vec<(f64, f64)> = corners(&pieces, ramp);
    let length = corners.last().unwrap().0;
    let (mut way, mut speed, mut path) = (0.0, 0.0_f64, Vec::new());
    while way < length - 1e-4 {
        let braking = (0.2 * (length - way)).sqrt();
        speed = (speed + 0.1 * period).min(top).min(braking.max(0.004));
        way += speed * period;
        path.push((speed, (curvature(&corners, way) * vehicle.wheelbase).atan()));
    }
    path
}

/// Stations and curvatures between which the curvature is linear.
fn corners(pieces: &[(f64, f64)], ramp: f64) -> Vec<(f64, f64)> {
    let mut corners = vec![(0.0, 0.0)];
    let mut way = 0.0;
    for (length, bend) in pieces {
        if corners.last().unwrap().1 != *bend {
            way += ramp;
            corners.push((way, *bend));
        }
        way += length;
        corners.push((way, *bend));
    }
    corners
}

fn curvature(corners: &[(f64, f64)], way: f64) -> f64 {
    let edge = corners.windows(2).find(|edge| way <= edge[1].0);
    edge.map_or(0.0, |edge| {
        let share = (way - edge[0].0) / (edge[1].0 - edge[0].0);
        edge[0].1 + share * (edge[1].1 - edge[0].1)
    })
}
