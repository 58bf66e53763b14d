//! What every effect is held to, by the trial in its own file.

use kerbside_geometry::{Pose, Reference, Vehicle, WHEELS, Wheel, angle};

use super::{Definition, Effects, Parameter, definition};
use crate::drive::{Command, Drive};
use crate::plant::Plant;
use crate::simulator::STEP;
use crate::stepper::Stepper;
use crate::train::Actuators;
use crate::trajectory::Trajectory;

/// Wheels' way, wheels' speed, steering, yaw rate, reference x, y and yaw.
const CHANNELS: usize = 13;
/// What a sensor errs by, about: [m], [m/s], [rad], [rad/s], [m], [m], [rad].
const NOISE: [f64; CHANNELS] =
    [1e-3, 1e-3, 1e-3, 1e-3, 5e-3, 5e-3, 5e-3, 5e-3, 2e-3, 3e-3, 2e-3, 2e-3, 2e-3];
/// Length of every run [s].
const UNTIL: f64 = 16.0;

/// Which sensors there are.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Seen {
    All,
    NoSteeringSensor,
    NoGyro,
    NoReference,
}

/// How an effect is tried.
pub(super) struct Trial {
    pub(super) id: &'static str,
    pub(super) wheel: Option<Wheel>,
    /// Of its parameters, in their order.
    pub(super) values: &'static [f64],
    /// The same effect in a mirror, left for right.
    pub(super) mirrored: &'static [f64],
    /// A run in which it shows.
    pub(super) shows: fn() -> Vec<Command>,
    /// A run in which it does not, whatever its value.
    pub(super) hides: fn() -> Vec<Command>,
    /// What is seen of that.
    pub(super) seen: Seen,
    /// Where the search for its values begins, where that is not the neutral ones.
    pub(super) begin: Option<&'static [f64]>,
    /// Step of the finite differences, in widths of the ranges.
    pub(super) difference: f64,
    /// Largest error of the values found, in widths of their ranges.
    pub(super) tolerance: f64,
}

impl Trial {
    /// One that is the same in a mirror and found from its neutral value.
    pub(super) const fn of(
        id: &'static str,
        values: &'static [f64],
        shows: fn() -> Vec<Command>,
        hides: fn() -> Vec<Command>,
    ) -> Self {
        Self {
            id,
            wheel: None,
            values,
            mirrored: values,
            shows,
            hides,
            seen: Seen::All,
            begin: None,
            difference: 1e-4,
            tolerance: 1e-5,
        }
    }

