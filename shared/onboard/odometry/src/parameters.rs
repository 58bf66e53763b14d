//! What is uncertain about a vehicle's own numbers, and how the fused filter numbers it.

use kerbside_geometry::Vehicle;
use kerbside_messages::FilterState;
use nalgebra::SMatrix;

/// How many parameters the fused filter carries beside the pose.
pub const PARAMETERS: usize = 9;

/// A parameter of the vehicle, as a deviation from what its file states. Its number is its row in
/// every covariance of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Radius of the front left wheel, relative.
    RadiusFrontLeft = 0,
    /// Radius of the front right wheel, relative.
    RadiusFrontRight = 1,
    /// Radius of the rear left wheel, relative.
    RadiusRearLeft = 2,
    /// Radius of the rear right wheel, relative.
    RadiusRearRight = 3,
    /// Front track \[m\].
    TrackFront = 4,
    /// Rear track \[m\].
    TrackRear = 5,
    /// Wheelbase \[m\].
    Wheelbase = 6,
    /// What the steering sensor reads when the wheels point straight ahead \[rad\].
    SteeringZero = 7,
    /// What the gyro reads at rest \[rad/s\].
    GyroBias = 8,
}

impl Parameter {
    /// All, in the order of their numbers.
    pub const ALL: [Self; PARAMETERS] = [
        Self::RadiusFrontLeft,
        Self::RadiusFrontRight,
        Self::RadiusRearLeft,
        Self::RadiusRearRight,
        Self::TrackFront,
        Self::TrackRear,
        Self::Wheelbase,
        Self::SteeringZero,
        Self::GyroBias,
    ];

    /// Name, as configuration and reports write it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::RadiusFrontLeft => "radius.fl",
            Self::RadiusFrontRight => "radius.fr",
            Self::RadiusRearLeft => "radius.rl",
            Self::RadiusRearRight => "radius.rr",
            Self::TrackFront => "track_front",
            Self::TrackRear => "track_rear",
            Self::Wheelbase => "wheelbase",
            Self::SteeringZero => "steering_zero",
            Self::GyroBias => "gyro_bias",
        }
    }

    /// Unit of its value.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::SteeringZero => "rad",
            Self::GyroBias => "rad/s",
            _ => "m",
        }
    }

    /// What a deviation of 0 stands for, and what one of 1 adds to it \[m, rad or rad/s\].
    #[must_use]
    pub fn basis(self, vehicle: &Vehicle) -> (f64, f64) {
        match self {
            Self::TrackFront => (vehicle.track_front, 1.0),
            Self::TrackRear => (vehicle.track_rear, 1.0),
            Self::Wheelbase => (vehicle.wheelbase, 1.0),
            // Offset and gain are taken out of every reading before, and so is the gyro's bias.
            Self::SteeringZero => {
                vehicle.steering_sensor.map_or((0.0, 1.0), |sensor| (sensor.offset, sensor.gain))
            }
            Self::GyroBias => (vehicle.gyro.map_or(0.0, |gyro| gyro.bias), 1.0),
            radius => (vehicle.radius[radius.index()], vehicle.radius[radius.index()]),
        }
    }

    /// Row in a covariance of parameters.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// Covariance of all parameters, rows and columns by [`Parameter::index`].
pub type ParameterCovariance = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// What a calibration leaves open: the fused filter's prior.
///
/// A calibration gives the whole covariance; by its off-diagonal entries the filter knows what the
/// runs determined only together.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterPrior {
    /// Covariance of the parameters; zeros: known exactly.
    pub covariance: ParameterCovariance,
    /// Random part of each wheel's travel, standard deviation \[m/sqrt(m)\]; none: as the vehicle's
    /// file or the settings state it, the same for all.
    pub wheel_noise: Option<[f64; 4]>,
}

impl ParameterPrior {
    /// All parameters are exactly as the vehicle's file states them.
    #[must_use]
    pub fn known() -> Self {
        Self { covariance: ParameterCovariance::zeros(), wheel_noise: None }
    }

    /// Independent parameters with these standard deviations, in the order of [`Parameter`].
    #[must_use]
    pub fn independent(deviations: [f64; PARAMETERS]) -> Self {
        let mut covariance = ParameterCovariance::zeros();
        for (index, deviation) in deviations.iter().enumerate() {
            covariance[(index, index)] = deviation * deviation;
        }
        Self { covariance, wheel_noise: None }
    }

    /// What an ordinary calibration of `vehicle` leaves where nothing else is stated: radii to
    /// 0.05 %, tracks to 0.35 %, the wheelbase to 0.4 %, the steering zero to 0.3 degrees, the gyro
    /// to 0.01 rad/s. For the 1:6 car of Lee, Chung and Chang these are 1 mm and 2 mm.
    #[must_use]
    pub fn calibrated(vehicle: &Vehicle) -> Self {
        let (front, rear) = (0.0035 * vehicle.track_front, 0.0035 * vehicle.track_rear);
        let radius = 5e-4;
        let wheelbase = 0.004 * vehicle.wheelbase;
        Self::independent([radius, radius, radius, radius, front, rear, wheelbase, 0.0052, 0.01])
    }
}

/// What the fused filter has learnt of the parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterEstimate {
    /// Deviations from what the vehicle's file states, in the order of [`Parameter`].
    pub deviation: [f64; PARAMETERS],
    /// Their covariance.
    pub covariance: ParameterCovariance,
}

impl ParameterEstimate {
    /// What the filter knew that sent `state`; none where it carries no parameters.
    #[must_use]
    pub fn of(state: &FilterState) -> Option<Self> {
        let mut covariance = ParameterCovariance::zeros();
        let mut lower = state.parameter_covariance.iter();
        for row in 0..PARAMETERS {
            for (column, entry) in (0..=row).zip(&mut lower) {
                covariance[(row, column)] = *entry;
                covariance[(column, row)] = *entry;
            }
        }
        (state.basis != 0).then_some(Self { deviation: state.parameters, covariance })
    }
}
