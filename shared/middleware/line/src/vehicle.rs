//! The vehicle's end.

use crate::HELLO_PERIOD;
use crate::bytes::Fields;
use crate::errors::{FrameError, LineErrors, Refusal};
use crate::frame::Frame;
use crate::messages::{COMMAND, Command, Hello, Reading, START, Sensors, Start, encode_refusal};
use crate::receiver::Receiver;

/// What the vehicle hears.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VehicleEvent {
    /// A host began a session. Nothing moves yet.
    Started,
    /// What the actuators shall do.
    Command {
        /// Its number on the line.
        sequence: u32,
        /// Speed of the rear-axle centre \[m/s\].
        speed: f32,
        /// Road-wheel angle, left positive \[rad\].
        steering: f32,
    },
    /// A host asked for what this vehicle is not; the session, if there was one, is over.
    Refused(Refusal),
}

/// The vehicle's end of the line.
///
/// `now` is the vehicle's own time \[ns since its start\], the same that its readings carry. Write
/// to the line what [`pending`](Self::pending) gives until it gives none, and a
/// [`reading`](Self::reading) per period, whether a host listens or not; stop the vehicle while
/// [`is_silent`](Self::is_silent).
#[derive(Clone, Debug)]
pub struct VehicleEnd {
    receiver: Receiver,
    link: Link,
    /// Sequence of the next reading.
    sequence: u32,
    next_hello: u64,
}

#[derive(Clone, Debug)]
struct Link {
    hello: Hello,
    errors: LineErrors,
    /// Newest START or COMMAND taken in this session.
    accepted: Option<u32>,
    /// When a command of this session was taken last.
    commanded: Option<u64>,
    /// Commands outside a session, or repeated.
    ignored: u64,
    refusal: Option<Refusal>,
}

impl VehicleEnd {
    /// An end of the vehicle that `hello` describes, at its start.
    #[must_use]
    pub fn new(hello: Hello) -> Self {
        let link = Link {
            hello,
            errors: LineErrors::default(),
            accepted: None,
            commanded: None,
            ignored: 0,
            refusal: None,
        };
        Self { receiver: Receiver::new(), link, sequence: 0, next_hello: 0 }
    }

    /// Takes bytes from the line, cut anywhere, and calls `sink` for each event in order.
    pub fn receive(&mut self, now: u64, bytes: &[u8], sink: &mut impl FnMut(VehicleEvent)) {
        let Self { receiver, link, .. } = self;
        receiver.receive(bytes, |message| {
            if let Err(error) = message.and_then(|message| link.hear(now, message, sink)) {
                link.errors.count(error);
            }
        });
    }

    /// A frame to write now, if there is one: the answer to a refused START, or the HELLO that is
    /// due.
    pub fn pending(&mut self, now: u64) -> Option<Frame> {
        if let Some(refusal) = self.link.refusal.take() {
            return Some(encode_refusal(refusal, self.link.hello.boot));
        }
        if now < self.next_hello {
            return None;
        }
        self.next_hello = now + HELLO_PERIOD;
        Some(self.link.hello.encode())
    }

    /// The next reading. It carries what was declared in the HELLO of what `sensors` has, and no
    /// number that is not finite; counters are cut to their width.
    pub fn reading(&mut self, sensors: &Sensors) -> Frame {
        self.reading_at(sensors.time, sensors)
    }

    /// The same at `now`, of sensors that are stamped by a clock of their own.
    pub fn reading_at(&mut self, now: u64, sensors: &Sensors) -> Frame {
        let reading = Reading {
            boot: self.link.hello.boot,
            sequence: self.sequence,
            acknowledged: self.link.accepted,
            silent: self.is_silent(now),
            sensors: sensors.declared(&self.link.hello),
        };
        self.sequence = self.sequence.wrapping_add(1);
        reading.encode(self.link.hello.counter_bits > 32)
    }

    /// Whether the vehicle has to stop, or to stand, because no command came for the silence
    /// time-out.
    #[must_use]
    pub fn is_silent(&self, now: u64) -> bool {
        let limit = u64::from(self.link.hello.silence_ms) * 1_000_000;
        self.link.commanded.is_none_or(|then| now.saturating_sub(then) >= limit)
    }

    /// Forgets a frame begun: the line was opened again.
    pub fn line_lost(&mut self) {
        self.receiver.clear();
    }

    /// Frames refused since the start, by reason.
    #[must_use]
    pub fn errors(&self) -> LineErrors {
        self.link.errors
    }

    /// Well-formed commands that did not count: outside a session, or not newer than the last.
    #[must_use]
    pub fn ignored(&self) -> u64 {
        self.link.ignored
    }
}

impl Link {
    fn hear(
        &mut self,
        now: u64,
        message: &[u8],
        sink: &mut impl FnMut(VehicleEvent),
    ) -> Result<(), FrameError> {
        let (kind, fields) = message.split_first().ok_or(FrameError::Length)?;
        match *kind {
            START => self.on_start(Start::decode(Fields(fields), self.hello.boot)?, sink),
            COMMAND => self.on_command(now, Command::decode(Fields(fields))?, sink),
            other => return Err(FrameError::Kind(other)),
        }
        Ok(())
    }

    fn on_start(&mut self, start: Result<Start, Refusal>, sink: &mut impl FnMut(VehicleEvent)) {
        self.commanded = None;
        self.accepted = start.ok().map(|start| start.sequence);
        self.refusal = start.err();
        sink(self.refusal.map_or(VehicleEvent::Started, VehicleEvent::Refused));
    }

    fn on_command(&mut self, now: u64, command: Command, sink: &mut impl FnMut(VehicleEvent)) {
        let Command { sequence, speed, steering } = command;
        if self.accepted.is_some_and(|last| is_newer(sequence, last)) {
            self.accepted = Some(sequence);
            self.commanded = Some(now);
            sink(VehicleEvent::Command { sequence, speed, steering });
        } else {
            self.ignored += 1;
        }
    }
}

/// Sequences wrap: newer is what lies less than half the numbers ahead.
fn is_newer(sequence: u32, last: u32) -> bool {
    matches!(sequence.wrapping_sub(last), 1..=0x7fff_ffff)
}
