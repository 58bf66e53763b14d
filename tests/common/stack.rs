//! A stack as a person starts it: `park` or `up`, with its verbs, its processes, and its end.

use core::time::Duration;
use std::fs::{self, File};
use std::process::{Child, Command, Output, Stdio};

use kerbside_messages::{Mode, Nanos, Process};
use kerbside_runtime::{FileLock, Instance, Ticker, now};
use rustix::process::{Pid, kill_process};
use serde_json::Value;

pub(crate) use rustix::process::Signal;

use super::disturbance::end_if_stalled;
use super::judging::ROLLING_OUT;
use super::observer::Observer;
use super::{PATIENCE, Sandbox, Seen};

/// Time between looks at what cannot be waited for.
const LOOK: Duration = Duration::from_millis(5);

/// A running stack with its observer.
#[derive(Debug)]
pub(crate) struct Stack {
    // Ended in this order.
    observer: Observer,
    child: Child,
    sandbox: Sandbox,
}

/// How a verb ended.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    pub(crate) code: Option<i32>,
    /// What it printed with `--json`; null where that is none.
    pub(crate) json: Value,
    pub(crate) stderr: String,
    /// What the observer saw of a stack; empty for a verb.
    pub(crate) seen: Seen,
}

impl Outcome {
    /// The verdict must be good; the attempt ends where the machine stalled somebody else than the harmed process.
    pub(crate) fn assert_good(&self, harmed: Option<Process>) {
        if self.code != Some(0) {
            end_if_stalled(self.cause(), harmed);
        }
        assert_eq!(self.code, Some(0), "{self:?}");
    }

    /// Its verdict in words.
    pub(crate) fn cause(&self) -> &str {
        self.json["cause"].as_str().unwrap_or_default()
    }
}

impl Stack {
    /// `park` with these arguments.
    pub(crate) fn park(arguments: &[&str]) -> Self {
        Self::park_in(Sandbox::new(), arguments)
    }

    /// The same in a certain sandbox.
    pub(crate) fn park_in(sandbox: Sandbox, arguments: &[&str]) -> Self {
        let mut verb = vec!["park", "--headless", "--json"];
        verb.extend(arguments);
        Self::start(sandbox, &verb)
    }

    /// `replay` with these arguments.
    pub(crate) fn replay(arguments: &[&str]) -> Self {
        let mut verb = vec!["replay", "--json"];
        verb.extend(arguments);
        Self::start(Sandbox::new(), &verb)
    }

    /// `up --simulate` with these arguments.
    pub(crate) fn up(arguments: &[&str]) -> Self {
        Self::up_in(Sandbox::new(), arguments)
    }

    /// `up --simulate` once more in a sandbox whose first supervisor ended.
    pub(crate) fn up_in(sandbox: Sandbox, arguments: &[&str]) -> Self {
        let mut verb = vec!["up", "--simulate"];
        verb.extend(arguments);
        Self::start(sandbox, &verb)
    }

