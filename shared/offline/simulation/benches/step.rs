//! How fast the vehicle is simulated: `cargo bench -p kerbside-simulation`.
//!
//! Prints nanoseconds per step of 5 ms and the factor over real time, medians over interleaved
//! blocks: of the nominal motion alone and with a reading of every sensor at each step, of a whole
//! drive with three effects, and of such a drive with what the sensors of a recorded run showed.
//! Exit code 1 where the nominal motion or the drive with three effects misses 30,000 x.

use std::process::ExitCode;
use std::time::Instant;

use kerbside_geometry::{Gyro, Pose, Vehicle};
use kerbside_simulation::{Command, Drive, Effects, Noise, Parameter, STEP, Simulator, Trajectory};

// Blocks far shorter than a time slice: the median is one that ran without interruption even on a
// machine that others use too.
const BLOCKS: usize = 1001;
const STEPS: u32 = 2_000;
const AIM: f64 = 30_000.0;

fn vehicle() -> Vehicle {
    Vehicle { gyro: Some(Gyro { noise: 0.003, rate: 200.0, bias: 0.0 }), ..Vehicle::paper_car() }
}

/// Commands that change every 50 ms, so that nothing ever settles.
fn command(step: u32) -> Command {
    let swing = f64::from(step / 10 % 40) / 20.0 - 1.0;
    let t = f64::from(step) * STEP + 0.0013;
    Command { t, speed: 0.2 + 0.2 * swing, steering: 0.4 * swing }
}

/// Nanoseconds per step of a live drive.
fn live(reads: bool) -> f64 {
    let mut simulator = Simulator::new(&vehicle(), Pose::default(), &Noise::default(), 1);
    let begin = Instant::now();
    let mut sum = 0;
    for step in 0..STEPS {
        let time = f64::from(step) * STEP;
        if step % 10 == 0 {
            let command = command(step);
            simulator.command(command.t, command.speed, command.steering);
        }
        simulator.advance(time + STEP);
        if reads {
            sum += simulator.reading().counts[0];
        }
    }
    std::hint::black_box((simulator.pose(), sum));
    begin.elapsed().as_secs_f64() * 1e9 / f64::from(STEPS)
}

/// Nanoseconds per step of a whole drive; with `reads` its sensors are read as often as in a
/// recorded run: encoders 50 Hz, gyro 40 Hz, steering and reference 25 Hz.
fn whole(
    vehicle: &Vehicle,
    effects: Effects,
    commands: &[Command],
    out: &mut Trajectory,
    reads: bool,
) -> f64 {
    let until = f64::from(STEPS) * STEP;
    let begin = Instant::now();
    Drive { vehicle, effects, commands, start: Pose::default(), step: STEP }.trajectory(until, out);
    let mut sum = out.pose(until).x;
    let mut read = |rate: f64, reading: &dyn Fn(f64) -> f64| {
        let mut t = 0.003;
        while reads && t < until {
            sum += reading(t);
            t += 1.0 / rate;
        }
    };
    read(50.0, &|t| out.rotation(t)[2]);
    read(40.0, &|t| out.yaw_rate(t));
    read(25.0, &|t| out.steering(t));
    read(25.0, &|t| out.reference(t).x);
    std::hint::black_box(sum);
    begin.elapsed().as_secs_f64() * 1e9 / f64::from(STEPS)
}

/// Three effects that make the simulator work: an equation to solve, a slip that jumps, a slide.
fn three() -> Effects {
    [
        ("understeer", "gradient", 1.6),
        ("acceleration_slip", "rate", 0.3),
        ("lateral_slip", "rate", 0.3),
    ]
    .into_iter()
    .filter_map(|(id, name, value)| Some((Parameter::find(id, name)?, value)))
    .fold(Effects::NEUTRAL, |effects, (parameter, value)| effects.with(parameter, value))
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() -> ExitCode {
    let (car, mut out) = (vehicle(), Trajectory::new());
    let commands: Vec<Command> = (0..STEPS).step_by(10).map(command).collect();
    let mut drive = |effects, reads| whole(&car, effects, &commands, &mut out, reads);
    let blocks: Vec<[f64; 5]> = (0..BLOCKS)
        .map(|_| {
            let nominal = drive(Effects::NEUTRAL, false);
            let [three, read] = [drive(three(), false), drive(three(), true)];
            [live(false), live(true), nominal, three, read]
        })
        .collect();
    let mut passed = true;
    for (column, (name, aim)) in [
        ("motion", AIM),
        ("motion and reading", 0.0),
        ("a drive", 0.0),
        ("a drive with three effects", AIM),
        ("a drive with three effects and its readings", 0.0),
    ]
    .into_iter()
    .enumerate()
    {
        let time = median(blocks.iter().map(|block| block[column]).collect());
        let factor = STEP * 1e9 / time;
        println!("{name}: {time:.0} ns a step, {factor:.0} x real time");
        passed &= factor >= aim;
    }
    if passed { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
