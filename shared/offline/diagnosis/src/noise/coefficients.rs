//! How errors move from bin to bin: the linear model about a path.

use kerbside_geometry::{Vehicle, math};

use crate::bins::{Binned, Channels};
use crate::path::{Path, driven_share, rolling};

/// Number of states.
pub(crate) const STATES: usize = 26;
/// Error of the compared point's pose in the path's body frame \[m, m, rad\].
pub(crate) const POSE: usize = 0;
/// Error of each wheel's travel \[m\].
pub(crate) const TRAVEL: usize = 3;
/// Coloured disturbances: motor, slip, curvature, side velocity, rack, four wheels, gyro.
pub(crate) const SPEED: usize = 7;
pub(crate) const SLIP: usize = 8;
pub(crate) const CURVATURE: usize = 9;
pub(crate) const SIDE: usize = 10;
pub(crate) const RACK: usize = 11;
pub(crate) const WHEELS: usize = 12;
pub(crate) const GYRO: usize = 16;
/// Coloured errors of the reference.
pub(crate) const COLOUR: usize = 17;
/// What differs from run to run: motor, slip, curvature, side velocity, rack, gyro.
pub(crate) const RUN: usize = 20;
/// Inputs that move the integrated states: the coloured ones from SPEED to WHEELS + 3.
pub(crate) const INPUTS: usize = 9;

/// The input of [`Coefficients::response`] that is slip of the driven wheels.
pub(crate) const OF_SLIP: usize = 1;
/// The input of [`Coefficients::response`] that is the first wheel's.
pub(crate) const OF_WHEEL: usize = 5;

/// From one bin to the next.
#[derive(Clone, Debug)]
pub(crate) struct StepCoefficients {
    pub along: f64,
    pub across: f64,
    pub sin: f64,
    pub cos: f64,
    /// Change of (x, y, yaw, travel of the four wheels) per unit of each input, in the frame at the end of the step.
    pub input: [[f64; INPUTS]; 7],
    /// The same per second, of yaw and wheels' speed, in the bin at the end of the step.
    pub rate: [[f64; INPUTS]; 5],
}

/// All bins of a run.
#[derive(Clone, Debug)]
pub(crate) struct Coefficients {
    pub steps: Vec<StepCoefficients>,
    /// Rates in the first bin.
    pub first: [[f64; INPUTS]; 5],
    pub width: f64,
    pub speeds: bool,
    /// Which channels were measured in each bin.
    pub present: Vec<[bool; crate::bins::CHANNELS]>,
}

impl Coefficients {
    /// Of `vehicle` along `path`.
    pub(crate) fn new(vehicle: &Vehicle, binned: &Binned, path: &Path) -> Self {
        let share = driven_share(vehicle);
        let curvatures: Vec<f64> = path
            .steps
            .iter()
            .map(|step| math::tan(step.steering.clamp(-1.5, 1.5)) / vehicle.wheelbase)
            .collect();
        let inputs: Vec<[[f64; INPUTS]; 7]> = path
            .steps
            .iter()
            .zip(&curvatures)
            .map(|(step, curvature)| {
                inputs(vehicle, &share, step.distance, step.steering, *curvature)
            })
            .collect();
        let rate = |k: usize| -> [[f64; INPUTS]; 5] {
            let (before, after) = (k.saturating_sub(1), k.min(inputs.len().saturating_sub(1)));
            core::array::from_fn(|row| {
                core::array::from_fn(|i| {
                    inputs.get(before).map_or(0.0, |b| {
                        0.5 * (b[row + 2][i] + inputs[after][row + 2][i]) / binned.width
                    })
                })
            })
        };
        let steps = path.steps.iter().enumerate().map(|(k, step)| {
            let (sin, cos) = math::sin_cos(step.turn);
            StepCoefficients {
                along: step.along,
                across: step.across,
                sin,
                cos,
                input: inputs[k],
                rate: rate(k + 1),
            }
        });
        Self {
            steps: steps.collect(),
            first: rate(0),
            width: binned.width,
            speeds: binned.speeds,
            present: binned.measured.iter().map(|bin: &Channels| bin.map(f64::is_finite)).collect(),
        }
    }
}

/// What a step of `distance` \[m\] with the road wheels at `steering` \[rad\] adds to the integrated errors, per unit of
/// each input. Slip leaves the driven wheels as they are and slows the body and the wheels that are not driven.
fn inputs(
    vehicle: &Vehicle,
    share: &[f64; 4],
    distance: f64,
    steering: f64,
    curvature: f64,
) -> [[f64; INPUTS]; 7] {
    let roll = rolling(vehicle, curvature);
    let mean: f64 = share.iter().zip(&roll).map(|(s, g)| s * g.0).sum();
    let slope: f64 = share.iter().zip(&roll).map(|(s, g)| s * g.1).sum();
    // The motor fixes the driven wheels' mean: the car slows where they have to roll further.
    let body = -slope / mean.max(1e-9);
    let cos = math::cos(steering).abs().max(0.05);
    let per_rack = 1.0 / (cos * cos * vehicle.wheelbase);
    let mut m = [[0.0; INPUTS]; 7];
    let curvature_column = |m: &mut [[f64; INPUTS]; 7], i: usize, scale: f64| {
        m[0][i] = scale * distance * body;
        m[2][i] = scale * distance * (1.0 + curvature * body);
        for (wheel, (g, dg)) in roll.iter().enumerate() {
            m[3 + wheel][i] = scale * distance * (dg + g * body);
        }
    };
    m[0][0] = distance;
    m[2][0] = distance * curvature;
    m[0][1] = -distance;
    m[2][1] = -distance * curvature;
    for (wheel, (g, _)) in roll.iter().enumerate() {
        m[3 + wheel][0] = distance * g;
        m[3 + wheel][1] = if share[wheel] > 0.0 { 0.0 } else { -distance * g };
        m[3 + wheel][5 + wheel] = distance;
    }
    curvature_column(&mut m, 2, 1.0 / vehicle.wheelbase);
    m[1][3] = distance.abs();
    curvature_column(&mut m, 4, per_rack);
    m
}

impl Coefficients {
    /// What an input (0 motor, 1 slip, 2 curvature, 3 side velocity, 4 rack, 5..8 wheels) of this size in each bin makes
    /// of all channels.
    pub(crate) fn response(&self, input: usize, size: &[f64]) -> Vec<Channels> {
        let mut state = [0.0; 7];
        let mut rows = Vec::with_capacity(size.len());
        for (k, now) in size.iter().enumerate() {
            if k > 0 {
                let step = &self.steps[k - 1];
                let mean = 0.5 * (size[k - 1] + now);
                let (x, y) = (state[0] - state[2] * step.across, state[1] + state[2] * step.along);
                (state[0], state[1]) = (step.cos * x + step.sin * y, -step.sin * x + step.cos * y);
                for (value, inputs) in state.iter_mut().zip(&step.input) {
                    *value += inputs[input] * mean;
                }
            }
            let rate = if k == 0 { &self.first } else { &self.steps[k - 1].rate };
            let mut row = [0.0; crate::bins::CHANNELS];
            for wheel in 0..4 {
                row[wheel] =
                    if self.speeds { rate[1 + wheel][input] * now } else { state[TRAVEL + wheel] };
            }
            row[crate::bins::STEERING] = if input == 4 { *now } else { 0.0 };
            row[crate::bins::GYRO] = rate[0][input] * now;
            row[crate::bins::REFERENCE..].copy_from_slice(&state[..3]);
            rows.push(row);
        }
        rows
    }
}
