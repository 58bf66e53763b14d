//! The host's end.

use crate::bytes::Fields;
use crate::errors::{FrameError, LineErrors, Refusal};
use crate::frame::Frame;
use crate::messages::{Command, HELLO, Hello, READING, REFUSE, Reading, Start, decode_refusal};
use crate::receiver::Receiver;

/// What the host hears.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HostEvent {
    /// A vehicle not known before, or one that describes itself differently now.
    Hello(Hello),
    /// The vehicle acknowledged this host: commands count from now on.
    Started {
        /// Its boot id.
        boot: u32,
    },
    /// A reading of the vehicle last described by [`HostEvent::Hello`].
    Reading {
        /// The reading; counters sign-extended from the vehicle's width.
        reading: Reading,
        /// Frames refused since the reading before.
        line_errors: u32,
    },
    /// The vehicle started anew: its counters are new ones, the session is over.
    Restarted {
        /// Its new boot id.
        boot: u32,
    },
    /// The vehicle no longer knows this host; the next HELLO is answered with a new START.
    Closed,
    /// Host and vehicle do not come together.
    Refused(Refusal),
}

/// How far the handshake has come. The vehicle acknowledges what this host sent from `since` on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Session {
    /// No START on its way.
    None,
    /// START sent, the first of them with the sequence `since`.
    Asked { since: u32 },
    /// Acknowledged up to `since`.
    Open { since: u32 },
}

/// The host's end of the line.
///
/// Feed it what arrives with [`receive`](Self::receive), then write what [`pending`](Self::pending)
/// gives; send commands with [`command`](Self::command). Of itself it answers HELLO with START,
/// nothing else.
#[derive(Clone, Debug)]
pub struct HostEnd {
    receiver: Receiver,
    link: Link,
}

#[derive(Clone, Debug)]
struct Link {
    errors: LineErrors,
    /// Errors before the last reading.
    reported: u64,
    /// Boot id of the vehicle's life last heard of.
    boot: Option<u32>,
    /// How that life describes itself, once it did.
    hello: Option<Hello>,
    session: Session,
    start_due: bool,
    /// Sequence of the last START or COMMAND sent.
    sent: u32,
    /// The version last refused, so that it is said once and not at each HELLO.
    refused: Option<Refusal>,
}

impl Default for HostEnd {
    fn default() -> Self {
        Self::new()
    }
}

impl HostEnd {
    /// An end that has heard nothing yet.
    #[must_use]
    pub fn new() -> Self {
        let link = Link {
            errors: LineErrors::default(),
            reported: 0,
            boot: None,
            hello: None,
            session: Session::None,
            start_due: false,
            sent: 0,
            refused: None,
        };
        Self { receiver: Receiver::new(), link }
    }

    /// Takes bytes from the line, cut anywhere, and calls `sink` for each event in order.
    pub fn receive(&mut self, bytes: &[u8], sink: &mut impl FnMut(HostEvent)) {
        let Self { receiver, link } = self;
        receiver.receive(bytes, |message| {
            if let Err(error) = message.and_then(|message| link.hear(message, sink)) {
                link.errors.count(error);
            }
        });
    }

    /// The START that is due after a HELLO, if one is. It moves nothing.
    pub fn pending(&mut self) -> Option<Frame> {
        let boot = self.link.hello.filter(|_| self.link.start_due)?.boot;
        self.link.start_due = false;
        let sequence = self.link.next();
        if self.link.session == Session::None {
            self.link.session = Session::Asked { since: sequence };
        }
        Some(Start { boot, sequence }.encode())
    }

    /// A command for the actuators: speed of the rear-axle centre \[m/s\], road-wheel angle
    /// \[rad\].
    ///
    /// None before the vehicle has acknowledged this host, and for numbers that are not finite,
    /// which no vehicle takes.
    pub fn command(&mut self, speed: f32, steering: f32) -> Option<Frame> {
        let open = matches!(self.link.session, Session::Open { .. });
        let usable = open && speed.is_finite() && steering.is_finite();
        usable.then(|| Command { sequence: self.link.next(), speed, steering }.encode())
    }

    /// The line is gone, or was opened again: forgets the frame begun and the session. The
    /// vehicle's description is kept, so that readings of the same life go on at once; its next
    /// HELLO brings the session back.
    pub fn line_lost(&mut self) {
        self.receiver.clear();
        self.link.close();
        self.link.refused = None;
    }

    /// Whether commands count.
    #[must_use]
    pub fn is_open(&self) -> bool {
        matches!(self.link.session, Session::Open { .. })
    }

    /// How the vehicle describes itself, once it did.
    #[must_use]
    pub fn hello(&self) -> Option<&Hello> {
        self.link.hello.as_ref()
    }

    /// Sequence of the last START or COMMAND given out; 0 before the first.
    #[must_use]
    pub fn sent(&self) -> u32 {
        self.link.sent
    }

