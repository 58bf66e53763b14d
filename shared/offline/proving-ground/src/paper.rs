//! The car of Lee, Chung and Chang, "Improvement of odometry accuracy and Parking Control for a Car-Like Mobile Robot",
//! as its calibration found it: what is true on the proving ground. Where the paper is silent, what docs/reproduction.md
//! says was chosen.

use kerbside_geometry::{Drive, Pose, Vehicle, WHEELS, Wheel, angle};

use crate::chassis::Chassis;
use crate::normal::Normal;
use crate::physics::Actuators;
use crate::profile::Pace;
use crate::sensors::{Coloured, Encoders, Reference, Sensors, SteeringSensor};

/// Stream of the residual errors; the sensors have those below.
const RESIDUALS: u64 = 8;

/// Of the driven wheels' travel, one standard deviation \[m/sqrt(m)\].
pub const REAR_NOISE: f64 = 1e-3;

impl Chassis {
    /// Diameters of the paper's Table 1, tracks of its Table 2, a wheelbase of 0.50 m; mass, its place and its
    /// inertia are those of a car of this size and chosen.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            wheelbase: 0.50,
            track_front: 0.285,
            track_rear: 0.292,
            radius: [0.5 * 0.141_94, 0.5 * 0.142_28, 0.5 * 0.139_03, 0.5 * 0.139_21],
            drive: Drive::Rear,
            mass: 15.0,
            yaw_inertia: 0.9,
            centre_of_mass: 0.22,
        }
    }

    /// The vehicle that somebody believes in who knows these measures, with `sensors` and a footprint as the one of
    /// `Vehicle::paper_car`. It has what the sensors are, not how they err beyond their white noise; noise of the wheels
    /// is that of the first driven one.
    #[must_use]
    pub fn believed(&self, sensors: &Sensors) -> Vehicle {
        let driven = WHEELS.into_iter().find(|wheel| self.is_driven(*wheel));
        Vehicle {
            name: "proving-ground".to_owned(),
            wheelbase: self.wheelbase,
            track_front: self.track_front,
            track_rear: self.track_rear,
            radius: self.radius,
            drive: self.drive,
            encoders: sensors.encoders.as_ref().map(|encoders| kerbside_geometry::Encoders {
                counts_per_revolution: encoders.counts_per_revolution,
                counter_bits: encoders.counter_bits,
                noise_per_distance: driven.map(|wheel| encoders.noise[wheel.index()]),
                rate: encoders.rate,
            }),
            steering_sensor: sensors
                .steering
                .map(|sensor| kerbside_geometry::SteeringSensor::new(sensor.white, sensor.rate)),
            gyro: sensors.gyro.map(|gyro| kerbside_geometry::Gyro {
                noise: gyro.white,
                rate: gyro.rate,
                bias: 0.0,
            }),
            reference: sensors.reference.map(|reference| kerbside_geometry::Reference {
                position_noise: reference.position_white,
                yaw_noise: reference.yaw_white,
                rate: reference.rate,
                marker: reference.marker,
            }),
            ..Vehicle::paper_car()
        }
    }
}

impl Encoders {
    /// 2000 counts a turn at 50 Hz; the rear wheels err by 1 mm per square root of a metre, the front wheels' variance is
    /// `front_share` of theirs: 1/3, 1 or 2 in the three cases.
    #[must_use]
    pub fn paper(front_share: f64) -> Self {
        let front = REAR_NOISE * front_share.sqrt();
        Self {
            counts_per_revolution: [Some(2000.0); 4],
            counter_bits: 32,
            first_counts: [0; 4],
            phase: 1.0,
            noise: [front, front, REAR_NOISE, REAR_NOISE],
            correlation_length: 0.0,
            rate: 50.0,
            faults: Vec::new(),
        }
    }
}

impl SteeringSensor {
    /// White noise of 0.2 degrees at 50 Hz.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            offset: 0.0,
            gain: 1.0,
            white: angle::radians(0.2),
            coloured: Coloured::NONE,
            rate: 50.0,
        }
    }
}

impl Reference {
    /// At 50 Hz on the rear axle, with white noise only.
    #[must_use]
    pub fn white(position: f64, yaw: f64) -> Self {
        Self {
            position_white: position,
            position_coloured: Coloured::NONE,
            yaw_white: yaw,
            yaw_coloured: Coloured::NONE,
            marker: Pose::default(),
            clock_offset: 0.0,
            rate: 50.0,
        }
    }

    /// 2 mm and 2 mrad: what a reference needs that is to judge anything.
    #[must_use]
    pub fn fine() -> Self {
        Self::white(2e-3, 2e-3)
    }

    /// 5 cm and 5 degrees: the paper's.
    #[must_use]
    pub fn coarse() -> Self {
        Self::white(0.05, angle::radians(5.0))
    }
}

impl Sensors {
    /// Encoders and steering sensor as above, no gyro, no reference.
    #[must_use]
    pub fn paper(front_share: f64) -> Self {
        Self {
            encoders: Some(Encoders::paper(front_share)),
            steering: Some(SteeringSensor::paper()),
            gyro: None,
            reference: None,
        }
    }

