//! Prints the errors of both methods over many repetitions of a calibration, beside the Cramer-Rao bound:
//! `cargo run --release -p kerbside-calibration --example monte_carlo -- [TRIALS]`.
//!
//! The car is that of the paper's Tables 1 and 2 with a steering zero of 0.2 degrees; ten straights of 5 m and ten
//! full circles of 1.5 m radius, to both sides; wheel noise 1 mm/sqrt(m), steering noise 0.2 degrees, 2000 counts a
//! turn at 50 Hz.

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::Instant;

use kerbside_calibration::{
    Calibrated, Information, PARAMETERS, Settings, Source, Vector, calibrate, information,
};
use support::{Car, Errors, nominal};

fn main() {
    let trials = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(200);
    let degree = 1.0_f64.to_radians();
    for (label, position, yaw) in
        [("2 mm / 2 mrad", 0.002, 0.002), ("5 cm / 5 degrees", 0.05, 5.0 * degree)]
    {
        for zero in [0.0, 0.2 * degree] {
            let mut car = Car::new(position, yaw);
            car.truth.values[7] = zero;
            println!("\nreference {label}, steering zero {:.1} degrees", zero / degree);
            table(&car, trials);
        }
    }
}

fn table(car: &Car, trials: u64) {
    let settings = Settings { folds: 0, ..car.settings() };
    let bound = information(&car.plan(10, 0), &nominal(), &car.truth, &settings);
    let Ok(bound) = bound else { return };
    let (mut joint, mut closed) = (Errors::default(), Errors::default());
    let (mut seconds, mut squares, mut rejected) = (0.0, [0.0; 2], 0);
    for trial in 1..=trials {
        let runs = car.plan(10, trial);
        let begun = Instant::now();
        let Ok(found) = calibrate(&runs, &nominal(), &settings) else { continue };
        seconds += begun.elapsed().as_secs_f64();
        squares[0] += found.truth_mean_square;
        squares[1] += found.comparison_mean_square;
        rejected += found.rejected.len();
        joint.add(&found.parameters, &car.truth, &deviations(&found));
        closed.add(&found.closed_form.parameters, &car.truth, &Vector::zeros());
    }
    let count = trials as f64;
    println!(
        "{:.3} s each; mean squares of poses {:.3}, of comparisons {:.3}; {rejected} runs rejected; condition {:.0}",
        seconds / count,
        squares[0] / count,
        squares[1] / count,
        bound.condition
    );
    print_rows(&joint, &closed, &bound);
    print_left_out(car);
}

fn deviations(found: &Calibrated) -> Vector {
    found.covariance.diagonal().map(f64::sqrt)
}

fn print_rows(joint: &Errors, closed: &Errors, bound: &Information) {
    println!("parameter      bound     joint rms ratio  bias      covered  closed rms bias");
    let printed = PARAMETERS.into_iter().filter(|parameter| bound.free[parameter.index()]);
    for parameter in printed {
        let i = parameter.index();
        println!(
            "{:14} {:9.2e} {:9.2e} {:5.2} {:10.2e} {:6.1} %  {:9.2e} {:10.2e}",
            parameter.name(),
            bound.bound[i],
            joint.rms(i),
            joint.rms(i) / bound.bound[i],
            joint.bias(i),
            100.0 * joint.covered(i),
            closed.rms(i),
            closed.bias(i)
        );
    }
}

fn print_left_out(car: &Car) {
    let Ok(found) = calibrate(&car.plan(10, 1), &nominal(), &car.settings()) else { return };
    for source in [Source::Rear, Source::Front, Source::All] {
        if let Some((before, after)) = found.left_out_distance(source) {
            println!("left out, {:5}: end error rms {before:.4} m -> {after:.4} m", source.name());
        }
    }
}
