//! The life of a supervised process: joining, beating, and ending in order.

use core::time::Duration;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use kerbside_messages::{Header, Heartbeat, Message, Nanos, Process, Refusals, State};
use kerbside_runtime::{
    FileLock, Listener, LockError, Newest, Publisher, RealtimeReport, RealtimeRequest, Session,
    SessionError, Subscriber, Ticker, now,
};
use kerbside_safety::{LoopMonitor, SafetySettings, Timeouts};
use kerbside_settings::InterfaceSettings;
use signal_hook::consts::{SIGINT, SIGTERM};

pub use crate::service::Service;

use crate::exit::{Exit, Failure};
use crate::parent;

/// Time between looks for what is not there yet.
const RETRY: Duration = Duration::from_millis(20);

/// A process's part in its instance: signs of life, and the reasons to end.
#[derive(Debug)]
pub struct Life {
    session: Session,
    safety: SafetySettings,
    monitor: LoopMonitor,
    heartbeat: Publisher<Heartbeat>,
    state: Newest<State>,
    heard: Nanos,
    stop: Arc<AtomicBool>,
    exit: Exit,
    in_step: bool,
    replays: bool,
    external: bool,
    supervisor: Option<u32>,
    failed: Option<Nanos>,
    _lock: FileLock,
}

impl Life {
    /// Joins the instance, waiting for its supervisor and saying so. `checkpoints` are passed in each step.
    ///
    /// # Errors
    /// [`Failure`] where another copy of the process runs, or the middleware refuses.
    pub fn join(service: &Service, checkpoints: u32) -> Result<Self, Failure> {
        let stop = stop_flag()?;
        service.instance.create_folder()?;
        let lock = take_lock(service)?;
        let process = service.process;
        let mut waiting = Waiting::new(&stop, service.args.supervisor);
        let session = waiting.until(|| Session::join(&service.instance, process))?;
        let heartbeat = waiting.until(|| session.publisher::<Heartbeat>(Some(process)))?;
        let state = waiting.until(|| session.subscriber::<State>(None, 1))?;
        let safety = service.safety().clone();
        let realtime = enter_realtime(service, process);
        let mut monitor =
            LoopMonitor::new(process, std::process::id(), &safety.timeouts, checkpoints);
        monitor.set_realtime(realtime.scheduled);
        Ok(Self {
            session,
            safety,
            monitor,
            heartbeat,
            state: Newest::of(state),
            heard: now(),
            stop,
            exit: Exit::Good,
            in_step: false,
            replays: service.replays(),
            external: service.is_external(process),
            supervisor: service.args.supervisor,
            failed: None,
            _lock: lock,
        })
    }

    /// Opens a port, waiting for its service.
    ///
    /// # Errors
    /// [`Failure`] where the middleware refuses.
    pub fn open<T>(
        &self,
        open: impl Fn(&Session) -> Result<T, SessionError>,
    ) -> Result<T, Failure> {
        Waiting::new(&self.stop, self.supervisor).until(|| open(&self.session))
    }

    /// A subscriber that keeps up to `buffer` samples.
    ///
    /// # Errors
    /// [`Failure`] where the middleware refuses.
    pub fn subscriber<M: Message>(&self, buffer: usize) -> Result<Subscriber<M>, Failure> {
        self.open(|session| session.subscriber(None, buffer))
    }

    /// A publisher.
    ///
    /// # Errors
    /// [`Failure`] where the middleware refuses.
    pub fn publisher<M: Message>(&self) -> Result<Publisher<M>, Failure> {
        self.open(|session| session.publisher(None))
    }

    /// What samples of `M` wake.
    ///
    /// # Errors
    /// [`Failure`] where the middleware refuses.
    pub fn listener<M: Message>(&self) -> Result<Listener, Failure> {
        self.open(Session::listener::<M>)
    }

    /// Supervision and gate, as this instance's rights make them.
    #[must_use]
    pub fn safety(&self) -> &SafetySettings {
        &self.safety
    }

    /// The time-outs.
    #[must_use]
    pub fn timeouts(&self) -> &Timeouts {
        &self.safety.timeouts
    }

    /// Beats where a heartbeat is due; false when the process is to end: it was asked to, or its supervisor is silent.
    pub fn goes_on(&mut self) -> bool {
        let now = now();
        if self.stop.load(Ordering::Relaxed) {
            return false;
        }
        if self.state.update() {
            self.heard = now;
        }
        if now.saturating_sub(self.heard) > nanos(self.safety.timeouts.supervisor_silence) {
            tracing::error!("the supervisor is silent: ending");
            self.exit = Exit::Unavailable;
            return false;
        }
        self.beat(now);
        let window = nanos(self.safety.timeouts.heartbeat_window);
        if self.external && self.failed.is_some_and(|failed| now.saturating_sub(failed) > window) {
            // Nobody else ends it, and whoever started it learns that it has to be started again.
            tracing::error!("own check failed: ending");
            self.exit = Exit::Internal;
            return false;
        }
        true
    }

