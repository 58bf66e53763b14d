//! How long a drive takes: `cargo run --release -p kerbside-proving-ground --example speed`.

use std::time::Instant;

use kerbside_proving_ground::{Chassis, Manoeuvre, Pace, Physics, Sensors, TestDrive};

fn main() {
    let ordinary = Physics::ordinary();
    for (name, physics) in [("kinematic limit", Physics::NEUTRAL), ("physics on", ordinary)] {
        for speed in [0.09, 0.26] {
            let manoeuvre = Manoeuvre::s_path(Pace::paper(speed));
            let drive = TestDrive::new(Chassis::paper(), physics, Sensors::paper(1.0), manoeuvre);
            let (begin, trials) = (Instant::now(), 50_u32);
            let count = |recorded: kerbside_proving_ground::Recorded| recorded.counts.len();
            let rows: usize = (0..u64::from(trials)).map(|seed| count(drive.record(seed))).sum();
            let each = begin.elapsed().as_secs_f64() * 1e3 / f64::from(trials);
            let (driven, begin) = (drive.driven(), Instant::now());
            let again: usize = (0..u64::from(trials)).map(|seed| count(driven.record(seed))).sum();
            let seed = begin.elapsed().as_secs_f64() * 1e3 / f64::from(trials);
            assert_eq!(rows, again, "the same drive has the same rows");
            let end = drive.record(1).truth.last().map(|state| state.pose);
            println!("{name}, {speed} m/s: {each:.3} ms a drive, {seed:.3} ms a further seed");
            println!("  {} rows a drive, end {end:?}", rows / 50);
        }
    }
}
