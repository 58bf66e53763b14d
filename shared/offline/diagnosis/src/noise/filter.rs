//! The Kalman filter of the noise, as a whitener.

use super::coefficients::{
    COLOUR, CURVATURE, Coefficients, GYRO, INPUTS, POSE, RACK, RUN, SIDE, SLIP, SPEED, STATES,
    StepCoefficients, TRAVEL, WHEELS,
};
use super::level::{Level, Noise};
use crate::bins::{self, CHANNELS, Channels};
use kerbside_geometry::math;

type State = [f64; STATES];

/// Start of what nothing is known of: pose \[m, m, rad\] and travel \[m\].
const UNKNOWN: f64 = 1.0;
/// Motor and rack of a car that follows what was measured: a share, and an angle \[rad\].
const FOLLOWS: (f64, f64) = (0.5, 0.5);
/// Time constant of both \[s\].
const FOLLOWS_TIME: f64 = 0.1;

/// A measurement's gain and scale.
#[derive(Clone, Debug)]
struct Update {
    channel: usize,
    gain: State,
    /// One over the innovation's standard deviation.
    weight: f64,
    /// Where the channel's row of the measurement matrix has entries, in all rows.
    row: core::ops::Range<usize>,
}

/// The filter of one run, ready to whiten any residual of it.
#[derive(Clone, Debug)]
pub(crate) struct Whitener {
    steps: Vec<StepCoefficients>,
    decay: State,
    updates: Vec<Vec<Update>>,
    /// Entries of all measurement rows: state and factor.
    rows: Vec<(usize, f64)>,
    /// Sum of the logarithms of the innovations' variances.
    pub log_determinant: f64,
    /// Number of values.
    pub values: usize,
}

/// Whitened values with their bin and channel, in a fixed order.
pub(crate) type Whitened = Vec<f64>;

impl Whitener {
    /// The filter along a path.
    pub(crate) fn new(
        coefficients: &Coefficients,
        noise: &Noise,
        wheelbase_has_rack: bool,
    ) -> Self {
        let model = Model::new(coefficients, noise, wheelbase_has_rack);
        let mut covariance = model.initial();
        let (mut log_determinant, mut values) = (0.0, 0);
        let mut updates = Vec::with_capacity(coefficients.present.len());
        let mut rows = Vec::new();
        for (k, present) in coefficients.present.iter().enumerate() {
            let rate = if k == 0 { &coefficients.first } else { &coefficients.steps[k - 1].rate };
            if k > 0 {
                model.predict(&mut covariance, &coefficients.steps[k - 1]);
            }
            let mut bin = Vec::new();
            for channel in (0..CHANNELS).filter(|channel| present[*channel]) {
                let row = measurement(channel, rate, coefficients.speeds);
                let mut update = model.update(&mut covariance, channel, &row);
                update.row.start = rows.len();
                rows.extend_from_slice(row.entries());
                update.row.end = rows.len();
                log_determinant -= 2.0 * math::ln(update.weight);
                values += 1;
                bin.push(update);
            }
            updates.push(bin);
        }
        Self {
            steps: coefficients.steps.clone(),
            decay: model.decay,
            updates,
            rows,
            log_determinant,
            values,
        }
    }

    /// Bin and channel of each whitened value, in their order.
    pub(crate) fn places(&self) -> impl Iterator<Item = (usize, usize)> {
        let of_bin = |(bin, updates): (usize, &Vec<Update>)| {
            updates.iter().map(move |update| (bin, update.channel)).collect::<Vec<_>>()
        };
        self.updates.iter().enumerate().flat_map(of_bin)
    }

    /// Appends the whitened residuals to `out`. A value that is missing where one was measured counts as no residual.
    pub(crate) fn apply(&self, residuals: &[Channels], out: &mut Whitened) {
        let mut x: State = [0.0; STATES];
        for (k, updates) in self.updates.iter().enumerate() {
            if k > 0 {
                advance(&mut x, &self.steps[k - 1], &self.decay);
            }
            for update in updates {
                let entries = &self.rows[update.row.clone()];
                let expected: f64 = entries.iter().map(|(state, factor)| factor * x[*state]).sum();
                let value = residuals[k][update.channel];
                let innovation = if value.is_finite() { value - expected } else { 0.0 };
                for (state, gain) in x.iter_mut().zip(&update.gain) {
                    *state += gain * innovation;
                }
                out.push(innovation * update.weight);
            }
        }
    }
}

