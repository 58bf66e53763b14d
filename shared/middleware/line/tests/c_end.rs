//! The microcontroller's end in C, compiled here, against the host's end in Rust, through pipes.
#![allow(clippy::expect_used, clippy::panic)] // Helpers of a test are part of it.

mod common;

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use common::{Generator, frame};
use kerbside_line::{Hello, HostEnd, HostEvent, MAX_FRAME, Reading, Refusal, Sensors};

const BOOT: u32 = 0xb007_1d07;

/// Four wheels with counts and speeds, steering and gyro.
const ALL: u16 = 0x3ff;

fn compile(arguments: &[&str], output: &Path) {
    let folder =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../deploy/examples/microcontroller");
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let result = Command::new(&compiler)
        .args(["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2"])
        .args(arguments)
        .arg("-o")
        .arg(output)
        .current_dir(&folder)
        .output()
        .unwrap_or_else(|error| panic!("{compiler}: {error}"));
    assert!(result.status.success(), "{}", String::from_utf8_lossy(&result.stderr));
}

/// The C vehicle as a process, and the host's end that talks to it.
struct Line {
    _folder: tempfile::TempDir,
    process: Child,
    input: Option<ChildStdin>,
    output: Receiver<Vec<u8>>,
    host: HostEnd,
    garbage: Option<Generator>,
    /// Whether the last byte heard ended a frame, so that garbage may follow.
    between: bool,
    zeros: usize,
}

impl Line {
    fn open(bits: u8, declared: u16, flags: &[&str], garbage: Option<Generator>) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let binary: PathBuf = folder.path().join("peer");
        compile(&[&["peer.c", "kerbside_line.c"], flags].concat(), &binary);
        let mut process = Command::new(&binary)
            .args([BOOT.to_string(), bits.to_string(), declared.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the peer runs");
        let input = process.stdin.take();
        let mut pipe = process.stdout.take().expect("a pipe");
        let (sender, output) = channel();
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(length @ 1..) = pipe.read(&mut buffer) {
                if sender.send(buffer[..length].to_vec()).is_err() {
                    break;
                }
            }
        });
        let host = HostEnd::new();
        Self { _folder: folder, process, input, output, host, garbage, between: true, zeros: 0 }
    }

    fn send(&mut self, bytes: &[u8]) {
        let garbage = self.garbage.as_mut().map(|generator| generator.garbage(2 * MAX_FRAME));
        let input = self.input.as_mut().expect("open");
        input.write_all(&garbage.unwrap_or_default()).expect("the peer lives");
        input.write_all(bytes).expect("the peer lives");
    }

    /// What the host hears of `chunk`, with garbage between the frames.
    fn hear(&mut self, chunk: &[u8]) -> Vec<HostEvent> {
        let mut events = Vec::new();
        for byte in chunk {
            if let Some(generator) = self.garbage.as_mut().filter(|_| self.between) {
                self.host.receive(&generator.garbage(MAX_FRAME), &mut |event| events.push(event));
            }
            self.zeros += usize::from(*byte == 0);
            self.between = *byte == 0 && self.zeros.is_multiple_of(2);
            self.host.receive(&[*byte], &mut |event| events.push(event));
        }
        events
    }

    /// Events up to one that `done` wants; answers HELLO on the way.
    fn until(&mut self, done: impl Fn(&HostEvent) -> bool) -> Vec<HostEvent> {
        let mut events = Vec::new();
        while !events.iter().any(&done) {
            let chunk = self.output.recv_timeout(Duration::from_secs(20));
            events.extend(self.hear(&chunk.expect("the peer answers")));
            if let Some(start) = self.host.pending() {
                self.send(&start);
            }
        }
        events
    }

    fn handshake(&mut self) -> Vec<HostEvent> {
        let started = |event: &HostEvent| matches!(event, HostEvent::Reading { .. });
        let events = self.until(started);
        assert!(self.host.is_open());
        events
    }

    /// Ends the peer; its line errors and ignored commands.
    fn close(mut self) -> (u64, u64) {
        drop(self.input.take());
        let mut said = String::new();
        self.process.stderr.take().expect("a pipe").read_to_string(&mut said).expect("text");
        assert!(self.process.wait().expect("the peer ends").success());
        let numbers: Vec<u64> = said.split_whitespace().filter_map(|w| w.parse().ok()).collect();
        (numbers[0], numbers[1])
    }
}

