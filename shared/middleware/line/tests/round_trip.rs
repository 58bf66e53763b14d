//! What goes in comes out, for every vehicle that there can be.
#![allow(clippy::expect_used, clippy::panic)] // Helpers of a test are part of it.

mod common;

use common::{hear, hello, obey, pair, readings};
use kerbside_line::{Hello, HostEvent, MAX_FRAME, Sensors, VehicleEvent};
use proptest::prelude::*;

fn finite() -> impl Strategy<Value = f32> {
    any::<u32>().prop_map(f32::from_bits).prop_filter("a number", |value| value.is_finite())
}

prop_compose! {
    fn any_hello()(
        (boot, counter_bits) in (any::<u32>(), 1_u8..=64),
        (counts_mask, speeds_mask) in (0_u8..16, 0_u8..16),
        (has_steering, has_yaw_rate) in any::<(bool, bool)>(),
        (reading_period_us, silence_ms) in (1_u32.., 1_u16..),
    ) -> Hello {
        Hello {
            boot, counter_bits, counts_mask, speeds_mask, has_steering, has_yaw_rate,
            reading_period_us, silence_ms,
        }
    }
}

prop_compose! {
    fn any_sensors()(
        time in any::<u64>(),
        (counts_mask, speeds_mask) in (0_u8..16, 0_u8..16),
        counts in any::<[i64; 4]>(),
        speeds in prop::array::uniform4(finite()),
        (steering, yaw_rate) in (prop::option::of(finite()), prop::option::of(finite())),
    ) -> Sensors {
        Sensors { time, counts_mask, counts, speeds_mask, speeds, steering, yaw_rate }
    }
}

/// What of the sensors a vehicle of this kind can say: a second account of the rules.
fn sayable(sensors: &Sensors, hello: &Hello) -> Sensors {
    let mut said = *sensors;
    said.counts_mask &= hello.counts_mask;
    said.speeds_mask &= hello.speeds_mask;
    for i in 0..4 {
        let modulus = 1_i128 << hello.counter_bits;
        let wrapped = i128::from(said.counts[i]).rem_euclid(modulus);
        let signed = if wrapped >= modulus / 2 { wrapped - modulus } else { wrapped };
        let present = said.counts_mask & 1 << i != 0;
        said.counts[i] = if present { i64::try_from(signed).expect("at most 64 bits") } else { 0 };
        if said.speeds_mask & 1 << i == 0 {
            said.speeds[i] = 0.0;
        }
    }
    said.steering = said.steering.filter(|_| hello.has_steering);
    said.yaw_rate = said.yaw_rate.filter(|_| hello.has_yaw_rate);
    said
}

/// Negative zero equals zero but has other bits.
fn bits(sensors: &Sensors) -> (Vec<u32>, Vec<i64>, u64) {
    let floats = sensors.speeds.into_iter().chain(sensors.steering).chain(sensors.yaw_rate);
    (floats.map(f32::to_bits).collect(), sensors.counts.to_vec(), sensors.time)
}

proptest! {
    #[test]
    fn any_vehicle_introduces_itself(hello in any_hello()) {
        let (host, _) = pair(hello);
        prop_assert_eq!(host.hello(), Some(&hello));
    }

    #[test]
    fn readings_of_any_sensors(hello in any_hello(), sensors in any_sensors()) {
        let (mut host, mut vehicle) = pair(hello);
        let frame = vehicle.reading(&sensors);
        prop_assert!(frame.len() <= MAX_FRAME);
        let heard = readings(&hear(&mut host, &frame));
        let expected = sayable(&sensors, &hello);
        prop_assert_eq!(heard.len(), 1);
        prop_assert_eq!(heard[0].sensors, expected);
        prop_assert_eq!(bits(&heard[0].sensors), bits(&expected));
        prop_assert_eq!((heard[0].boot, heard[0].acknowledged), (hello.boot, Some(host.sent())));
    }

    #[test]
    fn any_command(speed in finite(), steering in finite()) {
        let (mut host, mut vehicle) = pair(hello(7));
        let frame = host.command(speed, steering).expect("a session");
        let heard = obey(&mut vehicle, 0, &frame);
        prop_assert_eq!(heard.len(), 1);
        let VehicleEvent::Command { speed: s, steering: a, .. } = heard[0] else { unreachable!() };
        prop_assert_eq!((s.to_bits(), a.to_bits()), (speed.to_bits(), steering.to_bits()));
    }
}

#[test]
fn every_mask_with_every_width() {
    let values = [i64::MIN, -1, 0, i64::MAX];
    for counter_bits in [1, 16, 31, 32, 33, 64] {
        let mut all = hello(3);
        (all.counter_bits, all.speeds_mask) = (counter_bits, 0xf);
        let (mut host, mut vehicle) = pair(all);
        for presence in 0_u16..1 << 10 {
            let sensors = Sensors {
                time: u64::from(presence),
                counts_mask: (presence & 0xf) as u8,
                counts: values,
                speeds_mask: (presence >> 4 & 0xf) as u8,
                speeds: [1.5, -2.5, 3.5, -0.0],
                steering: (presence >> 8 & 1 == 1).then_some(0.5),
                yaw_rate: (presence >> 9 & 1 == 1).then_some(-0.5),
            };
            let events = hear(&mut host, &vehicle.reading(&sensors));
            let [HostEvent::Reading { reading, line_errors: 0 }] = events[..] else {
                panic!("{events:?}")
            };
            assert_eq!(reading.sensors, sayable(&sensors, &all));
        }
    }
}
