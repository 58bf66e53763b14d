//! Fuzzing: whatever bytes come over the line, either end stays within its words.
#![allow(clippy::expect_used, clippy::unwrap_used, clippy::panic)] // Helpers of a test are part of it.

#[path = "../../../../tests/common_fuzz/mod.rs"]
mod common_fuzz;

mod common;

use kerbside_line::{HostEnd, HostEvent, MAX_FRAME, VehicleEnd};

use common::{MILLISECOND, hear, hello, obey, pair, sensors};
use common_fuzz::{corpus, damaged};

/// What a vehicle and a host say to each other in good order.
fn examples() -> Vec<Vec<u8>> {
    let (mut host, mut vehicle) = pair(hello(7));
    let mut from_vehicle = Vec::new();
    let mut from_host = Vec::new();
    for step in 2..40 {
        let now = step * 5 * MILLISECOND;
        while let Some(frame) = vehicle.pending(now) {
            from_vehicle.extend_from_slice(&frame);
        }
        from_vehicle.extend_from_slice(&vehicle.reading(&sensors(now)));
        hear(&mut host, &from_vehicle);
        if let Some(frame) = host.command(0.2, -0.1) {
            from_host.extend_from_slice(&frame);
        }
    }
    let mut all = vec![from_vehicle, from_host];
    all.extend(corpus(env!("CARGO_MANIFEST_DIR"), "line_frames"));
    all
}

/// Both ends hear `bytes`, in two pieces, as a line delivers them, and are used as a program uses them.
fn examine(bytes: &[u8]) {
    let cut = bytes.first().map_or(0, |first| usize::from(*first) * bytes.len() / 256);
    let (one, two) = bytes.split_at(cut);
    let mut host = HostEnd::new();
    let mut events = hear(&mut host, one);
    events.extend(hear(&mut host, two));
    // A frame has an end, so there cannot be more of them than ends, and every number in one is a number.
    assert!(events.len() <= 2 * bytes.len());
    for event in &events {
        if let HostEvent::Reading { reading, .. } = event {
            let sensors = &reading.sensors;
            assert!(sensors.steering.is_none_or(f32::is_finite), "{event:?}");
            assert!(sensors.yaw_rate.is_none_or(f32::is_finite), "{event:?}");
        }
    }
    if let Some(hello) = host.hello() {
        assert_eq!(hello.check(), Ok(()), "a host keeps no hello that is none");
    }
    assert!(host.pending().is_none_or(|frame| frame.len() <= MAX_FRAME + 2));
    assert!(host.errors().total() <= bytes.len() as u64 + 1);
    let mut vehicle = VehicleEnd::new(hello(7));
    obey(&mut vehicle, 0, one);
    obey(&mut vehicle, MILLISECOND, two);
    vehicle.reading(&sensors(2 * MILLISECOND));
    // What came before costs no good frame: a host that heard rubbish still opens a session.
    host.line_lost();
    for step in 0..3 {
        common::cycle(&mut host, &mut vehicle, 60 * MILLISECOND * (1 + step));
    }
    assert!(host.is_open(), "the ends do not come together after {bytes:02x?}");
}

#[test]
fn line_frames() {
    let examples = examples();
    examples.iter().for_each(|example| examine(example));
    bolero::check!().for_each(|bytes: &[u8]| {
        examine(bytes);
        examine(&damaged(&examples, bytes));
    });
}