fn expected_hello(counter_bits: u8, declared: u16) -> Hello {
    Hello {
        boot: BOOT,
        counter_bits,
        counts_mask: (declared & 0xf) as u8,
        speeds_mask: (declared >> 4 & 0xf) as u8,
        has_steering: declared >> 8 & 1 == 1,
        has_yaw_rate: declared >> 9 & 1 == 1,
        reading_period_us: 100_000,
        silence_ms: 300,
    }
}

fn next_float(generator: &mut Generator) -> f32 {
    ((generator.next() >> 40) as f32 - 8_388_608.0) / 65_536.0
}

/// The peer's next reading, if `command` is the newest one's speed and steering.
fn twin(generator: &mut Generator, hello: &Hello, time: u64, command: (f32, f32)) -> Sensors {
    let presence = generator.next() >> 32;
    let is = |bit: u32| presence >> bit & 1 == 1;
    let finite_mask = if is(10) { 0b0111 } else { 0b1111 };
    let mut sensors = Sensors {
        time,
        counts_mask: presence as u8 & hello.counts_mask,
        speeds_mask: (presence >> 4) as u8 & finite_mask & hello.speeds_mask | 1,
        steering: hello.has_steering.then_some(command.1),
        ..Sensors::default()
    };
    let unused = 64 - hello.counter_bits;
    for i in 0..4 {
        let (count, speed) = ((generator.next() as i64) << unused >> unused, next_float(generator));
        sensors.counts[i] = if sensors.counts_mask & 1 << i == 0 { 0 } else { count };
        sensors.speeds[i] = if sensors.speeds_mask & 1 << i == 0 { 0.0 } else { speed };
    }
    sensors.speeds[0] = command.0;
    // Where the peer sends what is no number, it draws none.
    sensors.yaw_rate =
        (!is(9)).then(|| next_float(generator)).filter(|_| is(8) && hello.has_yaw_rate);
    sensors
}

fn float_bits(sensors: &Sensors) -> Vec<u32> {
    let floats = sensors.speeds.into_iter().chain(sensors.steering).chain(sensors.yaw_rate);
    floats.map(f32::to_bits).collect()
}

fn any_finite(generator: &mut Generator) -> f32 {
    loop {
        let value = f32::from_bits((generator.next() >> 32) as u32);
        if value.is_finite() {
            return value;
        }
    }
}

fn acknowledges(event: &HostEvent, number: u32) -> bool {
    let HostEvent::Reading { reading, .. } = event else { return false };
    reading.acknowledged == Some(number)
}

/// Checks readings in their order against the twin, and the commands that come back in them.
struct Witness {
    generator: Generator,
    hello: Hello,
    sequence: u32,
    time: u64,
    /// Sequence, speed and steering of what was sent.
    sent: Vec<(u32, f32, f32)>,
}

impl Witness {
    fn check(&mut self, events: &[HostEvent]) -> usize {
        let readings = common::readings(events);
        readings.iter().for_each(|reading| self.check_one(reading));
        readings.len()
    }

    fn check_one(&mut self, reading: &Reading) {
        let acknowledged = reading.acknowledged.expect("a session");
        let known = self.sent.iter().find(|(sequence, ..)| *sequence == acknowledged);
        let command = known.map_or((0.0, 0.0), |(_, speed, steering)| (*speed, *steering));
        let expected = twin(&mut self.generator, &self.hello, reading.sensors.time, command);
        assert_eq!(reading.sensors, expected);
        assert_eq!(float_bits(&reading.sensors), float_bits(&expected));
        assert_eq!((reading.boot, reading.sequence), (BOOT, self.sequence));
        assert!(reading.sensors.time > self.time);
        self.sequence += 1;
        self.time = reading.sensors.time;
    }
}

