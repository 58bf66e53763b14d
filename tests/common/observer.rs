//! An observer: a process of its own that joins the instance and tells, a line a sample, what it sees.
//!
//! It is this very test binary, started once more for the one ignored test below: a process can join one instance only,
//! and the tests of a binary run many.

use core::time::Duration;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use kerbside_messages::{
    Actuator, AlterReason, Cause, EstimatorState, Inhibit, Mode, Nanos, Odometry, Process,
    ProcessState, State, Truth, text,
};
use kerbside_runtime::{Instance, Newest, Session, SessionError, Subscriber, Ticker, now};
use serde::{Deserialize, Serialize};

use super::Sandbox;

/// Names the instance to the observing process.
const INSTANCE: &str = "KERBSIDE_TEST_OBSERVES";
/// Longest wait for the observing process to leave.
const ORDERLY: Duration = Duration::from_secs(1);
/// The name of the test below.
const TEST: &str = "common::observer::observes";

/// The true state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct TruthLine {
    pub(crate) stamp: Nanos,
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) yaw: f64,
    pub(crate) speed: f64,
    /// Rolled in either direction since the vehicle's start \[m\].
    pub(crate) distance: f64,
    /// The vehicle stops because commands stay away.
    pub(crate) silent: bool,
}

/// An estimate.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct OdometryLine {
    pub(crate) stamp: Nanos,
    /// The estimator's life.
    pub(crate) epoch: u64,
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) yaw: f64,
    pub(crate) valid: bool,
    pub(crate) standstill: bool,
}

/// What the gate let pass.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct GateLine {
    pub(crate) sent: Nanos,
    pub(crate) speed: f64,
    pub(crate) latch: String,
}

/// The supervisor's state; told when it changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct StateLine {
    pub(crate) sent: Nanos,
    pub(crate) mode: String,
    pub(crate) cause: String,
    pub(crate) words: String,
    pub(crate) arms: u64,
    pub(crate) healthy: bool,
    pub(crate) rows: Vec<RowLine>,
}

/// A process in the supervisor's state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RowLine {
    pub(crate) name: String,
    pub(crate) pid: u32,
    pub(crate) state: String,
    pub(crate) restarts: u32,
}

impl StateLine {
    /// The row of a process.
    pub(crate) fn row(&self, process: Process) -> &RowLine {
        self.rows.iter().find(|row| row.name == process.name()).unwrap()
    }
}

#[derive(Debug, Serialize, Deserialize)]
enum Line {
    Truth(TruthLine),
    Odometry(OdometryLine),
    Gate(GateLine),
    State(StateLine),
}

/// Everything seen so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Seen {
    pub(crate) truth: Vec<TruthLine>,
    pub(crate) odometry: Vec<OdometryLine>,
    pub(crate) gate: Vec<GateLine>,
    pub(crate) states: Vec<StateLine>,
}

impl Seen {
    /// The newest state.
    pub(crate) fn state(&self) -> Option<&StateLine> {
        self.states.last()
    }

    /// The newest state, if it is in that mode.
    pub(crate) fn in_mode(&self, mode: Mode) -> Option<&StateLine> {
        self.state().filter(|state| state.mode == mode.name())
    }

    /// Distance rolled \[m\].
    pub(crate) fn distance(&self) -> f64 {
        self.truth.last().map_or(0.0, |truth| truth.distance)
    }

    fn take(&mut self, line: Line) {
        match line {
            Line::Truth(line) => self.truth.push(line),
            Line::Odometry(line) => self.odometry.push(line),
            Line::Gate(line) => self.gate.push(line),
            Line::State(line) => {
                line.rows.iter().for_each(|row| super::witness::follow(row.pid));
                self.states.push(line);
            }
        }
    }
}

/// The observing process as the test sees it; ended when dropped.
#[derive(Debug)]
pub(crate) struct Observer {
    child: Child,
    stdin: Option<ChildStdin>,
    shared: Arc<(Mutex<Seen>, Condvar)>,
}

impl Observer {
    /// Starts to observe the sandbox's instance, which may come up later.
    pub(crate) fn start(sandbox: &Sandbox) -> Self {
        let mut command = sandbox.at_home(Command::new(std::env::current_exe().unwrap()));
        command.args(["--exact", TEST, "--ignored", "--nocapture", "--test-threads=1"]);
        command.env(INSTANCE, sandbox.instance().name());
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let shared: Arc<(Mutex<Seen>, Condvar)> = Arc::default();
        let (lines, told) = (BufReader::new(child.stdout.take().unwrap()), Arc::clone(&shared));
        std::thread::spawn(move || {
            // The test harness in the child has words of its own on the same stream.
            for line in lines.lines().map_while(Result::ok) {
                if let Ok(line) = serde_json::from_str(&line) {
                    lock(&told.0).take(line);
                    told.1.notify_all();
                }
            }
        });
        let stdin = child.stdin.take();
        Self { child, stdin, shared }
    }

    /// Everything seen so far.
    pub(crate) fn seen(&self) -> Seen {
        lock(&self.shared.0).clone()
    }

    /// Waits until `found` finds something; none after `bound`.
    pub(crate) fn wait<T>(&self, bound: Duration, found: impl Fn(&Seen) -> Option<T>) -> Option<T> {
        let mut result = None;
        let searching = |seen: &mut Seen| {
            result = found(seen);
            result.is_none()
        };
        let waited = self.shared.1.wait_timeout_while(lock(&self.shared.0), bound, searching);
        drop(waited);
        result
    }