    /// The same sensors without any error: whole counts remain, at the start on the edge of a count.
    #[must_use]
    pub fn without_errors(mut self) -> Self {
        if let Some(encoders) = &mut self.encoders {
            encoders.noise = [0.0; 4];
            encoders.phase = 0.0;
            encoders.faults.clear();
        }
        let steering = |sensor| SteeringSensor {
            offset: 0.0,
            gain: 1.0,
            white: 0.0,
            coloured: Coloured::NONE,
            ..sensor
        };
        self.steering = self.steering.map(steering);
        self.gyro = self.gyro.map(|gyro| crate::sensors::Gyro {
            bias: 0.0,
            gain: 1.0,
            drift: 0.0,
            white: 0.0,
            ..gyro
        });
        self.reference = self.reference.map(|reference| Reference {
            position_white: 0.0,
            position_coloured: Coloured::NONE,
            yaw_white: 0.0,
            yaw_coloured: Coloured::NONE,
            clock_offset: 0.0,
            ..reference
        });
        self
    }
}

impl Actuators {
    /// The simulated car that parks: lags of 0.1 s, 1 rad/s, 35 degrees.
    #[must_use]
    pub fn paper_parking() -> Self {
        Self {
            speed_lag: 0.1,
            steering_lag: 0.1,
            steering_rate_limit: 1.0,
            steering_limit: angle::radians(35.0),
            ..Self::NEUTRAL
        }
    }
}

impl Pace {
    /// Up to `speed` \[m/s\] with 0.1 m/s^2; the paper drives at 0.09 and 0.26 m/s.
    #[must_use]
    pub fn paper(speed: f64) -> Self {
        Self { speed, acceleration: 0.1 }
    }
}

/// What a calibration leaves: differences between a vehicle and what is believed of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residuals {
    /// Relative, of each radius \[1\].
    pub radius: [f64; 4],
    /// \[m\].
    pub track_front: f64,
    /// \[m\].
    pub track_rear: f64,
    /// \[m\].
    pub wheelbase: f64,
    /// Added to the steering sensor's offset \[rad\].
    pub steering_zero: f64,
}

impl Residuals {
    /// One standard deviation of each: 0.05 % per radius, 1 mm per track, 2 mm of wheelbase,
    /// 0.3 degrees of steering zero.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            radius: [5e-4; 4],
            track_front: 1e-3,
            track_rear: 1e-3,
            wheelbase: 2e-3,
            steering_zero: angle::radians(0.3),
        }
    }

    /// Independent normal deviates with these as their standard deviations.
    #[must_use]
    pub fn draw(&self, seed: u64) -> Self {
        let mut normal = Normal::new(seed, RESIDUALS);
        let mut drawn = |deviation: f64| deviation * normal.sample();
        Self {
            radius: self.radius.map(&mut drawn),
            track_front: drawn(self.track_front),
            track_rear: drawn(self.track_rear),
            wheelbase: drawn(self.wheelbase),
            steering_zero: drawn(self.steering_zero),
        }
    }

    /// `chassis` with these differences; with them left out where the belief is to be made from the truth, see
    /// [`Residuals::reversed`].
    #[must_use]
    pub fn chassis(&self, chassis: &Chassis) -> Chassis {
        let radius = WHEELS.map(Wheel::index).map(|i| chassis.radius[i] * (1.0 + self.radius[i]));
        Chassis {
            radius,
            track_front: chassis.track_front + self.track_front,
            track_rear: chassis.track_rear + self.track_rear,
            wheelbase: chassis.wheelbase + self.wheelbase,
            ..*chassis
        }
    }

    /// `sensors` whose steering sensor is off by the steering zero.
    #[must_use]
    pub fn sensors(&self, sensors: &Sensors) -> Sensors {
        let mut sensors = sensors.clone();
        if let Some(steering) = &mut sensors.steering {
            steering.offset += self.steering_zero;
        }
        sensors
    }

    /// The differences seen from the other side.
    #[must_use]
    pub fn reversed(&self) -> Self {
        Self {
            radius: self.radius.map(|relative| 1.0 / (1.0 + relative) - 1.0),
            track_front: -self.track_front,
            track_rear: -self.track_rear,
            wheelbase: -self.wheelbase,
            steering_zero: -self.steering_zero,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_of_the_radii_are_the_tables() {
        // Table 1: epsilon = left minus right.
        let [fl, fr, rl, rr] = Chassis::paper().radius;
        assert!((fl - fr + 0.17e-3).abs() < 1e-9 && (rl - rr + 0.09e-3).abs() < 1e-9);
    }

    #[test]
    fn residuals_have_their_deviations_and_can_be_undone() {
        let (deviations, count) = (Residuals::paper(), 4000_u32);
        let mut squares = [0.0; 4];
        for seed in 0..u64::from(count) {
            let drawn = deviations.draw(seed);
            let scaled = [
                drawn.radius[2] / deviations.radius[2],
                drawn.track_front / deviations.track_front,
                drawn.wheelbase / deviations.wheelbase,
                drawn.steering_zero / deviations.steering_zero,
            ];
            squares.iter_mut().zip(scaled).for_each(|(sum, z)| *sum += z * z / f64::from(count));
        }
        for square in squares {
            assert!((square - 1.0).abs() < 5.0 * (2.0 / f64::from(count)).sqrt(), "{squares:?}");
        }
        let drawn = deviations.draw(1);
        let back = drawn.reversed().chassis(&drawn.chassis(&Chassis::paper()));
        for (a, b) in back.radius.iter().zip(Chassis::paper().radius) {
            assert!((a - b).abs() < 1e-15);
        }
        assert_eq!(drawn, deviations.draw(1));
    }
}
