//! The filters compared over many drives of the S path: end error, its variance against the rear
//! axle alone, and what the covariance is worth.
//!
//! `cargo run --release -p kerbside-odometry --example filters [TRIALS]`

#![allow(clippy::unwrap_used)]

#[path = "../tests/support/mod.rs"]
mod support;

use kerbside_odometry::Filter;
use support::car;
use support::scatter::{Case, Leg, NOISE, Outcome, reversed, run, s_legs, straight_legs};

const FRONTS: [(f64, &str); 3] =
    [(1.0 / 3.0, "front 3x better"), (1.0, "equal"), (2.0, "front 2x worse")];

fn row(name: &str, outcome: &Outcome, rear: Option<f64>) {
    let ratio = rear.map_or(String::new(), |rear| format!("{:.3}", outcome.variance() / rear));
    println!(
        "  {name:24} mean {:5.1} mm  variance {:6.0} mm^2  /rear {ratio:5}  NEES/3 {:9.3}  bias \
         {:4.1} mm  gated {:.2} of {:.0}, flagged {:.3}",
        1e3 * outcome.mean(),
        1e6 * outcome.variance(),
        outcome.nees(),
        1e3 * outcome.bias(),
        outcome.gated as f64 / outcome.errors.len() as f64,
        outcome.corrections as f64 / outcome.errors.len() as f64,
        outcome.flags()
    );
}

fn table(trials: u64, residual: bool, legs: &[Leg], speed: f64) {
    for (front, name) in FRONTS {
        println!("{name}, {speed} m/s, {}", if residual { "residual errors" } else { "known" });
        let case = |filter| {
            let case = Case::new(filter, front, trials);
            if residual { case.residual() } else { case }
        };
        let rear = run(&case(Filter::Rear), &car(), legs);
        row("rear", &rear, None);
        for filter in [Filter::PaperOwn, Filter::Paper, Filter::Fused] {
            let outcome = run(&case(filter), &car(), legs);
            row(&format!("{filter:?}"), &outcome, Some(rear.variance()));
        }
        let mut blind = case(Filter::Fused);
        blind.sensors.steering = false;
        row("Fused, no steering", &run(&blind, &car(), legs), Some(rear.variance()));
    }
}

fn slips(trials: u64, legs: &[Leg], speed: f64, steering: bool) {
    println!("slip at {speed} m/s{}", if steering { "" } else { ", no steering" });
    let fused = |trials| {
        let mut case = Case::new(Filter::Fused, 1.0, trials);
        case.sensors.steering = steering;
        case
    };
    let clean = run(&fused(trials), &car(), legs);
    row("none", &clean, None);
    for (name, travel) in [
        ("rl 5 mm", [0.0, 0.0, 0.005, 0.0]),
        ("rl 10 mm", [0.0, 0.0, 0.010, 0.0]),
        ("rl 30 mm", [0.0, 0.0, 0.030, 0.0]),
        ("both 30 mm", [0.0, 0.0, 0.030, 0.030]),
        ("fl -10 mm", [-0.010, 0.0, 0.0, 0.0]),
    ] {
        let case = Case { spin: Some((0.4, travel)), ..fused(trials) };
        row(name, &run(&case, &car(), legs), None);
    }
    for wheel in 0..4 {
        let case = Case { dead: Some(wheel), ..fused(trials) };
        row(&format!("wheel {wheel} dead"), &run(&case.residual(), &car(), legs), None);
    }
}

fn lengths(trials: u64) {
    println!("NEES/3 over length, straight, residual errors; rear noise {NOISE}");
    for length in [1.0, 2.0, 4.0, 8.0] {
        for backwards in [false, true] {
            let legs = straight_legs(length, 0.26, 0.02);
            let legs = if backwards { reversed(&legs) } else { legs };
            let name = format!("{length} m{}", if backwards { " reverse" } else { "" });
            row(
                &name,
                &run(&Case::new(Filter::Fused, 1.0, trials).residual(), &car(), &legs),
                None,
            );
            let own = Case { filter: Filter::Paper, ..Case::new(Filter::Paper, 1.0, trials) };
            row(&format!("{name} paper"), &run(&own, &car(), &legs), None);
        }
    }
}

fn main() {
    let trials = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(600);
    for speed in [0.09, 0.26] {
        let legs = s_legs(speed, 0.02);
        table(trials, false, &legs, speed);
        table(trials, true, &legs, speed);
        slips(trials, &legs, speed, true);
        slips(trials, &legs, speed, false);
    }
    lengths(trials);
}