    fn definition(&self) -> &'static Definition {
        definition(self.id).unwrap()
    }

    fn parameters(&self) -> Vec<Parameter> {
        Parameter::of(self.id).filter(|parameter| parameter.wheel() == self.wheel).collect()
    }

    fn effects(&self, values: &[f64]) -> Effects {
        let parameters = self.parameters();
        assert_eq!(parameters.len(), values.len(), "{}", self.id);
        parameters
            .into_iter()
            .zip(values)
            .fold(Effects::NEUTRAL, |effects, (parameter, value)| effects.with(parameter, *value))
    }

    /// Neutral values that are applied change no bit of any state.
    pub(super) fn neutral_values_change_no_bit(&self) {
        let mut plant = Plant::new(&car(1.0), &Effects::NEUTRAL);
        let nominal = run(&plant, &(self.shows)());
        let neutral: Vec<f64> = Parameter::of(self.id).map(Parameter::neutral).collect();
        (self.definition().apply)(&neutral, &mut plant);
        let altered = run(&plant, &(self.shows)());
        assert_eq!(nominal.knots().len(), altered.knots().len());
        assert_eq!(format!("{nominal:?}"), format!("{altered:?}"), "to the sign of a zero");
        let applied = self.effects(self.values);
        let plant = Plant::new(&car(1.0), &applied);
        let changed = run(&plant, &(self.shows)());
        assert_ne!(format!("{nominal:?}"), format!("{changed:?}"), "and other values do");
    }

    /// A mirrored drive shows the mirror image.
    pub(super) fn a_mirrored_drive_is_the_mirror_image(&self) {
        let effects = self.effects(self.values);
        let mut image = self.effects(self.mirrored);
        if let Some(wheel) = self.wheel {
            let parameter = self.definition().parameters[0].name;
            let across = WHEELS[wheel.index() ^ 1];
            image = Effects::NEUTRAL
                .with(Parameter::find_at(self.id, parameter, across).unwrap(), self.mirrored[0]);
        }
        let commands = (self.shows)();
        let mirrored: Vec<Command> = commands
            .iter()
            .map(|command| Command { steering: -command.steering, ..*command })
            .collect();
        let left = run(&Plant::new(&car(1.0), &effects), &commands);
        let right = run(&Plant::new(&car(-1.0), &image), &mirrored);
        for step in 0..160 {
            let t = f64::from(step) * 0.1;
            let (left, right) = (shown(&left, t), shown(&right, t));
            // Each channel's image, and its sign.
            let across = [1, 0, 3, 2, 5, 4, 7, 6, 8, 9, 10, 11, 12];
            let sign = |channel: usize| if matches!(channel, 8 | 9 | 11 | 12) { -1.0 } else { 1.0 };
            for channel in 0..CHANNELS {
                let error = left[channel] - sign(channel) * right[across[channel]];
                assert!(error.abs() < 1e-9, "{t} {channel}: {error}");
            }
        }
    }

    /// Gauss-Newton, damped, on noise-free readings of a run that excites the effect.
    pub(super) fn a_run_that_excites_it_gives_its_values_back(&self) {
        let commands = (self.shows)();
        let readings = |values: &[f64]| self.readings(&commands, values, Seen::All);
        let truth = readings(self.values);
        let misfit = |values: &[f64]| -> Vec<f64> {
            readings(values).iter().zip(&truth).map(|(ours, theirs)| ours - theirs).collect()
        };
        let widths: Vec<f64> = self
            .definition()
            .parameters
            .iter()
            .map(|parameter| (parameter.range.1 - parameter.range.0).min(2.0))
            .collect();
        let neutral: Vec<f64> = self.parameters().into_iter().map(Parameter::neutral).collect();
        let mut values = self.begin.map_or(neutral, <[f64]>::to_vec);
        let mut residual = misfit(&values);
        let (mut cost, mut damping) = (square(&residual), 1e-3);
        for _ in 0..60 {
            let columns: Vec<Vec<f64>> = (0..values.len())
                .map(|index| {
                    let step = self.difference * widths[index];
                    let mut moved = values.clone();
                    moved[index] += step;
                    let ahead = misfit(&moved);
                    ahead.iter().zip(&residual).map(|(a, b)| (a - b) / self.difference).collect()
                })
                .collect();
            let step = damped_step(&columns, &residual, damping);
            let trial: Vec<f64> =
                values.iter().zip(&widths).zip(&step).map(|((v, w), s)| v + w * s).collect();
            let next = misfit(&trial);
            if square(&next) < cost {
                (values, cost, residual) = (trial, square(&next), next);
                damping *= 0.1;
            } else {
                damping *= 10.0;
            }
        }
        for (index, width) in widths.iter().enumerate() {
            let mut error = values[index] - self.values[index];
            if self.definition().parameters[index].name == "direction" {
                error = angle::wrap(error);
            }
            let error = error / width;
            assert!(error.abs() < self.tolerance, "{}: {values:?}", self.id);
        }
    }

    /// A run that does not excite the effect looks the same whatever its values.
    pub(super) fn a_run_that_does_not_excite_it_does_not_show_it(&self) {
        let commands = (self.hides)();
        let neutral: Vec<f64> = self.parameters().into_iter().map(Parameter::neutral).collect();
        let nominal = self.readings(&commands, &neutral, self.seen);
        let altered = self.readings(&commands, self.values, self.seen);
        let difference: Vec<f64> = nominal.iter().zip(&altered).map(|(n, a)| a - n).collect();
        // In noise of the sensors: what is left is that other instants are joined by lines.
        let size = (square(&difference) / difference.len() as f64).sqrt();
        assert!(size < 1e-3, "{}: {size}", self.id);
    }

    /// Every reading of a run over what its sensor errs by.
    fn readings(&self, commands: &[Command], values: &[f64], seen: Seen) -> Vec<f64> {
        let (vehicle, effects) = (car(1.0), self.effects(values));
        let drive =
            Drive { vehicle: &vehicle, effects, commands, start: Pose::default(), step: STEP };
        let mut trajectory = Trajectory::new();
        drive.trajectory(UNTIL, &mut trajectory);
        let mut readings = Vec::new();
        for row in 0..320 {
            let shown = shown(&trajectory, f64::from(row) * 0.05);
            for (channel, (value, noise)) in shown.iter().zip(NOISE).enumerate() {
                let hidden = match seen {
                    Seen::All => false,
                    Seen::NoSteeringSensor => channel == 8,
                    Seen::NoGyro => channel == 9,
                    Seen::NoReference => channel >= 10,
                };
                readings.extend((!hidden).then_some(value / noise));
            }
        }
        readings
    }
}

/// The trial's tests.
macro_rules! tests {
    ($trial:expr) => {
        #[test]
        fn neutral_values_change_no_bit() {
            $trial.neutral_values_change_no_bit();
        }

        #[test]
        fn a_mirrored_drive_is_the_mirror_image() {
            $trial.a_mirrored_drive_is_the_mirror_image();
        }

        #[test]
        fn a_run_that_excites_it_gives_its_values_back() {
            $trial.a_run_that_excites_it_gives_its_values_back();
        }

        #[test]
        fn a_run_that_does_not_excite_it_does_not_show_it() {
            $trial.a_run_that_does_not_excite_it_does_not_show_it();
        }
    };
}
pub(super) use tests;

