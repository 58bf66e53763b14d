//! Absolute fixes in motion: on time, late, out of order, with a lever arm, wrong.

#![allow(clippy::unwrap_used)] // Helpers of tests are tests.

mod support;

use kerbside_geometry::Pose;
use kerbside_messages::{Fix, FixVerdict, Header, Odometry, ResetReason, Travel};
use kerbside_odometry::{
    Estimator, EstimatorInputs, EstimatorSettings, InitialPose, ParameterEstimate,
};
use support::{Car, Chain, car, s_path};

/// Travels of a drive and the true pose at each.
fn drive(seed: u64) -> Vec<(Travel, Pose)> {
    let vehicle = car();
    let mut driven = Car::new(car()).noisy(seed, 0.001, 0.001, 0.0035);
    let mut chain = Chain::new(&vehicle, &placed());
    let path = s_path(&vehicle, 0.26, 0.005);
    let mut travels = Vec::new();
    for (speed, angle) in path {
        driven.roll(speed, angle);
        chain.feed(&driven.raw());
        travels.push((chain.travel, driven.truth));
    }
    travels
}

fn placed() -> EstimatorSettings {
    let initial = InitialPose { pose: Pose::default(), position_noise: 0.01, yaw_noise: 0.01 };
    EstimatorSettings { initial_pose: Some(initial), ..EstimatorSettings::default() }
}

fn fix(stamp: u64, pose: Pose) -> Fix {
    let covariance = [4e-6, 1e-6, 0.0, 1e-6, 4e-6, 0.0, 0.0, 0.0, 4e-6];
    let header = Header::stamped(stamp, 0);
    Fix { header, x: pose.x, y: pose.y, yaw: pose.yaw, covariance, ..Fix::default() }
}

/// Runs over `travels`; `fixes` come with the travel of that number.
fn run(travels: &[(Travel, Pose)], fixes: &[(usize, Fix)]) -> (Odometry, ParameterEstimate) {
    let mut estimator = Estimator::new(&car(), &placed()).unwrap();
    let mut out = Odometry::default();
    for (number, (travel, _)) in travels.iter().enumerate() {
        let fix = fixes.iter().find(|(at, _)| *at == number).map(|(_, fix)| fix);
        let inputs = EstimatorInputs { travel, missing: 0, fix, restore: None };
        estimator.step(inputs, &mut out);
        if fix.is_some() {
            assert_eq!(out.fix_verdict, FixVerdict::Accepted.code(), "{number}");
        }
    }
    (out, estimator.parameters().unwrap())
}

/// True pose at a number, off by a little.
fn seen(travels: &[(Travel, Pose)], number: usize) -> Fix {
    let (travel, truth) = &travels[number];
    let off = Pose::new(truth.x + 0.002, truth.y - 0.001, truth.yaw + 0.001);
    fix(travel.header.stamp, off)
}

fn assert_same(left: &Odometry, right: &Odometry, bound: f64) {
    let differences = [left.x - right.x, left.y - right.y, left.yaw - right.yaw];
    for (difference, name) in differences.iter().zip(["x", "y", "yaw"]) {
        assert!(difference.abs() <= bound, "{name}: {difference}");
    }
    for (left, right) in left.covariance.iter().zip(&right.covariance) {
        assert!((left - right).abs() <= bound * bound.max(1e-6), "{left} {right}");
    }
}

#[test]
fn a_late_fix_is_worth_what_it_would_have_been_on_time() {
    let travels = drive(11);
    let whole = &travels[..1500];
    for number in [400, 777, 1200] {
        let seen = seen(whole, number);
        let (on_time, learnt) = run(whole, &[(number, seen)]);
        for late in [1, 13, 100] {
            let (later, learnt_later) = run(whole, &[(number + late, seen)]);
            assert_same(&on_time, &later, 0.0);
            assert_eq!(learnt, learnt_later);
        }
    }
}

#[test]
fn fixes_out_of_order_are_worth_what_they_are_in_order() {
    let travels = drive(12);
    let whole = &travels[..1500];
    let fixes: Vec<Fix> = [500, 530, 560].map(|number| seen(whole, number)).into();
    let (ordered, learnt) = run(whole, &[(600, fixes[0]), (601, fixes[1]), (602, fixes[2])]);
    for order in [[2, 1, 0], [1, 2, 0], [2, 0, 1]] {
        let shuffled: Vec<_> =
            order.iter().enumerate().map(|(place, which)| (600 + place, fixes[*which])).collect();
        let (other, learnt_other) = run(whole, &shuffled);
        assert_same(&ordered, &other, 1e-12);
        let off = (learnt.covariance - learnt_other.covariance).abs().max();
        assert!(off < 1e-15, "{off}");
    }
}

