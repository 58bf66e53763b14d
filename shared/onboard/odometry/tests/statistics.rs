//! What the paper's correction is worth on the S path, over many noisy drives.

mod support;

use kerbside_messages::OdometryModel as Model;
use kerbside_odometry::{EstimatorSettings, Filter, Sensors};
use support::{Car, Chain, car, s_path, sensors};

/// Rear noise \[m/sqrt(m)\]; the front's is scaled against it.
const NOISE: f64 = 0.001;

/// End errors of `trials` drives: mean and mean square of the position's \[m, m^2\].
struct Outcome {
    bias: f64,
    square: f64,
    corrections: u32,
    gated: u32,
}

fn with(filter: Filter) -> EstimatorSettings {
    EstimatorSettings { filter, ..EstimatorSettings::default() }
}

fn drive(sensors: Sensors, front: f64, top: f64, rate: f64, trials: u64) -> Outcome {
    let vehicle = car();
    let path = s_path(&vehicle, top, 1.0 / rate);
    let (mut x, mut y, mut square) = (0.0, 0.0, 0.0);
    let (mut corrections, mut gated) = (0, 0);
    for trial in 0..trials {
        let mut chain = Chain::with(&vehicle, &sensors, &with(Filter::Paper));
        let mut car = Car::new(car()).noisy(20_240 + trial, NOISE * front, NOISE, 0.0035);
        car.period = (1e9 / rate) as u64;
        chain.feed(&car.raw());
        for (speed, angle) in &path {
            car.roll(*speed, *angle);
            chain.feed(&car.raw());
        }
        let (ex, ey) = (chain.odometry.x - car.truth.x, chain.odometry.y - car.truth.y);
        (x, y, square) = (x + ex, y + ey, square + ex * ex + ey * ey);
        corrections += chain.odometry.corrections;
        gated += chain.odometry.gated;
    }
    let count = trials as f64;
    Outcome { bias: (x / count).hypot(y / count), square: square / count, corrections, gated }
}

fn both() -> (Sensors, Sensors) {
    let all = sensors([true; 4], true, false);
    let rear = sensors([false, false, true, true], false, false);
    assert_eq!(all.model(&car()), Ok(Model::RearFront));
    (all, rear)
}

#[test]
fn front_wheels_of_equal_noise_halve_the_square_error() {
    let (all, rear) = both();
    for (top, rate) in [(0.26, 50.0), (0.26, 200.0), (0.09, 50.0)] {
        let trials = if rate > 100.0 { 40 } else { 100 };
        let (fused, alone) =
            (drive(all, 1.0, top, rate, trials), drive(rear, 1.0, top, rate, trials));
        let ratio = fused.square / alone.square;
        println!(
            "{top} m/s {rate} Hz: rms {:.4} of {:.4} m, ratio {ratio:.3}, bias {:.4}, {} of {}",
            fused.square.sqrt(),
            alone.square.sqrt(),
            fused.bias,
            fused.gated,
            fused.corrections
        );
        assert!(ratio < 0.75, "{ratio} at {top} m/s, {rate} Hz");
        assert!(fused.bias < 3.0 * (fused.square / trials as f64).sqrt() + 2e-3, "{}", fused.bias);
        assert!(fused.gated * 50 < fused.corrections, "{} gated", fused.gated);
    }
}

#[test]
fn better_front_wheels_help_more() {
    let (all, rear) = both();
    let alone = drive(rear, 1.0, 0.26, 50.0, 60).square;
    let ratio = drive(all, (1.0_f64 / 3.0).sqrt(), 0.26, 50.0, 60).square / alone;
    println!("front three times better: ratio {ratio:.3}");
    assert!(ratio < 0.5, "{ratio}");
}

#[test]
fn the_rear_models_covariance_is_the_true_spread() {
    let vehicle = car();
    let rear = sensors([false, false, true, true], false, false);
    let path = s_path(&vehicle, 0.26, 0.02);
    let (mut sum, trials) = (0.0, 150);
    for trial in 0..trials {
        let mut chain = Chain::with(&vehicle, &rear, &with(Filter::Rear));
        let mut car = Car::new(car()).noisy(400 + trial, NOISE, NOISE, 0.0);
        car.period = 20_000_000;
        chain.feed(&car.raw());
        for (speed, angle) in &path {
            car.roll(*speed, *angle);
            chain.feed(&car.raw());
        }
        let odometry = chain.odometry;
        let error = nalgebra::Vector3::new(
            odometry.x - car.truth.x,
            odometry.y - car.truth.y,
            odometry.yaw - car.truth.yaw,
        );
        let covariance = nalgebra::Matrix3::from_row_slice(&odometry.covariance);
        sum += (error.transpose() * covariance.try_inverse().unwrap() * error).x / 3.0;
    }
    let nees = sum / trials as f64;
    println!("rear alone: NEES/3 {nees:.3}");
    assert!((0.8..1.2).contains(&nees), "{nees}");
}
