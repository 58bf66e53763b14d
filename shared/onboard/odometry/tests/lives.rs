//! Who may die without the pose: estimator, ingest, interface, vehicle; and what a fix does.

#![allow(clippy::unwrap_used)] // Helpers of tests are tests.

mod support;

use kerbside_geometry::Vehicle;
use kerbside_messages::{
    EstimatorState as State, Fix, FixVerdict, Header, Odometry, ResetReason as Reason, Restore,
    Travel,
};
use kerbside_odometry::{
    Estimator, EstimatorInputs, EstimatorSettings, Ingest, IngestSettings, Sensors,
};
use support::{Car, Chain, car, fine_car, placed};

/// A car under way with a valid pose, 1 m into a left bend.
fn under_way(vehicle: &Vehicle) -> (Chain, Car) {
    let mut chain = Chain::new(vehicle, &placed());
    let mut car = Car::new(vehicle.clone()).rolling(0.3, 0.2);
    chain.feed(&car.raw());
    drive(&mut chain, &mut car, 0.3, 600);
    (chain, car)
}

fn drive(chain: &mut Chain, car: &mut Car, speed: f64, periods: usize) {
    for _ in 0..periods {
        car.roll(speed, 0.2);
        chain.feed(&car.raw());
    }
}

fn unseen(car: &mut Car, periods: usize) {
    for _ in 0..periods {
        car.roll(0.3, 0.2);
    }
}

fn ingest(vehicle: &Vehicle) -> Ingest {
    Ingest::new(vehicle, &IngestSettings::default()).unwrap()
}

fn estimator(vehicle: &Vehicle) -> Estimator {
    Estimator::new(vehicle, &EstimatorSettings::default()).unwrap()
}

fn restore_of(odometry: &Odometry) -> Restore {
    Restore { odometry: *odometry, ..Restore::default() }
}

/// The next reading, with a restore for the estimator.
fn feed_with(chain: &mut Chain, car: &mut Car, restore: &Restore) {
    car.roll(0.3, 0.2);
    chain.ingest.step(&car.raw(), 0, false, &mut chain.travel);
    let inputs =
        EstimatorInputs { travel: &chain.travel, missing: 0, fix: None, restore: Some(restore) };
    chain.estimator.step(inputs, &mut chain.odometry);
}

/// The pose is the true one, to within `bound`, and said to be valid.
fn assert_true(chain: &Chain, car: &Car, bound: f64) {
    let error = chain.pose().distance(&car.truth);
    assert_eq!(chain.odometry.state, State::Valid.code());
    assert!(error < bound, "{error} m off");
    assert!((chain.odometry.yaw - car.truth.yaw).abs() < bound);
}

#[test]
fn a_restarted_ingest_is_not_noticed_but_as_a_gap() {
    for bits in [32, 30] {
        let vehicle = fine_car(bits);
        let (mut chain, mut car) = under_way(&vehicle);
        let spread = chain.odometry.covariance[4];
        let resets = chain.odometry.resets;
        unseen(&mut car, 60);
        chain.ingest = ingest(&vehicle);
        drive(&mut chain, &mut car, 0.3, 1);
        assert_true(&chain, &car, 1e-6);
        assert!(chain.odometry.covariance[4] > spread, "a gap is less certain");
        drive(&mut chain, &mut car, 0.3, 200);
        assert_true(&chain, &car, 1e-6);
        assert_eq!(chain.odometry.resets, resets);
    }
}

#[test]
fn narrow_counters_are_unwrapped_across_lives() {
    // 2^14 counts of 0.22 mm: the counter wraps every 3.6 m.
    let mut vehicle = car();
    if let Some(encoders) = &mut vehicle.encoders {
        encoders.counter_bits = 14;
    }
    let (mut chain, mut car) = under_way(&vehicle);
    for _ in 0..12 {
        unseen(&mut car, 60);
        chain.ingest = ingest(&vehicle);
        drive(&mut chain, &mut car, 0.3, 240);
    }
    assert!(car.truth.yaw > 2.0);
    assert_true(&chain, &car, 0.02);
}