#[test]
fn a_fix_between_two_readings_is_met_on_the_arc_between_them() {
    let travels = drive(13);
    let whole = &travels[..1200];
    let (before, after) = (&whole[800], &whole[801]);
    let half = before.0.header.stamp + (after.0.header.stamp - before.0.header.stamp) / 2;
    let mut truth = before.1;
    let distance = before.1.distance(&after.1);
    truth = truth.advance(0.5 * distance, 0.5 * (after.1.yaw - before.1.yaw));
    let between =
        Fix { covariance: [1e-12, 0., 0., 0., 1e-12, 0., 0., 0., 1e-12], ..fix(half, truth) };
    let (out, _) = run(&whole[..802], &[(801, between)]);
    let off = Pose::new(out.x, out.y, out.yaw).distance(&after.1);
    // Half a period is 0.65 mm, a count 0.22 mm.
    assert!(off < 0.3e-3, "{off}");
}

#[test]
fn a_marker_is_not_the_rear_axle() {
    let travels = drive(14);
    let whole = &travels[..1000];
    let (travel, truth) = &whole[900];
    let marker = Pose::new(0.3, -0.1, 0.7);
    let (sin, cos) = truth.yaw.sin_cos();
    let mut sighted = fix(
        travel.header.stamp,
        Pose::new(
            truth.x + cos * marker.x - sin * marker.y,
            truth.y + sin * marker.x + cos * marker.y,
            truth.yaw + marker.yaw - core::f64::consts::TAU,
        ),
    );
    (sighted.marker_x, sighted.marker_y, sighted.marker_yaw) = (marker.x, marker.y, marker.yaw);
    sighted.covariance = [1e-12, 0., 0., 0., 1e-12, 0., 0., 0., 1e-12];
    let (out, _) = run(&whole[..901], &[(900, sighted)]);
    let off = Pose::new(out.x, out.y, out.yaw).distance(truth);
    assert!(off < 1e-5 && (out.yaw - truth.yaw).abs() < 1e-5, "{off} m, {}", out.yaw - truth.yaw);
}

#[test]
fn a_fix_that_contradicts_a_moving_vehicle_changes_nothing() {
    let travels = drive(15);
    let mut wrong = seen(&travels, 600);
    wrong.x += 0.5;
    let (mut one, mut other) =
        (Estimator::new(&car(), &placed()).unwrap(), Estimator::new(&car(), &placed()).unwrap());
    let (mut with, mut without) = (Odometry::default(), Odometry::default());
    for (number, (travel, _)) in travels[..1200].iter().enumerate() {
        let fix = (number == 650).then_some(&wrong);
        one.step(EstimatorInputs { travel, missing: 0, fix, restore: None }, &mut with);
        let inputs = EstimatorInputs { travel, missing: 0, fix: None, restore: None };
        other.step(inputs, &mut without);
    }
    assert_eq!(with.fix_verdict, FixVerdict::Moving.code());
    assert!(with.test_ratio > 1000.0);
    assert_eq!((with.x, with.y, with.yaw), (without.x, without.y, without.yaw));
    assert_eq!(with.covariance, without.covariance);
}

#[test]
fn a_fix_from_before_a_jump_is_not_gone_back_to() {
    let mut travels = drive(16);
    for (travel, _) in &mut travels[700..] {
        travel.counter_epoch += 1;
    }
    let late = seen(&travels, 690);
    let mut estimator = Estimator::new(&car(), &placed()).unwrap();
    let mut out = Odometry::default();
    for (number, (travel, _)) in travels[..760].iter().enumerate() {
        let fix = (number == 740).then_some(&late);
        estimator.step(EstimatorInputs { travel, missing: 0, fix, restore: None }, &mut out);
    }
    assert_eq!(out.fix_verdict, FixVerdict::Moving.code());
}

