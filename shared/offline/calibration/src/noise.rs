//! How the sensors are believed to err, and the settings of a fit.

use core::f64::consts::TAU;

use kerbside_geometry::{Vehicle, WHEELS};

use crate::parameters::{Parameter, Parameters, Vector};

/// Believed noise of the sensors; standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Of each wheel's travel: the variance is the square of this times the travel \[m/sqrt(m)\].
    pub wheel: f64,
    /// Travel per count of fl, fr, rl, rr \[m\]; 0 where a wheel is not counted.
    pub quantum: [f64; 4],
    /// Of one reading of the steering sensor, white \[rad\].
    pub steering: f64,
    /// Of the reference's position, each axis \[m\].
    pub position: f64,
    /// Of the reference's heading \[rad\].
    pub yaw: f64,
    /// Least time between readings of the reference whose errors are independent \[s\]: what comes sooner
    /// is not used.
    pub reference_interval: f64,
    /// By which the reference's stamps may be late against the wheels', all through a run; 0: by nothing \[s\].
    pub reference_lag: f64,
    /// By which that wanders \[s/sqrt(s)\].
    pub reference_wander: f64,
    /// Of one reading of the gyro, white \[rad/s\].
    pub gyro: f64,
    /// Of the gyro's bias, another one in every run \[rad/s\].
    pub gyro_bias: f64,
    /// Of a position measured by hand, each axis \[m\].
    pub hand_position: f64,
    /// Of a heading measured by hand \[rad\].
    pub hand_yaw: f64,
    /// Of a distance measured by tape \[m\].
    pub distance: f64,
    /// Of a net turn known otherwise \[rad\].
    pub turn: f64,
}

impl Noise {
    /// What the vehicle's file believes; where it says nothing, 1 mm per square root of a metre, 0.2 degrees,
    /// 5 mm and 5 mrad for what is measured by hand, 2 mm for a tape, and 1 mrad for a guide rail.
    #[must_use]
    pub fn of(vehicle: &Vehicle) -> Self {
        let encoders = vehicle.encoders.as_ref();
        let quantum = WHEELS.map(|wheel| {
            let per_turn = encoders.and_then(|e| e.counts_per_revolution[wheel.index()]);
            per_turn.map_or(0.0, |counts| TAU * vehicle.radius[wheel.index()] / counts)
        });
        Self {
            wheel: encoders.and_then(|e| e.noise_per_distance).unwrap_or(0.001),
            quantum,
            steering: vehicle.steering_sensor.map_or(0.0035, |sensor| sensor.noise),
            position: vehicle.reference.map_or(0.005, |reference| reference.position_noise),
            yaw: vehicle.reference.map_or(0.005, |reference| reference.yaw_noise),
            reference_interval: 0.1,
            reference_lag: 0.0,
            reference_wander: 0.0,
            gyro: vehicle.gyro.map_or(0.003, |gyro| gyro.noise),
            gyro_bias: 0.05,
            hand_position: 0.005,
            hand_yaw: 0.005,
            distance: 0.002,
            turn: 0.001,
        }
    }
}

/// Settings of a joint fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Believed noise.
    pub noise: Noise,
    /// Travel over which front, rear and steering increments are condensed \[m\].
    pub block: f64,
    /// Travel over which what the axles say is compared \[m\].
    pub comparison: f64,
    /// Whether the steering gain is fitted; else it stays at 1.
    pub free_gain: bool,
    /// Whether the place of the reference's marker is fitted; else it stays as the vehicle's file states it.
    pub free_marker: bool,
    /// Standard deviations of the weak priors about the nominal vehicle, each in its parameter's unit: 4 % of a
    /// radius, 10 % of a track, 6 % of the wheelbase (3 mm, 30 mm and 30 mm for the 1:6 car), 0.1 rad, 0.1; a
    /// fifth of the wheelbase and 0.05 rad of the marker's place.
    pub prior: Vector,
    /// A parameter whose standard deviation from the runs alone exceeds this share of the prior's is not identified.
    pub identified_share: f64,
    /// Deviations beyond which a residual is weighed down (Huber).
    pub huber: f64,
    /// Deviations beyond which a run's sum of squares makes it an outlier.
    pub outlier: f64,
    /// Largest share of the runs that may be rejected as outliers.
    pub largest_rejected_share: f64,
    /// Folds of the leave-out check; below 2 there is none.
    pub folds: usize,
}

impl Settings {
    /// The defaults for `vehicle`.
    #[must_use]
    pub fn of(vehicle: &Vehicle) -> Self {
        Self {
            noise: Noise::of(vehicle),
            block: 0.1 * vehicle.wheelbase,
            comparison: 2.0 * vehicle.wheelbase,
            free_gain: false,
            free_marker: false,
            prior: prior(vehicle),
            identified_share: 0.5,
            huber: 3.0,
            outlier: 5.0,
            largest_rejected_share: 0.34,
            folds: 5,
        }
    }
}

const MARKER_X: usize = Parameter::MarkerX.index();
const MARKER_Y: usize = Parameter::MarkerY.index();
const MARKER_YAW: usize = Parameter::MarkerYaw.index();

fn prior(vehicle: &Vehicle) -> Vector {
    let nominal = Parameters::nominal(vehicle).values;
    // Of two wheels on the centre line nothing but the radius is known; a track of 0 stays 0.
    let shares = [0.04, 0.04, 0.04, 0.04, 0.1, 0.1, 0.06];
    Vector::from_fn(|index, _| match shares.get(index) {
        Some(share) if nominal[index] > 0.0 => share * nominal[index],
        None if index == MARKER_X || index == MARKER_Y => 0.2 * vehicle.wheelbase,
        None if index == MARKER_YAW => 0.05,
        _ => 0.1,
    })
}
