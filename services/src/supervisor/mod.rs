//! The supervisor: starts, watches, permits, restarts. The decisions are `kerbside_safety`'s; this acts them out.
//!
//! Topics in: every `heartbeat`, `odometry`, `command`, `actuator`, `inhibit`, and the operator's requests.
//! Topics out: `permit` and `state` each cycle, `restore` to a restarted estimator.

mod children;
mod ports;
mod sweeper;
mod systemd;

use core::time::Duration;
use std::collections::BTreeMap;

use kerbside_messages::{MAX_ROWS, Mode, OperatorAnswer, OperatorRequest, Process, Verb};
use kerbside_runtime::{Asked, FileLock, Services, Ticker, kill, now};
use kerbside_safety::{Action, Actions, Event, Supervised, Supervisor, bounds};
use tokio::signal::unix::{SignalKind, signal};
use tokio::time::MissedTickBehavior;

use crate::exit::{Exit, Failure};
use crate::gateway::Rights;
use crate::life::{self, Service};
use children::Children;
use ports::Ports;
use sweeper::Sweeper;
use systemd::Systemd;

/// Longest wait for what an earlier life left to end.
const LEFTOVERS: Duration = Duration::from_secs(2);
// A process without a row in the state would be watched by nobody.
const _: () = assert!(Process::SUPERVISED.len() <= MAX_ROWS);

/// Time between looks whether it did.
const LOOK: Duration = Duration::from_millis(1);

/// Runs the supervisor of `service`'s instance until it is told to end.
///
/// # Errors
/// [`Failure`] where the instance is busy or cannot be set up.
pub fn run(service: &Service, ready: impl FnOnce()) -> Result<Exit, Failure> {
    if service.supervised().contains(&Process::Gateway) {
        // Said by whoever a person started, not by a process that dies of it again and again.
        Rights::of(&service.stack.gateway, rustix::process::geteuid().as_raw())?;
    }
    let lock = service.instance.lock()?;
    end_leftovers(service)?;
    let services = Services::create(&service.instance)?;
    life::enter_realtime(service, Process::Supervisor);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(Failure::internal)?;
    let local = tokio::task::LocalSet::new();
    let exit = local.block_on(&runtime, Acting::new(service, &services)?.run(ready))?;
    drop(services);
    service.instance.remove()?;
    drop(lock);
    Ok(exit)
}

/// Ends processes of an earlier life of this instance, whose supervisor died.
fn end_leftovers(service: &Service) -> Result<(), Failure> {
    let deadline = now() + u64::try_from(LEFTOVERS.as_nanos()).unwrap_or(0);
    for process in Process::SUPERVISED {
        let path = service.instance.process_lock(process);
        let external = service.is_external(process);
        let mut look = Ticker::new(LOOK);
        let mut said = None;
        while let Some(pid) = FileLock::holder(&path).filter(|_| !external) {
            if said != Some(pid) {
                tracing::warn!(%process, pid, "ending what an earlier supervisor left");
                said = Some(pid);
            }
            kill(pid);
            if now() > deadline {
                return Err(Failure::unavailable(format!(
                    "{process} (pid {pid}) of an earlier life does not end"
                )));
            }
            look.wait();
        }
    }
    Ok(())
}

/// Everything the supervisor holds while it runs.
struct Acting<'a> {
    service: &'a Service,
    ports: Ports,
    supervisor: Supervisor,
    actions: Actions,
    children: Children,
    sweeper: Sweeper,
    asked: BTreeMap<u64, Asked<OperatorRequest, OperatorAnswer>>,
    next_id: u64,
    systemd: Systemd,
    finished: Option<u8>,
}

impl<'a> Acting<'a> {
    fn new(service: &'a Service, services: &Services) -> Result<Self, Failure> {
        let external = |process| Supervised { process, external: service.is_external(process) };
        let supervised: Vec<_> = service.supervised().into_iter().map(external).collect();
        let safety = service.safety();
        let stop = bounds::stop_times(&service.vehicle, safety);
        Ok(Self {
            service,
            ports: Ports::open(services.session())?,
            supervisor: Supervisor::new(safety, &supervised, stop, std::process::id()),
            actions: Actions::default(),
            children: Children::new(service),
            sweeper: Sweeper::start(&service.instance)?,
            asked: BTreeMap::new(),
            next_id: 1,
            systemd: Systemd::from_environment(),
            finished: None,
        })
    }