    /// Any verb that runs a stack.
    pub(crate) fn start(sandbox: Sandbox, verb: &[&str]) -> Self {
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
    pub(crate) fn sandbox(&self) -> &Sandbox {
        &self.sandbox
    }

    /// The instance.
    pub(crate) fn instance(&self) -> Instance {
        self.sandbox.instance()
    }

    /// Everything seen so far.
    pub(crate) fn seen(&self) -> Seen {
        self.observer.seen()
    }

    /// Waits until `found` finds `what` in what was seen.
    ///
    /// # Panics
    /// Where it does not come.
    pub(crate) fn until<T>(&self, what: &str, found: impl Fn(&Seen) -> Option<T>) -> T {
        let result = self.observer.wait(PATIENCE, found);
        result.unwrap_or_else(|| panic!("{what} does not come\n{}", self.tale()))
    }

    /// Waits for a mode.
    pub(crate) fn until_mode(&self, mode: Mode) {
        self.until(mode.name(), |seen| seen.in_mode(mode).map(|_| ()));
    }

    /// Waits until the vehicle drives and has rolled so far since its start.
    pub(crate) fn until_driving(&self, metres: f64) {
        let called = now();
        let halted = [Mode::Stopping, Mode::Faulted, Mode::Down].map(Mode::name);
        let stopped = self.until(&format!("a drive of {metres} m"), |seen| {
            let state = seen.state()?;
            if state.mode == Mode::Driving.name() && seen.distance() > metres {
                return Some(None);
            }
            let stopped = state.sent > called && halted.contains(&state.mode.as_str());
            stopped.then(|| Some(state.clone()))
        });
        if let Some(state) = stopped {
            end_if_stalled(&format!("{}: {}", state.cause, state.words), None);
            panic!("it stopped by itself\n{}", self.tale());
        }
    }

    /// Waits until a vehicle that drove only rolls out: without a supervisor nobody hears its truth for long.
    pub(crate) fn until_stands(&self) {
        self.until("standstill", |seen| {
            (seen.truth.last()?.speed.abs() < ROLLING_OUT).then_some(())
        });
    }

    /// Waits until the stack is in `mode`, with all processes healthy and the pose known.
    pub(crate) fn until_recovered(&self, mode: Mode, since: Nanos) -> Nanos {
        self.until(&format!("recovery to {mode}"), |seen| {
            let state = seen.in_mode(mode).filter(|state| state.healthy && state.sent > since)?;
            let known = seen.odometry.last()?;
            (known.valid && known.stamp > since).then_some(state.sent.max(known.stamp))
        })
    }

    /// Waits until the estimate says that the vehicle stands: a restarted process has to see it for a moment.
    pub(crate) fn until_standstill(&self) {
        self.until("standstill", |seen| seen.odometry.last()?.standstill.then_some(()));
    }

    /// Tells a vehicle that stands where it is: in metres and degrees.
    pub(crate) fn fix(&self, x: &str, y: &str, yaw: &str) {
        self.until_standstill();
        self.must(&["fix", x, y, yaw]);
    }

    /// Has a vehicle that stands drive to a scenario's goal.
    pub(crate) fn go(&self, scenario: &str) -> Verb {
        self.until_standstill();
        self.begin(&["go", scenario])
    }

    /// The pid of a process; waits for it.
    pub(crate) fn pid(&self, process: Process) -> u32 {
        let path = self.instance().process_lock(process);
        self.poll(&format!("process {process}"), || FileLock::holder(&path))
    }

    /// Signals a process; returns the pid, and when it was done.
    pub(crate) fn signal(&self, process: Process, signal: Signal) -> (u32, Nanos) {
        let pid = self.pid(process);
        send(pid, signal);
        (pid, now())
    }

    /// Signals the process the person started.
    pub(crate) fn signal_main(&self, signal: Signal) -> Nanos {
        send(self.child.id(), signal);
        now()
    }

    /// Has somebody inhibit motion for so long.
    pub(crate) fn inhibit(&mut self, span: Duration) {
        self.observer.inhibit(span);
    }

    /// Runs another verb on this stack.
    pub(crate) fn verb(&self, arguments: &[&str]) -> Outcome {
        self.begin(arguments).end()
    }

    /// The same, which takes its time.
    pub(crate) fn begin(&self, arguments: &[&str]) -> Verb {
        let mut command = self.sandbox.kerbside();
        let (verb, rest) = arguments.split_first().unwrap();
        command.args([verb, "--json", "--instance", self.instance().name()]).args(rest);
        Verb::start(command)
    }

    /// The same, which must do what it was asked.
    pub(crate) fn must(&self, arguments: &[&str]) -> Value {
        let outcome = self.verb(arguments);
        assert_eq!(outcome.code, Some(0), "{arguments:?}: {outcome:?}\n{}", self.tale());
        outcome.json
    }

    /// Waits for the end of what the person started, and holds it against leaving nothing.
    pub(crate) fn end(self) -> Outcome {
        let (outcome, sandbox) = self.end_and_keep();
        sandbox.assert_empty();
        outcome
    }

    /// Waits for the end of what the person started; what it left stays.
    pub(crate) fn end_and_keep(mut self) -> (Outcome, Sandbox) {
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
    pub(crate) fn down(self) -> Outcome {
        self.must(&["down"]);
        self.end()
    }

    /// Waits for something that nobody tells.
    ///
    /// # Panics
    /// Where it does not come.
    pub(crate) fn poll<T>(&self, what: &str, look: impl FnMut() -> Option<T>) -> T {
        poll(PATIENCE, look).unwrap_or_else(|| panic!("{what} does not come\n{}", self.tale()))
    }

    /// What happened, for a test that failed.
    pub(crate) fn tale(&self) -> String {
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
pub(crate) struct Verb(Child);

impl Verb {
    /// Starts it.
    pub(crate) fn start(mut command: Command) -> Self {
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(command.spawn().unwrap())
    }

    /// Waits for its end.
    ///
    /// # Panics
    /// Where it does not come.
    pub(crate) fn end(mut self) -> Outcome {
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
pub(crate) fn poll<T>(bound: Duration, mut look: impl FnMut() -> Option<T>) -> Option<T> {
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
pub(crate) fn send(pid: u32, signal: Signal) {
    let pid = Pid::from_raw(i32::try_from(pid).unwrap()).unwrap();
    kill_process(pid, signal).unwrap();
}
