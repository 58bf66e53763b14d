//! The conversation: handshake, restarts of either end, versions, silence.
#![allow(clippy::expect_used, clippy::panic)] // Helpers of a test are part of it.

mod common;

use common::{MILLISECOND, cycle, frame, hear, hello, obey, pair, readings, sensors};
use kerbside_line::{
    HELLO_PERIOD, HostEnd, HostEvent, PROTOCOL_VERSION, Refusal, VehicleEnd, VehicleEvent,
};

/// Cycles of 5 ms until commands count; the time that took.
fn time_to_open(host: &mut HostEnd, vehicle: &mut VehicleEnd, from: u64) -> u64 {
    for step in 1..100 {
        let now = from + step * 5 * MILLISECOND;
        cycle(host, vehicle, now);
        if host.is_open() {
            return now - from;
        }
    }
    panic!("no session within 500 ms");
}

#[test]
fn the_handshake_goes_step_by_step() {
    let (mut host, mut vehicle) = (HostEnd::new(), VehicleEnd::new(hello(7)));
    assert!(host.pending().is_none(), "a host that heard nothing says nothing");

    let first = vehicle.pending(0).expect("HELLO");
    assert_eq!(hear(&mut host, &first), [HostEvent::Hello(hello(7))]);
    assert!(vehicle.pending(HELLO_PERIOD - 1).is_none());
    assert!(host.command(0.1, 0.0).is_none(), "START is not even sent");

    let start = host.pending().expect("START");
    assert!(host.pending().is_none(), "one START for one HELLO");
    assert!(host.command(0.1, 0.0).is_none(), "START is not acknowledged");
    let events = hear(&mut host, &vehicle.reading(&sensors(0)));
    assert_eq!(readings(&events)[0].acknowledged, None);
    assert!(!host.is_open());

    assert_eq!(obey(&mut vehicle, 0, &start), [VehicleEvent::Started]);
    let events = hear(&mut host, &vehicle.reading(&sensors(1)));
    assert_eq!(events[0], HostEvent::Started { boot: 7 });
    assert_eq!(readings(&events)[0].acknowledged, Some(host.sent()));

    let command = host.command(0.5, -0.25).expect("a session");
    let expected = VehicleEvent::Command { sequence: host.sent(), speed: 0.5, steering: -0.25 };
    assert_eq!(obey(&mut vehicle, 2, &command), [expected]);
    let events = hear(&mut host, &vehicle.reading(&sensors(3)));
    assert_eq!(readings(&events)[0].acknowledged, Some(host.sent()));
}

#[test]
fn hello_goes_on_but_a_host_with_a_session_does_not_answer() {
    let (mut host, mut vehicle) = pair(hello(7));
    let sent = host.sent();
    for step in 1..100 {
        let events = cycle(&mut host, &mut vehicle, step * 5 * MILLISECOND);
        assert_eq!(events.len(), 1, "the reading only: {events:?}");
    }
    assert_eq!(host.sent(), sent);
}

#[test]
fn a_lost_start_is_sent_again() {
    let (mut host, mut vehicle) = (HostEnd::new(), VehicleEnd::new(hello(7)));
    hear(&mut host, &vehicle.pending(0).expect("HELLO"));
    assert!(host.pending().is_some(), "and it is lost");
    assert!(time_to_open(&mut host, &mut vehicle, 0) <= 60 * MILLISECOND);
}

#[test]
fn a_restarted_host_is_back_within_100_ms() {
    let (mut host, mut vehicle) = pair(hello(7));
    for i in 0..50 {
        let frame = host.command(0.1, 0.0).expect("a session");
        obey(&mut vehicle, 2 * MILLISECOND + i, &frame);
    }
    let mut host = HostEnd::new();
    assert!(time_to_open(&mut host, &mut vehicle, 2 * MILLISECOND) <= 100 * MILLISECOND);
    let frame = host.command(0.2, 0.1).expect("a session");
    assert_eq!(obey(&mut vehicle, 0, &frame).len(), 1, "its numbers count, though they are lower");
}

#[test]
fn somebody_elses_session_is_not_taken_for_ones_own() {
    let (mut old, mut vehicle) = pair(hello(7));
    for _ in 0..50 {
        let frame = old.command(0.1, 0.0).expect("a session");
        obey(&mut vehicle, 0, &frame);
    }
    hear(&mut old, &vehicle.reading(&sensors(0)));
    let mut host = HostEnd::new();
    hear(&mut host, &vehicle.pending(60 * MILLISECOND).expect("HELLO"));
    let start = host.pending().expect("START");
    // The acknowledgement of the old host's commands is still on its way.
    hear(&mut host, &vehicle.reading(&sensors(0)));
    assert!(!host.is_open());
    obey(&mut vehicle, 0, &start);
    // And the old one, if it lives, learns that it lost the line.
    assert_eq!(hear(&mut old, &vehicle.reading(&sensors(0)))[0], HostEvent::Closed);
    assert!(old.command(0.1, 0.0).is_none());
}