#[test]
fn a_restored_estimator_goes_on_where_the_old_one_was() {
    let vehicle = fine_car(32);
    let (mut chain, mut car) = under_way(&vehicle);
    let restore = restore_of(&chain.odometry);
    unseen(&mut car, 40);
    chain.estimator = estimator(&vehicle);
    feed_with(&mut chain, &mut car, &restore);
    assert_true(&chain, &car, 1e-6);
    assert_eq!(chain.odometry.reset_reason, Reason::Restored.code());
    assert_eq!(chain.odometry.resets, restore.odometry.resets + 1);
    assert!(chain.odometry.distance > restore.odometry.distance);
    assert!(chain.odometry.covariance[4] > restore.odometry.covariance[4]);
    feed_with(&mut chain, &mut car, &restore);
    assert_eq!(chain.odometry.resets, restore.odometry.resets + 1, "taken up once");
    assert_true(&chain, &car, 1e-6);
}

#[test]
fn a_restore_may_come_later_than_the_first_travel() {
    let vehicle = fine_car(32);
    let (mut chain, mut car) = under_way(&vehicle);
    let restore = restore_of(&chain.odometry);
    chain.estimator = estimator(&vehicle);
    unseen(&mut car, 10);
    drive(&mut chain, &mut car, 0.3, 30);
    assert_eq!(chain.odometry.state, State::Unset.code());
    feed_with(&mut chain, &mut car, &restore);
    assert_true(&chain, &car, 1e-6);
    drive(&mut chain, &mut car, 0.3, 100);
    assert_true(&chain, &car, 1e-6);
}

#[test]
fn estimator_and_ingest_may_die_together() {
    for bits in [32, 30] {
        let vehicle = fine_car(bits);
        let (mut chain, mut car) = under_way(&vehicle);
        let restore = restore_of(&chain.odometry);
        unseen(&mut car, 100);
        (chain.estimator, chain.ingest) = (estimator(&vehicle), ingest(&vehicle));
        feed_with(&mut chain, &mut car, &restore);
        drive(&mut chain, &mut car, 0.3, 100);
        assert_true(&chain, &car, 1e-6);
    }
}

#[test]
fn a_restarted_interface_is_a_gap() {
    let vehicle = fine_car(32);
    let (mut chain, mut car) = under_way(&vehicle);
    unseen(&mut car, 100);
    car.frame = 3;
    car.roll(0.3, 0.2);
    chain.ingest.step(&car.raw(), 0, true, &mut chain.travel);
    chain.estimate();
    assert_eq!(chain.odometry.gap, 1);
    drive(&mut chain, &mut car, 0.3, 50);
    assert_true(&chain, &car, 1e-6);
}

#[test]
fn lost_travels_lose_no_motion() {
    let vehicle = fine_car(32);
    let (mut chain, mut car) = under_way(&vehicle);
    for _ in 0..5 {
        car.roll(0.3, 0.2);
        chain.ingest.step(&car.raw(), 0, false, &mut chain.travel);
    }
    let inputs = EstimatorInputs { travel: &chain.travel, missing: 4, fix: None, restore: None };
    chain.estimator.step(inputs, &mut chain.odometry);
    assert_eq!(chain.odometry.gap, 1);
    assert_true(&chain, &car, 1e-6);
}

#[test]
fn the_vehicles_restart_loses_the_pose_without_a_jump() {
    let vehicle = fine_car(32);
    let (mut chain, mut car) = under_way(&vehicle);
    let (pose, resets) = (chain.pose(), chain.odometry.resets);
    car.boot += 1;
    car.rolled = [0.0; 4];
    chain.feed(&car.raw());
    assert_eq!(chain.odometry.state, State::Lost.code());
    assert_eq!(chain.odometry.reset_reason, Reason::CounterReset.code());
    assert_eq!((chain.pose(), chain.odometry.resets), (pose, resets + 1));
    drive(&mut chain, &mut car, 0.3, 100);
    assert_eq!(chain.odometry.state, State::Lost.code());
    assert!((chain.pose().distance(&pose) - 0.15).abs() < 1e-3, "it goes on from there");
}

#[test]
fn a_restore_of_another_epoch_is_a_lost_pose() {
    let vehicle = fine_car(32);
    let (mut chain, mut car) = under_way(&vehicle);
    let restore = restore_of(&chain.odometry);
    car.boot += 1;
    (chain.estimator, chain.ingest) = (estimator(&vehicle), ingest(&vehicle));
    feed_with(&mut chain, &mut car, &restore);
    assert_eq!(chain.odometry.state, State::Lost.code());
    assert!((chain.odometry.x - restore.odometry.x).abs() < 0.01);
}

