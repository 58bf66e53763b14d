//! Cases for the tests: the simulator's vehicle with effects put in, its sensors with seeded noise, and a floor that
//! disturbs it a little. That the model fits its own data says nothing of other plants; it does say whether the answer
//! follows from the data.

use core::f64::consts::TAU;

use kerbside_diagnosis::{Allowance, Case, Diagnosis, Run, Series, Settings, Wheels, diagnose};
use kerbside_geometry::{Gyro, Pose, Reference, Vehicle, math};
use kerbside_simulation::{Command, Drive, Effects, Parameter, Trajectory};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Which sensors a case has.
#[derive(Clone, Copy)]
pub(crate) struct Sensors {
    pub(crate) steering: bool,
    pub(crate) gyro: bool,
    pub(crate) yaw: bool,
}

/// What is said of a case.
pub(crate) fn answer(case: &Case) -> Diagnosis {
    diagnose(case, &Settings::default(), &|_, _| {}).expect("a diagnosis")
}

/// One effect.
pub(crate) fn with(id: &str, name: &str, value: f64) -> Effects {
    Effects::NEUTRAL.with(Parameter::find(id, name).expect("listed"), value)
}

pub(crate) const ALL: Sensors = Sensors { steering: true, gyro: true, yaw: true };

/// The paper's car with a gyro and a reference.
pub(crate) fn vehicle() -> Vehicle {
    Vehicle {
        gyro: Some(Gyro { noise: 0.003, rate: 40.0, bias: 0.0 }),
        reference: Some(Reference {
            position_noise: 0.002,
            yaw_noise: 0.002,
            rate: 20.0,
            marker: Pose::default(),
        }),
        ..Vehicle::paper_car()
    }
}

/// What a car in good order may have.
pub(crate) fn allowance() -> Allowance {
    let mut allowance = Allowance::default();
    for (field, deviation) in
        [("wheelbase", 0.001), ("track_front", 0.001), ("track_rear", 0.001), ("radius", 0.0001)]
    {
        allowance.fields.insert(field.to_owned(), deviation);
    }
    for (id, name, deviation) in [
        ("speed_gain", "gain", 0.003),
        ("steering_gain", "gain", 0.004),
        ("steering_offset", "offset", 0.001),
        ("gyro_bias", "bias", 0.0003),
    ] {
        allowance.effects.insert((id.to_owned(), name.to_owned()), deviation);
    }
    allowance
}

/// Normal deviates.
struct Dice(Pcg64Mcg);

impl Dice {
    fn normal(&mut self) -> f64 {
        let (u, v): (f64, f64) = (self.0.random(), self.0.random());
        (-2.0 * math::ln(1.0 - u)).sqrt() * math::cos(TAU * v)
    }
}

/// Speed and steering of six drives at `t` \[s\].
fn asked(drive: usize, t: f64) -> (f64, f64) {
    if t < 1.0 {
        return (0.0, 0.0);
    }
    let phase = t - 1.0;
    match drive {
        0 => (0.3, 0.35 * math::sin(TAU * phase / 5.0)),
        1 => (if phase % 6.0 < 3.0 { 0.4 } else { 0.15 }, 0.3),
        2 => (if phase < 5.0 { 0.35 } else { -0.3 }, -0.25),
        3 => (0.25, if phase % 4.0 < 2.0 { 0.4 } else { -0.4 }),
        4 => (if phase < 6.0 { 0.45 } else { -0.2 }, 0.0),
        _ => (0.2, if phase % 5.0 < 2.5 { -0.2 } else { 0.1 }),
    }
}

/// A case of six drives of 12 s.
pub(crate) fn case(effects: &Effects, sensors: Sensors, seed: u64) -> Case {
    let mut vehicle = vehicle();
    if !sensors.steering {
        vehicle.steering_sensor = None;
    }
    if !sensors.gyro {
        vehicle.gyro = None;
    }
    let runs = (0..6)
        .map(|drive| run(&vehicle, effects, sensors, seed, (drive, 12.0), |t| asked(drive, t)))
        .collect();
    Case { name: "case".to_owned(), vehicle, allowance: Some(allowance()), runs }
}

/// The six drives of a car that is asked for no more than its limit \[m/s\], and in some of them for just that; its motor may be off by
/// 3 %.
pub(crate) fn case_at_limit(effects: &Effects, limit: f64, seed: u64) -> Case {
    let mut vehicle = vehicle();
    vehicle.limits.speed = limit;
    let told = |drive: usize, t: f64| {
        let (speed, steering) = asked(drive, t);
        (speed.clamp(-limit, limit), steering)
    };
    let runs = (0..6)
        .map(|drive| run(&vehicle, effects, ALL, seed, (drive, 12.0), |t| told(drive, t)))
        .collect();
    let mut allowance = allowance();
    allowance.effects.insert(("speed_gain".to_owned(), "gain".to_owned()), 0.03);
    Case { name: "limited".to_owned(), vehicle, allowance: Some(allowance), runs }
}