#[test]
fn fixes_tell_the_scale_that_wheels_alone_cannot() {
    let travels = drive(17);
    let common = |estimate: &ParameterEstimate| {
        let radii = estimate.covariance.fixed_view::<4, 4>(0, 0);
        radii.sum() / 16.0
    };
    let prior = 5e-4_f64.powi(2) / 4.0;
    let (_, alone) = run(&travels, &[]);
    let share = common(&alone) / prior;
    assert!((0.97..1.01).contains(&share), "wheels alone: {share} of the prior's variance");
    let fixes: Vec<_> =
        (100..travels.len() - 10).step_by(200).map(|at| (at + 5, seen(&travels, at))).collect();
    let (out, told) = run(&travels, &fixes);
    assert!(common(&told) < 0.75 * prior, "{}", common(&told) / prior);
    assert!(out.covariance[0] < 1e-5);
    let eigenvalues = told.covariance.symmetric_eigenvalues();
    assert!(eigenvalues.min() > 0.0, "{eigenvalues}");
}

/// Travels of a car whose wheels are all larger by `share` than its file says, and the true poses.
fn larger(seed: u64, share: f64) -> Vec<(Travel, Pose)> {
    let mut travels = drive(seed);
    let shrunk = |travel: &mut [f64; 4]| travel.iter_mut().for_each(|way| *way /= 1.0 + share);
    for (travel, _) in &mut travels {
        shrunk(&mut travel.travel);
        shrunk(&mut travel.increment);
    }
    travels
}

/// Steps over `travels` with fixes every `every` from `seen`; what became of each, and the last odometry.
fn judged(
    travels: &[(Travel, Pose)],
    every: usize,
    seen: impl Fn(usize) -> Fix,
) -> (Vec<FixVerdict>, Odometry, ParameterEstimate) {
    let mut estimator = Estimator::new(&car(), &placed()).unwrap();
    let (mut out, mut verdicts) = (Odometry::default(), Vec::new());
    for (number, (travel, _)) in travels.iter().enumerate() {
        let fix = (number > 0 && number.is_multiple_of(every)).then(|| seen(number));
        let inputs = EstimatorInputs { travel, missing: 0, fix: fix.as_ref(), restore: None };
        estimator.step(inputs, &mut out);
        if fix.is_some() {
            verdicts.push(FixVerdict::from_code(out.fix_verdict).unwrap());
        }
    }
    (verdicts, out, estimator.parameters().unwrap())
}

#[test]
fn fixes_that_agree_with_one_another_widen_a_covariance_that_was_too_small() {
    // Eighty standard deviations of the prior.
    let travels = larger(18, 0.04);
    let (verdicts, out, learnt) = judged(&travels, 40, |at| seen(&travels, at));
    let count = |verdict| verdicts.iter().filter(|said| **said == verdict).count();
    let refused = count(FixVerdict::Moving);
    assert!(count(FixVerdict::Widened) >= 1, "{verdicts:?}");
    assert!(refused * 5 < verdicts.len(), "{refused} of {} refused", verdicts.len());
    assert_eq!(out.reset_reason, ResetReason::Contradicted.code());
    assert_eq!(out.resets as usize, 1 + count(FixVerdict::Widened));
    let truth = travels.last().unwrap().1;
    let off = Pose::new(out.x, out.y, out.yaw).distance(&truth);
    assert!(off < 0.01, "{off} m");
    let scale = learnt.deviation[..4].iter().sum::<f64>() / 4.0;
    assert!((scale - 0.04).abs() < 0.006, "{scale}");
}

#[test]
fn wrong_fixes_that_do_not_agree_are_refused_for_good() {
    let travels = drive(19);
    let wrong = |at: usize| {
        let mut fix = seen(&travels, at);
        let side = if (at / 40).is_multiple_of(2) { 1.0 } else { -1.0 };
        (fix.x, fix.y) = (fix.x + 0.4 * side, fix.y - 0.3 * side);
        fix
    };
    let (verdicts, out, _) = judged(&travels, 40, wrong);
    assert!(verdicts.iter().all(|said| *said == FixVerdict::Moving), "{verdicts:?}");
    assert_eq!((out.resets, out.reset_reason), (1, ResetReason::Initial.code()));
    let off = Pose::new(out.x, out.y, out.yaw).distance(&travels.last().unwrap().1);
    assert!(off < 0.15, "{off} m");
}

#[test]
fn late_fixes_widen_the_past_that_they_are_of() {
    let travels = larger(20, 0.04);
    let late = |at: usize| seen(&travels, at.saturating_sub(60));
    let (verdicts, out, _) = judged(&travels, 40, late);
    assert!(verdicts.contains(&FixVerdict::Widened), "{verdicts:?}");
    let off = Pose::new(out.x, out.y, out.yaw).distance(&travels.last().unwrap().1);
    assert!(off < 0.02, "{off} m");
}