#[test]
fn a_restore_over_which_no_wheel_can_have_turned_so_far_is_a_lost_pose() {
    let vehicle = fine_car(32);
    let (mut chain, mut car) = under_way(&vehicle);
    let restore = restore_of(&chain.odometry);
    car.rolled[2] += 5.0;
    (chain.estimator, chain.ingest) = (estimator(&vehicle), ingest(&vehicle));
    feed_with(&mut chain, &mut car, &restore);
    assert_eq!(chain.odometry.state, State::Lost.code());
}

#[test]
fn counters_that_began_anew_while_ingest_was_dead_are_a_lost_pose() {
    for back in [0.05, 0.3, 0.6] {
        let vehicle = fine_car(32);
        let (mut chain, mut car) = under_way(&vehicle);
        unseen(&mut car, 10);
        for rolled in &mut car.rolled {
            *rolled -= back;
        }
        chain.ingest = ingest(&vehicle);
        drive(&mut chain, &mut car, 0.3, 2);
        assert_eq!(chain.odometry.state, State::Lost.code(), "{back} m back");
        assert_eq!(chain.odometry.reset_reason, Reason::CounterReset.code());
    }
}

#[test]
fn counters_that_may_have_begun_anew_within_a_gap_are_a_lost_pose() {
    // The lengths of a gap by whose motion alone nobody could tell: the vehicle might have turned about in it.
    for periods in [100, 200, 380] {
        let vehicle = fine_car(32);
        let mut chain = Chain::new(&vehicle, &placed());
        let mut car = Car::new(vehicle).rolling(0.3, 0.2);
        car.rolled = [0.02, 0.03, 0.01, 0.02];
        chain.feed(&car.raw());
        drive(&mut chain, &mut car, 0.3, 60);
        let resets = chain.odometry.resets;
        unseen(&mut car, periods / 2);
        car.rolled = [0.0; 4];
        unseen(&mut car, periods / 2);
        drive(&mut chain, &mut car, 0.3, 1);
        assert_eq!(chain.odometry.state, State::Lost.code(), "{periods}");
        assert_eq!(chain.odometry.reset_reason, Reason::CounterReset.code());
        assert_eq!(chain.odometry.resets, resets + 1);
    }
}

#[test]
fn counters_near_zero_keep_the_pose_of_a_car_that_stands_and_over_a_few_lost_readings() {
    let vehicle = fine_car(32);
    let mut chain = Chain::new(&vehicle, &placed());
    let mut car = Car::new(vehicle);
    car.rolled = [0.001; 4];
    chain.feed(&car.raw());
    let resets = chain.odometry.resets;
    (0..200).for_each(|_| car.roll(0.0, 0.2));
    drive(&mut chain, &mut car, 0.0, 1);
    drive(&mut chain, &mut car, 0.3, 10);
    unseen(&mut car, 15);
    drive(&mut chain, &mut car, 0.3, 1);
    assert_eq!((chain.odometry.gap, chain.odometry.resets), (1, resets));
    assert_eq!(chain.odometry.state, State::Valid.code());
}

#[test]
fn a_vehicle_that_brakes_while_ingest_is_dead_keeps_its_pose() {
    let vehicle = fine_car(32);
    let (mut chain, mut car) = under_way(&vehicle);
    let period = 0.005;
    let mut speed = 0.3_f64;
    for _ in 0..80 {
        speed = (speed - vehicle.limits.deceleration * period).max(0.0);
        car.roll(speed, 0.2);
    }
    chain.ingest = ingest(&vehicle);
    drive(&mut chain, &mut car, speed, 2);
    assert_true(&chain, &car, 1e-3);
}

#[test]
fn wheel_speeds_do_not_survive_ingest() {
    let mut vehicle = fine_car(32);
    vehicle.encoders = None;
    let sensors = Sensors::of(&vehicle).with_speeds([true; 4]);
    let mut chain = Chain::with(&vehicle, &sensors, &placed());
    let mut car = Car::new(vehicle.clone());
    chain.feed(&car.raw());
    drive(&mut chain, &mut car, 0.3, 100);
    assert_eq!(chain.odometry.state, State::Valid.code());
    let settings = IngestSettings::default();
    chain.ingest = Ingest::with_sensors(&vehicle, &sensors, &settings).unwrap();
    drive(&mut chain, &mut car, 0.3, 2);
    assert_eq!(chain.odometry.state, State::Lost.code());
}