    fn beat(&mut self, now: Nanos) {
        let mut beat = Heartbeat::default();
        if !self.monitor.beat(now, &mut beat) {
            return;
        }
        let sent = self.heartbeat.send(|out| {
            *out = beat;
            true
        });
        if let Err(error) = sent {
            tracing::error!(%error, "heartbeat lost");
        }
    }

    /// What the supervisor said last.
    #[must_use]
    pub fn state(&self) -> Option<&State> {
        self.state.get()
    }

    /// When a sample arrived, for [`Life::begin`]: what it says itself, `arrival`; but in a replay that is a time of
    /// then, and the deadline counts from when the sample was handed over.
    #[must_use]
    pub fn arrival(&self, arrival: Nanos, header: &Header) -> Nanos {
        if self.replays { header.sent } else { arrival }
    }

    /// A sample that arrived at `arrival` is about to be worked on: begins a step, or joins the one under way.
    pub fn begin(&mut self, arrival: Nanos) {
        if self.in_step {
            self.monitor.arrived(arrival);
        } else {
            self.in_step = true;
            self.monitor.begin(now(), arrival);
        }
    }

    /// The step under way, if one is, passes a checkpoint.
    pub fn checkpoint(&mut self, index: u32) {
        if self.in_step {
            self.monitor.checkpoint(index);
        }
    }

    /// The step under way, if one is, ends.
    pub fn end(&mut self) {
        if core::mem::take(&mut self.in_step) {
            self.monitor.end(now());
        }
    }

    /// The loop runs, with all it needs; or says what it waits for.
    pub fn waits_for(&mut self, what: Option<&str>) {
        self.monitor.set_ready(what.is_none(), what.unwrap_or_default());
    }

    /// What the process's input refused and lost so far.
    pub fn counts(&mut self, refusals: &Refusals) {
        self.monitor.set_counts(refusals.total(), refusals.lost);
    }

    /// The process failed its own check: one more heartbeat says why, then it falls silent.
    pub fn fail(&mut self, why: &str) {
        self.monitor.fail(why);
        self.failed.get_or_insert(now());
    }

    /// How the process ends.
    #[must_use]
    pub fn exit(&self) -> Exit {
        self.exit
    }
}

/// Nanoseconds of a configured duration.
#[must_use]
pub fn nanos(duration: Duration) -> Nanos {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// Set by SIGTERM and SIGINT.
///
/// # Errors
/// [`Failure`] where the handlers cannot be installed.
pub fn stop_flag() -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&flag)).map_err(Failure::internal)?;
    }
    Ok(flag)
}

fn take_lock(service: &Service) -> Result<FileLock, Failure> {
    let process = service.process;
    FileLock::take(&service.instance.process_lock(process)).map_err(|error| match error {
        LockError::Held { pid, .. } => {
            let instance = service.instance.name();
            Failure::unavailable(format!(
                "{process} of instance {instance} already runs as process {pid}"
            ))
        }
        error @ LockError::File { .. } => Failure::unavailable(error),
    })
}

/// Waits for what is not there yet, and says once what it waits for.
struct Waiting<'a> {
    stop: &'a AtomicBool,
    supervisor: Option<u32>,
    said: String,
}

impl<'a> Waiting<'a> {
    /// Until `stop` is set, or the supervisor that started this process is dead.
    fn new(stop: &'a AtomicBool, supervisor: Option<u32>) -> Self {
        Self { stop, supervisor, said: String::new() }
    }

    fn until<T>(
        &mut self,
        mut attempt: impl FnMut() -> Result<T, SessionError>,
    ) -> Result<T, Failure> {
        let mut retry = Ticker::new(RETRY);
        loop {
            match attempt() {
                Err(error) if error.is_missing() => self.say(&error.to_string()),
                other => return other.map_err(Into::into),
            }
            if self.stop.load(Ordering::Relaxed) {
                return Err(Failure::unavailable(format!("ended while waiting: {}", self.said)));
            }
            if self.supervisor.is_some_and(|pid| !parent::is_alive(pid)) {
                return Err(Failure::unavailable(
                    "the supervisor ended before this process met it",
                ));
            }
            retry.wait();
        }
    }