    async fn run(mut self, ready: impl FnOnce()) -> Result<Exit, Failure> {
        let mut cycle = tokio::time::interval(self.service.safety().cycle);
        cycle.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut interrupt = signal(SignalKind::interrupt()).map_err(Failure::internal)?;
        let mut terminate = signal(SignalKind::terminate()).map_err(Failure::internal)?;
        let mut hangup = signal(SignalKind::hangup()).map_err(Failure::internal)?;
        let door = self.ports.door().map_err(Failure::internal)?;
        let mut ready = Some(ready);
        let exit = loop {
            let mut tick = false;
            tokio::select! {
                _ = cycle.tick() => tick = true,
                Some((process, exit)) = self.children.exited() => {
                    self.event(Event::Exited { process, exit });
                }
                () = door.wait() => {}
                _ = interrupt.recv() => self.event(Event::Shutdown),
                _ = terminate.recv() => self.event(Event::Shutdown),
                _ = hangup.recv() => self.event(Event::Shutdown),
            }
            self.take_in();
            if tick {
                self.event(Event::Tick);
                self.publish();
            }
            if self.supervisor.mode() == Mode::Ready
                && let Some(ready) = ready.take()
            {
                ready();
            }
            if let Some(exit) = self.finished {
                break exit;
            }
        };
        self.systemd.stopping();
        self.children.reap().await;
        Ok(if exit == 0 { Exit::Good } else { Exit::Bad })
    }

    /// Hands everything that arrived to the state machine.
    fn take_in(&mut self) {
        self.ports.drain_door();
        while let Some(beat) = self.ports.heartbeat() {
            self.event(Event::Heartbeat(&beat));
        }
        while let Some(odometry) = self.ports.odometry.receive() {
            self.event(Event::Odometry(&odometry));
        }
        while let Some(command) = self.ports.command.receive() {
            self.event(Event::Command(&command));
        }
        while let Some(actuator) = self.ports.actuator.receive() {
            self.event(Event::Actuator(&actuator));
        }
        while let Some(inhibit) = self.ports.inhibit.receive() {
            self.event(Event::Inhibit(&inhibit));
        }
        while let Some(asked) = self.ports.operator.receive() {
            self.ask(asked);
        }
    }

    /// Requests get ids of our own: two clients may have chosen the same.
    fn ask(&mut self, asked: Asked<OperatorRequest, OperatorAnswer>) {
        let id = self.next_id;
        self.next_id += 1;
        let mut request = *asked.request();
        request.id = id;
        let verb = Verb::from_code(request.verb).map_or("unknown", Verb::name);
        tracing::info!(verb, pid = request.pid, "operator asks");
        self.asked.insert(id, asked);
        if let Some(event) = Event::of_request(&request) {
            self.event(event);
        }
    }

    fn event(&mut self, event: Event<'_>) {
        self.supervisor.step(now(), event, &mut self.actions);
        // Spawning leads to events of its own, which use the buffer again: work on a copy.
        let actions = self.actions.clone();
        for action in actions.iter() {
            self.act(action);
        }
    }

    fn act(&mut self, action: &Action) {
        match action {
            Action::Spawn(process) => match self.children.spawn(*process) {
                Ok(pid) => self.event(Event::Spawned { process: *process, pid }),
                Err(error) => {
                    tracing::error!(%process, %error, "cannot be started");
                    self.event(Event::SpawnFailed { process: *process });
                }
            },
            Action::Terminate(process) => self.children.terminate(*process),
            Action::Kill(process) => {
                tracing::warn!(%process, "killed: it no longer answers");
                self.children.kill(*process);
            }
            Action::CleanUp => self.sweeper.sweep(),
            Action::PublishRestore => {
                if let Some(odometry) = self.supervisor.restore() {
                    self.ports.publish_restore(odometry);
                }
            }
            Action::Answer(answer) => self.answer(answer),
            Action::Entered { mode, cause, culprit } => {
                let culprit = culprit.map(Process::name);
                tracing::info!(%mode, %cause, culprit, "mode");
            }
            Action::Failed { process, cause } => tracing::warn!(%process, %cause, "failed"),
            Action::Finished { exit } => self.finished = Some(*exit),
        }
    }

    fn answer(&mut self, answer: &kerbside_safety::Answer) {
        let Some(asked) = self.asked.remove(&answer.id) else { return };
        let message = OperatorAnswer { id: asked.request().id, ..answer.message() };
        if let Err(error) = asked.answer(message) {
            tracing::warn!(%error, "an operator went away before its answer");
        }
    }

    fn publish(&mut self) {
        self.ports.publish_permit(|permit| self.supervisor.fill_permit(permit));
        self.ports.publish_state(|state| self.supervisor.fill_state(state));
        let supervisor = &self.supervisor;
        self.systemd.tell(now(), supervisor.mode(), |state| supervisor.fill_state(state));
    }
}