/// A sparse row of the measurement matrix.
struct Row {
    entries: [(usize, f64); 2 * INPUTS + 3],
    count: usize,
}

impl Row {
    fn new() -> Self {
        Self { entries: [(0, 0.0); 2 * INPUTS + 3], count: 0 }
    }

    fn put(&mut self, state: usize, factor: f64) {
        if factor != 0.0 {
            self.entries[self.count] = (state, factor);
            self.count += 1;
        }
    }

    fn entries(&self) -> &[(usize, f64)] {
        &self.entries[..self.count]
    }

    fn of(&self, x: &State) -> f64 {
        self.entries().iter().map(|(state, factor)| factor * x[*state]).sum()
    }
}

/// State of the run-to-run part of an input; none of the single wheels.
fn run_state(input: usize) -> Option<usize> {
    (input < 5).then_some(RUN + input)
}

fn put_rates(row: &mut Row, rates: &[f64; INPUTS]) {
    for (input, rate) in rates.iter().enumerate() {
        row.put(SPEED + input, *rate);
        if let Some(state) = run_state(input) {
            row.put(state, *rate);
        }
    }
}

fn measurement(channel: usize, rate: &[[f64; INPUTS]; 5], speeds: bool) -> Row {
    let mut row = Row::new();
    match channel {
        0..=3 if speeds => put_rates(&mut row, &rate[1 + channel]),
        0..=3 => row.put(TRAVEL + channel, 1.0),
        bins::STEERING => {
            row.put(RACK, 1.0);
            row.put(RUN + 4, 1.0);
        }
        bins::GYRO => {
            put_rates(&mut row, &rate[0]);
            row.put(GYRO, 1.0);
            row.put(RUN + 5, 1.0);
        }
        _ => {
            row.put(POSE + channel - bins::REFERENCE, 1.0);
            row.put(COLOUR + channel - bins::REFERENCE, 1.0);
        }
    }
    row
}

/// Moves a state to the next bin.
fn advance(x: &mut State, step: &StepCoefficients, decay: &State) {
    let mut sums = [0.0; INPUTS];
    for (input, sum) in sums.iter_mut().enumerate() {
        *sum = x[SPEED + input] + run_state(input).map_or(0.0, |state| x[state]);
    }
    let (ex, ey) = (x[0] - x[2] * step.across, x[1] + x[2] * step.along);
    (x[0], x[1]) = (step.cos * ex + step.sin * ey, -step.sin * ex + step.cos * ey);
    for (row, inputs) in step.input.iter().enumerate() {
        x[row] += inputs.iter().zip(&sums).map(|(factor, sum)| factor * sum).sum::<f64>();
    }
    for state in SPEED..RUN {
        x[state] *= decay[state];
    }
}

/// The noise model of a run.
pub(super) struct Model {
    decay: State,
    drive: State,
    start: State,
    white: [f64; CHANNELS],
}

