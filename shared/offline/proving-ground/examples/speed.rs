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
            let rows: usize =
                (0..u64::from(trials)).map(|seed| drive.record(seed).counts.len()).sum();
            let each = begin.elapsed().as_secs_f64() * 1e3 / f64::from(trials);
            let end = drive.record(1).truth.last().map(|state| state.pose);
            println!("{name}, {speed} m/s: {each:.3} ms a drive, {rows} rows in all, end {end:?}");
        }
    }
}
