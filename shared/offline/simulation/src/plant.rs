//! The vehicle with its effects, in the numbers that the stations work by.

use kerbside_geometry::{Drive, Pose, Vehicle};

use crate::effects::Effects;

/// No actuator is slower than that \[1/s\]: one that never moves would never be done.
const SLOWEST: f64 = 1e-6;

/// What a vehicle is once every effect had its say. An effect alters these numbers; what they mean
/// is told by the station that uses them.
#[derive(Clone, Debug)]
pub(crate) struct Plant {
    /// From the commanded speed to the motor's.
    pub(crate) speed: Actuation,
    /// From the commanded angle to the rack's.
    pub(crate) steering: Actuation,
    /// Full play between the steering's actuator and the rack \[rad\].
    pub(crate) backlash: f64,
    /// Tyres, floor, and what is between rack and road wheels.
    pub(crate) contact: Contact,
    /// What is shown of the motion.
    pub(crate) sensors: Sensors,
}

/// An actuator: `gain`, dead zone, delay, limit, then a lag whose rate is limited.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Actuation {
    /// Of the command.
    pub(crate) gain: f64,
    /// Commands below it, times `gain`, count as 0.
    pub(crate) dead_zone: f64,
    /// \[s\]
    pub(crate) delay: f64,
    /// Largest value.
    pub(crate) limit: f64,
    /// \[s\]
    pub(crate) lag: f64,
    /// Largest rate \[1/s\].
    pub(crate) rate_limit: f64,
}

/// How rack and motor move the body.
#[derive(Clone, Debug)]
pub(crate) struct Contact {
    /// Which wheels the motor turns.
    pub(crate) drive: Drive,
    /// The mean nominal radius of those, by which the motor's speed is told \[m\].
    pub(crate) driven_radius: f64,
    /// True radii \[m\].
    pub(crate) radius: [f64; 4],
    /// Effective \[m\].
    pub(crate) wheelbase: f64,
    /// Effective \[m\].
    pub(crate) track_front: f64,
    /// Effective \[m\].
    pub(crate) track_rear: f64,
    /// Road wheels beyond the rack \[rad\].
    pub(crate) offset: f64,
    /// Loss of angle per V^2 k0 \[rad s^2/m\].
    pub(crate) compliance: f64,
    /// Loss of curvature per V^2 \[s^2/m^2\].
    pub(crate) understeer: f64,
    /// Way that the driven wheels keep of what they turn: the product of 1 - ratio.
    pub(crate) kept: f64,
    /// Slip per acceleration \[s^2/m\].
    pub(crate) acceleration_slip: f64,
    /// Side velocity outwards per V and yaw rate \[s\].
    pub(crate) lateral_slip: f64,
    /// Side velocity to the left per |V|.
    pub(crate) lateral_drift: f64,
    /// Velocity of the floor per |V|, in the reference frame (x, y).
    pub(crate) floor: (f64, f64),
    /// A slippery disc.
    pub(crate) patch: Patch,
}

/// A disc on the floor, in the reference frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch {
    /// Centre \[m\].
    pub(crate) x: f64,
    /// Centre \[m\].
    pub(crate) y: f64,
    /// \[m\]
    pub(crate) radius: f64,
    /// Way that the driven wheels keep of what they turn, inside.
    pub(crate) kept: f64,
}

/// What is shown of the motion.
#[derive(Clone, Debug)]
pub(crate) struct Sensors {
    /// Radii through which wheel speeds are told \[m\].
    pub(crate) radius: [f64; 4],
    /// Share of each wheel's rotation that is shown.
    pub(crate) kept: [f64; 4],
    /// Age of the rotation that is shown \[s\].
    pub(crate) encoder_delay: f64,
    /// Reading per angle of the rack.
    pub(crate) steering_gain: f64,
    /// Reading at a straight rack \[rad\].
    pub(crate) steering_offset: f64,
    /// Reading per yaw rate.
    pub(crate) gyro_gain: f64,
    /// Reading at rest \[rad/s\].
    pub(crate) gyro_bias: f64,
    /// Age of the pose that is shown \[s\].
    pub(crate) reference_delay: f64,
    /// Of the position that is shown, about the frame's origin.
    pub(crate) reference_scale: f64,
    /// `body_from_marker`.
    pub(crate) marker: Pose,
    /// By which the reference's stamps run faster than the vehicle's clock.
    pub(crate) clock_rate: f64,
}

impl Plant {
    /// `vehicle` with `effects`.
    pub(crate) fn new(vehicle: &Vehicle, effects: &Effects) -> Self {
        let mut plant = Self::nominal(vehicle);
        effects.apply(&mut plant);
        for actuation in [&mut plant.speed, &mut plant.steering] {
            actuation.delay = actuation.delay.max(0.0);
            actuation.lag = actuation.lag.max(0.0);
            actuation.rate_limit = actuation.rate_limit.max(SLOWEST);
        }
        plant
    }