#[test]
fn a_line_opened_again_needs_a_new_start_but_readings_go_on() {
    let (mut host, mut vehicle) = pair(hello(7));
    let cut = vehicle.reading(&sensors(2));
    hear(&mut host, &cut[..20]);
    host.line_lost();
    assert!(host.command(0.1, 0.0).is_none());
    let events = hear(&mut host, &vehicle.reading(&sensors(3)));
    assert_eq!(events.len(), 1, "a reading, and no session: {events:?}");
    assert_eq!(host.errors().total(), 0, "the cut frame is forgotten");
    assert!(time_to_open(&mut host, &mut vehicle, 2 * MILLISECOND) <= 100 * MILLISECOND);
}

#[test]
fn a_restarted_vehicle_is_named_and_back_within_100_ms() {
    let (mut host, _) = pair(hello(7));
    let mut vehicle = VehicleEnd::new(hello(8));
    // Its first HELLO is lost; a reading says that it is another life.
    assert!(vehicle.pending(0).is_some());
    let events = hear(&mut host, &vehicle.reading(&sensors(0)));
    assert_eq!(events, [HostEvent::Restarted { boot: 8 }], "and nobody knows what it means yet");
    assert!(host.command(0.1, 0.0).is_none());
    assert!(time_to_open(&mut host, &mut vehicle, 0) <= 100 * MILLISECOND);
    assert_eq!(host.hello(), Some(&hello(8)));
}

#[test]
fn a_restart_seen_by_hello_is_said_before_the_hello() {
    let (mut host, _) = pair(hello(7));
    let frame = VehicleEnd::new(hello(9)).pending(0).expect("HELLO");
    let expected = [HostEvent::Restarted { boot: 9 }, HostEvent::Hello(hello(9))];
    assert_eq!(hear(&mut host, &frame), expected);
}

#[test]
fn a_start_for_an_earlier_life_is_refused_by_name() {
    let (mut host, _) = pair(hello(7));
    host.line_lost();
    hear(&mut host, &VehicleEnd::new(hello(7)).pending(0).expect("HELLO"));
    let start = host.pending().expect("START");
    let mut vehicle = VehicleEnd::new(hello(8));
    let refusal = Refusal::Boot { asked: 7, vehicle: 8 };
    assert_eq!(obey(&mut vehicle, 0, &start), [VehicleEvent::Refused(refusal)]);
    let answer = vehicle.pending(0).expect("REFUSE");
    assert_eq!(hear(&mut host, &answer), [HostEvent::Refused(refusal)]);
    assert!(time_to_open(&mut host, &mut vehicle, 0) <= 100 * MILLISECOND);
}

#[test]
fn a_vehicle_of_another_version_is_refused_once_with_both_versions() {
    let (mut host, _) = pair(hello(7));
    let other = frame(&[b'H', PROTOCOL_VERSION + 1, 7, 0, 0, 0, 99, 98, 97]);
    let expected = Refusal::Version { host: PROTOCOL_VERSION, vehicle: PROTOCOL_VERSION + 1 };
    assert_eq!(hear(&mut host, &other), [HostEvent::Refused(expected)]);
    assert_eq!(hear(&mut host, &other), []);
    assert_eq!(hear(&mut host, &frame(b"R with another layout")), []);
    assert!(host.pending().is_none() && host.command(0.1, 0.0).is_none());
    assert_eq!(host.errors().total(), 0);
    assert_eq!(
        expected.to_string(),
        "the host speaks version 1 of the line protocol, the vehicle version 2"
    );
}

#[test]
fn a_host_of_another_version_gets_refuse_and_ends_the_session() {
    let (mut host, mut vehicle) = pair(hello(7));
    let frame = frame(&[b'S', 9, 7, 0, 0, 0]);
    let refusal = Refusal::Version { host: 9, vehicle: PROTOCOL_VERSION };
    assert_eq!(obey(&mut vehicle, 0, &frame), [VehicleEvent::Refused(refusal)]);
    let answer = vehicle.pending(0).expect("REFUSE");
    assert_eq!(hear(&mut host, &answer), [HostEvent::Refused(refusal)]);
    let command = host.command(0.1, 0.0).expect("this host does not know yet");
    assert_eq!(obey(&mut vehicle, 0, &command), []);
    assert_eq!(vehicle.ignored(), 1);
    assert_eq!(hear(&mut host, &vehicle.reading(&sensors(0)))[0], HostEvent::Closed);
}

#[test]
fn commands_before_start_and_repeated_ones_do_not_count() {
    let (mut host, mut vehicle) = pair(hello(7));
    let (first, second) = (host.command(0.1, 0.0), host.command(0.2, 0.0));
    let (first, second) = (first.expect("a session"), second.expect("a session"));
    let mut fresh = VehicleEnd::new(hello(7));
    assert_eq!(obey(&mut fresh, 0, &first), []);
    assert_eq!(obey(&mut vehicle, 0, &first).len(), 1);
    assert_eq!(obey(&mut vehicle, 0, &first), [], "repeated");
    assert_eq!(obey(&mut vehicle, 0, &second).len(), 1);
    assert_eq!(obey(&mut vehicle, 0, &first), [], "overtaken");
    assert_eq!((vehicle.ignored(), fresh.ignored()), (2, 1));
}

