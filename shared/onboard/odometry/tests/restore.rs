//! A restarted estimator goes on with all that its earlier life knew.

#![allow(clippy::unwrap_used)] // Helpers of tests are tests.

mod support;

use kerbside_geometry::Vehicle;
use kerbside_messages::{EstimatorState, Fix, Header, Odometry, ResetReason, Restore, Travel};
use kerbside_odometry::{
    Estimator, EstimatorInputs, EstimatorSettings, Filter, Ingest, IngestSettings, Parameter,
    ParameterEstimate, ParameterPrior, Sensors,
};
use support::{Car, car, placed, s_path, sensors};

/// Travels of a noisy drive along the S path at 200 Hz; `mask` gives the wheels of each reading.
fn travels(sensors: &Sensors, mask: impl Fn(usize) -> u8) -> Vec<Travel> {
    let vehicle = car();
    let mut driven = Car::new(car()).noisy(5, 0.001, 0.001, 0.0035);
    let settings = IngestSettings::default();
    let mut ingest = Ingest::with_sensors(&vehicle, sensors, &settings).unwrap();
    let mut travel = Travel::default();
    let path = s_path(&vehicle, 0.26, 0.005);
    let drive = path.iter().enumerate().map(|(index, (speed, angle))| {
        driven.roll(*speed, *angle);
        let mut raw = driven.raw();
        raw.counts_mask = mask(index);
        raw.yaw_rate += 0.004;
        ingest.step(&raw, 0, false, &mut travel);
        travel
    });
    drive.collect()
}

