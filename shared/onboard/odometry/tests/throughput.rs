//! How long a reading takes: `cargo test --release -p kerbside-odometry --test throughput --
//! --ignored --nocapture`.

#![allow(clippy::unwrap_used)] // Helpers of tests are tests.

mod support;

use std::time::Instant;

use kerbside_messages::{Fix, Header, Odometry, Travel};
use kerbside_odometry::{Estimator, EstimatorInputs, EstimatorSettings, Filter};
use support::{Car, Chain, car, placed, s_path};

/// Travels of a drive along the S path at 200 Hz.
fn travels() -> Vec<Travel> {
    let vehicle = car();
    let mut driven = Car::new(car()).noisy(3, 0.001, 0.001, 0.0035);
    let mut chain = Chain::new(&vehicle, &placed());
    let path = s_path(&vehicle, 0.26, 0.005);
    path.iter()
        .map(|(speed, angle)| {
            driven.roll(*speed, *angle);
            chain.feed(&driven.raw());
            chain.travel
        })
        .collect()
}

fn estimator(filter: Filter) -> Estimator {
    let mut vehicle = car();
    vehicle.gyro = None;
    Estimator::new(&vehicle, &EstimatorSettings { filter, ..placed() }).unwrap()
}

fn step(estimator: &mut Estimator, travel: &Travel, fix: Option<&Fix>, out: &mut Odometry) {
    estimator.step(EstimatorInputs { travel, missing: 0, fix, restore: None }, out);
}

#[test]
#[ignore = "a measurement: run in release mode on a quiet machine"]
fn a_step_takes_less_than_a_microsecond() {
    let travels = travels();
    for filter in [Filter::Rear, Filter::Paper, Filter::PaperOwn, Filter::Fused] {
        let (mut best, mut closing) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..20 {
            let (mut estimator, mut out) = (estimator(filter), Odometry::default());
            let begin = Instant::now();
            travels.iter().for_each(|travel| step(&mut estimator, travel, None, &mut out));
            best = best.min(begin.elapsed().as_secs_f64() / travels.len() as f64);
            closing = closing.min(corrections(filter, &travels));
        }
        println!(
            "{filter:?}: {:.0} ns a step, {:.1} us where it corrects",
            best * 1e9,
            closing * 1e6
        );
        assert!(best < 1e-6 && closing < 10e-6);
    }
}

/// Mean time of the steps that corrected \[s\].
fn corrections(filter: Filter, travels: &[Travel]) -> f64 {
    let (mut estimator, mut out) = (estimator(filter), Odometry::default());
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for travel in travels {
        let begin = Instant::now();
        step(&mut estimator, travel, None, &mut out);
        if out.corrected == 1 {
            (sum, count) = (sum + begin.elapsed().as_secs_f64(), count + 1.0);
        }
    }
    sum / count.max(1.0)
}

#[test]
#[ignore = "a measurement: run in release mode on a quiet machine"]
fn a_fix_late_by_half_a_second_takes_less_than_200_microseconds() {
    let travels = travels();
    let (mut estimator, mut out) = (estimator(Filter::Fused), Odometry::default());
    let mut times = Vec::new();
    let mut past = Vec::new();
    for (index, travel) in travels.iter().enumerate() {
        let late = index.checked_sub(100).and_then(|then| past.get(then)).copied();
        let fix = late.map(|(stamp, x, y, yaw)| Fix {
            header: Header::stamped(stamp, 0),
            x,
            y,
            yaw,
            covariance: [4e-6, 0.0, 0.0, 0.0, 4e-6, 0.0, 0.0, 0.0, 4e-6],
            ..Fix::default()
        });
        let taken = out.corrections;
        let begin = Instant::now();
        let fix = fix.as_ref().filter(|_| index % 20 == 0);
        step(&mut estimator, travel, fix, &mut out);
        if fix.is_some() && out.corrections > taken {
            times.push(begin.elapsed().as_secs_f64());
        }
        past.push((travel.header.stamp, out.x, out.y, out.yaw));
    }
    times.sort_by(f64::total_cmp);
    let (median, worst) = (times[times.len() / 2], times[times.len() - 1]);
    println!("{} fixes: median {:.0} us, worst {:.0} us", times.len(), median * 1e6, worst * 1e6);
    assert!(median < 200e-6);
}
