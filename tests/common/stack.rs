//! A stack as a person starts it: `park` or `up`, with its verbs, its processes, and its end.

use core::time::Duration;
use std::fs::{self, File};
use std::process::{Child, Command, Output, Stdio};

use kerbside_messages::{Mode, Nanos, Process};
use kerbside_runtime::{FileLock, Instance, Ticker, now};
use rustix::process::{Pid, kill_process};
use serde_json::Value;

pub use rustix::process::Signal;

use super::observer::Observer;
use super::judging::ROLLING_OUT;
use super::{PATIENCE, Sandbox, Seen};

/// Time between looks at what cannot be waited for.
const LOOK: Duration = Duration::from_millis(5);

/// A running stack with its observer.
#[derive(Debug)]
pub struct Stack {
    // Ended in this order.
    observer: Observer,
    child: Child,
    sandbox: Sandbox,
}

/// How a verb ended.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub code: Option<i32>,
    /// What it printed with `--json`; null where that is none.
    pub json: Value,
    pub stderr: String,
    /// What the observer saw of a stack; empty for a verb.
    pub seen: Seen,
}

impl Outcome {
    /// Its verdict in words.
    pub fn cause(&self) -> &str {
        self.json["cause"].as_str().unwrap_or_default()
    }
}

impl Stack {
    /// `park` with these arguments.
    pub fn park(arguments: &[&str]) -> Self {
        Self::park_in(Sandbox::new(), arguments)
    }

    /// The same in a certain sandbox.
    pub fn park_in(sandbox: Sandbox, arguments: &[&str]) -> Self {
        let mut verb = vec!["park", "--headless", "--json"];
        verb.extend(arguments);
        Self::start(sandbox, &verb)
    }

    /// `up --simulate` with these arguments.
    pub fn up(arguments: &[&str]) -> Self {
        Self::up_in(Sandbox::new(), arguments)
    }

    /// `up --simulate` once more in a sandbox whose first supervisor ended.
    pub fn up_in(sandbox: Sandbox, arguments: &[&str]) -> Self {
        let mut verb = vec!["up", "--simulate"];
        verb.extend(arguments);
        Self::start(sandbox, &verb)
    }

    fn start(sandbox: Sandbox, verb: &[&str]) -> Self {
        let file = |name: &str| File::create(sandbox.file(name)).unwrap();
        let (stdout, stderr) = (file("stdout"), file("stderr"));
        let mut command = sandbox.kerbside();
        command.args(verb).args(["--instance", sandbox.instance().name()]);
        command.stdin(Stdio::null()).stdout(stdout).stderr(stderr);
        let child = command.spawn().unwrap();
        let observer = Observer::start(&sandbox);
        Self { observer, child, sandbox }
    }

    /// Where it lives.
    pub fn sandbox(&self) -> &Sandbox {
        &self.sandbox
    }

    /// The instance.
    pub fn instance(&self) -> Instance {
        self.sandbox.instance()
    }

    /// Everything seen so far.
    pub fn seen(&self) -> Seen {
        self.observer.seen()
    }

    /// Waits until `found` finds `what` in what was seen.
    ///
    /// # Panics
    /// Where it does not come.
    pub fn until<T>(&self, what: &str, found: impl Fn(&Seen) -> Option<T>) -> T {
        let result = self.observer.wait(PATIENCE, found);
        result.unwrap_or_else(|| panic!("{what} does not come\n{}", self.tale()))
    }

    /// Waits for a mode.
    pub fn until_mode(&self, mode: Mode) {
        self.until(mode.name(), |seen| seen.in_mode(mode).map(|_| ()));
    }

    /// Waits until the vehicle has rolled so far under this plan.
    pub fn until_rolled(&self, metres: f64) {
        let rolled = |seen: &Seen| (seen.distance() > metres).then_some(());
        self.until(&format!("{metres} m"), rolled);
    }

    /// Waits until a vehicle that drove only rolls out: without a supervisor nobody hears its truth for long.
    pub fn until_stands(&self) {
        self.until("standstill", |seen| (seen.truth.last()?.speed.abs() < ROLLING_OUT).then_some(()));
    }

    /// Waits until the stack is in `mode`, with all processes healthy and the pose known.
    pub fn until_recovered(&self, mode: Mode, since: Nanos) -> Nanos {
        self.until(&format!("recovery to {mode}"), |seen| {
            let state = seen.in_mode(mode).filter(|state| state.healthy && state.sent > since)?;
            let known = seen.odometry.last()?;
            (known.valid && known.stamp > since).then_some(state.sent.max(known.stamp))
        })
    }

    /// Tells a vehicle that stands where it is: in metres and degrees.
    pub fn fix(&self, x: &str, y: &str, yaw: &str) {
        self.until("standstill", |seen| seen.odometry.last()?.standstill.then_some(()));
        self.must(&["fix", x, y, yaw]);
    }