/// A name, the sensors, and the wheels that each reading carries.
type Case = (&'static str, Sensors, fn(usize) -> u8);

fn estimator(vehicle: &Vehicle, sensors: &Sensors, settings: &EstimatorSettings) -> Estimator {
    Estimator::with_sensors(vehicle, sensors, settings).unwrap()
}

fn step(
    life: &mut Estimator,
    travel: &Travel,
    missing: u64,
    restore: Option<&Restore>,
) -> Odometry {
    let mut out = Odometry::default();
    life.step(EstimatorInputs { travel, missing, fix: None, restore }, &mut out);
    out
}

/// The numbers of an estimate: pose, covariance, way, what was learnt, and how certain that is.
fn numbers(odometry: &Odometry) -> Vec<f64> {
    let state = &odometry.filter_state;
    let mut all = vec![odometry.x, odometry.y, odometry.yaw, odometry.distance];
    all.extend(odometry.covariance.map(|entry| entry.abs().sqrt()));
    all.extend(state.parameters);
    all.extend(state.parameter_covariance.map(|entry| entry.abs().sqrt()));
    all
}

fn farthest(one: &Odometry, other: &Odometry) -> f64 {
    let pairs = numbers(one).into_iter().zip(numbers(other));
    pairs.fold(0.0, |most, (one, other)| most.max((one - other).abs()))
}

/// Feeds `travels` to one life of the estimator, and after every 37th what it knew to another, with
/// `missing` travels lost on the way to both; returns the largest difference between the two over
/// the next two seconds.
fn largest_difference(
    sensors: &Sensors,
    settings: &EstimatorSettings,
    travels: &[Travel],
    missing: usize,
) -> f64 {
    let vehicle = car();
    let mut first = estimator(&vehicle, sensors, settings);
    let later = EstimatorSettings { initial_pose: None, ..settings.clone() };
    let mut most = 0.0_f64;
    for (index, travel) in travels.iter().enumerate() {
        let known = step(&mut first, travel, 0, None);
        if index < 60 || index % 37 != 0 {
            continue;
        }
        let restore = Restore { odometry: known, ..Restore::default() };
        let mut whole = first.clone();
        let mut next = estimator(&vehicle, sensors, &later);
        let rest = travels.iter().skip(index + 1 + missing).take(400);
        for (position, travel) in rest.enumerate() {
            let lost = if position == 0 { missing as u64 } else { 0 };
            let expected = step(&mut whole, travel, lost, None);
            let found = step(&mut next, travel, 0, Some(&restore));
            assert_eq!(found.state, EstimatorState::Valid.code());
            most = most.max(farthest(&expected, &found));
        }
    }
    most
}

#[test]
fn where_nothing_was_missed_the_estimates_are_those_of_one_life() {
    let all = |_| 0xf;
    let cases: [Case; 7] = [
        ("all sensors", sensors([true; 4], true, true), all),
        ("no gyro", sensors([true; 4], true, false), all),
        ("no steering sensor", sensors([true; 4], false, false), all),
        ("one wheel and the gyro", sensors([false, false, false, true], false, true), all),
        ("rear wheels", sensors([false, false, true, true], false, false), all),
        ("a dead wheel", sensors([true; 4], true, true), |_| 0b1101),
        ("a wheel read now and then", sensors([true; 4], true, true), |index| {
            if index % 5 == 0 { 0xf } else { 0b1110 }
        }),
    ];
    for (name, sensors, mask) in cases {
        let travels = travels(&sensors, mask);
        let off = largest_difference(&sensors, &placed(), &travels, 0);
        println!("{name}: {off:.1e}");
        assert!(off < 1e-9, "{name}: {off}");
    }
}

#[test]
fn other_filters_go_on_as_well() {
    let sensors = sensors([true; 4], true, true);
    let travels = travels(&sensors, |_| 0xf);
    let settings = EstimatorSettings { filter: Filter::Rear, ..placed() };
    let off = largest_difference(&sensors, &settings, &travels, 0);
    assert!(off < 1e-9, "{off}");
}

#[test]
fn over_a_gap_they_are_those_of_a_life_that_missed_the_same_travels() {
    let sensors = sensors([true; 4], true, true);
    let travels = travels(&sensors, |_| 0xf);
    for missing in [1, 20, 150] {
        let off = largest_difference(&sensors, &placed(), &travels, missing);
        println!("{missing} missing: {off:.1e}");
        assert!(off < 1e-9, "{missing} missing: {off}");
    }
}

/// A drive's travels, what was known in its middle, and the estimator that knew it.
fn half_way(settings: &EstimatorSettings) -> (Vec<Travel>, usize, Odometry, Estimator) {
    let sensors = Sensors::of(&car());
    let travels = travels(&sensors, |_| 0xf);
    let half = travels.len() / 2;
    let mut first = estimator(&car(), &sensors, settings);
    let mut known = Odometry::default();
    for travel in &travels[..=half] {
        known = step(&mut first, travel, 0, None);
    }
    (travels, half, known, first)
}

#[test]
fn a_gap_inflates_the_covariance_of_the_pose_and_keeps_that_of_the_parameters() {
    let (travels, half, known, mut first) = half_way(&placed());
    let restore = Restore { odometry: known, ..Restore::default() };
    let mut next = Estimator::new(&car(), &EstimatorSettings::default()).unwrap();
    for travel in &travels[half + 1..=half + 100] {
        step(&mut first, travel, 0, None);
    }
    let whole = step(&mut first, &travels[half + 101], 0, None);
    let found = step(&mut next, &travels[half + 101], 0, Some(&restore));
    assert_eq!(found.reset_reason, ResetReason::Restored.code());
    // 100 readings at 0.26 m/s are 0.13 m, over which full lock leaves an arc by up to 3 mm.
    let (blurred, sharp) = (found.covariance, whole.covariance);
    assert!(blurred[0] + blurred[4] > sharp[0] + sharp[4] + 0.002_f64.powi(2));
    assert_eq!(found.filter_state.parameters, known.filter_state.parameters);
    let before = known.filter_state.parameter_covariance;
    assert_eq!(found.filter_state.parameter_covariance[0], before[0]);
}

#[test]
fn what_was_learnt_from_fixes_is_not_lost() {
    let vehicle = car();
    let sensors = Sensors::of(&vehicle);
    let travels = travels(&sensors, |_| 0xf);
    let prior = ParameterPrior::calibrated(&vehicle);
    let mut first = estimator(&vehicle, &sensors, &placed());
    let mut out = Odometry::default();
    let mut truth = Car::new(car());
    let path = s_path(&vehicle, 0.26, 0.005);
    for (index, (travel, (speed, angle))) in travels.iter().zip(&path).enumerate() {
        truth.roll(*speed, *angle);
        let fix = Fix {
            header: Header::stamped(travel.header.stamp, 0),
            x: truth.truth.x,
            y: truth.truth.y,
            yaw: truth.truth.yaw,
            covariance: [1e-6, 0.0, 0.0, 0.0, 1e-6, 0.0, 0.0, 0.0, 1e-6],
            ..Fix::default()
        };
        let fix = (index % 40 == 0).then_some(&fix);
        first.step(EstimatorInputs { travel, missing: 0, fix, restore: None }, &mut out);
    }
    let zero = Parameter::SteeringZero.index();
    let learnt = first.parameters().unwrap();
    assert!(learnt.covariance[(zero, zero)] < 0.1 * prior.covariance[(zero, zero)]);
    assert_eq!(ParameterEstimate::of(&out.filter_state), Some(learnt));
    let restore = Restore { odometry: out, ..Restore::default() };
    let mut next = estimator(&vehicle, &sensors, &EstimatorSettings::default());
    let mut standing = *travels.last().unwrap();
    standing.header.stamp += 5_000_000;
    step(&mut next, &standing, 0, Some(&restore));
    let found = next.parameters().unwrap();
    assert_eq!(found.deviation, learnt.deviation);
    assert!((found.covariance - learnt.covariance).abs().max() < 1e-15);
}

#[test]
fn what_was_learnt_of_another_vehicle_is_not_taken_up() {
    let (travels, half, known, _) = half_way(&placed());
    let restore = Restore { odometry: known, ..Restore::default() };
    let mut calibrated = car();
    calibrated.radius[2] *= 1.001;
    let mut next = Estimator::new(&calibrated, &EstimatorSettings::default()).unwrap();
    let standing = Travel { travel: known.travel, ..travels[half + 1] };
    let found = step(&mut next, &standing, 0, Some(&restore));
    assert_eq!(found.state, EstimatorState::Valid.code());
    assert_eq!(found.filter_state.parameters, [0.0; 9]);
    let twice = known.covariance.map(|entry| 2.0 * entry);
    assert_eq!(found.covariance, twice);
}

#[test]
fn what_is_no_covariance_is_not_taken_up() {
    let (travels, half, mut known, _) = half_way(&placed());
    known.filter_state.shared_covariance[3] = 1.0;
    let restore = Restore { odometry: known, ..Restore::default() };
    let mut next = Estimator::new(&car(), &EstimatorSettings::default()).unwrap();
    let found = step(&mut next, &travels[half + 1], 0, Some(&restore));
    assert_eq!(found.state, EstimatorState::Valid.code());
    assert_eq!(found.filter_state.parameters, [0.0; 9]);
}
