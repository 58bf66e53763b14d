//! The fused filter over many drives: its end error against the rear axle's, and its covariance
//! against the truth. The whole table: `cargo run --release -p kerbside-odometry --example filters`.

mod support;

use kerbside_odometry::Filter;
use support::car;
use support::scatter::{Case, Leg, Outcome, reversed, run, s_legs, straight_legs};

const TRIALS: u64 = 150;

fn s_path() -> Vec<Leg> {
    s_legs(0.26, 0.02)
}

fn outcome(case: &Case, legs: &[Leg]) -> Outcome {
    run(case, &car(), legs)
}

/// Mean NEES/3 of that many trials is within this of 1 in 99.9 % of all seeds.
fn spread() -> f64 {
    3.3 * (2.0 / (3.0 * TRIALS as f64)).sqrt()
}

#[test]
fn with_known_parameters_it_beats_the_rear_axle_and_knows_its_error() {
    for (front, most) in [(1.0 / 3.0, 0.30), (1.0, 0.57), (2.0, 0.80)] {
        let rear = outcome(&Case::new(Filter::Rear, front, TRIALS), &s_path());
        let fused = outcome(&Case::new(Filter::Fused, front, TRIALS), &s_path());
        let ratio = fused.variance() / rear.variance();
        println!("front {front:.2}: ratio {ratio:.3}, NEES/3 {:.3}", fused.nees());
        assert!(ratio < most, "front {front}: {ratio}");
        assert!((fused.nees() - 1.0).abs() < 0.1 + spread(), "{}", fused.nees());
        assert!(fused.bias() < 0.003, "{}", fused.bias());
    }
}

#[test]
fn without_the_steering_sensor_it_is_the_best_of_both_axles() {
    for (front, most) in [(1.0 / 3.0, 0.36), (1.0, 0.68), (2.0, 0.95)] {
        let rear = outcome(&Case::new(Filter::Rear, front, TRIALS), &s_path());
        let mut case = Case::new(Filter::Fused, front, TRIALS);
        case.sensors.steering = false;
        let fused = outcome(&case, &s_path());
        let ratio = fused.variance() / rear.variance();
        println!("front {front:.2}: ratio {ratio:.3}, NEES/3 {:.3}", fused.nees());
        assert!(ratio < most, "front {front}: {ratio}");
        assert!((fused.nees() - 1.0).abs() < 0.15 + spread(), "{}", fused.nees());
    }
}

#[test]
fn what_a_calibration_leaves_open_is_in_its_covariance() {
    for (front, most) in [(1.0 / 3.0, 0.33), (1.0, 0.45), (2.0, 0.48)] {
        let rear = outcome(&Case::new(Filter::Rear, front, TRIALS).residual(), &s_path());
        let fused = outcome(&Case::new(Filter::Fused, front, TRIALS).residual(), &s_path());
        let ratio = fused.variance() / rear.variance();
        println!("front {front:.2}: ratio {ratio:.3}, NEES/3 {:.3}", fused.nees());
        assert!(ratio < most, "front {front}: {ratio}");
        assert!((fused.nees() - 1.0).abs() < 0.15 + spread(), "{}", fused.nees());
        assert!(fused.flags() < 0.05, "{}", fused.flags());
    }
}

#[test]
fn the_published_filter_does_not_know_its_error() {
    for filter in [Filter::Paper, Filter::PaperOwn] {
        let outcome = outcome(&Case::new(filter, 1.0, 40), &s_path());
        println!("{filter:?}: NEES/3 {:.0}", outcome.nees());
        assert!(outcome.nees() > 100.0, "{}", outcome.nees());
    }
}

#[test]
fn its_covariance_is_right_at_any_length_both_ways() {
    for length in [1.0, 2.0, 4.0, 8.0] {
        for backwards in [false, true] {
            let legs = straight_legs(length, 0.26, 0.02);
            let legs = if backwards { reversed(&legs) } else { legs };
            let fused = outcome(&Case::new(Filter::Fused, 1.0, TRIALS).residual(), &legs);
            println!("{length} m, backwards {backwards}: NEES/3 {:.3}", fused.nees());
            assert!((fused.nees() - 1.0).abs() < 0.1 + spread(), "{}", fused.nees());
        }
    }
}

#[test]
fn its_covariance_is_right_at_any_speed() {
    // From 0.3 m/s on eight readings are more than a block.
    for (top, length) in [(0.3, 3.0), (0.5, 4.0), (1.0, 8.0)] {
        let legs = straight_legs(length, top, 0.02);
        let fused = outcome(&Case::new(Filter::Fused, 1.0, TRIALS), &legs);
        println!("{top} m/s: NEES/3 {:.3}", fused.nees());
        assert!((fused.nees() - 1.0).abs() < 0.1 + spread(), "{}", fused.nees());
    }
}

#[test]
fn a_spinning_wheel_is_found_and_its_axle_left_out() {
    let clean = outcome(&Case::new(Filter::Fused, 1.0, 100), &s_path());
    assert!(clean.flags() <= 0.02, "{}", clean.flags());
    for travel in [0.005, 0.010, 0.030] {
        for wheels in [[0.0, 0.0, travel, 0.0], [0.0, 0.0, 0.0, travel]] {
            let spin = Some((0.4, wheels));
            let spun = outcome(&Case { spin, ..Case::new(Filter::Fused, 1.0, 50) }, &s_path());
            assert!(spun.flags() >= 0.99, "{travel} m: {}", spun.flags());
            assert!(spun.mean() < 1.25 * clean.mean(), "{travel} m: {}", spun.mean());
        }
    }
}

#[test]
fn a_counter_that_stands_still_does_not_move_the_pose() {
    for dead in 0..4 {
        let case = Case { dead: Some(dead), ..Case::new(Filter::Fused, 1.0, 60).residual() };
        let outcome = outcome(&case, &s_path());
        println!("wheel {dead}: mean {:.4} m, NEES/3 {:.3}", outcome.mean(), outcome.nees());
        assert!(
            outcome.nees() < 1.6 && outcome.mean() < 0.06,
            "{} {}",
            outcome.nees(),
            outcome.mean()
        );
    }
}

#[test]
fn priors_that_are_off_by_two_are_survived() {
    let rear = outcome(&Case::new(Filter::Rear, 1.0, TRIALS).residual(), &s_path());
    for factor in [0.5, 2.0] {
        let case = Case::new(Filter::Fused, 1.0, TRIALS).residual();
        let believed = case.believed.map(|deviation| factor * deviation);
        let fused = outcome(&Case { believed, ..case }, &s_path());
        let ratio = fused.variance() / rear.variance();
        println!("priors x {factor}: ratio {ratio:.3}, NEES/3 {:.3}", fused.nees());
        assert!(ratio < 0.5, "{ratio}");
        assert!((0.4..3.0).contains(&fused.nees()), "{}", fused.nees());
    }
}
