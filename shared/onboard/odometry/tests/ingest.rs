//! Readings that are missing, repeated, implausible or from another life.

#![allow(clippy::unwrap_used)] // Helpers of tests are tests.

mod support;

use kerbside_geometry::SteeringSensor;
use kerbside_messages::{Raw, Travel, WheelStatus};
use kerbside_odometry::{Ingest, IngestSettings, NoModel, Sensors};
use support::{Car, car, sensors};

use WheelStatus::{Absent, Implausible, NotRead, Valid, Zeroed};

/// Ingest and the travel it wrote last.
struct Bench {
    ingest: Ingest,
    car: Car,
    travel: Travel,
}

impl Bench {
    fn new(sensors: &Sensors) -> Self {
        let ingest = Ingest::with_sensors(&car(), sensors, &IngestSettings::default()).unwrap();
        Self { ingest, car: Car::new(car()), travel: Travel::default() }
    }

    fn four() -> Self {
        Self::new(&sensors([true; 4], true, true))
    }

    fn step(&mut self, raw: &Raw) -> Travel {
        let before = self.travel;
        self.ingest.step(raw, 0, false, &mut self.travel);
        if before != Travel::default() {
            assert!(self.travel.header.stamp > before.header.stamp, "stamps increase");
        }
        self.travel
    }

    /// Rolls for one period and takes the reading.
    fn roll(&mut self) -> Travel {
        self.car.roll(0.3, 0.1);
        let raw = self.car.raw();
        self.step(&raw)
    }

    fn statuses(&self) -> [WheelStatus; 4] {
        core::array::from_fn(|index| self.travel.wheel(index))
    }
}

#[test]
fn travel_is_the_counters_and_increments_add_up() {
    let mut bench = Bench::four();
    let raw = bench.car.raw();
    let first = bench.step(&raw);
    assert_eq!(bench.statuses(), [Zeroed; 4]);
    assert_eq!((first.counter_epoch, first.interval), (77, 0.0));
    let metres = core::f64::consts::TAU * car().radius[2] / 2000.0;
    assert_eq!(first.travel[2], raw.counts[2] as f64 * metres);
    let mut sums = first.travel;
    for _ in 0..1000 {
        let travel = bench.roll();
        assert_eq!(bench.statuses(), [Valid; 4]);
        assert!((travel.interval - 0.005).abs() < 1e-12);
        for (sum, increment) in sums.iter_mut().zip(travel.increment) {
            *sum += increment;
        }
    }
    for (index, sum) in sums.iter().enumerate() {
        assert!((sum - bench.travel.travel[index]).abs() < 1e-9);
        assert!((sum - bench.car.rolled[index]).abs() < 3e-4);
    }
    assert_eq!((bench.travel.gap, bench.travel.refused, bench.travel.missing), (0, 0, 0));
}

#[test]
fn stamps_and_origin_are_the_readings() {
    let mut bench = Bench::four();
    for _ in 0..10 {
        let travel = bench.roll();
        assert_eq!(travel.header.stamp, bench.car.time);
        assert_eq!(travel.header.origin, bench.car.time);
        assert_eq!(
            (travel.clock_offset, travel.clock_drift, travel.transport_delay),
            (0, 0.0, 0.0)
        );
    }
    let mut raw = bench.car.raw();
    raw.frame += 1;
    assert_eq!(
        bench.step(&raw).header.stamp,
        bench.car.time + 1,
        "an equal stamp is lifted by 1 ns"
    );
}

#[test]
fn a_recording_that_begins_at_zero_keeps_its_stamps() {
    let mut bench = Bench::four();
    bench.car.time = 0;
    let raw = bench.car.raw();
    assert_eq!(bench.step(&raw).header.stamp, 0);
}

#[test]
fn missing_frames_are_a_gap_that_the_counters_bridge() {
    let mut bench = Bench::four();
    bench.roll();
    let before = bench.travel;
    for _ in 0..3 {
        bench.car.roll(0.3, 0.1);
    }
    let travel = bench.roll();
    assert_eq!((travel.gap, travel.missing), (1, 3));
    assert!((travel.increment[2] - (travel.travel[2] - before.travel[2])).abs() < 1e-15);
    assert!(travel.increment[2] > 0.005);
    assert_eq!(bench.roll().gap, 0);
}

#[test]
fn samples_lost_on_the_way_and_a_new_interface_are_gaps() {
    let mut bench = Bench::four();
    bench.roll();
    bench.car.roll(0.3, 0.0);
    let raw = bench.car.raw();
    bench.ingest.step(&raw, 2, false, &mut bench.travel);
    assert_eq!((bench.travel.gap, bench.travel.missing), (1, 2));
    for _ in 0..100 {
        bench.car.roll(0.3, 0.0);
    }
    let raw = bench.car.raw();
    bench.ingest.step(&raw, 0, true, &mut bench.travel);
    assert_eq!((bench.travel.gap, bench.travel.counter_epoch), (1, 77));
    assert_eq!(bench.statuses(), [Valid; 4]);
    assert!((bench.travel.increment[3] - 0.1515).abs() < 2e-3, "{:?}", bench.travel.increment);
}

