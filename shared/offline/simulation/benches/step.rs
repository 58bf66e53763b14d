//! How fast the nominal vehicle is simulated: `cargo bench -p kerbside-simulation`.
//!
//! Prints nanoseconds per step of 5 ms and the factor over real time, medians over interleaved
//! blocks, of the motion alone and with a reading of every sensor at each step. Exit code 1 where
//! the motion alone misses 30,000 x.

use std::process::ExitCode;
use std::time::Instant;

use kerbside_geometry::{Gyro, Pose, Vehicle};
use kerbside_simulation::{Noise, STEP, Simulator};

// Blocks far shorter than a time slice: the median is one that ran without interruption even on a
// machine that others use too.
const BLOCKS: usize = 1001;
const STEPS: u32 = 2_000;
const AIM: f64 = 30_000.0;

fn vehicle() -> Vehicle {
    Vehicle { gyro: Some(Gyro { noise: 0.003, rate: 200.0 }), ..Vehicle::paper_car() }
}

/// Nanoseconds per step of a drive whose commands change every 50 ms, so that nothing ever settles.
fn block(reads: bool) -> f64 {
    let mut simulator = Simulator::new(&vehicle(), Pose::default(), &Noise::default(), 1);
    let begin = Instant::now();
    let mut sum = 0;
    for step in 0..STEPS {
        let time = f64::from(step) * STEP;
        if step % 10 == 0 {
            let swing = f64::from(step / 10 % 40) / 20.0 - 1.0;
            simulator.command(time + 0.0013, 0.2 + 0.2 * swing, 0.4 * swing);
        }
        simulator.advance(time + STEP);
        if reads {
            sum += simulator.reading().counts[0];
        }
    }
    std::hint::black_box((simulator.pose(), sum));
    begin.elapsed().as_secs_f64() * 1e9 / f64::from(STEPS)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() -> ExitCode {
    let blocks: Vec<(f64, f64)> = (0..BLOCKS).map(|_| (block(false), block(true))).collect();
    let motion = median(blocks.iter().map(|block| block.0).collect());
    let all = median(blocks.iter().map(|block| block.1).collect());
    for (name, time) in [("motion", motion), ("motion and reading", all)] {
        println!("{name}: {time:.0} ns a step, {:.0} x real time", STEP * 1e9 / time);
    }
    if STEP * 1e9 / motion < AIM { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}
