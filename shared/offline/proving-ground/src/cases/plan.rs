//! Drives: which manoeuvres from where, and when what is read.

use core::f64::consts::PI;

use kerbside_geometry::{Pose, Vehicle, math};

use super::dice::Dice;
use super::specification::{Plan, Specification, Stamps};
use super::vehicle::deviating;
use crate::insertions::Effect;
use crate::library::{Asked, Manoeuvre, NAMES, Style};

/// Commands are sent so often \[Hz\].
const COMMAND_RATE: f64 = 20.0;
/// Stamps scatter by this share of their interval, by at most the second.
const JITTER: f64 = 0.08;
const FARTHEST: f64 = 0.3;
/// So many rows are lost, and as often a few in a row.
const LOST: f64 = 0.008;
const BURSTS: f64 = 0.001;
/// How much runs differ, as a share of what is uncertain.
const VARIATION: f64 = 0.3;
/// Steps of the believed path \[s\].
const PATH_STEP: f64 = 0.05;
/// Manoeuvres of which at least one is driven: they turn both ways and reverse.
const RICH: [&str; 5] = ["parking", "s-reverse", "circle-reverse", "shuttle", "creep"];
/// And of these: they turn both ways at speed.
const QUICK: [&str; 5] =
    ["circle-speeds", "eight", "slalom-large", "speed-steps", "steering-steps"];

/// `count` drives; where one `repeats`, it is the last before their order is drawn.
pub(super) fn plans(
    case: &Specification,
    count: usize,
    duration: f64,
    repeats: bool,
    seed: u64,
) -> Vec<Plan> {
    let mut dice = Dice::new(seed, 0);
    let new = if repeats && count > 1 { count - 1 } else { count };
    let (mut out, mut names): (Vec<Plan>, _) = (Vec::new(), chosen(&mut dice, new));
    names.truncate(new);
    for name in names {
        let number = 1 + out.iter().filter(|plan| is_of(plan, name)).count();
        let start = somewhere(&mut dice, &case.vehicle);
        out.extend(planned(case, &mut dice, (name, number), start, duration));
    }
    if new < count
        && let Some(again) = out.get(dice.below(out.len())).cloned()
    {
        out.push(repeated(case, &mut dice, &again, out.len()));
    }
    // A stated start or distance is a habit of whoever records, not of one run.
    let (start, distance) = (dice.chance(0.3), dice.chance(0.2));
    for plan in &mut out {
        let straight = ["straight-", "straight-stops-"].iter().any(|name| {
            plan.name.strip_prefix(name).is_some_and(|number| number.parse::<u32>().is_ok())
        });
        plan.states_start = start;
        plan.states_distance = distance && straight;
    }
    out.sort_by(|a, b| a.name.cmp(&b.name));
    out
}

fn is_of(plan: &Plan, name: &str) -> bool {
    plan.name.rsplit_once('-').is_some_and(|(of, _)| of == name)
}

/// Different manoeuvres as long as there are enough.
fn chosen(dice: &mut Dice, count: usize) -> Vec<&'static str> {
    let mut names = vec![dice.one(&QUICK, QUICK[0]), dice.one(&RICH, RICH[0])];
    let left: Vec<_> = NAMES.iter().copied().filter(|name| !names.contains(name)).collect();
    names.extend(dice.several(&left, count.saturating_sub(names.len())));
    while names.len() < count {
        names.push(dice.one(NAMES, NAMES[0]));
    }
    names
}

/// A start within a few wheelbases.
fn somewhere(dice: &mut Dice, vehicle: &Vehicle) -> Pose {
    let reach = 2.0 * vehicle.wheelbase;
    Pose::new(dice.between(-reach, reach), dice.between(-reach, reach), dice.between(-PI, PI))
}

fn planned(
    case: &Specification,
    dice: &mut Dice,
    (name, number): (&str, usize),
    start: Pose,
    duration: f64,
) -> Option<Plan> {
    let style = Style {
        speed: dice.between(0.65, 1.0),
        steering: dice.between(0.6, 0.95),
        mirrored: dice.chance(0.5),
    };
    let manoeuvre = Manoeuvre::new(name, &case.vehicle, style, duration)?;
    let sent = stamps(dice, COMMAND_RATE, duration, false);
    let commands = sent.iter().map(|time| written(manoeuvre.at(*time))).collect();
    Some(Plan {
        name: format!("{name}-{number}"),
        manoeuvre: manoeuvre.kind,
        repeat_of: None,
        duration,
        commands,
        start,
        stamps: Stamps { commands: sent, ..readings(case, dice, duration) },
        variation: variation(case, dice),
        seed: dice.seed(),
        states_start: false,
        states_distance: false,
    })
}