#[test]
fn an_interface_that_counts_frames_anew_is_understood() {
    let mut bench = Bench::four();
    bench.car.frame = 9000;
    bench.roll();
    bench.car.frame = 0;
    bench.car.roll(0.3, 0.0);
    let raw = bench.car.raw();
    bench.ingest.step(&raw, 0, true, &mut bench.travel);
    assert_eq!(bench.statuses(), [Valid; 4]);
    assert_eq!((bench.travel.gap, bench.travel.missing), (1, 0));
    assert_eq!(bench.roll().gap, 0);
}

#[test]
fn a_hole_in_time_is_a_gap_without_any_missing_frame() {
    let mut bench = Bench::four();
    for _ in 0..50 {
        assert_eq!(bench.roll().gap, 0);
    }
    bench.car.time += 20_000_000;
    assert_eq!(bench.roll().gap, 1);
    assert_eq!(bench.roll().gap, 0);
}

#[test]
fn repeated_and_old_frames_move_nothing() {
    let mut bench = Bench::four();
    bench.roll();
    let old = bench.car.raw();
    let newest = bench.roll();
    for raw in [old, bench.car.raw()] {
        let travel = bench.step(&raw);
        assert_eq!(bench.statuses(), [NotRead; 4]);
        assert_eq!((travel.increment, travel.travel), ([0.0; 4], newest.travel));
    }
    assert_eq!(bench.travel.refused, 2);
    let travel = bench.roll();
    assert_eq!((bench.statuses(), travel.gap), ([Valid; 4], 0));
}

#[test]
fn an_unread_wheel_is_bridged_by_its_next_reading() {
    let mut bench = Bench::four();
    bench.roll();
    let before = bench.travel.travel;
    for _ in 0..3 {
        bench.car.roll(0.3, 0.1);
        let mut raw = bench.car.raw();
        raw.counts_mask = 0b0111;
        bench.step(&raw);
        assert_eq!(bench.statuses(), [Valid, Valid, Valid, NotRead]);
        assert_eq!((bench.travel.increment[3], bench.travel.travel[3]), (0.0, before[3]));
    }
    let travel = bench.roll();
    assert_eq!(bench.statuses(), [Valid; 4]);
    assert!((travel.increment[3] - (travel.travel[3] - before[3])).abs() < 1e-15);
    assert!(travel.increment[3] > 0.005);
}

#[test]
fn readings_without_wheels_carry_what_they_have() {
    let mut bench = Bench::four();
    bench.roll();
    let travelled = bench.travel.travel;
    bench.car.tick();
    let mut raw = Raw { counts_mask: 0, has_yaw_rate: 0, steering: 0.25, ..bench.car.raw() };
    let travel = bench.step(&raw);
    assert_eq!((bench.statuses(), travel.travel), ([NotRead; 4], travelled));
    assert_eq!((travel.steering, travel.steering_is_new, travel.has_yaw_rate), (0.25, 1, 1));
    assert_eq!(travel.yaw_rate_is_new, 0);
    bench.car.tick();
    raw = Raw { has_steering: 0, yaw_rate: 0.5, counts_mask: 0, ..bench.car.raw() };
    let travel = bench.step(&raw);
    assert_eq!((travel.steering, travel.steering_is_new), (0.25, 0));
    assert_eq!((travel.yaw_rate, travel.yaw_rate_is_new), (0.5, 1));
}

#[test]
fn a_gap_before_a_reading_without_wheels_is_still_told_with_the_wheels() {
    let mut bench = Bench::four();
    bench.roll();
    bench.car.roll(0.3, 0.0);
    bench.car.roll(0.3, 0.0);
    let raw = Raw { counts_mask: 0, ..bench.car.raw() };
    assert_eq!(bench.step(&raw).gap, 1);
    assert_eq!(bench.roll().gap, 1);
    assert_eq!(bench.roll().gap, 0);
}

#[test]
fn one_wild_value_is_marked_and_costs_nothing() {
    let mut bench = Bench::four();
    bench.roll();
    bench.car.roll(0.3, 0.1);
    let mut raw = bench.car.raw();
    raw.counts[1] += 100_000;
    let travel = bench.step(&raw);
    assert_eq!(bench.statuses(), [Valid, Implausible, Valid, Valid]);
    assert_eq!((travel.increment[1], travel.refused), (0.0, 1));
    let travel = bench.roll();
    assert_eq!((bench.statuses(), travel.counter_epoch), ([Valid; 4], 77));
    assert!((travel.travel[1] - bench.car.rolled[1]).abs() < 3e-4);
}

