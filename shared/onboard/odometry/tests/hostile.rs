//! Whatever passes admission, both stages write samples that pass it too, and never move a pose by
//! rubbish.

mod support;

use kerbside_messages::{Message, Raw};
use kerbside_odometry::{EstimatorSettings, Filter, Sensors};
use proptest::prelude::*;
use support::{Car, Chain, car, placed, sensors};

/// A reading that admission lets through, otherwise anything.
fn any_raw() -> impl Strategy<Value = Raw> {
    let times = (any::<u64>(), any::<u64>(), any::<u32>(), 0..3_u32);
    let values = (any::<[i64; 4]>(), prop::array::uniform4(-999.0..999.0_f64), -3.1..3.1_f64);
    let masks = (0..16_u8, 0..16_u8, 0..2_u8, 0..2_u8, -999.0..999.0_f64);
    (times, values, masks).prop_map(|(times, values, masks)| Raw {
        vehicle_time: times.0,
        arrival: times.1,
        frame: times.2,
        boot: times.3,
        counts: values.0,
        speeds: values.1,
        steering: values.2,
        counts_mask: masks.0,
        speeds_mask: masks.1,
        has_steering: masks.2,
        has_yaw_rate: masks.3,
        yaw_rate: masks.4,
        ..Raw::default()
    })
}

/// One of the models, and wheel speeds.
fn any_sensors() -> impl Strategy<Value = Sensors> {
    prop::sample::select(vec![
        sensors([true; 4], true, true),
        sensors([false, false, true, true], false, false),
        sensors([true, true, false, false], true, false),
        sensors([true, false, false, false], true, false),
        sensors([false, false, true, false], false, true),
        sensors([true; 4], true, true).with_speeds([true; 4]),
    ])
}

proptest! {
    #[test]
    fn rubbish_in_samples_out(
        sensors in any_sensors(),
        raws in prop::collection::vec(any_raw(), 1..60),
    ) {
        let mut chain = Chain::with(&car(), &sensors, &placed());
        for raw in &raws {
            chain.feed(raw);
            prop_assert_eq!(chain.travel.validate(), Ok(()), "{:?}", chain.travel);
            prop_assert_eq!(chain.odometry.validate(), Ok(()), "{:?}", chain.odometry);
        }
    }

    #[test]
    fn wild_counts_in_a_drive_move_no_pose(
        wild in prop::collection::vec((20..180_usize, 0..4_usize, 20_000..2_000_000_000_i64), 0..12)
    ) {
        let vehicle = car();
        let mut chain = Chain::new(&vehicle, &placed());
        let mut driven = Car::new(vehicle);
        for step in 0..200 {
            driven.roll(0.3, 0.2);
            let mut raw = driven.raw();
            // Every second reading at most: three that agree would be a counter that jumped.
            for (at, wheel, jump) in wild.iter().filter(|(at, ..)| at & !1 == step) {
                raw.counts[*wheel] += if at % 2 == 0 { *jump } else { -*jump };
            }
            chain.feed(&raw);
        }
        let error = chain.pose().distance(&driven.truth);
        prop_assert_eq!(chain.odometry.state, 1);
        prop_assert!(error < 0.01, "{} m", error);
    }

    #[test]
    fn any_reading_may_be_lost_repeated_or_partly_unread(
        filter in prop::sample::select(vec![Filter::Rear, Filter::Paper, Filter::Fused]),
        fates in prop::collection::vec((0..6_u8, 0..16_u8), 200)
    ) {
        let vehicle = support::fine_car(40);
        let settings = EstimatorSettings { filter, ..placed() };
        let mut chain = Chain::new(&vehicle, &settings);
        let mut driven = Car::new(vehicle).rolling(0.3, 0.2);
        chain.feed(&driven.raw());
        for (fate, mask) in fates {
            driven.roll(0.3, 0.2);
            let raw = driven.raw();
            match fate {
                0 => {}
                1 => chain.feed(&Raw { counts_mask: mask, ..raw }),
                2 => (0..2).for_each(|_| chain.feed(&raw)),
                _ => chain.feed(&raw),
            }
        }
        driven.roll(0.3, 0.2);
        chain.feed(&driven.raw());
        let error = chain.pose().distance(&driven.truth);
        prop_assert_eq!(chain.odometry.state, 1);
        // Where wheels of different moments are weighed against one another, periods of 1.5 mm
        // between them stay.
        let bound = if filter == Filter::Fused { 6e-3 } else { 1e-3 };
        prop_assert!(error < bound, "{} m", error);
        prop_assert!((chain.odometry.yaw - driven.truth.yaw).abs() < bound);
    }
}