    /// The pid of a process; waits for it.
    pub fn pid(&self, process: Process) -> u32 {
        let path = self.instance().process_lock(process);
        self.poll(&format!("process {process}"), || FileLock::holder(&path))
    }

    /// Signals a process; returns the pid, and when it was done.
    pub fn signal(&self, process: Process, signal: Signal) -> (u32, Nanos) {
        let pid = self.pid(process);
        send(pid, signal);
        (pid, now())
    }

    /// Signals the process the person started.
    pub fn signal_main(&self, signal: Signal) -> Nanos {
        send(self.child.id(), signal);
        now()
    }

    /// Has somebody inhibit motion for so long.
    pub fn inhibit(&mut self, span: Duration) {
        self.observer.inhibit(span);
    }

    /// Runs another verb on this stack.
    pub fn verb(&self, arguments: &[&str]) -> Outcome {
        self.begin(arguments).end()
    }

    /// The same, which takes its time.
    pub fn begin(&self, arguments: &[&str]) -> Verb {
        let mut command = self.sandbox.kerbside();
        let (verb, rest) = arguments.split_first().unwrap();
        command.args([verb, "--json", "--instance", self.instance().name()]).args(rest);
        Verb::start(command)
    }

    /// The same, which must do what it was asked.
    pub fn must(&self, arguments: &[&str]) -> Value {
        let outcome = self.verb(arguments);
        assert_eq!(outcome.code, Some(0), "{arguments:?}: {outcome:?}\n{}", self.tale());
        outcome.json
    }

    /// Waits for the end of what the person started, and holds it against leaving nothing.
    pub fn end(self) -> Outcome {
        let (outcome, sandbox) = self.end_and_keep();
        sandbox.assert_empty();
        outcome
    }

    /// Waits for the end of what the person started; what it left stays.
    pub fn end_and_keep(mut self) -> (Outcome, Sandbox) {
        let ended = poll(PATIENCE, || self.child.try_wait().unwrap());
        let Some(status) = ended else { panic!("it does not end\n{}", self.tale()) };
        let read = |name: &str| fs::read_to_string(self.sandbox.file(name)).unwrap();
        let (stdout, stderr) = (read("stdout"), read("stderr"));
        let json = serde_json::from_str(&stdout).unwrap_or_default();
        let seen = self.observer.seen();
        drop(self.observer);
        (Outcome { code: status.code(), json, stderr, seen }, self.sandbox)
    }

    /// Ends a stack of `up` in order.
    pub fn down(self) -> Outcome {
        self.must(&["down"]);
        self.end()
    }

    /// Waits for something that nobody tells.
    ///
    /// # Panics
    /// Where it does not come.
    pub fn poll<T>(&self, what: &str, look: impl FnMut() -> Option<T>) -> T {
        poll(PATIENCE, look).unwrap_or_else(|| panic!("{what} does not come\n{}", self.tale()))
    }

    /// What happened, for a test that failed.
    pub fn tale(&self) -> String {
        let seen = self.seen();
        let stderr = fs::read_to_string(self.sandbox.file("stderr")).unwrap_or_default();
        let (truth, odometry) = (seen.truth.last(), seen.odometry.last());
        format!("state {:#?}\ntruth {truth:?}\nodometry {odometry:?}\n{stderr}", seen.state())
    }
}

impl From<Output> for Outcome {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code(),
            json: serde_json::from_slice(&output.stdout).unwrap_or_default(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
            seen: Seen::default(),
        }
    }
}

/// A verb that runs.
#[derive(Debug)]
pub struct Verb(Child);

impl Verb {
    /// Starts it.
    pub fn start(mut command: Command) -> Self {
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(command.spawn().unwrap())
    }

    /// Waits for its end.
    ///
    /// # Panics
    /// Where it does not come.
    pub fn end(mut self) -> Outcome {
        let ended = poll(PATIENCE, || self.0.try_wait().unwrap());
        if ended.is_none() {
            self.0.kill().unwrap();
        }
        let outcome = self.0.wait_with_output().unwrap().into();
        assert!(ended.is_some(), "a verb does not end: {outcome:?}");
        outcome
    }
}

/// Looks again and again; none after `bound`.
pub fn poll<T>(bound: Duration, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let deadline = now() + u64::try_from(bound.as_nanos()).unwrap();
    let mut pause = Ticker::new(LOOK);
    loop {
        let found = look();
        if found.is_some() || now() > deadline {
            return found;
        }
        pause.wait();
    }
}

/// Sends a signal to a process that a test started.
pub fn send(pid: u32, signal: Signal) {
    let pid = Pid::from_raw(i32::try_from(pid).unwrap()).unwrap();
    kill_process(pid, signal).unwrap();
}