#[test]
fn one_rear_wheel_is_awaited_and_nothing_is_invented() {
    let vehicle = fine_car(32);
    let (mut chain, mut car) = under_way(&vehicle);
    let (pose, certain, unusable) =
        (chain.pose(), chain.odometry.covariance, chain.odometry.unusable);
    for _ in 0..20 {
        car.roll(0.3, 0.2);
        let mut raw = car.raw();
        raw.counts_mask = 0b1011;
        chain.feed(&raw);
        assert_eq!(chain.pose(), pose);
    }
    assert_eq!(chain.odometry.unusable, unusable + 20);
    assert!(chain.odometry.covariance[0] > certain[0] + 0.02 * 0.02, "the other rolled 3 cm");
    drive(&mut chain, &mut car, 0.3, 1);
    assert_true(&chain, &car, 1e-5);
    assert!(chain.odometry.covariance[0] < certain[0] + 0.01 * 0.01);
}

#[test]
fn wheels_read_in_turns_are_enough() {
    let vehicle = fine_car(32);
    let (mut chain, mut car) = under_way(&vehicle);
    for step in 0..400 {
        car.roll(if step < 380 { 0.3 } else { 0.0 }, 0.2);
        let mut raw = car.raw();
        raw.counts_mask = if step % 2 == 0 { 0b0101 } else { 0b1010 };
        chain.feed(&raw);
    }
    // The two wheels' readings are 5 ms apart: while rolling the heading is off by 0.3 m/s * 5 ms /
    // track.
    assert_true(&chain, &car, 5e-3);
    let off = (chain.odometry.yaw - car.truth.yaw).abs();
    assert!(off < 1e-3, "not once it stands: {off}");
}

fn fix_at(stamp: u64) -> Fix {
    let covariance = [4e-6, 0.0, 0.0, 0.0, 4e-6, 0.0, 0.0, 0.0, 3e-6];
    let header = Header { sequence: 12, ..Header::stamped(stamp, 0) };
    Fix { header, x: 1.0, y: -2.0, yaw: 0.5, covariance, ..Fix::default() }
}

/// The car stands for some periods; `fix` comes with the last reading.
fn stand(chain: &mut Chain, car: &mut Car, periods: usize, fix: Option<&Fix>) {
    for period in 1..=periods {
        car.roll(0.0, 0.2);
        chain.ingest.step(&car.raw(), 0, false, &mut chain.travel);
        let fix = fix.filter(|_| period == periods);
        let inputs = EstimatorInputs { travel: &chain.travel, missing: 0, fix, restore: None };
        chain.estimator.step(inputs, &mut chain.odometry);
    }
}

fn verdict(chain: &Chain) -> Option<FixVerdict> {
    FixVerdict::from_code(chain.odometry.fix_verdict)
}

#[test]
fn a_fix_sets_the_pose_of_a_car_that_stands() {
    let vehicle = car();
    let mut chain = Chain::new(&vehicle, &EstimatorSettings::default());
    let mut car = Car::new(vehicle);
    drive(&mut chain, &mut car, 0.3, 100);
    assert_eq!((chain.odometry.state, chain.odometry.standstill), (State::Unset.code(), 0));
    let fix = fix_at(car.time);
    stand(&mut chain, &mut car, 1, Some(&fix));
    assert_eq!(verdict(&chain), Some(FixVerdict::Moving));
    assert_eq!((chain.odometry.state, chain.odometry.resets), (State::Unset.code(), 0));
    stand(&mut chain, &mut car, 70, None);
    assert_eq!((chain.odometry.standstill, chain.odometry.speed), (1, 0.0));
    let fix = fix_at(car.time);
    stand(&mut chain, &mut car, 1, Some(&fix));
    assert_eq!(verdict(&chain), Some(FixVerdict::Accepted));
    let odometry = chain.odometry;
    assert_eq!((odometry.x, odometry.y, odometry.yaw), (1.0, -2.0, 0.5));
    assert_eq!((odometry.covariance, odometry.fix_sequence), (fix.covariance, 12));
    assert_eq!((odometry.state, odometry.resets), (State::Valid.code(), 1));
    assert_eq!(odometry.reset_reason, Reason::Fix.code());
}

