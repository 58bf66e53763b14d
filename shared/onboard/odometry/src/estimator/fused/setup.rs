//! What does not change in the fused filter's life.

use kerbside_geometry::{Drive, Vehicle};

use super::joint::Values;
use crate::parameters::{Parameter, ParameterPrior};
use crate::sensors::Sensors;
use crate::settings::EstimatorSettings;
use crate::wheels::WheelScale;

/// Blocks after which the parameters learn, as a share of the wheelbase: 50 mm for the 1:6 car.
const BLOCK: f64 = 0.1;

/// And at least so many counts.
const COUNTS: f64 = 20.0;

/// Way after which a parameter is as uncertain as its prior says by change alone: tyres wear, loads
/// and pressures change \[m\].
const MEMORY: f64 = 1e5;

/// Random walk of a gyro's bias \[rad/s/sqrt(s)\].
const BIAS_WALK: f64 = 5e-5;

/// A sensor without noise would leave nothing to weigh \[m, rad^2\].
pub(crate) const LEAST_VARIANCE: f64 = 1e-12;

/// A wheel's own gate, as a multiple of that for three degrees of freedom: 25 (five standard
/// deviations) where that is 16.27.
const WHEEL_GATE: f64 = 1.5366;

/// Vehicle, noise and prior.
#[derive(Clone, Debug)]
pub(crate) struct Setup {
    pub(crate) wheelbase: f64,
    pub(crate) track_front: f64,
    pub(crate) track_rear: f64,
    pub(crate) drive: Drive,
    /// Variance of each wheel's travel per metre \[m\].
    pub(crate) wheel_variance: [f64; 4],
    /// What a count leaves open of a travel between two readings: q^2/6 \[m^2\].
    pub(crate) quantisation: [f64; 4],
    /// Variance of the steering angle \[rad^2\].
    pub(crate) steering_variance: f64,
    pub(crate) steered: bool,
    /// The coarsest count \[m\].
    pub(crate) coarsest: f64,
    /// Wheels that report.
    pub(crate) wheels: [bool; 4],
    /// Length of a block \[m\].
    pub(crate) block: f64,
    /// Test ratio beyond which a wheel is left out of a block, one degree of freedom.
    pub(crate) wheel_gate: f64,
    /// Squared Mahalanobis length beyond which a fix is refused.
    pub(crate) gate: f64,
    pub(crate) prior: ParameterPrior,
    /// Tells this vehicle and prior from others: what was learnt is deviations from these.
    pub(crate) basis: u64,
    /// What change adds to the parameters' variances per metre.
    drift: Values,
    /// And to that of the gyro's bias per second.
    bias_drift: f64,
}

impl Setup {
    pub(crate) fn new(
        vehicle: &Vehicle,
        sensors: &Sensors,
        settings: &EstimatorSettings,
        prior: &ParameterPrior,
        scales: &[WheelScale; 4],
    ) -> Self {
        let coarsest = scales.iter().fold(0.0_f64, |most, scale| most.max(scale.metres_per_count));
        let noise = wheel_noise(vehicle, settings, prior);
        let steering =
            vehicle.steering_sensor.map_or(settings.steering_noise, |sensor| sensor.noise);
        let uncertain = prior.covariance.diagonal();
        let bias = Parameter::GyroBias.index();
        let mut drift = uncertain / MEMORY;
        drift[bias] = 0.0;
        Self {
            wheelbase: vehicle.wheelbase,
            track_front: vehicle.track_front,
            track_rear: vehicle.track_rear,
            drive: vehicle.drive,
            wheel_variance: noise.map(|noise| (noise * noise).max(LEAST_VARIANCE)),
            quantisation: scales.map(|scale| scale.metres_per_count.powi(2) / 6.0),
            steering_variance: (steering * steering).max(LEAST_VARIANCE),
            coarsest,
            steered: sensors.steering,
            wheels: sensors.wheels,
            block: (BLOCK * vehicle.wheelbase).max(COUNTS * coarsest),
            wheel_gate: WHEEL_GATE * settings.gate,
            gate: settings.gate,
            drift,
            bias_drift: if uncertain[bias] > 0.0 { BIAS_WALK * BIAS_WALK } else { 0.0 },
            basis: basis(vehicle, prior, scales),
            prior: prior.clone(),
        }
    }

    /// What way \[m\] and time \[s\] add to the parameters' variances.
    pub(crate) fn drift(&self, way: f64, time: f64) -> Values {
        let mut drift = self.drift * way;
        drift[Parameter::GyroBias.index()] = self.bias_drift * time;
        drift
    }
}

/// A number that other measures or another prior do not share (FNV-1a over their bits); never 0.
fn basis(vehicle: &Vehicle, prior: &ParameterPrior, scales: &[WheelScale; 4]) -> u64 {
    let sensor = vehicle.steering_sensor.map_or((0.0, 1.0), |sensor| (sensor.offset, sensor.gain));
    let bias = vehicle.gyro.map_or(0.0, |gyro| gyro.bias);
    let (tracks, base) = ([vehicle.track_front, vehicle.track_rear], vehicle.wheelbase);
    let measures = [base, tracks[0], tracks[1], sensor.0, sensor.1, bias];
    let counts = scales.iter().map(|scale| scale.metres_per_count);
    let numbers = measures.into_iter().chain(vehicle.radius).chain(counts);
    let all = numbers.chain(prior.covariance.iter().copied());
    let bytes = all.flat_map(|number| number.to_bits().to_le_bytes());
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    hash.max(1)
}

/// Random part of each wheel's travel \[m/sqrt(m)\]: the prior's, else the file's, else the
/// settings'.
pub(crate) fn wheel_noise(
    vehicle: &Vehicle,
    settings: &EstimatorSettings,
    prior: &ParameterPrior,
) -> [f64; 4] {
    let stated = vehicle.encoders.and_then(|encoders| encoders.noise_per_distance);
    prior.wheel_noise.unwrap_or([stated.unwrap_or(settings.wheel_noise); 4])
}
