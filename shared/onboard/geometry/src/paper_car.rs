//! The car that examples and tests are about.

use crate::{
    Actuators, Drive, Encoders, Footprint, Limits, Pose, Reference, SteeringSensor, Vehicle,
};

impl Vehicle {
    /// The 1:6 car of Lee, Chung and Chang as its makers believed it to be, the very one that
    /// `config/vehicles/paper-1-6.toml` describes: radii and tracks are the paper's nominal ones, the wheelbase and
    /// whatever else the paper does not state are chosen.
    #[must_use]
    #[allow(clippy::approx_constant)] // 30 degrees as the file writes them
    pub fn paper_car() -> Self {
        Self {
            name: "paper-1-6".to_owned(),
            wheelbase: 0.5,
            track_front: 0.31,
            track_rear: 0.31,
            radius: [0.0725; 4],
            speed_radius: [None; 4],
            drive: Drive::Rear,
            footprint: Footprint { length: 0.75, width: 0.37, rear_overhang: 0.13 },
            limits: Limits {
                speed: 0.5,
                acceleration: 0.3,
                deceleration: 0.3,
                steering: 0.5236,
                steering_rate: 0.8,
            },
            actuators: Some(Actuators {
                speed_delay: 0.02,
                speed_lag: 0.10,
                steering_delay: 0.02,
                steering_lag: 0.05,
                ..Actuators::default()
            }),
            encoders: Some(Encoders {
                counts_per_revolution: [Some(2048.0); 4],
                counter_bits: 32,
                noise_per_distance: Some(0.0005),
                rate: 200.0,
            }),
            steering_sensor: Some(SteeringSensor::new(0.0035, 200.0)),
            gyro: None,
            reference: Some(Reference {
                position_noise: 0.002,
                yaw_noise: 0.002,
                rate: 50.0,
                marker: Pose::default(),
            }),
        }
    }
}