/// The six drives with a rack that swings by `amplitude` \[rad\], `often` \[Hz\], and nobody commands it.
pub(crate) fn case_swinging(amplitude: f64, often: f64, seed: u64) -> Case {
    let vehicle = vehicle();
    let swinging = |drive: usize| {
        let told = |t: f64| {
            let (speed, steering) = asked(drive, t);
            (speed, steering + amplitude * math::sin(TAU * (often * t + 0.37 * drive as f64)))
        };
        let mut run = run(&vehicle, &Effects::NEUTRAL, ALL, seed, (drive, 12.0), told);
        run.commands.iter_mut().for_each(|command| command.steering = asked(drive, command.t).1);
        run
    };
    let runs = (0..6).map(swinging).collect();
    Case { name: "swinging".to_owned(), vehicle, allowance: Some(allowance()), runs }
}

/// The six drives with a reference that shows the position of `marker` alone.
pub(crate) fn case_marked(effects: &Effects, marker: Pose, seed: u64) -> Case {
    let mut vehicle = vehicle();
    vehicle.reference = vehicle.reference.map(|reference| Reference { marker, ..reference });
    let sensors = Sensors { yaw: false, ..ALL };
    let runs = (0..6)
        .map(|drive| run(&vehicle, effects, sensors, seed, (drive, 12.0), |t| asked(drive, t)))
        .collect();
    Case { name: "marked".to_owned(), vehicle, allowance: Some(allowance()), runs }
}

/// A case of one drive of `seconds`: what the six do, one after the other without a rest.
pub(crate) fn one_log(effects: &Effects, seconds: f64, seed: u64) -> Case {
    let vehicle = vehicle();
    let told = |t: f64| {
        let drive = (0..6).rev().find(|drive| t % 66.0 >= 11.0 * f64::from(*drive)).unwrap_or(0);
        if t < 1.0 { (0.0, 0.0) } else { asked(drive as usize, t % 11.0 + 1.0) }
    };
    let runs = vec![run(&vehicle, effects, ALL, seed, (0, seconds), told)];
    Case { name: "log".to_owned(), vehicle, allowance: Some(allowance()), runs }
}

fn run(
    vehicle: &Vehicle,
    effects: &Effects,
    sensors: Sensors,
    seed: u64,
    (drive, seconds): (usize, f64),
    asked: impl Fn(f64) -> (f64, f64),
) -> Run {
    let mut dice = Dice(Pcg64Mcg::seed_from_u64(seed * 100 + drive as u64));
    let commands: Vec<Command> = (0..)
        .map(|k| 0.05 * f64::from(k))
        .take_while(|t| *t < seconds - 0.01)
        .map(|t| {
            let (speed, steering) = asked(t);
            Command { t, speed, steering }
        })
        .collect();
    let start = Pose::new(0.3 * dice.normal(), 0.3 * dice.normal(), 0.5 * dice.normal());
    let mut trajectory = Trajectory::default();
    Drive { vehicle, effects: *effects, commands: &commands, start, step: 0.005 }
        .trajectory(seconds + 0.1, &mut trajectory);
    let stamps = |rate: f64| {
        (0..).map(move |k| f64::from(k) / rate + 0.003).take_while(move |t| *t < seconds)
    };
    let per_radian = 2048.0 / TAU;
    let mut wheels = Series::default();
    for t in stamps(50.0) {
        wheels.t.push(t);
        wheels.value.push(
            trajectory.rotation(t).map(|turn| ((turn * per_radian).floor() + 0.5) / per_radian),
        );
    }
    let mut steering = Series::default();
    for t in stamps(25.0).take_while(|_| sensors.steering) {
        steering.t.push(t);
        steering.value.push([trajectory.steering(t) + 0.002 * dice.normal()]);
    }
    let mut gyro = Series::default();
    for t in stamps(40.0).take_while(|_| sensors.gyro) {
        gyro.t.push(t);
        gyro.value.push([trajectory.yaw_rate(t) + 0.003 * dice.normal()]);
    }
    let mut reference = Series::default();
    for t in stamps(20.0) {
        let pose = trajectory.reference(t);
        let yaw = if sensors.yaw { pose.yaw + 0.002 * dice.normal() } else { f64::NAN };
        reference.t.push(t);
        reference.value.push([pose.x + 0.002 * dice.normal(), pose.y + 0.002 * dice.normal(), yaw]);
    }
    Run {
        name: format!("drive-{drive}"),
        repeat_of: None,
        start: None,
        commands,
        wheels: Wheels::Rotation(wheels),
        steering,
        gyro,
        reference,
    }
}
