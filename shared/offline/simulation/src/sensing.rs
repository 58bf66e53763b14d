//! What the sensors make of the motion.

use core::f64::consts::TAU;

use kerbside_geometry::{SteeringSensor, Vehicle, WHEELS};

use crate::body::Body;
use crate::ground::Motion;
use crate::noise::Noise;
use crate::normal::Normal;

/// One reading of every sensor the vehicle has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorReading {
    /// Counts of fl, fr, rl, rr: the counter's bits, sign-extended.
    pub counts: [i64; 4],
    /// Bit i: wheel i has an encoder.
    pub counts_mask: u8,
    /// Surface speeds of fl, fr, rl, rr, through the nominal radii \[m/s\], of vehicles that report
    /// these instead.
    pub speeds: [f64; 4],
    /// Bit i: wheel i reports a speed.
    pub speeds_mask: u8,
    /// Road-wheel angle, left positive \[rad\]; none without a sensor.
    pub steering: Option<f64>,
    /// Yaw rate \[rad/s\]; none without a gyro.
    pub yaw_rate: Option<f64>,
}

/// Encoders, steering sensor and gyro, with their errors.
#[derive(Clone, Debug)]
pub(crate) struct Sensing {
    radius: [f64; 4],
    counts_per_radian: [f64; 4],
    counts_mask: u8,
    speeds_mask: u8,
    counter_bits: u32,
    first_counts: [i64; 4],
    phase: [f64; 4],
    steering: Option<SteeringSensor>,
    has_gyro: bool,
    noise: Noise,
    normal: Normal,
    /// Rotation that each wheel's noise has added so far \[rad\].
    error: [f64; 4],
    /// How far each wheel had turned at the previous reading \[rad\], and when that was \[s\].
    read: ([f64; 4], f64),
}

impl Sensing {
    /// The sensors of `vehicle`.
    pub(crate) fn new(vehicle: &Vehicle, noise: &Noise, seed: u64) -> Self {
        let mut normal = Normal::new(seed);
        let encoders =
            vehicle.encoders.map_or([None; 4], |encoders| encoders.counts_per_revolution);
        Self {
            radius: core::array::from_fn(|wheel| {
                vehicle.speed_radius[wheel].unwrap_or(vehicle.radius[wheel])
            }),
            counts_per_radian: encoders.map(|counts| counts.unwrap_or_default() / TAU),
            counts_mask: mask(encoders.map(|counts| counts.is_some())),
            speeds_mask: if vehicle.encoders.is_some() { 0 } else { wheels_mask(vehicle) },
            counter_bits: vehicle.encoders.map_or(64, |encoders| encoders.counter_bits),
            first_counts: [0; 4],
            phase: core::array::from_fn(|_| noise.phase * normal.uniform()),
            steering: vehicle.steering_sensor,
            has_gyro: vehicle.gyro.is_some(),
            noise: *noise,
            normal,
            error: [0.0; 4],
            read: ([0.0; 4], 0.0),
        }
    }

    /// Lets the counters begin at `counts`.
    pub(crate) fn set_first_counts(&mut self, counts: [i64; 4]) {
        self.first_counts = counts;
    }

    /// Reads all sensors at `now` \[s\].
    pub(crate) fn read(
        &mut self,
        now: f64,
        body: &Body,
        motion: &Motion,
        rack: f64,
    ) -> SensorReading {
        let error = self.wheel_errors(body);
        let elapsed = now - self.read.1;
        self.read = (body.turned, now);
        SensorReading {
            counts: core::array::from_fn(|wheel| self.count(wheel, body.rotation[wheel])),
            counts_mask: self.counts_mask,
            speeds: core::array::from_fn(|wheel| {
                let extra = if elapsed > 0.0 { error[wheel] / elapsed } else { 0.0 };
                self.speed(wheel, motion.rotation_rate[wheel] + extra)
            }),
            speeds_mask: self.speeds_mask,
            steering: self.angle(rack),
            yaw_rate: self.rate(motion.yaw_rate),
        }
    }

    /// Draws what each wheel's noise adds since the previous reading \[rad\]: its variance grows
    /// with the travel alone, so how often the sensors are read changes nothing of its size.
    fn wheel_errors(&mut self, body: &Body) -> [f64; 4] {
        let mut drawn = [0.0; 4];
        if self.noise.wheel == 0.0 {
            return drawn;
        }
        for (wheel, drawn) in drawn.iter_mut().enumerate() {
            let travel = (body.turned[wheel] - self.read.0[wheel]) * self.radius[wheel];
            *drawn = self.noise.wheel * travel.sqrt() / self.radius[wheel] * self.normal.sample();
            self.error[wheel] += *drawn;
        }
        drawn
    }

    // 63 bits of counts reach to the next star.
    #[allow(clippy::cast_possible_truncation)]
    fn count(&self, wheel: usize, rotation: f64) -> i64 {
        if self.counts_mask & (1 << wheel) == 0 {
            return 0;
        }
        let turned = (rotation + self.error[wheel]) * self.counts_per_radian[wheel];
        let count =
            self.first_counts[wheel].wrapping_add((turned + self.phase[wheel]).floor() as i64);
        let unused = 64 - self.counter_bits.clamp(1, 64);
        count << unused >> unused
    }

    fn speed(&self, wheel: usize, rotation_rate: f64) -> f64 {
        if self.speeds_mask & (1 << wheel) == 0 { 0.0 } else { rotation_rate * self.radius[wheel] }
    }

    fn angle(&mut self, rack: f64) -> Option<f64> {
        let sensor = self.steering?;
        Some(sensor.reading(rack) + white(&mut self.normal, self.noise.steering))
    }

    fn rate(&mut self, yaw_rate: f64) -> Option<f64> {
        self.has_gyro.then(|| yaw_rate + white(&mut self.normal, self.noise.gyro))
    }
}

fn white(normal: &mut Normal, deviation: f64) -> f64 {
    if deviation == 0.0 { 0.0 } else { deviation * normal.sample() }
}

fn mask(present: [bool; 4]) -> u8 {
    present.iter().enumerate().fold(0, |mask, (wheel, present)| mask | u8::from(*present) << wheel)
}

/// The wheels there are: of an axle without track only the left one.
fn wheels_mask(vehicle: &Vehicle) -> u8 {
    mask(WHEELS.map(|wheel| wheel.is_left() || vehicle.wheel_position(wheel).1 != 0.0))
}
