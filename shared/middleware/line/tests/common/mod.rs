//! What several tests share.
#![allow(dead_code)] // Each test uses its part.

use kerbside_line::{Hello, HostEnd, HostEvent, Reading, Sensors, VehicleEnd, VehicleEvent};

/// A millisecond in the vehicle's time.
pub(crate) const MILLISECOND: u64 = 1_000_000;

/// Knuth's MMIX linear congruential generator; the high bits are the good ones.
pub(crate) struct Generator(pub(crate) u64);

impl Generator {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0
    }

    /// A number below `limit`.
    pub(crate) fn below(&mut self, limit: usize) -> usize {
        ((self.next() >> 33) % limit as u64) as usize
    }

    /// Up to `longest` bytes; in one case of four mostly zeros, in another none.
    pub(crate) fn garbage(&mut self, longest: usize) -> Vec<u8> {
        let length = self.below(longest + 1);
        let style = self.below(4);
        let byte = |generator: &mut Self| match (style, (generator.next() >> 56) as u8) {
            (0, byte) if byte < 200 => 0,
            (1, 0) => 1,
            (_, byte) => byte,
        };
        (0..length).map(|_| byte(self)).collect()
    }
}

/// A vehicle with four 32 bit counters, steering and gyro.
pub(crate) fn hello(boot: u32) -> Hello {
    Hello {
        boot,
        counter_bits: 32,
        counts_mask: 0xf,
        speeds_mask: 0,
        has_steering: true,
        has_yaw_rate: true,
        reading_period_us: 5_000,
        silence_ms: 300,
    }
}

pub(crate) fn sensors(time: u64) -> Sensors {
    let count = time as i64 / 1_000;
    Sensors {
        time,
        counts_mask: 0xf,
        counts: [count, -count, count + 1, 0],
        steering: Some(0.25),
        yaw_rate: Some(-0.5),
        ..Sensors::default()
    }
}

pub(crate) fn hear(host: &mut HostEnd, bytes: &[u8]) -> Vec<HostEvent> {
    let mut events = Vec::new();
    host.receive(bytes, &mut |event| events.push(event));
    events
}

pub(crate) fn obey(vehicle: &mut VehicleEnd, now: u64, bytes: &[u8]) -> Vec<VehicleEvent> {
    let mut events = Vec::new();
    vehicle.receive(now, bytes, &mut |event| events.push(event));
    events
}

/// The readings among the events.
pub(crate) fn readings(events: &[HostEvent]) -> Vec<Reading> {
    let reading = |event: &HostEvent| match event {
        HostEvent::Reading { reading, .. } => Some(*reading),
        _ => None,
    };
    events.iter().filter_map(reading).collect()
}

/// One cycle of both at the vehicle's time `now`: what is due, a reading, and the host's answer.
pub(crate) fn cycle(host: &mut HostEnd, vehicle: &mut VehicleEnd, now: u64) -> Vec<HostEvent> {
    let mut bytes = Vec::new();
    while let Some(frame) = vehicle.pending(now) {
        bytes.extend_from_slice(&frame);
    }
    bytes.extend_from_slice(&vehicle.reading(&sensors(now)));
    let events = hear(host, &bytes);
    if let Some(frame) = host.pending() {
        obey(vehicle, now, &frame);
    }
    events
}

/// Two ends with a session, at the vehicle's time 1 ms.
pub(crate) fn pair(hello: Hello) -> (HostEnd, VehicleEnd) {
    let (mut host, mut vehicle) = (HostEnd::new(), VehicleEnd::new(hello));
    cycle(&mut host, &mut vehicle, 0);
    cycle(&mut host, &mut vehicle, MILLISECOND);
    assert!(host.is_open());
    (host, vehicle)
}

/// `message` as a frame, made without the crate under test.
pub(crate) fn frame(message: &[u8]) -> Vec<u8> {
    let mut content = message.to_vec();
    content.extend_from_slice(&crc32fast::hash(message).to_le_bytes());
    let mut wire = vec![0];
    for block in content.split(|byte| *byte == 0) {
        wire.push(u8::try_from(block.len() + 1).expect("short messages"));
        wire.extend_from_slice(block);
    }
    wire.push(0);
    wire
}
