//! What the vehicle's sensors are, and how each of them errs. Every error can be set to zero on its own.

use kerbside_geometry::{Pose, Wheel};

/// An error that is remembered: a stationary first-order Gauss-Markov process, the exponentially correlated variable of
/// Gelb, *Applied Optimal Estimation*.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coloured {
    /// Standard deviation, in the unit of what it is added to.
    pub deviation: f64,
    /// After which the correlation has fallen to 1/e \[s\]; 0 makes it white.
    pub time_constant: f64,
}

impl Coloured {
    /// No error.
    pub const NONE: Self = Self { deviation: 0.0, time_constant: 0.0 };
}

/// How an encoder fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// It is not read: its count is missing.
    Missing,
    /// It repeats the count it had; what rolls by in the meantime is not counted.
    Stuck,
}

/// An encoder that fails for a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderFault {
    /// Whose.
    pub wheel: Wheel,
    /// How.
    pub failure: Failure,
    /// From when \[s\].
    pub begin: f64,
    /// Until when \[s\]; may be infinite.
    pub end: f64,
}

/// The wheel encoders.
#[derive(Clone, Debug, PartialEq)]
pub struct Encoders {
    /// Counts per turn; none where a wheel has no encoder.
    pub counts_per_revolution: [Option<f64>; 4],
    /// Width of the counter, after which it wraps, 1 to 64 \[bit\].
    pub counter_bits: u32,
    /// Counts at the start.
    pub first_counts: [i64; 4],
    /// Where between two counts a wheel stands at first: evenly drawn from so much of a count, 0 to 1.
    pub phase: f64,
    /// Random part of each wheel's travel: variance `noise`^2 per metre rolled in either direction \[m/sqrt(m)\].
    pub noise: [f64; 4],
    /// Distance over which that part is remembered \[m\]; 0 makes its increments independent. Over distances that are
    /// long against it the variance is the same.
    pub correlation_length: f64,
    /// Readings per second \[Hz\].
    pub rate: f64,
    /// Failures.
    pub faults: Vec<EncoderFault>,
}

/// The steering sensor, on the rack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteeringSensor {
    /// It reads `gain` * angle + `offset` \[rad\].
    pub offset: f64,
    /// See `offset`.
    pub gain: f64,
    /// Standard deviation of the white error \[rad\].
    pub white: f64,
    /// Beside it \[rad\].
    pub coloured: Coloured,
    /// Readings per second \[Hz\].
    pub rate: f64,
}

/// The gyro.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gyro {
    /// It reads `gain` * rate + bias; this is the bias at the start \[rad/s\].
    pub bias: f64,
    /// See `bias`.
    pub gain: f64,
    /// Random walk of the bias \[rad/s per sqrt(s)\].
    pub drift: f64,
    /// Standard deviation of the white error \[rad/s\].
    pub white: f64,
    /// Readings per second \[Hz\].
    pub rate: f64,
}

/// The reference: a marker on the vehicle, seen from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Standard deviation of the white error along each axis \[m\].
    pub position_white: f64,
    /// Beside it, along each axis \[m\].
    pub position_coloured: Coloured,
    /// Standard deviation of the heading's white error \[rad\].
    pub yaw_white: f64,
    /// Beside it \[rad\].
    pub yaw_coloured: Coloured,
    /// `body_from_marker`.
    pub marker: Pose,
    /// What its clock is ahead of the vehicle's \[s\].
    pub clock_offset: f64,
    /// Readings per second \[Hz\].
    pub rate: f64,
}

/// All sensors; none where the vehicle has not got it.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensors {
    /// Wheel encoders.
    pub encoders: Option<Encoders>,
    /// Steering sensor.
    pub steering: Option<SteeringSensor>,
    /// Gyro.
    pub gyro: Option<Gyro>,
    /// Reference.
    pub reference: Option<Reference>,
}

/// Wheels that turn and do not roll. They move counts and not the body: what the body does meanwhile is what the other
/// wheels and its inertia make it do, which at parking speed is to go on.
#[derive(Clone, Debug, PartialEq)]
pub struct Slip {
    /// Which wheels.
    pub wheels: Vec<Wheel>,
    /// What each surface runs on beyond its rolling, forward positive whichever way the car goes; negative for a wheel
    /// that skids on the way forward \[m\].
    pub travel: f64,
    /// From when \[s\].
    pub begin: f64,
    /// For how long, at an even rate \[s\]; 0 is a jump.
    pub duration: f64,
}

impl Slip {
    /// Both rear wheels spin by `travel` \[m\].
    #[must_use]
    pub fn rear_spin(travel: f64, begin: f64, duration: f64) -> Self {
        Self { wheels: vec![Wheel::RearLeft, Wheel::RearRight], travel, begin, duration }
    }

    /// One wheel spins by `travel` \[m\].
    #[must_use]
    pub fn spin(wheel: Wheel, travel: f64, begin: f64, duration: f64) -> Self {
        Self { wheels: vec![wheel], travel, begin, duration }
    }

    /// Both front wheels skid: they roll by `travel` \[m\] less than the car goes forward.
    #[must_use]
    pub fn front_skid(travel: f64, begin: f64, duration: f64) -> Self {
        Self { wheels: vec![Wheel::FrontLeft, Wheel::FrontRight], travel: -travel, begin, duration }
    }

    /// What the surface of `wheel` has run on beyond its rolling by `time` \[m\].
    #[must_use]
    pub fn travel_at(&self, wheel: Wheel, time: f64) -> f64 {
        if !self.wheels.contains(&wheel) || time < self.begin {
            return 0.0;
        }
        if time >= self.begin + self.duration {
            return self.travel;
        }
        self.travel * (time - self.begin) / self.duration
    }
}
