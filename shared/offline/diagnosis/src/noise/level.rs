//! How strong each part of the noise is.

use kerbside_geometry::{Vehicle, math};

/// A part of the noise: standard deviation or time constant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub(crate) enum Level {
    /// Steering sensor, white, of a bin's mean \[rad\].
    SteeringWhite,
    /// Gyro, white, of a bin's mean \[rad/s\].
    GyroWhite,
    /// Reference position, white, of a bin's mean \[m\].
    PositionWhite,
    /// Reference yaw, white, of a bin's mean \[rad\].
    YawWhite,
    /// Wheel travel \[m\] or speed \[m/s\], white, of a bin's mean.
    WheelWhite,
    /// Coloured error of the reference's position \[m\].
    PositionColour,
    /// Coloured error of the reference's yaw \[rad\].
    YawColour,
    /// Time constant of both \[s\].
    ReferenceTime,
    /// Disturbance of the motor's speed, as a share of it.
    Speed,
    /// Its time constant \[s\].
    SpeedTime,
    /// Slip of the driven wheels, as a share of the speed.
    Slip,
    /// Time constant of slip, curvature and side velocity \[s\].
    GroundTime,
    /// Disturbance of the curvature, times the wheelbase.
    Curvature,
    /// Side velocity, as a share of the speed.
    Side,
    /// Disturbance of the rack \[rad\].
    Rack,
    /// Its time constant \[s\].
    RackTime,
    /// Slip of each wheel on its own, as a share of the speed.
    Wheel,
    /// Coloured error of the gyro \[rad/s\].
    GyroColour,
    /// What slip differs by from run to run.
    RunSlip,
    /// What the curvature differs by from run to run, times the wheelbase.
    RunCurvature,
    /// What the side velocity differs by from run to run, as a share of the speed.
    RunSide,
    /// What the speed differs by from run to run, as a share of it.
    RunSpeed,
    /// What the rack differs by from run to run \[rad\].
    RunRack,
    /// What the gyro differs by from run to run \[rad/s\].
    RunGyro,
}

/// Number of levels.
pub(super) const COUNT: usize = 24;

impl Level {
    /// All of them, in the order of their numbers.
    pub(crate) const ALL: [Self; COUNT] = [
        Self::SteeringWhite,
        Self::GyroWhite,
        Self::PositionWhite,
        Self::YawWhite,
        Self::WheelWhite,
        Self::PositionColour,
        Self::YawColour,
        Self::ReferenceTime,
        Self::Speed,
        Self::SpeedTime,
        Self::Slip,
        Self::GroundTime,
        Self::Curvature,
        Self::Side,
        Self::Rack,
        Self::RackTime,
        Self::Wheel,
        Self::GyroColour,
        Self::RunSlip,
        Self::RunCurvature,
        Self::RunSide,
        Self::RunSpeed,
        Self::RunRack,
        Self::RunGyro,
    ];

    /// Standard deviation of the logarithm of what is thought possible before the data speak.
    pub(crate) fn spread(self) -> f64 {
        match self {
            Self::ReferenceTime | Self::SpeedTime | Self::GroundTime | Self::RackTime => 0.6,
            Self::RunSlip
            | Self::RunCurvature
            | Self::RunSide
            | Self::RunSpeed
            | Self::RunRack
            | Self::RunGyro => 0.8,
            _ => 1.2,
        }
    }
}

/// Logarithms of all levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Noise {
    /// By [`Level`].
    pub log: [f64; COUNT],
    /// Whether motor and rack were driven by what was measured instead of by commands: then both are as uncertain as if
    /// nothing were known, and no gap is told from the noise of their sensors.
    pub follows: bool,
}

impl Noise {
    /// Before any data: beliefs of vehicle.toml for the sensors, a good floor and a good car for the rest. `rows` is the
    /// mean number of rows per bin of wheels, steering, gyro and reference; `resolution` of a wheel \[m\] or \[m/s\].
    #[must_use]
    pub(crate) fn prior(vehicle: &Vehicle, rows: [f64; 4], resolution: f64, follows: bool) -> Self {
        let mean = |deviation: f64, rows: f64| deviation / rows.max(1.0).sqrt();
        let steering = vehicle.steering_sensor.map_or(0.002, |sensor| sensor.noise);
        let gyro = vehicle.gyro.map_or(0.003, |gyro| gyro.noise);
        let (position, yaw) =
            vehicle.reference.map_or((0.002, 0.002), |r| (r.position_noise, r.yaw_noise));
        let mut noise = Self { log: [0.0; COUNT], follows };
        for level in Level::ALL {
            let value = match level {
                Level::SteeringWhite => mean(steering.max(1e-5), rows[1]),
                Level::GyroWhite => mean(gyro.max(1e-6), rows[2]),
                Level::PositionWhite => mean(position.max(1e-5), rows[3]),
                Level::YawWhite => mean(yaw.max(1e-5), rows[3]),
                Level::WheelWhite => resolution,
                Level::PositionColour => 0.5 * position.max(1e-5),
                Level::YawColour => 0.5 * yaw.max(1e-5),
                Level::ReferenceTime => 1.0,
                Level::Speed => 0.003,
                Level::SpeedTime => 0.5,
                Level::Slip | Level::Curvature | Level::Side => 0.004,
                Level::GroundTime => 0.7,
                Level::Rack => 0.001,
                Level::RackTime => 0.3,
                Level::Wheel => 0.001,
                Level::GyroColour => 0.1 * gyro.max(1e-6),
                Level::RunSlip | Level::RunCurvature | Level::RunSide => 0.0007,
                Level::RunSpeed => 0.001,
                Level::RunRack => 0.0003,
                Level::RunGyro => 0.05 * gyro.max(1e-6),
            };
            noise.log[level as usize] = math::ln(value);
        }
        noise
    }

    /// Sets a level, above 0 however little.
    pub(crate) fn set(&mut self, level: Level, value: f64) {
        self.log[level as usize] = math::ln(value.max(1e-9));
    }

    /// The level itself.
    #[must_use]
    pub(crate) fn get(&self, level: Level) -> f64 {
        math::exp(self.log[level as usize])
    }
}
