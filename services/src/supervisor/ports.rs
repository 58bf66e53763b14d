//! The supervisor's ports.

use kerbside_messages::{
    Actuator, Command, Heartbeat, Inhibit, Odometry, OperatorAnswer, OperatorRequest, Permit,
    Process, Restore, State,
};
use kerbside_runtime::{
    Listener, Publisher, Readiness, Received, RuntimeError, Server, Session, SessionError,
    Subscriber,
};

/// Samples a supervisor may fall behind of topics of which the newest counts.
const BEHIND: usize = 64;

/// Everything the supervisor reads and writes.
#[derive(Debug)]
pub struct Ports {
    heartbeats: Vec<Subscriber<Heartbeat>>,
    /// Every estimate.
    pub odometry: Subscriber<Odometry>,
    /// The tracker's commands.
    pub command: Subscriber<Command>,
    /// The gate's outputs.
    pub actuator: Subscriber<Actuator>,
    /// Demands to stop.
    pub inhibit: Subscriber<Inhibit>,
    /// Operators' requests.
    pub operator: Server<OperatorRequest, OperatorAnswer>,
    listener: Listener,
    permit: Publisher<Permit>,
    state: Publisher<State>,
    restore: Publisher<Restore>,
}

impl Ports {
    /// Opens all ports.
    pub fn open(session: &Session) -> Result<Self, SessionError> {
        let beats = |process| session.subscriber::<Heartbeat>(Some(process), 16);
        Ok(Self {
            heartbeats: Process::SUPERVISED.into_iter().map(beats).collect::<Result<_, _>>()?,
            odometry: session.subscriber(None, 512)?,
            command: session.subscriber(None, BEHIND)?,
            actuator: session.subscriber(None, BEHIND)?,
            inhibit: session.subscriber(None, 8)?,
            operator: session.server()?,
            listener: session.listener::<OperatorRequest>()?,
            permit: session.publisher(None)?,
            state: session.publisher(None)?,
            restore: session.publisher(None)?,
        })
    }

    /// What wakes the reactor when an operator asks.
    pub fn door(&self) -> std::io::Result<Readiness> {
        Readiness::of(&self.listener)
    }

    /// Forgets the operators' notifications so far.
    pub fn drain_door(&self) {
        self.listener.drain();
    }

    /// The next heartbeat of any process.
    pub fn heartbeat(&mut self) -> Option<Received<Heartbeat>> {
        self.heartbeats.iter_mut().find_map(Subscriber::receive)
    }

    /// Publishes what `fill` writes.
    pub fn publish_permit(&mut self, fill: impl FnOnce(&mut Permit)) {
        said(self.permit.send(|permit| {
            fill(permit);
            true
        }));
    }

    /// Publishes what `fill` writes.
    pub fn publish_state(&mut self, fill: impl FnOnce(&mut State)) {
        said(self.state.send(|state| {
            fill(state);
            true
        }));
    }

    /// Publishes the pose that a restarted estimator is to take up.
    pub fn publish_restore(&mut self, odometry: &Odometry) {
        said(self.restore.send(|restore| {
            restore.header.stamp = odometry.header.stamp;
            restore.odometry = *odometry;
            true
        }));
    }
}

fn said(result: Result<bool, RuntimeError>) {
    if let Err(error) = result {
        tracing::error!(%error, "not published");
    }
}
