//! The protocol's description shows one frame of each message, byte by byte: they are these.
#![allow(clippy::expect_used, clippy::panic)] // Helpers of a test are part of it.

mod common;

use common::{frame, hear, obey};
use kerbside_line::{Hello, HostEnd, Sensors, VehicleEnd};

const DESCRIPTION: &str = include_str!("../../../../deploy/examples/microcontroller/README.md");

/// The bytes of the line `NAME  00 .. 00`.
fn documented(name: &str) -> Vec<u8> {
    let line = DESCRIPTION.lines().find(|line| {
        line.strip_prefix(name).is_some_and(|rest| rest.trim_start().starts_with("00 "))
    });
    let bytes = line.unwrap_or_else(|| panic!("{name} is not shown")).split_whitespace().skip(1);
    bytes.map(|byte| u8::from_str_radix(byte, 16).expect("hexadecimal")).collect()
}

#[track_caller]
fn same(name: &str, sent: &[u8]) {
    let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x} ")).collect::<String>();
    assert_eq!(hex(&documented(name)), hex(sent), "{name}");
}

#[test]
fn the_conversation_of_the_description() {
    let mut vehicle = VehicleEnd::new(Hello {
        boot: 0x1234_5678,
        counter_bits: 32,
        counts_mask: 0b1111,
        speeds_mask: 0,
        has_steering: true,
        has_yaw_rate: false,
        reading_period_us: 5_000,
        silence_ms: 100,
    });
    let mut host = HostEnd::new();

    let hello = vehicle.pending(0).expect("HELLO");
    same("HELLO", &hello);
    hear(&mut host, &hello);
    let start = host.pending().expect("START");
    same("START", &start);
    obey(&mut vehicle, 0, &start);

    let reading = vehicle.reading(&Sensors {
        time: 5_000_000,
        counts_mask: 0b1111,
        counts: [100, -100, 0, 7],
        steering: Some(0.25),
        ..Sensors::default()
    });
    same("READING", &reading);
    hear(&mut host, &reading);
    same("COMMAND", &host.command(0.5, -0.25).expect("a session"));

    obey(&mut vehicle, 0, &frame(&[b'S', 9]));
    same("REFUSE", &vehicle.pending(0).expect("REFUSE"));
}
