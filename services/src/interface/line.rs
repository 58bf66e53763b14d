//! The serial line: readings in, commands out.
//!
//! Topics in: `actuator`. Topics out: `raw`. Without commands the interface sends nothing of its own: silence is
//! what stops the vehicle. The line is opened by name, and again after an error or 100 ms of silence.
//!
//! It waits for two things at once, so it polls; `kerbside bench transport` finds a poll as quick as the event alone.

use std::os::fd::AsFd;
use std::path::PathBuf;

use kerbside_geometry::Actuators;
use kerbside_line::{Frame, HostEnd, HostEvent, Reading};
use kerbside_messages::{Actuator, Header, Nanos, Raw};
use kerbside_runtime::{Newest, Publisher, now, poll_readable};
use kerbside_settings::InterfaceSettings;

use super::serial::Line;
use crate::exit::{Exit, Failure};
use crate::life::{Life, Service, nanos};

/// A line that is silent is closed at the latest so long after it counts as lost, whatever it still carries to the
/// vehicle: no stop ramp takes longer \[ns\].
const RAMP: Nanos = 2_000_000_000;
/// Time between attempts to open the line, and longest wait for input \[ns\].
const REOPEN: Nanos = 100_000_000;
const WAIT: Nanos = 5_000_000;

/// The stage between line and samples: pure, driven live and in lockstep.
#[derive(Clone, Debug, Default)]
pub struct LineStage {
    end: HostEnd,
    actuators: Actuators,
    sent: Option<(u64, u64)>,
    heard: Option<Nanos>,
    /// The newest reading says that commands reach the vehicle.
    heeds: bool,
    /// When the vehicle stopped because they no longer did \[ns\].
    stopped: Option<Nanos>,
    /// The newest command asks for motion.
    moves: bool,
}

impl LineStage {
    /// The line to a vehicle whose actuators respond like this.
    #[must_use]
    pub fn new(actuators: Actuators) -> Self {
        Self { actuators, ..Self::default() }
    }

    /// Takes bytes that arrived at `now`; calls `reading` for each reading, `news` for everything else.
    pub fn receive(
        &mut self,
        now: Nanos,
        bytes: &[u8],
        mut reading: impl FnMut(&Reading, u32),
        mut news: impl FnMut(HostEvent),
    ) {
        let Self { end, heard, heeds, stopped, .. } = self;
        end.receive(bytes, &mut |event| match event {
            HostEvent::Reading { reading: content, line_errors } => {
                *heard = Some(now);
                if core::mem::replace(heeds, !content.silent) && content.silent {
                    *stopped = Some(now);
                }
                reading(&content, line_errors);
            }
            other => news(other),
        });
    }

    /// The frame for the newest actuator sample, once per sample, while it is fresh.
    ///
    /// A vehicle that stopped by itself, because commands stayed away, is not driven on: until it heeds one, it gets
    /// none but zero speed.
    pub fn command(&mut self, now: Nanos, actuator: &Actuator, freshness: Nanos) -> Option<Frame> {
        let id = (actuator.header.epoch, actuator.header.sequence);
        let stale = now.saturating_sub(actuator.header.sent) > freshness;
        let drives_on = !self.heeds && actuator.speed != 0.0;
        if self.sent == Some(id) || stale || drives_on {
            return None;
        }
        // The gate speaks of the vehicle's motion, the line of what its actuators are told.
        let (speed, steering) = self.actuators.command(actuator.speed, actuator.steering);
        #[allow(clippy::cast_possible_truncation)] // the line carries single precision
        let frame = self.end.command(speed as f32, steering as f32)?;
        (self.sent, self.moves) = (Some(id), actuator.speed != 0.0);
        Some(frame)
    }

    /// A frame of the handshake that is due.
    pub fn pending(&mut self) -> Option<Frame> {
        self.end.pending()
    }

    /// The line is gone.
    pub fn line_lost(&mut self) {
        self.end.line_lost();
        (self.heard, self.heeds, self.moves) = (None, false, false);
    }

