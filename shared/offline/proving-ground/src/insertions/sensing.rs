//! Between motion and the vehicle's own readings.

use kerbside_geometry::{Limits, math};

use super::Effect;

/// What is put in there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sensing {
    loss: [f64; 4],
    /// Of counts and wheel speeds \[s\].
    pub(crate) encoder_delay: f64,
    steering_offset: f64,
    steering_gain: f64,
    gyro_bias: f64,
    gyro_gain: f64,
    warming: f64,
    warming_time: f64,
    vibration: f64,
    eccentricity: [f64; 4],
    bow: f64,
    /// Full lock \[rad\] and top speed \[m/s\], against which sizes are stated.
    lock: f64,
    top: f64,
}

impl Sensing {
    pub(crate) fn neutral(limits: &Limits) -> Self {
        Self {
            loss: [0.0; 4],
            encoder_delay: 0.0,
            steering_offset: 0.0,
            steering_gain: 1.0,
            gyro_bias: 0.0,
            gyro_gain: 1.0,
            warming: 0.0,
            warming_time: 1.0,
            vibration: 0.0,
            eccentricity: [0.0; 4],
            bow: 0.0,
            lock: limits.steering,
            top: limits.speed,
        }
    }

    pub(crate) fn take(&mut self, effect: &Effect) {
        let wheel = effect.wheel.map_or(0, kerbside_geometry::Wheel::index);
        match effect.id {
            "count_loss" => self.loss[wheel] = effect.get("fraction"),
            "encoder_delay" => self.encoder_delay = effect.get("delay"),
            "steering_sensor_offset" => self.steering_offset = effect.get("offset"),
            "steering_sensor_gain" => self.steering_gain = effect.get("gain"),
            "gyro_bias" => self.gyro_bias = effect.get("bias"),
            "gyro_gain" => self.gyro_gain = effect.get("gain"),
            "gyro_warming" => {
                self.warming = effect.get("bias");
                self.warming_time = effect.get("time").max(1e-3);
            }
            "gyro_vibration" => self.vibration = effect.get("bias"),
            "encoder_eccentricity" => self.eccentricity[wheel] = effect.get("angle"),
            "sensor_bow" => self.bow = effect.get("share"),
            _ => {}
        }
    }

    /// Rotation that the encoders show of the true one \[rad\].
    pub(crate) fn rotation(&self, rotation: [f64; 4]) -> [f64; 4] {
        core::array::from_fn(|i| {
            let wobble = self.eccentricity[i] * math::sin(rotation[i]);
            (1.0 - self.loss[i]) * (rotation[i] + wobble)
        })
    }

    /// What the steering sensor reads of the rack's angle \[rad\].
    pub(crate) fn steering(&self, rack: f64) -> f64 {
        let bow = self.bow * rack * rack / self.lock;
        self.steering_gain * rack + bow + self.steering_offset
    }

    /// What the gyro reads at `time` \[s\] and `speed` \[m/s\] of the yaw rate \[rad/s\].
    pub(crate) fn yaw_rate(&self, yaw_rate: f64, speed: f64, time: f64) -> f64 {
        let warm = self.warming * (1.0 - math::exp(-time / self.warming_time));
        let vibration = self.vibration * (speed / self.top).abs();
        self.gyro_gain * yaw_rate + self.gyro_bias + warm + vibration
    }
}
