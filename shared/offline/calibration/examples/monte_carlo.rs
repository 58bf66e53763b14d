//! Prints the errors of both methods over many repetitions of a calibration, beside the Cramer-Rao bound:
//! `cargo run --release -p kerbside-calibration --example monte_carlo -- [TRIALS]`.
//!
//! The car is that of the paper's Tables 1 and 2 with a steering zero of 0.2 degrees; ten straights of 5 m and ten
//! full circles of 1.5 m radius, to both sides; wheel noise 1 mm/sqrt(m), steering noise 0.2 degrees, 2000 counts a
//! turn at 50 Hz.

#[path = "../tests/support/mod.rs"]
mod support;

use core::f64::consts::TAU;
use std::time::Instant;

use kerbside_calibration::{
    Calibrated, EndError, Information, LeftOut, PARAMETERS, Parameter, Run, Settings, Source,
    Vector, calibrate, information,
};
use support::{Car, Errors, nominal};

fn main() {
    let trials = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(200);
    let degree = 1.0_f64.to_radians();
    let references = [("2 mm / 2 mrad", 0.002, 0.002), ("5 cm / 5 degrees", 0.05, 5.0 * degree)];
    println!("Cramer-Rao bounds of ten straights of 5 m and ten arcs");
    println!(
        "reference, arcs                    R_rl um   R_l/R_r  b_r mm  b_f mm    L mm  zero deg"
    );
    for (label, position, yaw) in references {
        bounds(label, &Car::new(position, yaw));
    }
    for (label, position, yaw) in references {
        for zero in [0.0, 0.2 * degree] {
            let mut car = Car::new(position, yaw);
            car.truth.values[7] = zero;
            println!("\nreference {label}, steering zero {:.1} degrees", zero / degree);
            table(&car, trials);
        }
    }
}

/// The cases: arcs as (radius \[m\], turn \[rad\]), driven in turn.
fn bounds(label: &str, car: &Car) {
    let quarter = TAU / 4.0;
    let plans: [(&str, Vec<(f64, f64)>); 4] = [
        ("90 degrees, both sides", vec![(1.5, quarter), (-1.5, quarter)]),
        ("360 degrees, one side", vec![(1.5, TAU)]),
        ("360 degrees, both sides", vec![(1.5, TAU), (-1.5, TAU)]),
        (
            "two radii, both sides",
            vec![(1.5, TAU), (-1.5, TAU), (3.0, TAU / 2.0), (-3.0, TAU / 2.0)],
        ),
    ];
    for (arcs, legs) in plans {
        let mut runs: Vec<Run> = (0..10).map(|i| car.straight("straight", 5.0, i)).collect();
        runs.extend((0..10).map(|i| {
            let (radius, turn) = legs[i as usize % legs.len()];
            car.circle("arc", radius, turn, 50 + i)
        }));
        let Ok(found) = information(&runs, &nominal(), &car.truth, &car.settings()) else { return };
        let bound = |parameter: Parameter| found.bound[parameter.index()];
        println!(
            "{label:16} {arcs:23} {:6.0} {:9.1e} {:7.2} {:7.2} {:7.2} {:9.4}",
            1e6 * bound(Parameter::RadiusRearLeft),
            ratio_bound(&found, car),
            1e3 * bound(Parameter::TrackRear),
            1e3 * bound(Parameter::TrackFront),
            1e3 * bound(Parameter::Wheelbase),
            bound(Parameter::SteeringZero).to_degrees()
        );
    }
}

/// Bound of the ratio of the rear radii; the parameters that are not asked for are left out.
fn ratio_bound(found: &Information, car: &Car) -> f64 {
    let mut matrix = found.matrix;
    for i in (0..9).filter(|i| !found.free[*i]) {
        matrix.row_mut(i).fill(0.0);
        matrix.column_mut(i).fill(0.0);
        matrix[(i, i)] = 1.0;
    }
    let (left, right) = (car.truth.values[2], car.truth.values[3]);
    let mut gradient = Vector::zeros();
    (gradient[2], gradient[3]) = (1.0 / right, -left / (right * right));
    matrix.cholesky().map_or(f64::NAN, |inverse| gradient.dot(&inverse.solve(&gradient)).sqrt())
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
    println!(
        "parameter      bound     joint rms ratio  bias      covered    worst     closed rms bias"
    );
    let printed = PARAMETERS.into_iter().filter(|parameter| bound.free[parameter.index()]);
    for parameter in printed {
        let i = parameter.index();
        println!(
            "{:14} {:9.2e} {:9.2e} {:5.2} {:10.2e} {:6.1} % {:9.2e}  {:9.2e} {:10.2e}",
            parameter.name(),
            bound.bound[i],
            joint.rms(i),
            joint.rms(i) / bound.bound[i],
            joint.bias(i),
            100.0 * joint.covered(i),
            joint.worst(i),
            closed.rms(i),
            closed.bias(i)
        );
    }
    let [front, rear] = joint.worst_epsilon();
    println!("worst epsilon, joint: front {front:.2e}, rear {rear:.2e}");
}

/// Repetitions of the check on runs left out.
const REPEATS: u64 = 20;

/// End errors of runs left out, means over some repetitions: of single runs, and of the mean of ten runs (the paper's
/// Figure 6), front and rear axle and both.
fn print_left_out(car: &Car) {
    let mut tables = Vec::new();
    for trial in 1..=REPEATS {
        let Ok(found) = calibrate(&car.plan(10, trial), &nominal(), &car.settings()) else {
            return;
        };
        tables.push(found.left_out);
    }
    println!("left out       runs    single run, mean         mean of runs");
    for source in [Source::Rear, Source::Front, Source::All] {
        for (label, manoeuvre, digits) in
            [("straights", "straight", "0123456789"), ("left circles", "circle", "02468")]
        {
            let picked = |row: &&LeftOut| {
                let digit = row.run.chars().last().is_some_and(|digit| digits.contains(digit));
                row.source == source && row.manoeuvre == manoeuvre && digit
            };
            let mut sums = [0.0; 4];
            for table in &tables {
                let rows: Vec<&LeftOut> = table.iter().filter(picked).collect();
                sums[0] += single(&rows, |row| row.before);
                sums[1] += single(&rows, |row| row.after);
                sums[2] += mean(&rows, |row| row.before);
                sums[3] += mean(&rows, |row| row.after);
            }
            let [a, b, c, d] = sums.map(|sum| sum / tables.len() as f64);
            println!(
                "{:6} {label:12}  {a:.4} m -> {b:.4} m     {c:.4} m -> {d:.4} m",
                source.name()
            );
        }
    }
}

/// Mean length of end errors \[m\].
fn single(rows: &[&LeftOut], pick: fn(&LeftOut) -> EndError) -> f64 {
    rows.iter().map(|row| pick(row).distance()).sum::<f64>() / rows.len() as f64
}

/// Length of the mean of end errors \[m\].
fn mean(rows: &[&LeftOut], pick: fn(&LeftOut) -> EndError) -> f64 {
    let count = rows.len() as f64;
    let along = rows.iter().map(|row| pick(row).x).sum::<f64>() / count;
    along.hypot(rows.iter().map(|row| pick(row).y).sum::<f64>() / count)
}
