//! From what a plant did to the rows of a run.

use core::f64::consts::TAU;

use kerbside_geometry::Pose;

use super::floor::{Disturbance, Floor};
use super::specification::{Plan, Specification};
use crate::colour::Process;
use crate::insertions::Effect;
use crate::library::Asked;
use crate::normal::Normal;
use crate::record::Stamped;

/// Streams of a run's seed.
const FIRST_COUNTS: u64 = 30;
const WHEELS: u64 = 31;
const STEERING: u64 = 32;
const GYRO: u64 = 33;
const REFERENCE: u64 = 34;
const STATED: u64 = 37;
/// Counters begin below this.
const FIRST_COUNT: f64 = 900.0;
/// Steps in which values are written: wheel speed \[m/s\], angle \[rad\], everything else in SI units.
const SPEED_STEP: f64 = 0.002;
const ANGLE_STEP: f64 = 0.0005;
const STEP: f64 = 1e-4;

/// What a plant is told to drive.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The case.
    pub case: &'a Specification,
    /// The drive.
    pub plan: &'a Plan,
    /// All that acts, good order and run-to-run differences included.
    pub effects: &'a [Effect],
    /// What disturbs.
    pub disturbance: &'a Disturbance,
}

/// What the sensors show without noise, at the stamps of the plan and in their order, effects included.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Signals {
    /// Rotation of the wheels since the start \[rad\]; of a vehicle that reports speeds those of the surfaces \[m/s\].
    pub wheels: Vec<[f64; 4]>,
    /// Angle \[rad\].
    pub steering: Vec<f64>,
    /// \[rad/s\].
    pub yaw_rate: Vec<f64>,
    /// Of the marker, yaw not wrapped.
    pub reference: Vec<Pose>,
    /// True distance of the rear-axle centre along the body's x axis, signed \[m\].
    pub distance: f64,
}

/// Who can drive a case.
pub trait Drives {
    /// Drives once.
    fn drive(&self, task: &Task<'_>) -> Signals;
}

/// What errs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Errors {
    /// Nothing: no noise, no disturbance, no difference from run to run; counts are fractions, begin at 0 and do not wrap.
    None,
    /// All, drawn by the plan's seed and this one; 0 gives the case as it is handed out.
    Drawn(u64),
    /// The same, but counters begin at 0 and do not wrap, so that many seeds make a covariance.
    Unwrapped(u64),
}

impl Errors {
    /// The seed of what errs.
    pub(super) fn seed(self) -> Option<u64> {
        match self {
            Self::None => None,
            Self::Drawn(seed) | Self::Unwrapped(seed) => Some(seed),
        }
    }
}

/// The rows of a run's files. Arrays of four are fl, fr, rl, rr; a value that was not read is none.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// Name of the run.
    pub name: String,
    /// The word for its manoeuvre.
    pub manoeuvre: &'static str,
    /// Name of the run that it repeats.
    pub repeat_of: Option<String>,
    /// Stated start pose of the body.
    pub start: Option<Pose>,
    /// Stated distance \[m\].
    pub distance: Option<f64>,
    /// commands.csv.
    pub commands: Vec<Asked>,
    /// encoders.csv; whole numbers unless nothing errs.
    pub counts: Vec<Stamped<[Option<f64>; 4]>>,
    /// wheels.csv \[m/s\].
    pub speeds: Vec<Stamped<[f64; 4]>>,
    /// steering.csv \[rad\].
    pub steering: Vec<Stamped<f64>>,
    /// imu.csv \[rad/s\].
    pub yaw_rate: Vec<Stamped<f64>>,
    /// reference.csv: x, y \[m\] and yaw \[rad\], not wrapped.
    pub reference: Vec<Stamped<(f64, f64, Option<f64>)>>,
}

/// A stamp with what is read then.
fn rows<A: Copy, B>(
    stamps: &[f64],
    values: &[A],
    mut read: impl FnMut(f64, A) -> B,
) -> Vec<Stamped<B>> {
    let pairs = stamps.iter().zip(values);
    pairs.map(|(time, value)| Stamped { time: *time, value: read(*time, *value) }).collect()
}

fn rounded(value: f64, step: f64) -> f64 {
    (value / step).round() * step
}

/// One seed of two.
pub(super) fn mixed(one: u64, other: u64) -> u64 {
    one ^ other.wrapping_mul(0xd134_2543_de82_ef95).rotate_left(29)
}