    fn say(&mut self, what: &str) {
        if self.said != what {
            tracing::info!("waiting: {what}");
            what.clone_into(&mut self.said);
        }
    }
}

/// Real-time rights for the calling thread, as the configuration asks and the rights allow; refusals are said.
pub fn enter_realtime(service: &Service, process: Process) -> RealtimeReport {
    if !service.realtime() || service.stack.interface == InterfaceSettings::Replay {
        return RealtimeReport::default();
    }
    let settings = &service.stack.realtime;
    let timed =
        process.on_control_path() || matches!(process, Process::Supervisor | Process::Vehicle);
    // A sample is worked on by one process after the other, so sharing a core costs the path nothing, and saves it the
    // wake-ups across cores: `kerbside bench pipeline` finds less work and the shorter tail.
    let cores = settings.cores.clone().or_else(|| Some(vec![kerbside_runtime::last_core()?]));
    let cores = cores.filter(|_| process.on_control_path());
    let report = kerbside_runtime::enter_realtime(&RealtimeRequest {
        priority: timed.then_some(settings.priority),
        lock_memory: settings.lock_memory && timed,
        cores: cores.unwrap_or_default(),
    });
    for refused in &report.refused {
        tracing::warn!(refused, "real-time rights not granted");
    }
    report
}

/// The thread that works while another one beats for it.
#[derive(Clone, Debug)]
pub struct Worker {
    progress: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    text: Arc<std::sync::Mutex<String>>,
}

impl Worker {
    /// Something was done: the process is alive.
    pub fn progress(&self) {
        self.progress.fetch_add(1, Ordering::Relaxed);
    }

    /// Whether the process is to end.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// What `status` shows of the process beside its state.
    pub fn says(&self, text: &str) {
        if let Ok(mut said) = self.text.lock() {
            text.clone_into(&mut said);
        }
    }
}

/// Runs a process whose work comes in lumps: `work` is called again and again on a thread of its own, with what
/// `open` made there, and calls [`Worker::progress`] at least every slow window; this thread beats.
///
/// # Errors
/// [`Failure`] where the process cannot take part.
pub fn run_with_worker<P>(
    service: &Service,
    open: impl Fn(&Session, &Service) -> Result<P, SessionError> + Send + 'static,
    mut work: impl FnMut(&mut P, &Worker) + Send + 'static,
) -> Result<Exit, Failure> {
    let mut life = Life::join(service, 0)?;
    let worker = Worker { progress: Arc::default(), stop: Arc::default(), text: Arc::default() };
    let thread = {
        let (worker, service) = (worker.clone(), service.clone());
        let body = move || {
            let (session, mut ports) = match open_for_worker(&service, &worker, &open) {
                Ok(opened) => opened,
                Err(failure) => return tracing::error!("{}", failure.report),
            };
            worker.progress();
            while !worker.is_stopped() {
                work(&mut ports, &worker);
            }
            drop((ports, session));
        };
        std::thread::Builder::new()
            .name("worker".to_owned())
            .spawn(body)
            .map_err(Failure::internal)?
    };
    let window = nanos(life.timeouts().slow_window);
    let (mut seen, mut since, mut looked) = (0, now(), now());
    let mut tick = Ticker::new(life.timeouts().heartbeat);
    while life.goes_on() && !thread.is_finished() {
        let progress = worker.progress.load(Ordering::Relaxed);
        // A process that was stopped as a whole is given its time again.
        let was_stopped = now().saturating_sub(looked) > window / 2;
        looked = now();
        if progress != seen || was_stopped {
            (seen, since) = (progress, looked);
        } else if looked.saturating_sub(since) > window {
            life.fail("the work makes no progress");
        }
        let text = worker.text.lock().map(|text| text.clone()).unwrap_or_default();
        life.waits_for(if seen == 0 { Some("its ports") } else { None });
        life.monitor.set_text(&text);
        tick.wait();
    }
    let died = thread.is_finished();
    worker.stop.store(true, Ordering::Relaxed);
    let _ = thread.join();
    if died { Err(Failure::internal("the working thread ended")) } else { Ok(life.exit()) }
}

fn open_for_worker<P>(
    service: &Service,
    worker: &Worker,
    open: impl Fn(&Session, &Service) -> Result<P, SessionError>,
) -> Result<(Session, P), Failure> {
    let mut waiting = Waiting::new(&worker.stop, service.args.supervisor);
    let session = waiting.until(|| Session::join(&service.instance, service.process))?;
    let ports = waiting.until(|| open(&session, service))?;
    Ok((session, ports))
}