/// The car of the paper with its marker off the centre, or the same in a mirror (`side` = -1).
fn car(side: f64) -> Vehicle {
    let marker = Pose::new(0.11, -0.04 * side, 0.3 * side);
    let reference = Reference { position_noise: 0.002, yaw_noise: 0.002, rate: 25.0, marker };
    Vehicle { radius: [0.0725; 4], reference: Some(reference), ..Vehicle::paper_car() }
}

fn run(plant: &Plant, commands: &[Command]) -> Trajectory {
    let mut actuators = Actuators::new(plant);
    commands
        .iter()
        .for_each(|command| actuators.command(command.t, command.speed, command.steering));
    let mut trajectory = Trajectory::new();
    let stepper = Stepper::new(plant, actuators, Pose::default(), STEP);
    trajectory.fill(plant, stepper, UNTIL, STEP);
    trajectory
}

fn shown(trajectory: &Trajectory, t: f64) -> [f64; CHANNELS] {
    let [fl, fr, rl, rr] = trajectory.rotation(t).map(|rotation| rotation * 0.0725);
    let [sfl, sfr, srl, srr] = trajectory.wheel_speed(t);
    let reference = trajectory.reference(t);
    let (steering, yaw_rate) = (trajectory.steering(t), trajectory.yaw_rate(t));
    let Pose { x, y, yaw } = reference;
    [fl, fr, rl, rr, sfl, sfr, srl, srr, steering, yaw_rate, x, y, yaw]
}

fn square(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

/// Solves (J'J + damping diag(J'J) + tiny) s = -J'r by elimination.
fn damped_step(columns: &[Vec<f64>], residual: &[f64], damping: f64) -> Vec<f64> {
    let n = columns.len();
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let mut rows: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            let mut row: Vec<f64> = (0..n).map(|j| dot(&columns[i], &columns[j])).collect();
            row[i] = row[i] * (1.0 + damping) + 1e-9;
            row.push(-dot(&columns[i], residual));
            row
        })
        .collect();
    for i in 0..n {
        let pivot = rows[i].clone();
        for (other, row) in rows.iter_mut().enumerate() {
            if other != i {
                let factor = row[i] / pivot[i];
                row.iter_mut().zip(&pivot).for_each(|(value, pivot)| *value -= factor * pivot);
            }
        }
    }
    (0..n).map(|i| rows[i][n] / rows[i][i]).collect()
}

fn rows(count: u32, of: impl Fn(f64) -> (f64, f64)) -> Vec<Command> {
    let row = |index: u32| {
        let t = f64::from(index) * 0.05;
        let (speed, steering) = of(t);
        Command { t, speed, steering }
    };
    (0..count).map(row).collect()
}

/// Nothing is driven, the wheels are steered to and fro.
pub(super) fn standing() -> Vec<Command> {
    rows(320, |t| (0.0, 0.4 * triangle(t / 8.0)))
}

/// Steps of speed straight ahead, none to below 0.2 m/s but for stops.
pub(super) fn straight() -> Vec<Command> {
    rows(320, |t| match t {
        1.0..5.0 => (0.2, 0.0),
        5.0..9.0 => (0.45, 0.0),
        9.0..12.0 => (0.3, 0.0),
        _ => (0.0, 0.0),
    })
}

/// Speed and steering grow and fall slowly.
pub(super) fn gentle() -> Vec<Command> {
    let ramp = |t: f64| (1.0 - (t - 8.0).abs() / 7.0).clamp(0.0, 1.0);
    rows(320, |t| (0.12 * ramp(t), 0.2 * ramp(t)))
}

/// Steps of speed and of steering to both sides, forward and in reverse.
pub(super) fn steps() -> Vec<Command> {
    rows(320, |t| match t {
        0.5..3.0 => (0.4, 0.3),
        3.0..5.0 => (0.48, -0.4),
        5.0..7.0 => (0.3, 0.2),
        7.0..9.0 => (-0.25, -0.3),
        9.0..11.0 => (-0.4, 0.35),
        11.0..15.0 => (0.35, -0.15),
        _ => (0.0, 0.0),
    })
}

/// To and fro over the same place in several directions.
pub(super) fn shuttle() -> Vec<Command> {
    rows(320, |t| match t {
        0.5..4.0 => (0.45, 0.5),
        4.0..8.0 => (-0.45, -0.45),
        8.0..12.0 => (0.45, -0.2),
        12.0..15.0 => (-0.45, 0.3),
        _ => (0.0, 0.0),
    })
}

/// Speeds that creep up through all small values and back, to both directions.
pub(super) fn creeping() -> Vec<Command> {
    let row = |index: u32| {
        let t = f64::from(index) * 0.005;
        Command { t, speed: 0.2 * triangle(t / 8.0), steering: 0.1 }
    };
    (0..3200).map(row).collect()
}

/// 0 at 0, 1 at a quarter, -1 at three quarters, of period 1.
fn triangle(t: f64) -> f64 {
    let phase = (t + 0.25).fract();
    1.0 - 4.0 * (phase - 0.5).abs()
}