/// The rows of `plan` from its `signals`.
pub(super) fn observed(
    case: &Specification,
    plan: &Plan,
    signals: &Signals,
    errors: Errors,
) -> Rows {
    let seed = errors.seed().map(|seed| mixed(plan.seed, seed));
    let floor = &case.floor;
    let mut out = Rows {
        name: plan.name.clone(),
        manoeuvre: plan.manoeuvre,
        repeat_of: plan.repeat_of.clone(),
        start: None,
        distance: None,
        commands: plan.commands.clone(),
        counts: Vec::new(),
        speeds: Vec::new(),
        steering: rows(&plan.stamps.steering, &signals.steering, |_, angle| angle),
        yaw_rate: rows(&plan.stamps.gyro, &signals.yaw_rate, |_, rate| rate),
        reference: rows(&plan.stamps.reference, &signals.reference, |_, pose| {
            (pose.x, pose.y, case.reference_yaw.then_some(pose.yaw))
        }),
    };
    state_by_hand(case, plan, signals, seed, &mut out);
    let stamps = &plan.stamps.encoders;
    match &case.vehicle.encoders {
        Some(encoders) => {
            let per_turn = encoders.counts_per_revolution;
            let counter = Counter::new(encoders.counter_bits, seed, errors);
            out.counts = rows(stamps, &signals.wheels, |_, rotation| {
                core::array::from_fn(|i| {
                    per_turn[i].map(|n| counter.shown(i, rotation[i] / TAU * n))
                })
            });
        }
        None => out.speeds = rows(stamps, &signals.wheels, |_, speeds| speeds),
    }
    if let Some(seed) = seed {
        add_noise(floor, seed, &mut out);
    }
    out
}

/// What a person writes down beside the files; with a tape's error where there are errors.
fn state_by_hand(
    case: &Specification,
    plan: &Plan,
    signals: &Signals,
    seed: Option<u64>,
    out: &mut Rows,
) {
    let mut normal = Normal::new(seed.unwrap_or_default(), STATED);
    let share = if seed.is_some() { 1.0 } else { 0.0 };
    let tape = share * 0.002 * case.vehicle.wheelbase;
    let mut off = |deviation: f64| deviation * normal.sample();
    let (x, y, turn, way) = (off(tape), off(tape), off(0.002 * share), off(2.0 * tape));
    let start = Pose::new(plan.start.x + x, plan.start.y + y, plan.start.yaw + turn);
    out.start = plan.states_start.then_some(start);
    out.distance = plan.states_distance.then_some(signals.distance.abs() + way);
}

/// Quantises and wraps.
struct Counter {
    /// Range of the counter; none where it does not end.
    range: Option<f64>,
    first: Option<[f64; 4]>,
}

impl Counter {
    fn new(bits: u32, seed: Option<u64>, errors: Errors) -> Self {
        let wraps = matches!(errors, Errors::Drawn(_));
        let reach = if wraps { FIRST_COUNT } else { 1.0 };
        let first = seed.map(|seed| {
            let mut normal = Normal::new(seed, FIRST_COUNTS);
            core::array::from_fn(|_| reach * normal.uniform())
        });
        let bits = i32::try_from(bits.clamp(1, 52)).unwrap_or(52);
        Self { range: wraps.then(|| 2.0_f64.powi(bits)), first }
    }

    /// What is shown of `steps`; the counter is signed.
    fn shown(&self, wheel: usize, steps: f64) -> f64 {
        let Some(first) = self.first else {
            return steps;
        };
        let count = (first[wheel] + steps).floor();
        self.range.map_or(count, |range| count - range * (count / range + 0.5).floor())
    }
}

fn add_noise(floor: &Floor, seed: u64, out: &mut Rows) {
    let mut normal = Normal::new(seed, WHEELS);
    for row in &mut out.speeds {
        let noisy = |speed: &mut f64| {
            *speed = rounded(*speed + normal.scaled(floor.wheel_speed), SPEED_STEP);
        };
        row.value.iter_mut().for_each(noisy);
    }
    let (mut normal, mut process) =
        (Normal::new(seed, STEERING), Process::new(floor.steering_coloured));
    for Stamped { time, value } in &mut out.steering {
        *value += process.at(*time, &mut normal) + normal.scaled(floor.steering);
        *value = rounded(*value, ANGLE_STEP);
    }
    let (mut normal, mut process) = (Normal::new(seed, GYRO), Process::new(floor.gyro_coloured));
    for Stamped { time, value } in &mut out.yaw_rate {
        *value += process.at(*time, &mut normal) + normal.scaled(floor.gyro);
        *value = rounded(*value, STEP);
    }
    let mut normals =
        [REFERENCE, REFERENCE + 1, REFERENCE + 2].map(|stream| Normal::new(seed, stream));
    let coloured = [floor.position_coloured, floor.position_coloured, floor.yaw_coloured];
    let mut processes = coloured.map(Process::new);
    let white = [floor.position, floor.position, floor.yaw];
    for Stamped { time, value } in &mut out.reference {
        let [x, y, yaw] = core::array::from_fn(|i| {
            processes[i].at(*time, &mut normals[i]) + normals[i].scaled(white[i])
        });
        let [x, y] = [value.0 + x, value.1 + y].map(|place| rounded(place, STEP));
        *value = (x, y, value.2.map(|heading| rounded(heading + yaw, STEP)));
    }
}
