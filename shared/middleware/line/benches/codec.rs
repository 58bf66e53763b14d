//! How long the codec takes: `cargo bench -p kerbside-line`.
//!
//! Each figure is the median over blocks of the mean time per call.
#![allow(clippy::expect_used)] // A bench that cannot run shall say so.

use std::hint::black_box;
use std::time::Instant;

use kerbside_line::{Hello, HostEnd, Sensors, VehicleEnd};

const BLOCKS: usize = 101;
const CALLS: usize = 2_000;

fn main() {
    for counter_bits in [32, 64] {
        let (mut host, mut vehicle) = pair(counter_bits);
        let sensors = sensors();
        println!("four wheels, {counter_bits} bit counters, steering and gyro:");
        report("encode a reading", || vehicle.reading(black_box(&sensors)).len());
        let frame = vehicle.reading(&sensors);
        println!("  a frame of {} bytes", frame.len());
        report("decode it in one piece", || hear(&mut host, &[&frame]));
        let (head, tail) = frame.split_at(frame.len() / 2);
        report("decode it in two", || hear(&mut host, &[head, tail]));
    }
    commands();
}

fn commands() {
    let (mut host, mut vehicle) = pair(32);
    println!("commands:");
    report("encode", || host.command(black_box(0.2), black_box(0.1)).map_or(0, |f| f.len()));
    report("encode and decode", || {
        let frame = host.command(black_box(0.2), black_box(0.1)).expect("a session");
        let mut heard = 0;
        vehicle.receive(0, &frame, &mut |_| heard += 1);
        heard
    });
    assert_eq!(vehicle.ignored(), 0);
}

fn hear(host: &mut HostEnd, chunks: &[&[u8]]) -> usize {
    let mut heard = 0;
    for chunk in chunks {
        host.receive(black_box(chunk), &mut |event| {
            black_box(event);
            heard += 1;
        });
    }
    assert_eq!(heard, 1);
    heard
}

fn report(name: &str, mut call: impl FnMut() -> usize) {
    let mut times: Vec<f64> = (0..BLOCKS)
        .map(|_| {
            let begin = Instant::now();
            for _ in 0..CALLS {
                black_box(call());
            }
            begin.elapsed().as_secs_f64() / CALLS as f64 * 1e9
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("  {name}: {:.0} ns", times[BLOCKS / 2]);
}

fn sensors() -> Sensors {
    Sensors {
        time: 123_456_789_012,
        counts_mask: 0xf,
        counts: [100_234, -99_887, 1_234_567, 42],
        speeds_mask: 0,
        speeds: [0.0; 4],
        steering: Some(0.123),
        yaw_rate: Some(-0.04),
    }
}

/// Two ends with a session.
fn pair(counter_bits: u8) -> (HostEnd, VehicleEnd) {
    let mut vehicle = VehicleEnd::new(Hello {
        boot: 0x1234_5678,
        counter_bits,
        counts_mask: 0xf,
        speeds_mask: 0,
        has_steering: true,
        has_yaw_rate: true,
        reading_period_us: 5_000,
        silence_ms: 300,
    });
    let mut host = HostEnd::new();
    let hello = vehicle.pending(0).expect("HELLO is due at the start");
    host.receive(&hello, &mut |_| {});
    let start = host.pending().expect("START answers HELLO");
    vehicle.receive(0, &start, &mut |_| {});
    host.receive(&vehicle.reading(&sensors()), &mut |_| {});
    assert!(host.is_open());
    (host, vehicle)
}