/// A thousand commands and their readings, all equal to the bit on both sides.
fn converse(counter_bits: u8, declared: u16, garbage: Option<Generator>) {
    let noisy = garbage.is_some();
    let mut line = Line::open(counter_bits, declared, &[], garbage);
    let hello = expected_hello(counter_bits, declared);
    let mut witness =
        Witness { generator: Generator(1), hello, sequence: 0, time: 0, sent: Vec::new() };
    let events = line.handshake();
    assert_eq!(events[0], HostEvent::Hello(hello));
    let mut count = witness.check(&events);
    let mut generator = Generator(77);
    for _ in 0..1_000 {
        let (speed, steering) = (any_finite(&mut generator), any_finite(&mut generator));
        let command = line.host.command(speed, steering).expect("a session");
        let number = line.host.sent();
        witness.sent.push((number, speed, steering));
        line.send(&command);
        let events = line.until(|event| acknowledges(event, number));
        count += witness.check(&events);
    }
    assert!(count > 1_000);
    assert_eq!(line.host.errors().total() > 0, noisy);
    let (errors, ignored) = line.close();
    assert_eq!((errors > 0, ignored), (noisy, 0));
}

#[test]
fn a_thousand_readings_and_commands_are_equal_to_the_bit() {
    converse(32, ALL, None);
}

#[test]
fn so_they_are_with_wide_counters_and_garbage_between_all_frames() {
    converse(64, ALL, Some(Generator(5)));
}

#[test]
fn so_they_are_with_few_sensors_narrow_counters_and_garbage() {
    converse(16, 0b0011_1100, Some(Generator(6)));
}

#[test]
fn silence_stops_it() {
    let mut line = Line::open(32, ALL, &[], None);
    let silent =
        |event: &HostEvent| matches!(event, HostEvent::Reading { reading, .. } if reading.silent);
    assert!(line.handshake().iter().any(silent), "START moves nothing");
    let command = line.host.command(0.1, 0.2).expect("a session");
    line.send(&command);
    let heard = line.until(|event| matches!(event, HostEvent::Reading { .. }));
    assert!(!heard.iter().any(silent));
    let commanded = common::readings(&heard)[0].sensors.time;
    // Its clock is its line: 10 us a byte. The command again and again keeps nobody going.
    let mut heard = Vec::new();
    for _ in 0..10 {
        line.send(&command);
        line.send(&[0; 11_000]);
        heard.extend(line.until(|event| matches!(event, HostEvent::Reading { .. })));
    }
    let readings = common::readings(&heard);
    let first = readings.iter().find(|reading| reading.silent).expect("it stops");
    let after = first.sensors.time - commanded;
    assert!((300_000_000..420_000_000).contains(&after), "stopped after {after} ns");
    assert!(line.close().1 >= 1, "repeated commands are ignored");
}

#[test]
fn a_vehicle_of_another_version_is_refused_with_both_versions() {
    let mut line = Line::open(32, ALL, &["-DKB_PROTOCOL_VERSION=2"], None);
    let events = line.until(|event| matches!(event, HostEvent::Refused(_)));
    assert_eq!(events, [HostEvent::Refused(Refusal::Version { host: 1, vehicle: 2 })]);
    assert!(line.host.pending().is_none());
    assert_eq!(line.close(), (0, 0));
}

