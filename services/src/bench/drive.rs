//! A stack that drives for a bench, in an instance of its own, and what is watched of it.

use core::time::Duration;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};

use kerbside_messages::{Command, Mode, Nanos, Process, Raw, State};
use kerbside_runtime::{Instance, Newest, Session, SessionError, Subscriber, Ticker, now};

use super::chain::PATH;
use crate::exit::Failure;
use crate::output;

/// Longest wait for the car to drive \[ns\].
const START: Nanos = 30_000_000_000;

/// A stack that drives, in an instance of its own.
#[derive(Debug)]
pub struct Drive {
    park: Child,
    /// Its instance.
    pub instance: Instance,
    folder: PathBuf,
}

impl Drive {
    /// Starts to park in `scenario`, with this stack's file.
    ///
    /// # Errors
    /// [`Failure`] where it cannot be started.
    pub fn start(scenario: &str, text: &str) -> Result<Self, Failure> {
        let folder = std::env::temp_dir().join(format!("kerbside-bench-{}", output::stamp()));
        fs::create_dir_all(&folder).map_err(Failure::internal)?;
        let stack = folder.join("stack.toml");
        output::write(&stack, text)?;
        // The same name each time: a process takes part in one instance only.
        let name = Instance::fresh_name("bench");
        let mut command = super::own_executable();
        command.args(["park", scenario, "--headless", "--rearm", "--json", "--instance", &name]);
        command.arg("--config").arg(&stack).arg("--out").arg(folder.join("out"));
        kerbside_runtime::close_inherited_on_exec();
        let park = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .map_err(Failure::internal)?;
        Ok(Self { park, instance: Instance::named(&name)?, folder })
    }

    /// Joins it, once it is there.
    ///
    /// # Errors
    /// [`Failure`] where it does not come.
    pub fn join(&mut self) -> Result<(Session, Watch), Failure> {
        let deadline = now() + START;
        let mut look = Ticker::new(Duration::from_millis(10));
        loop {
            let joined = Session::join(&self.instance, Process::Operator)
                .and_then(|session| Watch::open(&session).map(|watch| (session, watch)));
            match joined {
                Ok(joined) => return Ok(joined),
                Err(error) if !error.is_missing() => return Err(error.into()),
                Err(error) if now() > deadline => return Err(Failure::unavailable(error)),
                Err(_) => {}
            }
            if !matches!(self.park.try_wait(), Ok(None)) {
                return Err(Failure::unavailable("the stack ended at its start"));
            }
            look.wait();
        }
    }

    /// Waits until the car drives; false when the manoeuvre is over. A car that a busy machine stops is armed again.
    ///
    /// # Errors
    /// [`Failure`] where it does not drive.
    pub fn goes_on(&mut self, watch: &mut Watch, tick: &mut Ticker) -> Result<bool, Failure> {
        let deadline = now() + START;
        loop {
            watch.take_in();
            if watch.drives() {
                return Ok(true);
            }
            if !matches!(self.park.try_wait(), Ok(None)) || watch.mode() == Some(Mode::Done) {
                return Ok(false);
            }
            if now() > deadline {
                return Err(Failure::unavailable("the car did not drive"));
            }
            tick.wait();
        }
    }
}

impl Drop for Drive {
    fn drop(&mut self) {
        kerbside_runtime::terminate(self.park.id());
        let _ = self.park.wait();
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// What is watched of the stack.
#[derive(Debug)]
pub struct Watch {
    state: Newest<State>,
    raw: Subscriber<Raw>,
    command: Subscriber<Command>,
    /// Sequence of the newest reading.
    pub readings: u64,
}

impl Watch {
    /// Subscribes.
    ///
    /// # Errors
    /// [`SessionError`] where the middleware refuses.
    pub fn open(session: &Session) -> Result<Self, SessionError> {
        Ok(Self {
            state: Newest::of(session.subscriber(None, 1)?),
            raw: session.subscriber(None, 512)?,
            command: session.subscriber(None, 256)?,
            readings: 0,
        })
    }

    /// Takes in what came; the latencies of the commands among it.
    pub fn take_in(&mut self) -> Vec<Nanos> {
        self.state.update();
        while let Some(raw) = self.raw.receive() {
            self.readings = raw.header.sequence;
        }
        let latency = |command: kerbside_runtime::Received<Command>| {
            command.header.sent.saturating_sub(command.header.origin)
        };
        core::iter::from_fn(|| self.command.receive()).map(latency).collect()
    }

    /// The stack's mode.
    #[must_use]
    pub fn mode(&self) -> Option<Mode> {
        self.state.get().map(State::mode)
    }

    /// Whether the car drives.
    #[must_use]
    pub fn drives(&self) -> bool {
        self.mode() == Some(Mode::Driving)
    }

    /// The pids of the control path.
    #[must_use]
    pub fn pids(&self) -> Vec<(Process, u32)> {
        let rows = self.state.get().map(State::rows).unwrap_or_default();
        let pid_of = |process: Process| {
            let row = rows.iter().find(|row| row.process == process as u8)?;
            Some((process, row.pid))
        };
        PATH.into_iter().filter_map(pid_of).collect()
    }
}

/// What the kernel accounts to processes so far, and the readings they worked on.
#[derive(Debug)]
pub struct Account {
    work: Vec<Nanos>,
    readings: u64,
}

impl Account {
    /// Of these processes.
    #[must_use]
    pub fn of(pids: &[(Process, u32)], readings: u64) -> Self {
        Self { work: pids.iter().map(|(_, pid)| execution_time(*pid)).collect(), readings }
    }

    /// Work of each process per reading since `before` \[us\].
    #[must_use]
    pub fn since(&self, before: &Self) -> Option<Vec<f64>> {
        let readings = self.readings.checked_sub(before.readings).filter(|count| *count > 0)?;
        #[allow(clippy::cast_precision_loss)] // far below 2^53
        let each = |(now, before): (&Nanos, &Nanos)| {
            now.saturating_sub(*before) as f64 / readings as f64 / 1e3
        };
        Some(self.work.iter().zip(&before.work).map(each).collect())
    }
}

/// Time a process spent executing, in user code and in the kernel \[ns\].
fn execution_time(pid: u32) -> Nanos {
    let text = fs::read_to_string(Path::new("/proc").join(pid.to_string()).join("schedstat"));
    text.ok()
        .and_then(|text| text.split_whitespace().next().and_then(|word| word.parse().ok()))
        .unwrap_or(0)
}
