//! What is known of a vehicle: the nominal model that vehicle.toml states.

/// The four corners a wheel may sit at, in the order used for every array of four.
///
/// A wheel on the vehicle's centre line (a single front wheel; a motor behind a differential) is the left one of
/// an axle whose track is zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Wheel {
    /// `fl`, index 0.
    FrontLeft = 0,
    /// `fr`, index 1.
    FrontRight = 1,
    /// `rl`, index 2.
    RearLeft = 2,
    /// `rr`, index 3.
    RearRight = 3,
}

/// The wheels in index order.
pub const WHEELS: [Wheel; 4] =
    [Wheel::FrontLeft, Wheel::FrontRight, Wheel::RearLeft, Wheel::RearRight];

impl Wheel {
    /// Index into every array of four wheels.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The short name that files use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        ["fl", "fr", "rl", "rr"][self as usize]
    }

    /// Whether the wheel is on the front axle.
    #[must_use]
    pub const fn is_front(self) -> bool {
        matches!(self, Self::FrontLeft | Self::FrontRight)
    }

    /// Whether the wheel is on the left side.
    #[must_use]
    pub const fn is_left(self) -> bool {
        matches!(self, Self::FrontLeft | Self::RearLeft)
    }
}

/// Which wheels the motor turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Drive {
    /// The rear wheels.
    #[default]
    Rear,
    /// The front wheels.
    Front,
    /// All wheels.
    All,
}

/// The rectangle the body covers on the ground; the body frame's origin is on its long axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Along x \[m\].
    pub length: f64,
    /// Along y \[m\].
    pub width: f64,
    /// From the rear axle back to the rear edge \[m\].
    pub rear_overhang: f64,
}

/// What the vehicle can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest speed in either direction \[m/s\].
    pub speed: f64,
    /// Largest acceleration \[m/s^2\]; the actuator of the nominal vehicle knows this one limit.
    pub acceleration: f64,
    /// Deceleration that planner and gate may ask for \[m/s^2\].
    pub deceleration: f64,
    /// Largest road-wheel angle of the equivalent centre wheel \[rad\].
    pub steering: f64,
    /// Largest rate of that angle \[rad/s\].
    pub steering_rate: f64,
}

/// Nominal response of the actuators: a gain, a pure delay, then a first-order lag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuators {
    /// Delay of the speed \[s\].
    pub speed_delay: f64,
    /// Time constant of the speed \[s\].
    pub speed_lag: f64,
    /// Delay of the steering \[s\].
    pub steering_delay: f64,
    /// Time constant of the steering \[s\].
    pub steering_lag: f64,
    /// Speed reached per speed commanded \[-\].
    pub speed_gain: f64,
    /// Angle of the rack reached per angle commanded \[-\].
    pub steering_gain: f64,
    /// By which the road wheels stand askew of the rack \[rad\].
    pub steering_offset: f64,
}

impl Default for Actuators {
    /// An ideal response.
    fn default() -> Self {
        Self {
            speed_delay: 0.0,
            speed_lag: 0.0,
            steering_delay: 0.0,
            steering_lag: 0.0,
            speed_gain: 1.0,
            steering_gain: 1.0,
            steering_offset: 0.0,
        }
    }
}

impl Actuators {
    /// What to command, so that the vehicle drives at `speed` \[m/s\] with its road wheels at `steering` \[rad\].
    #[must_use]
    pub fn command(&self, speed: f64, steering: f64) -> (f64, f64) {
        (speed / self.speed_gain, (steering - self.steering_offset) / self.steering_gain)
    }
}

/// The wheel encoders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoders {
    /// Counts per turn of the wheel; none where a wheel has no encoder.
    pub counts_per_revolution: [Option<f64>; 4],
    /// Width of the counter, after which it wraps \[bit\].
    pub counter_bits: u32,
    /// Random part of a wheel's travel, standard deviation \[m/sqrt(m)\]; a belief.
    pub noise_per_distance: Option<f64>,
    /// Readings per second \[Hz\].
    pub rate: f64,
}

/// The steering sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteeringSensor {
    /// Standard deviation \[rad\]; a belief.
    pub noise: f64,
    /// Readings per second \[Hz\].
    pub rate: f64,
    /// What it reads while the wheels stand straight \[rad\].
    pub offset: f64,
    /// Reading per road-wheel angle, beyond the offset \[-\].
    pub gain: f64,
}