    /// Frames refused since the beginning, by reason.
    #[must_use]
    pub fn errors(&self) -> LineErrors {
        self.link.errors
    }
}

impl Link {
    fn next(&mut self) -> u32 {
        self.sent = self.sent.wrapping_add(1);
        self.sent
    }

    fn close(&mut self) {
        self.session = Session::None;
        self.start_due = false;
    }

    fn hear(&mut self, message: &[u8], sink: &mut impl FnMut(HostEvent)) -> Result<(), FrameError> {
        let (kind, fields) = message.split_first().ok_or(FrameError::Length)?;
        match *kind {
            HELLO => match Hello::decode(Fields(fields))? {
                Ok(hello) => self.on_hello(hello, sink),
                Err(refusal) => self.on_other_version(refusal, sink),
            },
            // What follows a HELLO of another version may mean anything.
            READING if self.refused.is_some() => {}
            READING => self.on_reading(Reading::decode(Fields(fields))?, sink)?,
            REFUSE => sink(HostEvent::Refused(decode_refusal(Fields(fields))?)),
            other => return Err(FrameError::Kind(other)),
        }
        Ok(())
    }

    fn on_hello(&mut self, hello: Hello, sink: &mut impl FnMut(HostEvent)) {
        self.on_boot(hello.boot, sink);
        self.refused = None;
        if self.hello != Some(hello) {
            self.hello = Some(hello);
            sink(HostEvent::Hello(hello));
        }
        self.start_due = !matches!(self.session, Session::Open { .. });
    }

    fn on_other_version(&mut self, refusal: Refusal, sink: &mut impl FnMut(HostEvent)) {
        self.close();
        self.hello = None;
        if self.refused != Some(refusal) {
            self.refused = Some(refusal);
            sink(HostEvent::Refused(refusal));
        }
    }

    fn on_boot(&mut self, boot: u32, sink: &mut impl FnMut(HostEvent)) {
        if self.boot == Some(boot) {
            return;
        }
        let known = self.boot.replace(boot);
        self.hello = None;
        self.close();
        if known.is_some() {
            sink(HostEvent::Restarted { boot });
        }
    }

    fn on_reading(
        &mut self,
        reading: Reading,
        sink: &mut impl FnMut(HostEvent),
    ) -> Result<(), FrameError> {
        self.on_boot(reading.boot, sink);
        // Before its HELLO, at most 50 ms away, nobody knows what a vehicle's readings mean.
        let Some(hello) = &self.hello else { return Ok(()) };
        let reading = reading.conform(hello)?;
        self.on_acknowledged(reading.acknowledged, reading.boot, sink);
        let line_errors = self.errors.total() - self.reported;
        self.reported = self.errors.total();
        let line_errors = u32::try_from(line_errors).unwrap_or(u32::MAX);
        sink(HostEvent::Reading { reading, line_errors });
        Ok(())
    }

    /// The numbers that this host sent since `since` are its own; any other is somebody else's
    /// session.
    fn on_acknowledged(
        &mut self,
        acknowledged: Option<u32>,
        boot: u32,
        sink: &mut impl FnMut(HostEvent),
    ) {
        let own =
            |since: u32, number: u32| number.wrapping_sub(since) <= self.sent.wrapping_sub(since);
        match (self.session, acknowledged) {
            (Session::Asked { since }, Some(number)) if own(since, number) => {
                self.session = Session::Open { since: number };
                self.start_due = false;
                sink(HostEvent::Started { boot });
            }
            (Session::Open { since }, Some(number)) if own(since, number) => {
                self.session = Session::Open { since: number };
            }
            (Session::Open { .. }, _) => {
                self.close();
                sink(HostEvent::Closed);
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Sensors, VehicleEnd, VehicleEvent};

    fn vehicle() -> VehicleEnd {
        VehicleEnd::new(Hello {
            boot: 7,
            counter_bits: 32,
            counts_mask: 0xf,
            speeds_mask: 0,
            has_steering: false,
            has_yaw_rate: false,
            reading_period_us: 1_000,
            silence_ms: 100,
        })
    }

    #[test]
    fn a_session_survives_the_wrap_of_its_numbers() {
        for before in 0..5 {
            let (mut host, mut vehicle) = (HostEnd::new(), vehicle());
            host.link.sent = u32::MAX - before;
            host.receive(&vehicle.pending(0).expect("HELLO"), &mut |_| {});
            vehicle.receive(0, &host.pending().expect("START"), &mut |_| {});
            for round in 0..10 {
                let reading = vehicle.reading(&Sensors::default());
                host.receive(&reading, &mut |event| assert_ne!(event, HostEvent::Closed));
                let command = host.command(0.1, 0.0).expect("a session");
                let mut heard = Vec::new();
                vehicle.receive(round, &command, &mut |event| heard.push(event));
                assert!(matches!(heard[..], [VehicleEvent::Command { .. }]), "{heard:?}");
            }
        }
    }
}