impl Model {
    pub(super) fn new(coefficients: &Coefficients, noise: &Noise, has_steering: bool) -> Self {
        let width = coefficients.width;
        let level = |level: Level| noise.get(level);
        let mut start = [0.0; STATES];
        let mut decay = [1.0; STATES];
        let mut put = |state: usize, deviation: f64, time: f64| {
            start[state] = deviation * deviation;
            decay[state] = math::exp(-width / time.max(1e-3));
        };
        if noise.follows {
            put(SPEED, FOLLOWS.0, FOLLOWS_TIME);
            put(RACK, if has_steering { FOLLOWS.1 } else { 1.0 }, FOLLOWS_TIME);
        } else {
            put(SPEED, level(Level::Speed), level(Level::SpeedTime));
            put(RACK, level(Level::Rack), level(Level::RackTime));
        }
        let ground = level(Level::GroundTime);
        put(SLIP, level(Level::Slip), ground);
        put(CURVATURE, level(Level::Curvature), ground);
        put(SIDE, level(Level::Side), ground);
        for wheel in 0..4 {
            put(WHEELS + wheel, level(Level::Wheel), ground);
        }
        put(GYRO, level(Level::GyroColour), 5.0);
        for (axis, kind) in
            [Level::PositionColour, Level::PositionColour, Level::YawColour].into_iter().enumerate()
        {
            put(COLOUR + axis, level(kind), level(Level::ReferenceTime));
        }
        let drive =
            core::array::from_fn(|state| start[state] * (1.0 - decay[state] * decay[state]));
        let run = [
            Level::RunSpeed,
            Level::RunSlip,
            Level::RunCurvature,
            Level::RunSide,
            Level::RunRack,
            Level::RunGyro,
        ];
        for (offset, kind) in run.into_iter().enumerate() {
            start[RUN + offset] = level(kind) * level(kind);
        }
        start[..SPEED].fill(UNKNOWN * UNKNOWN);
        let mut white = [level(Level::WheelWhite); CHANNELS];
        white[bins::STEERING] = level(Level::SteeringWhite);
        white[bins::GYRO] = level(Level::GyroWhite);
        white[bins::REFERENCE] = level(Level::PositionWhite);
        white[bins::REFERENCE + 1] = level(Level::PositionWhite);
        white[bins::REFERENCE + 2] = level(Level::YawWhite);
        Self { decay, drive, start, white: white.map(|deviation| deviation * deviation) }
    }

    /// Residuals of a right model, with deviates from `normal`; they begin at 0 where the start is free.
    pub(super) fn draw(
        &self,
        coefficients: &Coefficients,
        mut normal: impl FnMut() -> f64,
    ) -> Vec<Channels> {
        let mut x: State = core::array::from_fn(|state| {
            if state < SPEED { 0.0 } else { self.start[state].sqrt() * normal() }
        });
        let mut rows = Vec::with_capacity(coefficients.present.len());
        for (k, present) in coefficients.present.iter().enumerate() {
            let rate = if k == 0 { &coefficients.first } else { &coefficients.steps[k - 1].rate };
            if k > 0 {
                advance(&mut x, &coefficients.steps[k - 1], &self.decay);
                for (x, drive) in x.iter_mut().zip(&self.drive).take(RUN).skip(SPEED) {
                    *x += drive.sqrt() * normal();
                }
            }
            let mut row = bins::MISSING;
            for channel in (0..CHANNELS).filter(|channel| present[*channel]) {
                row[channel] = measurement(channel, rate, coefficients.speeds).of(&x)
                    + self.white[channel].sqrt() * normal();
            }
            rows.push(row);
        }
        rows
    }

    fn initial(&self) -> Box<[State; STATES]> {
        let mut covariance = Box::new([[0.0; STATES]; STATES]);
        for (state, row) in covariance.iter_mut().enumerate() {
            row[state] = self.start[state];
        }
        covariance
    }

    /// F P F' + Q, by moving the rows and then the columns of P as states are moved.
    fn predict(&self, covariance: &mut [State; STATES], step: &StepCoefficients) {
        for row in covariance.iter_mut() {
            advance(row, step, &self.decay);
        }
        transpose(covariance);
        for row in covariance.iter_mut() {
            advance(row, step, &self.decay);
        }
        for (state, row) in covariance.iter_mut().enumerate().take(RUN).skip(SPEED) {
            row[state] += self.drive[state];
        }
    }

    fn update(&self, covariance: &mut [State; STATES], channel: usize, row: &Row) -> Update {
        let mut spread = [0.0; STATES];
        for (state, factor) in row.entries() {
            for (sum, value) in spread.iter_mut().zip(&covariance[*state]) {
                *sum += factor * value;
            }
        }
        let variance = (row.of(&spread) + self.white[channel]).max(1e-18);
        let gain = spread.map(|value| value / variance);
        for (values, gain) in covariance.iter_mut().zip(&gain) {
            for (value, spread) in values.iter_mut().zip(&spread) {
                *value -= gain * spread;
            }
        }
        Update { channel, gain, weight: 1.0 / variance.sqrt(), row: 0..0 }
    }
}

fn transpose(covariance: &mut [State; STATES]) {
    for i in 1..STATES {
        let (above, below) = covariance.split_at_mut(i);
        for (j, row) in above.iter_mut().enumerate() {
            core::mem::swap(&mut row[i], &mut below[0][j]);
        }
    }
}