impl SteeringSensor {
    /// A sensor without offset, whose reading is the angle: `noise` \[rad\] at `rate` \[Hz\].
    #[must_use]
    pub const fn new(noise: f64, rate: f64) -> Self {
        Self { noise, rate, offset: 0.0, gain: 1.0 }
    }

    /// Road-wheel angle of the equivalent centre wheel for a reading, both \[rad\].
    #[must_use]
    pub fn angle(&self, reading: f64) -> f64 {
        (reading - self.offset) / self.gain
    }

    /// What it reads, but for noise, at a road-wheel angle, both \[rad\].
    #[must_use]
    pub fn reading(&self, angle: f64) -> f64 {
        self.gain * angle + self.offset
    }
}

/// The gyro.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gyro {
    /// Standard deviation \[rad/s\]; a belief.
    pub noise: f64,
    /// Readings per second \[Hz\].
    pub rate: f64,
    /// What it reads at rest \[rad/s\].
    pub bias: f64,
}

/// The reference sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Standard deviation of the position \[m\]; a belief.
    pub position_noise: f64,
    /// Standard deviation of the yaw \[rad\]; a belief.
    pub yaw_noise: f64,
    /// Readings per second \[Hz\].
    pub rate: f64,
    /// `body_from_marker`.
    pub marker: crate::Pose,
}

/// The nominal vehicle. Arrays of four are indexed by [`Wheel`].
#[derive(Clone, Debug, PartialEq)]
pub struct Vehicle {
    /// Name, for people.
    pub name: String,
    /// Axle to axle \[m\].
    pub wheelbase: f64,
    /// Between the contact points of the front wheels \[m\]; 0 for one wheel on the centre line.
    pub track_front: f64,
    /// Between the contact points of the rear wheels \[m\]; 0 for one wheel on the centre line.
    pub track_rear: f64,
    /// Wheel radii \[m\].
    pub radius: [f64; 4],
    /// Radii by which the vehicle computes the wheel speeds that it reports \[m\]; none where these are `radius`.
    ///
    /// A calibration finds other radii; the vehicle goes on computing with its own.
    pub speed_radius: [Option<f64>; 4],
    /// Which wheels the motor turns.
    pub drive: Drive,
    /// Outline.
    pub footprint: Footprint,
    /// What it can do.
    pub limits: Limits,
    /// Nominal response; none where unknown.
    pub actuators: Option<Actuators>,
    /// Wheel encoders; none where the wheels report speeds.
    pub encoders: Option<Encoders>,
    /// Steering sensor, where there is one.
    pub steering_sensor: Option<SteeringSensor>,
    /// Gyro, where there is one.
    pub gyro: Option<Gyro>,
    /// Reference sensor, where there is one.
    pub reference: Option<Reference>,
}

impl Vehicle {
    /// Position of a wheel's contact point in the body frame: (x, y) \[m\].
    #[must_use]
    pub fn wheel_position(&self, wheel: Wheel) -> (f64, f64) {
        let (x, track) = if wheel.is_front() {
            (self.wheelbase, self.track_front)
        } else {
            (0.0, self.track_rear)
        };
        (x, if wheel.is_left() { 0.5 * track } else { -0.5 * track })
    }

    /// What a speed that the vehicle reports of `wheel` has to be multiplied by.
    #[must_use]
    pub fn speed_scale(&self, wheel: Wheel) -> f64 {
        let radius = self.radius[wheel.index()];
        self.speed_radius[wheel.index()].map_or(1.0, |used| radius / used)
    }

    /// Mean nominal radius of the driven wheels \[m\].
    #[must_use]
    pub fn driven_radius(&self) -> f64 {
        let [fl, fr, rl, rr] = self.radius;
        match self.drive {
            Drive::Rear => 0.5 * (rl + rr),
            Drive::Front => 0.5 * (fl + fr),
            Drive::All => 0.25 * (fl + fr + rl + rr),
        }
    }

    /// Nominal response of the actuators; ideal where the vehicle's file states none.
    #[must_use]
    pub fn response(&self) -> Actuators {
        self.actuators.unwrap_or_default()
    }
}