#[test]
fn a_fix_from_before_the_stop_is_refused() {
    let vehicle = car();
    let (mut chain, mut car) = under_way(&vehicle);
    let rolling = fix_at(car.time - 100_000_000);
    stand(&mut chain, &mut car, 80, Some(&rolling));
    assert_eq!((verdict(&chain), chain.odometry.standstill), (Some(FixVerdict::Moving), 1));
    let late = fix_at(car.time - 1_100_000_000);
    stand(&mut chain, &mut car, 200, Some(&late));
    assert_eq!(verdict(&chain), Some(FixVerdict::Late));
    let future = fix_at(car.time + 2_000_000_000);
    stand(&mut chain, &mut car, 1, Some(&future));
    assert_eq!(verdict(&chain), Some(FixVerdict::Future));
    assert_eq!(chain.odometry.reset_reason, Reason::Initial.code());
}

#[test]
fn a_fix_stamped_now_waits_for_the_wheels_to_catch_up() {
    let vehicle = car();
    let (mut chain, mut car) = under_way(&vehicle);
    stand(&mut chain, &mut car, 80, None);
    let fix = fix_at(car.time + 12_000_000);
    stand(&mut chain, &mut car, 1, Some(&fix));
    assert_eq!(verdict(&chain), Some(FixVerdict::None));
    stand(&mut chain, &mut car, 2, None);
    assert_eq!((verdict(&chain), chain.odometry.x), (Some(FixVerdict::Accepted), 1.0));
}

#[test]
fn a_fix_restores_a_lost_pose() {
    let vehicle = car();
    let (mut chain, mut car) = under_way(&vehicle);
    car.boot += 1;
    stand(&mut chain, &mut car, 80, None);
    assert_eq!(chain.odometry.state, State::Lost.code());
    let fix = fix_at(car.time);
    stand(&mut chain, &mut car, 1, Some(&fix));
    assert_eq!((chain.odometry.state, chain.odometry.x), (State::Valid.code(), 1.0));
}

#[test]
fn standing_still_nothing_moves_and_nothing_grows() {
    let vehicle = car();
    let (mut chain, mut car) = under_way(&vehicle);
    stand(&mut chain, &mut car, 1, None);
    let before = chain.odometry;
    stand(&mut chain, &mut car, 2000, None);
    let after = chain.odometry;
    assert_eq!((after.x, after.y, after.yaw), (before.x, before.y, before.yaw));
    assert_eq!((after.covariance, after.distance), (before.covariance, before.distance));
    assert_eq!(after.standstill, 1);
}

#[test]
fn a_gyro_does_not_turn_a_car_that_stands() {
    let vehicle = fine_car(32);
    let sensors = support::sensors([false, false, false, true], false, true);
    let mut chain = Chain::with(&vehicle, &sensors, &placed());
    let mut car = Car::new(vehicle);
    drive(&mut chain, &mut car, 0.3, 200);
    let yaw = chain.odometry.yaw;
    for _ in 0..2000 {
        car.roll(0.0, 0.2);
        let mut raw = car.raw();
        raw.yaw_rate = 0.02;
        chain.feed(&raw);
    }
    assert!((chain.odometry.yaw - yaw).abs() < 1e-3);
    let standing = chain.odometry.yaw;
    drive(&mut chain, &mut car, 0.3, 1);
    assert!(
        (chain.odometry.yaw - standing).abs() < 2e-3,
        "the bias of 10 s is not in the first step"
    );
}

#[test]
fn odometry_is_one_per_travel_with_its_stamps() {
    let mut chain = Chain::new(&car(), &placed());
    let mut car = Car::new(car());
    chain.feed(&car.raw());
    assert_eq!(chain.odometry.header.stamp, chain.travel.header.stamp);
    assert_eq!(chain.odometry.header.origin, car.time);
    assert_eq!(chain.odometry.reset_reason, Reason::Initial.code());
    assert_eq!(chain.odometry.travel, chain.travel.travel);
    car.tick();
    let blind = Travel { status: [2, 2, 2, 2], ..chain.travel };
    chain.travel = blind;
    let before = chain.odometry;
    chain.estimate();
    assert_eq!((before.x, before.covariance), (chain.odometry.x, chain.odometry.covariance));
}