/// The same commands from about the same place.
fn repeated(case: &Specification, dice: &mut Dice, plan: &Plan, runs: usize) -> Plan {
    let near = 0.05 * case.vehicle.wheelbase;
    let Pose { x, y, yaw } = plan.start;
    let start = Pose::new(x + dice.within(near), y + dice.within(near), yaw + dice.within(0.01));
    let name = plan.name.rsplit_once('-').map_or(plan.name.as_str(), |(of, _)| of);
    let number = plan.name.rsplit_once('-').and_then(|(_, n)| n.parse().ok()).unwrap_or(runs);
    Plan {
        name: format!("{name}-{}", number + 1),
        repeat_of: Some(plan.name.clone()),
        start,
        stamps: Stamps {
            commands: plan.stamps.commands.clone(),
            ..readings(case, dice, plan.duration)
        },
        variation: variation(case, dice),
        seed: dice.seed(),
        ..plan.clone()
    }
}

/// As a file has it.
fn written(asked: Asked) -> Asked {
    let rounded = |value: f64, per: f64| (value * per).round() / per;
    Asked { speed: rounded(asked.speed, 1e3), steering: rounded(asked.steering, 1e4), ..asked }
}

fn variation(case: &Specification, dice: &mut Dice) -> Vec<Effect> {
    let varies = ["speed_gain", "steering_offset", "gyro_bias"];
    let all = deviating(dice, &case.uncertainty, VARIATION);
    all.into_iter().filter(|effect| varies.contains(&effect.id)).collect()
}

fn readings(case: &Specification, dice: &mut Dice, duration: f64) -> Stamps {
    let vehicle = &case.vehicle;
    let rates = [
        Some(vehicle.encoders.as_ref().map_or(50.0, |encoders| encoders.rate)),
        vehicle.steering_sensor.map(|sensor| sensor.rate),
        vehicle.gyro.map(|gyro| gyro.rate),
        vehicle.reference.map(|reference| reference.rate),
    ];
    let [encoders, steering, gyro, reference] =
        rates.map(|rate| rate.map_or_else(Vec::new, |rate| stamps(dice, rate, duration, true)));
    Stamps { commands: Vec::new(), encoders, steering, gyro, reference }
}

/// Stamps at about `rate` \[Hz\] in tenths of a millisecond, some of them missing where a sender `loses` rows.
fn stamps(dice: &mut Dice, rate: f64, duration: f64, loses: bool) -> Vec<f64> {
    let (phase, mut lost) = (dice.between(0.3, 1.0), 0_usize);
    let mut out = Vec::new();
    for k in 0_u32.. {
        let off = dice.within(JITTER).clamp(-FARTHEST, FARTHEST);
        let time = (f64::from(k) + phase + off) / rate;
        if time >= duration {
            return out;
        }
        if dice.chance(BURSTS) {
            lost = 2 + dice.below(4);
        }
        let single = dice.chance(LOST);
        if !(loses && (single || lost > 0)) {
            out.push((time * 1e4).round() / 1e4);
        }
        lost = lost.saturating_sub(1);
    }
    out
}

/// Where a vehicle that does what it is told would pass by: places of the rear axle while it moves.
pub(super) fn path(vehicle: &Vehicle, plan: &Plan) -> Vec<(f64, f64)> {
    let (mut pose, mut out, mut time) = (plan.start, Vec::new(), 0.0);
    while time < plan.duration {
        let behind = plan.commands.partition_point(|row| row.time <= time);
        let asked = behind.checked_sub(1).and_then(|at| plan.commands.get(at)).copied();
        let Asked { speed, steering, .. } = asked.unwrap_or_default();
        if speed != 0.0 {
            let way = speed * PATH_STEP;
            pose = pose.advance(way, way * math::tan(steering) / vehicle.wheelbase);
            out.push((pose.x, pose.y));
        }
        time += PATH_STEP;
    }
    out
}