#[test]
fn a_counter_that_jumped_for_good_begins_an_epoch() {
    let mut bench = Bench::four();
    bench.roll();
    bench.car.rolled[1] += 20.0;
    let statuses: Vec<_> = (0..4).map(|_| (bench.roll(), bench.statuses()[1])).collect();
    let seen: Vec<_> = statuses.iter().map(|(_, status)| *status).collect();
    assert_eq!(seen, [Implausible, Implausible, Zeroed, Valid]);
    assert_eq!(statuses[1].0.counter_epoch, 77);
    assert_ne!(statuses[2].0.counter_epoch, 77);
    assert_eq!((statuses[2].0.interval, statuses[2].0.increment), (0.0, [0.0; 4]));
    assert_eq!(statuses[2].0.counter_epoch, statuses[3].0.counter_epoch);
}

#[test]
fn too_long_a_gap_begins_an_epoch() {
    let mut bench = Bench::four();
    bench.roll();
    bench.car.time += 2_100_000_000;
    let travel = bench.roll();
    assert_eq!(bench.statuses(), [Zeroed; 4]);
    assert_ne!(travel.counter_epoch, 77);
    assert_eq!(travel.increment, [0.0; 4]);
}

#[test]
fn another_boot_is_another_epoch() {
    let mut bench = Bench::four();
    bench.roll();
    bench.car.boot = 78;
    bench.car.frame = 0;
    bench.car.rolled = [0.0; 4];
    let travel = bench.roll();
    assert_eq!((bench.statuses(), travel.counter_epoch), ([Zeroed; 4], 78));
    bench.roll();
    assert_eq!(bench.statuses(), [Valid; 4]);
}

#[test]
fn a_restarted_ingest_goes_on_with_the_same_numbers() {
    let mut old = Bench::four();
    for _ in 0..300 {
        old.roll();
    }
    let mut new = Bench::four();
    new.car = old.car;
    let raw = new.car.raw();
    let travel = new.step(&raw);
    assert_eq!(
        (travel.travel, travel.counter_epoch),
        (old.travel.travel, old.travel.counter_epoch)
    );
}

#[test]
fn a_clock_set_back_is_no_repetition() {
    let mut bench = Bench::four();
    for _ in 0..20 {
        bench.roll();
    }
    bench.car.roll(0.3, 0.1);
    let mut raw = bench.car.raw();
    raw.vehicle_time -= 3_000_000_000;
    let travel = bench.step(&raw);
    assert_eq!((bench.statuses(), travel.counter_epoch), ([Valid; 4], 77));
    assert_eq!(travel.header.stamp, raw.arrival);
    assert_eq!(travel.clock_offset, 3_000_000_000);
}

#[test]
fn what_the_vehicle_does_not_have_is_absent() {
    let mut bench = Bench::new(&sensors([false, false, true, true], false, false));
    let travel = bench.roll();
    assert_eq!(bench.statuses(), [Absent, Absent, Zeroed, Zeroed]);
    assert_eq!((travel.has_steering, travel.has_yaw_rate, travel.travel[0]), (0, 0, 0.0));
}

#[test]
fn angles_and_rates_out_of_belief_are_not_taken() {
    let mut bench = Bench::four();
    bench.roll();
    bench.car.roll(0.3, 0.1);
    let raw = Raw { steering: 1.5, yaw_rate: 90.0, ..bench.car.raw() };
    let travel = bench.step(&raw);
    assert_eq!((travel.steering, travel.steering_is_new), (0.1, 0));
    assert_eq!((travel.yaw_rate_is_new, travel.refused), (0, 1));
    assert_eq!(bench.statuses(), [Valid; 4]);
}

#[test]
fn a_vehicle_of_which_nothing_can_be_known_is_refused() {
    let none = sensors([false, false, true, false], false, false);
    let refused = Ingest::with_sensors(&car(), &none, &IngestSettings::default());
    assert!(matches!(refused, Err(NoModel::NoTurning { wheel: "rl" })));
}

#[test]
fn offset_and_gain_of_the_steering_sensor_are_taken_out() {
    let mut vehicle = car();
    let sensor = vehicle.steering_sensor.unwrap();
    vehicle.steering_sensor = Some(SteeringSensor { offset: 0.02, gain: 1.1, ..sensor });
    let (sensors, settings) = (sensors([true; 4], true, true), IngestSettings::default());
    let ingest = Ingest::with_sensors(&vehicle, &sensors, &settings).unwrap();
    let mut bench = Bench { ingest, ..Bench::four() };
    let raw = Raw { steering: 1.1 * 0.25 + 0.02, ..bench.car.raw() };
    assert!((bench.step(&raw).steering - 0.25).abs() < 1e-7);
}