    fn nominal(vehicle: &Vehicle) -> Self {
        let (response, limits) = (vehicle.response(), &vehicle.limits);
        let sensor = vehicle.steering_sensor;
        Self {
            speed: Actuation {
                gain: response.speed_gain,
                dead_zone: 0.0,
                delay: response.speed_delay,
                limit: limits.speed,
                lag: response.speed_lag,
                rate_limit: limits.acceleration,
            },
            steering: Actuation {
                gain: response.steering_gain,
                dead_zone: 0.0,
                delay: response.steering_delay,
                limit: limits.steering,
                lag: response.steering_lag,
                rate_limit: limits.steering_rate,
            },
            backlash: 0.0,
            contact: Contact {
                drive: vehicle.drive,
                driven_radius: vehicle.driven_radius(),
                radius: vehicle.radius,
                wheelbase: vehicle.wheelbase,
                track_front: vehicle.track_front,
                track_rear: vehicle.track_rear,
                offset: response.steering_offset,
                compliance: 0.0,
                understeer: 0.0,
                kept: 1.0,
                acceleration_slip: 0.0,
                lateral_slip: 0.0,
                lateral_drift: 0.0,
                floor: (0.0, 0.0),
                patch: Patch { x: 0.0, y: 0.0, radius: 0.0, kept: 1.0 },
            },
            sensors: Sensors {
                radius: core::array::from_fn(|wheel| {
                    vehicle.speed_radius[wheel].unwrap_or(vehicle.radius[wheel])
                }),
                kept: [1.0; 4],
                encoder_delay: 0.0,
                steering_gain: sensor.map_or(1.0, |sensor| sensor.gain),
                // The sensor sits at the rack, and its offset is stated for straight wheels.
                steering_offset: sensor
                    .map_or(0.0, |sensor| sensor.offset + sensor.gain * response.steering_offset),
                gyro_gain: 1.0,
                gyro_bias: vehicle.gyro.map_or(0.0, |gyro| gyro.bias),
                reference_delay: 0.0,
                reference_scale: 1.0,
                marker: vehicle.reference.map_or(Pose::default(), |reference| reference.marker),
                clock_rate: 0.0,
            },
        }
    }
}

impl Sensors {
    /// What the steering sensor makes of an angle of the rack, both \[rad\].
    pub(crate) fn steering(&self, rack: f64) -> f64 {
        self.steering_gain * rack + self.steering_offset
    }

    /// What the gyro makes of a yaw rate, both \[rad/s\].
    pub(crate) fn yaw_rate(&self, yaw_rate: f64) -> f64 {
        let reading = self.gyro_gain * yaw_rate;
        // Adding zero would turn a negative zero round.
        if self.gyro_bias == 0.0 { reading } else { reading + self.gyro_bias }
    }

    /// When the encoders saw what they show at `time` \[s\].
    pub(crate) fn encoder_time(&self, time: f64) -> f64 {
        time - self.encoder_delay
    }

    /// Rotation, or its rate, as the encoders show it.
    pub(crate) fn shown(&self, rotation: [f64; 4]) -> [f64; 4] {
        core::array::from_fn(|wheel| rotation[wheel] * self.kept[wheel])
    }

    /// Surface speeds as reported \[m/s\], for true rotation rates \[rad/s\].
    pub(crate) fn wheel_speed(&self, rate: [f64; 4]) -> [f64; 4] {
        let shown = self.shown(rate);
        core::array::from_fn(|wheel| shown[wheel] * self.radius[wheel])
    }

    /// When the reference saw what it stamps `stamp` \[s\].
    pub(crate) fn reference_time(&self, stamp: f64) -> f64 {
        stamp / (1.0 + self.clock_rate) - self.reference_delay
    }

    /// What the reference makes of the body's pose.
    pub(crate) fn reference(&self, body: &Pose) -> Pose {
        let marker = body.compose(&self.marker);
        let scale = self.reference_scale;
        Pose::new(marker.x * scale, marker.y * scale, marker.yaw)
    }

    /// The body's pose for what the reference shows of it while it stands: [`Self::reference`] undone.
    pub(crate) fn body(&self, shown: &Pose) -> Pose {
        let scale = self.reference_scale;
        Pose::new(shown.x / scale, shown.y / scale, shown.yaw).compose(&self.marker.inverse())
    }
}

#[cfg(test)]
mod tests {
    use kerbside_geometry::{Pose, Vehicle};

    use crate::{Noise, Simulator};

    #[test]
    fn reported_speeds_are_computed_with_the_vehicles_own_radii() {
        let mut vehicle = Vehicle::paper_car();
        vehicle.encoders = None;
        // A calibration found the rear left wheel larger; the vehicle goes on with the radius that it had.
        vehicle.speed_radius[2] = Some(vehicle.radius[2]);
        vehicle.radius[2] *= 1.02;
        let mut simulator = Simulator::new(&vehicle, Pose::default(), &Noise::NONE, 1);
        simulator.command(0.0, 0.3, 0.0);
        simulator.advance(5.0);
        let [_, _, left, right] = simulator.reading().speeds;
        assert!(right > 0.29 && (1.02 * left - right).abs() < 1e-6, "{left} and {right}");
    }
}