#[test]
fn it_refuses_a_host_of_another_version_or_for_another_life() {
    let mut line = Line::open(32, ALL, &[], None);
    let events = line.handshake();
    assert!(events.contains(&HostEvent::Started { boot: BOOT }));
    let refused = |event: &HostEvent| matches!(event, HostEvent::Refused(_));

    line.send(&frame(&[b'S', 9, 1, 2, 3]));
    let expected = Refusal::Version { host: 9, vehicle: 1 };
    assert!(line.until(refused).contains(&HostEvent::Refused(expected)));
    let command = line.host.command(0.1, 0.0).expect("this host does not know yet");
    line.send(&command);

    let mut start = vec![b'S', 1];
    start.extend(0x1234_5678_u32.to_le_bytes());
    start.extend([0; 4]);
    line.send(&frame(&start));
    let expected = Refusal::Boot { asked: 0x1234_5678, vehicle: BOOT };
    assert!(line.until(refused).contains(&HostEvent::Refused(expected)));
    assert_eq!(line.close(), (0, 1), "the command did not count");
}

#[test]
fn damaged_commands_are_refused_by_it() {
    let mut line = Line::open(32, ALL, &[], None);
    line.handshake();
    let mut command = line.host.command(0.1, 0.2).expect("a session").to_vec();
    let mut damaged = 0;
    for bit in 8..(command.len() - 1) * 8 {
        command[bit / 8] ^= 1 << (bit % 8);
        line.send(&command);
        command[bit / 8] ^= 1 << (bit % 8);
        damaged += 1;
    }
    line.send(&command);
    let number = line.host.sent();
    line.until(|event| acknowledges(event, number));
    let (errors, ignored) = line.close();
    assert!(errors >= damaged, "{errors} of {damaged}");
    assert_eq!(ignored, 0);
}

#[test]
fn a_new_start_stands_still_until_its_first_command() {
    let mut line = Line::open(32, ALL, &[], None);
    line.handshake();
    let command = line.host.command(0.1, 0.2).expect("a session");
    line.send(&command);
    let mut start = vec![b'S', 1];
    start.extend(BOOT.to_le_bytes());
    start.extend(500_u32.to_le_bytes());
    line.send(&frame(&start));
    let readings = common::readings(&line.until(|event| acknowledges(event, 500)));
    let silent: Vec<bool> = readings.iter().map(|reading| reading.silent).collect();
    assert_eq!(silent, [false, true]);
}

#[test]
fn it_refuses_commands_that_are_no_numbers() {
    let mut line = Line::open(32, ALL, &[], None);
    line.handshake();
    for (speed, steering) in [(f32::NAN, 0.0), (0.0, f32::INFINITY), (f32::NEG_INFINITY, 0.0)] {
        let mut command = vec![b'C'];
        command.extend((line.host.sent() + 1).to_le_bytes());
        command.extend(speed.to_le_bytes());
        command.extend(steering.to_le_bytes());
        line.send(&frame(&command));
    }
    let command = line.host.command(0.1, 0.2).expect("a session");
    line.send(&command);
    let number = line.host.sent();
    let events = line.until(|event| acknowledges(event, number));
    assert_eq!(common::readings(&events).len(), 1);
    assert_eq!(line.close(), (3, 0));
}

#[test]
fn its_numbers_wrap() {
    let mut line = Line::open(32, ALL, &[], None);
    line.handshake();
    let mut start = vec![b'S', 1];
    start.extend(BOOT.to_le_bytes());
    start.extend(u32::MAX.to_le_bytes());
    line.send(&frame(&start));
    for number in [0_u32, 0, u32::MAX, 1] {
        let mut command = vec![b'C'];
        command.extend(number.to_le_bytes());
        command.extend([0; 8]);
        line.send(&frame(&command));
    }
    let numbers: Vec<_> = common::readings(&line.until(|event| acknowledges(event, 1)))
        .into_iter()
        .map(|reading| reading.acknowledged)
        .collect();
    assert_eq!(numbers, [Some(u32::MAX), Some(0), Some(1)]);
    assert_eq!(line.close(), (0, 2));
}

#[test]
fn the_example_compiles() {
    let folder = tempfile::tempdir().expect("a folder");
    compile(&["-c", "example_main.c"], &folder.path().join("example_main.o"));
}