    /// Whether a line opened at `opened`, on which nothing is heard for longer than `silence`, is to be opened anew.
    ///
    /// What is silent may still carry commands: the gate's stop ramp reaches the vehicle sooner than its own silence
    /// time-out would stop it, so the line is kept until the ramp is over.
    #[must_use]
    pub fn is_lost(&self, now: Nanos, opened: Nanos, silence: Nanos) -> bool {
        let silent = now.saturating_sub(self.heard.unwrap_or(0).max(opened));
        silent > silence && (!self.moves || silent > silence + RAMP)
    }

    /// What is missing where not both directions carry: readings come, commands count, and they reach the vehicle.
    ///
    /// A vehicle that stopped because they did not stays missing for `silence` (longer than two heartbeats), however
    /// soon they reach it again: it must not drive on before somebody has noticed.
    #[must_use]
    pub fn waits_for(&self, now: Nanos, silence: Nanos) -> Option<&'static str> {
        let within = |at: Nanos| now.saturating_sub(at) <= silence;
        if !(self.end.is_open() && self.heard.is_some_and(within)) {
            Some("the vehicle's line")
        } else if !self.heeds || self.stopped.is_some_and(within) {
            Some("commands to reach the vehicle")
        } else {
            None
        }
    }
}

/// A reading as a sample: what the vehicle said, nothing added.
pub fn reading_to_raw(reading: &Reading, line_errors: u32, arrival: Nanos, out: &mut Raw) {
    let sensors = &reading.sensors;
    out.header = Header::stamped(arrival, arrival);
    out.vehicle_time = sensors.time;
    out.arrival = arrival;
    out.counts = sensors.counts;
    out.counts_mask = sensors.counts_mask;
    out.speeds = sensors.speeds.map(f64::from);
    out.speeds_mask = sensors.speeds_mask;
    out.steering = f64::from(sensors.steering.unwrap_or(0.0));
    out.has_steering = u8::from(sensors.steering.is_some());
    out.yaw_rate = f64::from(sensors.yaw_rate.unwrap_or(0.0));
    out.has_yaw_rate = u8::from(sensors.yaw_rate.is_some());
    out.boot = reading.boot;
    out.frame = reading.sequence;
    out.line_errors = line_errors;
}

/// The device: open, or waited for.
struct Door {
    path: PathBuf,
    baud: u32,
    line: Option<Line>,
    opened: Nanos,
    next: Nanos,
    said: bool,
}

impl Door {
    fn new(path: PathBuf, baud: u32) -> Self {
        Self { path, baud, line: None, opened: 0, next: 0, said: false }
    }

    fn open(&mut self, now: Nanos) {
        if self.line.is_some() || now < self.next {
            return;
        }
        self.next = now + REOPEN;
        match Line::open(&self.path, self.baud) {
            Ok(line) => {
                tracing::info!(line = %self.path.display(), "line opened");
                (self.line, self.opened, self.said) = (Some(line), now, false);
            }
            Err(error) if !self.said => {
                tracing::warn!(line = %self.path.display(), %error, "line cannot be opened, trying on");
                self.said = true;
            }
            Err(_) => {}
        }
    }

    fn close(&mut self, stage: &mut LineStage, why: &str) {
        if self.line.take().is_some() {
            tracing::warn!(line = %self.path.display(), why, "line lost");
            stage.line_lost();
        }
    }

    fn read<'a>(&mut self, stage: &mut LineStage, buffer: &'a mut [u8]) -> Option<&'a [u8]> {
        match self.line.as_mut()?.read(buffer) {
            Ok(length) => Some(&buffer[..length]),
            Err(error) => {
                self.close(stage, &error.to_string());
                None
            }
        }
    }

    fn send(&mut self, stage: &mut LineStage, actuator: Option<&Actuator>, freshness: Nanos) {
        let Some(line) = &mut self.line else { return };
        let handshake = stage.pending();
        let command = actuator.and_then(|actuator| stage.command(now(), actuator, freshness));
        let write = |frame: Frame| line.write(&frame);
        if let Err(error) = [handshake, command].into_iter().flatten().try_for_each(write) {
            self.close(stage, &error.to_string());
        }
    }

    fn close_when_silent(&mut self, stage: &mut LineStage, silence: Nanos) {
        if stage.is_lost(now(), self.opened, silence) {
            self.close(stage, "silent");
        }
    }
}