#[test]
fn a_repeated_command_does_not_keep_the_vehicle_going() {
    let (mut host, mut vehicle) = pair(hello(7));
    let limit = 300 * MILLISECOND;
    assert!(vehicle.is_silent(0), "START moves nothing");
    let command = host.command(0.1, 0.0).expect("a session");
    obey(&mut vehicle, 5, &command);
    for now in [5, 6, 5 + limit - 1] {
        assert!(!vehicle.is_silent(now));
        obey(&mut vehicle, now, &command);
    }
    assert!(vehicle.is_silent(5 + limit));
    let events = hear(&mut host, &vehicle.reading(&sensors(5 + limit)));
    assert!(readings(&events)[0].silent);
    obey(&mut vehicle, 6 + limit, &host.command(0.0, 0.0).expect("still a session"));
    assert!(!vehicle.is_silent(6 + limit), "the next one counts again");
}

#[test]
fn a_new_start_stands_still_until_its_first_command() {
    let (mut host, mut vehicle) = pair(hello(7));
    obey(&mut vehicle, 5, &host.command(0.1, 0.0).expect("a session"));
    assert!(!vehicle.is_silent(6));
    host.line_lost();
    hear(&mut host, &vehicle.pending(60 * MILLISECOND).expect("HELLO"));
    obey(&mut vehicle, 7, &host.pending().expect("START"));
    assert!(vehicle.is_silent(8));
}

#[test]
fn numbers_that_are_none_stay_at_home() {
    let (mut host, mut vehicle) = pair(hello(7));
    let sent = host.sent();
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!(host.command(bad, 0.0).is_none() && host.command(0.0, bad).is_none());
        let broken = kerbside_line::Sensors { steering: Some(bad), ..sensors(0) };
        let heard = readings(&hear(&mut host, &vehicle.reading(&broken)));
        assert_eq!(heard[0].sensors.steering, None);
    }
    assert_eq!(host.sent(), sent);
}

#[test]
fn numbers_that_are_none_are_refused_on_arrival() {
    let (mut host, mut vehicle) = pair(hello(7));
    let mut command = vec![b'C'];
    command.extend((host.sent() + 1).to_le_bytes());
    command.extend(f32::NAN.to_le_bytes());
    command.extend(0_f32.to_le_bytes());
    assert_eq!(obey(&mut vehicle, 0, &frame(&command)), []);
    assert_eq!(vehicle.errors().content, 1);

    let mut reading = vec![b'R', 1, 0];
    reading.extend(7_u32.to_le_bytes());
    reading.extend([0; 16]);
    reading.extend(f32::INFINITY.to_le_bytes());
    assert_eq!(hear(&mut host, &frame(&reading)), []);
    assert_eq!(host.errors().content, 1);
}

#[test]
fn what_was_not_declared_is_refused() {
    let mut narrow = hello(7);
    (narrow.counts_mask, narrow.has_yaw_rate) = (0b1100, false);
    let (mut host, mut vehicle) = pair(narrow);
    let heard = readings(&hear(&mut host, &vehicle.reading(&sensors(0))));
    assert_eq!((heard[0].sensors.counts_mask, heard[0].sensors.yaw_rate), (0b1100, None));
    let (_, mut liar) = pair(hello(7));
    assert_eq!(hear(&mut host, &liar.reading(&sensors(0))), []);
    assert_eq!(host.errors().content, 1);
}

#[test]
fn an_impossible_hello_is_refused() {
    for (field, make) in [
        ("counter_bits", (|h| h.counter_bits = 65) as fn(&mut kerbside_line::Hello)),
        ("counter_bits", |h| h.counter_bits = 0),
        ("reading_period_us", |h| h.reading_period_us = 0),
        ("silence_ms", |h| h.silence_ms = 0),
    ] {
        let mut bad = hello(7);
        make(&mut bad);
        assert!(bad.check().expect_err("impossible").to_string().contains(field));
        let mut host = HostEnd::new();
        assert_eq!(hear(&mut host, &VehicleEnd::new(bad).pending(0).expect("HELLO")), []);
        assert!(host.pending().is_none());
        assert_eq!(host.errors().content, 1);
    }
}

#[test]
fn each_end_refuses_what_only_it_sends() {
    let (mut host, mut vehicle) = pair(hello(7));
    let command = host.command(0.1, 0.0).expect("a session");
    let reading = vehicle.reading(&sensors(0));
    assert_eq!(hear(&mut host, &command), []);
    assert_eq!(obey(&mut vehicle, 0, &reading), []);
    assert_eq!((host.errors().kind, vehicle.errors().kind), (1, 1));
    // A byte too many or too few for the type, check sum right.
    obey(&mut vehicle, 0, &frame(&[b'C', 1, 2]));
    obey(&mut vehicle, 0, &frame(&[b'C'; 14]));
    assert_eq!(vehicle.errors().length, 2);
}
