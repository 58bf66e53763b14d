//! A bad line: garbage, bit errors, cut and lost bytes.
#![allow(clippy::expect_used, clippy::panic)] // Helpers of a test are part of it.

mod common;

use common::{Generator, MILLISECOND, hear, hello, obey, pair, readings, sensors};
use kerbside_line::{HostEvent, MAX_FRAME};

#[test]
fn garbage_between_frames_costs_no_frame_either_way() {
    let (mut host, mut vehicle) = pair(hello(7));
    let mut generator = Generator(1);
    for i in 0..2_000 {
        let garbage = generator.garbage(3 * MAX_FRAME);
        hear(&mut host, &garbage);
        let heard = readings(&hear(&mut host, &vehicle.reading(&sensors(i))));
        assert_eq!(heard.len(), 1, "after {garbage:02x?}");
        assert_eq!(heard[0].sensors, sensors(i));
        obey(&mut vehicle, i, &generator.garbage(3 * MAX_FRAME));
        let command = host.command(0.1, 0.2).expect("a session");
        assert_eq!(obey(&mut vehicle, i, &command).len(), 1);
    }
    assert!(host.errors().total() > 2_000 && vehicle.errors().total() > 2_000);
}

#[test]
fn an_endless_run_without_delimiter_costs_no_frame_either() {
    let (mut host, mut vehicle) = pair(hello(7));
    hear(&mut host, &vec![0x55; 1 << 20]);
    assert_eq!(readings(&hear(&mut host, &vehicle.reading(&sensors(1)))).len(), 1);
    assert_eq!(host.errors().overlong, 1);
}

#[test]
fn a_stream_cut_anywhere_is_the_same_stream() {
    let (host, mut vehicle) = pair(hello(7));
    let mut stream = Vec::new();
    for i in 2..200 {
        stream.extend_from_slice(&vehicle.reading(&sensors(i * MILLISECOND)));
        stream.extend(vehicle.pending(i * MILLISECOND).as_deref().unwrap_or_default());
    }
    let whole = hear(&mut host.clone(), &stream);
    assert_eq!(readings(&whole).len(), 198);
    for length in 1..=2 * MAX_FRAME {
        let mut pieces = host.clone();
        let heard: Vec<HostEvent> =
            stream.chunks(length).flat_map(|chunk| hear(&mut pieces, chunk)).collect();
        assert_eq!(heard, whole, "in pieces of {length}");
        assert_eq!(pieces.errors().total(), 0);
    }
}

#[test]
fn a_truncated_frame_costs_only_itself() {
    let (mut host, mut vehicle) = pair(hello(7));
    let frame = vehicle.reading(&sensors(1));
    for length in 1..frame.len() - 1 {
        let errors = host.errors().total();
        assert_eq!(hear(&mut host, &frame[..length]), []);
        let heard = hear(&mut host, &vehicle.reading(&sensors(2)));
        assert_eq!(heard.len(), 1);
        let lost = u32::from(length > 1);
        assert!(matches!(heard[0], HostEvent::Reading { line_errors, .. } if line_errors == lost));
        assert_eq!(host.errors().total(), errors + u64::from(lost));
    }
}

#[test]
fn a_lost_byte_costs_only_its_frame() {
    let (mut host, mut vehicle) = pair(hello(7));
    let frame = vehicle.reading(&sensors(1));
    for lost in 1..frame.len() - 1 {
        let mut rest = frame.to_vec();
        rest.remove(lost);
        assert_eq!(hear(&mut host, &rest), [], "without byte {lost}");
        assert_eq!(hear(&mut host, &vehicle.reading(&sensors(2))).len(), 1);
    }
}

/// Feeds a damaged frame and a good one after it: the first must not be heard, the second must be.
fn damaged(host: &mut kerbside_line::HostEnd, frame: &[u8], good: &[u8], what: &str) {
    assert_eq!(hear(host, frame), [], "{what}");
    assert_eq!(hear(host, good).len(), 1, "after {what}");
}

fn flip(frame: &mut [u8], bit: usize) {
    frame[bit / 8] ^= 1 << (bit % 8);
}

#[test]
fn one_and_two_bit_errors_are_never_accepted_and_cost_one_frame() {
    let (mut host, mut vehicle) = pair(hello(7));
    let (mut frame, good) = (vehicle.reading(&sensors(1)).to_vec(), vehicle.reading(&sensors(2)));
    let bits = frame.len() * 8;
    for first in 0..bits {
        flip(&mut frame, first);
        damaged(&mut host, &frame, &good, &format!("bit {first}"));
        for second in first + 1..bits {
            flip(&mut frame, second);
            damaged(&mut host, &frame, &good, &format!("bits {first} and {second}"));
            flip(&mut frame, second);
        }
        flip(&mut frame, first);
    }
}

#[test]
fn bursts_and_many_bit_errors_are_never_accepted() {
    let (mut host, mut vehicle) = pair(hello(7));
    let frame = vehicle.reading(&sensors(1)).to_vec();
    let good = vehicle.reading(&sensors(2));
    let mut generator = Generator(3);
    for _ in 0..100_000 {
        let mut bad = frame.clone();
        for _ in 0..1 + generator.below(40) {
            flip(&mut bad, generator.below(frame.len() * 8));
        }
        let begin = generator.below(frame.len() - 4);
        for byte in &mut bad[begin..begin + generator.below(5)] {
            *byte = (generator.next() >> 56) as u8;
        }
        if bad != frame {
            damaged(&mut host, &bad, &good, &format!("{bad:02x?}"));
        }
    }
}

#[test]
fn a_damaged_command_never_moves_the_vehicle() {
    let (mut host, mut vehicle) = pair(hello(7));
    let mut frame = host.command(0.1, 0.2).expect("a session").to_vec();
    for bit in 0..frame.len() * 8 {
        flip(&mut frame, bit);
        assert_eq!(obey(&mut vehicle, 0, &frame), [], "bit {bit}");
        flip(&mut frame, bit);
        // Ends what a damaged last delimiter left open.
        obey(&mut vehicle, 0, &[0]);
    }
    assert_eq!(obey(&mut vehicle, 0, &frame).len(), 1);
}

#[test]
fn random_bytes_are_never_a_message() {
    let (mut host, mut vehicle) = pair(hello(7));
    let mut generator = Generator(5);
    for _ in 0..5_000 {
        let garbage = generator.garbage(4 * MAX_FRAME);
        assert_eq!(hear(&mut host, &garbage), [], "{garbage:02x?}");
        assert_eq!(obey(&mut vehicle, 0, &garbage), [], "{garbage:02x?}");
    }
}
