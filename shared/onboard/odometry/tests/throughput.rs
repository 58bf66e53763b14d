//! How long the two stages take per reading: `cargo test --release -p kerbside-odometry --test
//! throughput -- --ignored
//! --nocapture`.

mod support;

use std::time::Instant;

use support::{Car, Chain, car, placed, s_path};

#[test]
#[ignore = "a measurement: run in release mode on a quiet machine"]
fn a_reading_takes_less_than_a_microsecond() {
    let vehicle = car();
    let path = s_path(&vehicle, 0.26, 0.005);
    let mut driven = Car::new(car()).noisy(3, 0.001, 0.001, 0.0035);
    let raws: Vec<_> = path
        .iter()
        .map(|(speed, angle)| {
            driven.roll(*speed, *angle);
            driven.raw()
        })
        .collect();
    let mut best = f64::INFINITY;
    for _ in 0..20 {
        let mut chain = Chain::new(&vehicle, &placed());
        let begin = Instant::now();
        for raw in &raws {
            chain.feed(raw);
        }
        best = best.min(begin.elapsed().as_secs_f64() / raws.len() as f64);
        assert!(chain.odometry.corrections > 100);
    }
    println!("{:.0} ns a reading, ingest and estimator together", best * 1e9);
    assert!(best < 1e-6);
}