    /// Has it inhibit motion for so long.
    pub(crate) fn inhibit(&mut self, span: Duration) {
        writeln!(self.stdin.as_ref().unwrap(), "{}", span.as_nanos()).unwrap();
    }
}

impl Drop for Observer {
    fn drop(&mut self) {
        // It leaves in order, as every process does that is asked to.
        self.stdin = None;
        if super::stack::poll(ORDERLY, || self.child.try_wait().ok()?).is_none() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

fn lock(seen: &Mutex<Seen>) -> MutexGuard<'_, Seen> {
    seen.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The observing process: its standard output is what it sees, its standard input what it is to inhibit.
#[test]
#[ignore = "a process that other tests start"]
fn observes() {
    let Ok(name) = std::env::var(INSTANCE) else { return };
    let instance = Instance::named(&name).unwrap();
    let inhibits = read_inhibits();
    let Some(mut eyes) = open(&instance, &inhibits) else { return };
    let mut look = Ticker::new(Duration::from_millis(5));
    let mut told = None;
    let mut out = std::io::stdout().lock();
    loop {
        let mut lines = eyes.look(&mut told);
        // Who started this one is gone when nobody reads.
        if lines.drain(..).try_for_each(|line| tell(&mut out, &line)).is_err() {
            return;
        }
        match inhibits.try_recv() {
            Ok(span) => eyes.inhibit(span),
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return,
        }
        look.wait();
    }
}

fn tell(out: &mut impl Write, line: &Line) -> std::io::Result<()> {
    writeln!(out, "{}", serde_json::to_string(line)?)?;
    out.flush()
}

fn read_inhibits() -> Receiver<Nanos> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lines().map_while(Result::ok) {
            let _ = sender.send(line.parse().unwrap());
        }
    });
    receiver
}

/// Waits for the instance as long as anybody waits for this process.
fn open(instance: &Instance, inhibits: &Receiver<Nanos>) -> Option<Eyes> {
    let mut retry = Ticker::new(Duration::from_millis(10));
    while inhibits.try_recv() != Err(TryRecvError::Disconnected) {
        if let Ok(eyes) = Eyes::open(instance) {
            return Some(eyes);
        }
        retry.wait();
    }
    None
}

struct Eyes {
    truth: Subscriber<Truth>,
    odometry: Subscriber<Odometry>,
    actuator: Subscriber<Actuator>,
    state: Newest<State>,
    inhibit: kerbside_runtime::Publisher<Inhibit>,
    _session: Session,
}

impl Eyes {
    fn open(instance: &Instance) -> Result<Self, SessionError> {
        let session = Session::join(instance, Process::Operator)?;
        Ok(Self {
            truth: session.subscriber(None, 64)?,
            odometry: session.subscriber(None, 64)?,
            actuator: session.subscriber(None, 64)?,
            state: Newest::of(session.subscriber(None, 1)?),
            inhibit: session.publisher(None)?,
            _session: session,
        })
    }

    fn look(&mut self, told: &mut Option<StateLine>) -> Vec<Line> {
        let mut lines = Vec::new();
        while let Some(truth) = self.truth.receive() {
            lines.push(Line::Truth(truth_line(&truth)));
        }
        while let Some(odometry) = self.odometry.receive() {
            lines.push(Line::Odometry(odometry_line(&odometry)));
        }
        while let Some(actuator) = self.actuator.receive() {
            lines.push(Line::Gate(gate_line(&actuator)));
        }
        if self.state.update()
            && let Some(line) = self.state.get().map(state_line)
            && told
                .as_ref()
                .is_none_or(|told| StateLine { sent: told.sent, ..line.clone() } != *told)
        {
            *told = Some(line.clone());
            lines.push(Line::State(line));
        }
        lines
    }

    fn inhibit(&mut self, span: Nanos) {
        let content = Inhibit {
            expiry: now() + span,
            who: text::from_str("test"),
            why: text::from_str("somebody in the way"),
            ..Inhibit::default()
        };
        let sent = self.inhibit.send(|inhibit| {
            *inhibit = content;
            true
        });
        assert!(sent.unwrap());
    }
}

fn truth_line(truth: &Truth) -> TruthLine {
    TruthLine {
        stamp: truth.header.stamp,
        x: truth.x,
        y: truth.y,
        yaw: truth.yaw,
        speed: truth.speed,
        distance: truth.distance,
        silent: truth.silent == 1,
    }
}

fn odometry_line(odometry: &Odometry) -> OdometryLine {
    OdometryLine {
        stamp: odometry.header.stamp,
        epoch: odometry.header.epoch,
        x: odometry.x,
        y: odometry.y,
        yaw: odometry.yaw,
        valid: odometry.state == EstimatorState::Valid.code(),
        standstill: odometry.standstill == 1,
    }
}

fn gate_line(actuator: &Actuator) -> GateLine {
    let latch = AlterReason::from_code(actuator.latch).unwrap();
    GateLine { sent: actuator.header.sent, speed: actuator.speed, latch: latch.name().to_owned() }
}

fn state_line(state: &State) -> StateLine {
    let row = |row: &kerbside_messages::ProcessRow| RowLine {
        name: Process::from_id(row.process).unwrap().name().to_owned(),
        pid: row.pid,
        state: ProcessState::from_code(row.state).unwrap().name().to_owned(),
        restarts: row.restarts,
    };
    StateLine {
        sent: state.header.sent,
        mode: state.mode().name().to_owned(),
        cause: Cause::from_code(state.cause).unwrap().name().to_owned(),
        words: text::as_str(&state.text).to_owned(),
        arms: state.arms,
        healthy: state.healthy == 1,
        rows: state.rows().iter().map(row).collect(),
    }
}