/// Runs the interface.
///
/// # Errors
/// [`Failure`] where the process cannot take part.
pub fn run(service: &Service) -> Result<Exit, Failure> {
    let mut life = Life::join(service, 2)?;
    let silence = nanos(life.timeouts().line_silence);
    let freshness = nanos(life.timeouts().freshness);
    let mut raw = life.publisher::<Raw>()?;
    let mut actuator = Newest::of(life.subscriber::<Actuator>(1)?);
    let listener = life.listener::<Actuator>()?;
    let (device, baud) = device_of(service);
    let mut door = Door::new(device, baud);
    let mut stage = LineStage::new(service.vehicle.response());
    let mut buffer = [0; 4096];
    while life.goes_on() {
        door.open(now());
        let woken = wait(&door, &listener);
        let arrival = now();
        life.begin(arrival);
        if woken.by_line
            && let Some(bytes) = door.read(&mut stage, &mut buffer)
        {
            hear(&mut stage, arrival, bytes, &mut raw);
        }
        life.checkpoint(0);
        take_in(&mut actuator, &listener, woken);
        door.send(&mut stage, actuator.get(), freshness);
        life.checkpoint(1);
        life.end();
        door.close_when_silent(&mut stage, silence);
        life.waits_for(stage.waits_for(now(), silence));
    }
    Ok(life.exit())
}

fn hear(stage: &mut LineStage, arrival: Nanos, bytes: &[u8], raw: &mut Publisher<Raw>) {
    let publish = |reading: &Reading, line_errors: u32| {
        let sent = raw.send(|out| {
            reading_to_raw(reading, line_errors, arrival, out);
            true
        });
        if let Err(error) = sent {
            tracing::error!(%error, "reading lost");
        }
    };
    stage.receive(arrival, bytes, publish, log_news);
}

/// The configured device; without one, the instance's simulated vehicle.
fn device_of(service: &Service) -> (PathBuf, u32) {
    match &service.stack.interface {
        InterfaceSettings::Line { device: Some(device), baud } => (device.clone(), *baud),
        InterfaceSettings::Line { device: None, baud } => (service.instance.vehicle_link(), *baud),
        InterfaceSettings::Replay => (service.instance.vehicle_link(), 0),
    }
}

/// What woke the interface; each thing costs system calls to look after, so only what is there is looked after.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Woken {
    by_line: bool,
    by_samples: bool,
}

fn wait(door: &Door, listener: &kerbside_runtime::Listener) -> Woken {
    let deadline = now() + WAIT;
    let ready = match &door.line {
        // The samples' bit stays the same with and without a line.
        Some(line) => poll_readable(&[listener.as_fd(), line.as_fd()], deadline),
        None => poll_readable(&[listener.as_fd()], deadline),
    };
    // After a wait in vain both are looked after: a wake-up may have got lost.
    Woken { by_samples: ready & 1 != 0 || ready == 0, by_line: ready & 2 != 0 || ready == 0 }
}

/// Takes in the newest actuator sample. Notifications are forgotten first, so that no sample is slept over; and where
/// a sample came without one, its wake-up got lost or is about to come.
fn take_in(actuator: &mut Newest<Actuator>, listener: &kerbside_runtime::Listener, woken: Woken) {
    if woken.by_samples {
        listener.drain();
    }
    if actuator.update() && !woken.by_samples {
        listener.drain();
        actuator.update();
    }
}

fn log_news(event: HostEvent) {
    match event {
        HostEvent::Hello(hello) => tracing::info!(
            boot = hello.boot,
            counter_bits = hello.counter_bits,
            counts_mask = hello.counts_mask,
            steering = hello.has_steering,
            yaw_rate = hello.has_yaw_rate,
            period_us = hello.reading_period_us,
            silence_ms = hello.silence_ms,
            "vehicle described itself"
        ),
        HostEvent::Started { boot } => tracing::info!(boot, "commands count from now on"),
        HostEvent::Restarted { boot } => {
            tracing::warn!(boot, "vehicle started anew: its counters are new")
        }
        HostEvent::Closed => tracing::warn!("vehicle forgot this host; shaking hands again"),
        HostEvent::Refused(refusal) => tracing::error!(%refusal, "no session with this vehicle"),
        HostEvent::Reading { .. } => {}
    }
}
