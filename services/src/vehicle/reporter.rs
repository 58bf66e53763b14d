//! Publishes the truth, on a thread of its own: joining an instance takes longer than a reading's period.

use core::time::Duration;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;

use kerbside_messages::{Nanos, Process, State, Truth};
use kerbside_runtime::{Instance, Newest, Publisher, Session, SessionError, now};

use crate::exit::Failure;

/// Truths that may wait; more are dropped: the vehicle waits for nobody.
const QUEUE: usize = 64;
/// Without a state for so long the instance is left, until a supervisor is back.
const SILENCE: Nanos = 1_000_000_000;
/// Time between attempts to join \[ns\].
const RETRY: Nanos = 100_000_000;

/// The reporting thread; ends when dropped.
#[derive(Debug)]
pub struct Reporter {
    sender: Option<SyncSender<Truth>>,
    thread: Option<JoinHandle<()>>,
}

impl Reporter {
    /// Starts the thread.
    pub fn start(instance: &Instance) -> Result<Self, Failure> {
        let (sender, receiver) = sync_channel(QUEUE);
        let instance = instance.clone();
        let thread = std::thread::Builder::new()
            .name("reporter".to_owned())
            .spawn(move || report(&instance, &receiver))
            .map_err(Failure::internal)?;
        Ok(Self { sender: Some(sender), thread: Some(thread) })
    }

    /// Hands a truth over, or drops it.
    pub fn tell(&self, truth: &Truth) {
        if let Some(sender) = &self.sender {
            let _ = sender.try_send(*truth);
        }
    }
}

impl Drop for Reporter {
    fn drop(&mut self) {
        self.sender = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Attached {
    truth: Publisher<Truth>,
    state: Newest<State>,
    heard: Nanos,
    _session: Session,
}

impl Attached {
    fn join(instance: &Instance) -> Result<Self, SessionError> {
        let session = Session::join(instance, Process::Vehicle)?;
        let truth = session.publisher(None)?;
        let state = Newest::of(session.subscriber(None, 1)?);
        Ok(Self { truth, state, heard: now(), _session: session })
    }

    /// Whether the instance's supervisor still speaks.
    fn is_alive(&mut self) -> bool {
        let now = now();
        if self.state.update() {
            self.heard = now;
        }
        now.saturating_sub(self.heard) <= SILENCE
    }

    fn publish(&mut self, content: &Truth) {
        let sent = self.truth.send(|truth| {
            *truth = *content;
            true
        });
        if let Err(error) = sent {
            tracing::debug!(%error, "truth lost");
        }
    }
}

fn report(instance: &Instance, receiver: &Receiver<Truth>) {
    let mut attached: Option<Attached> = None;
    let mut next = 0;
    loop {
        match receiver.recv_timeout(Duration::from_millis(100)) {
            Ok(truth) => attached.iter_mut().for_each(|attached| attached.publish(&truth)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        if attached.as_mut().is_some_and(|attached| !attached.is_alive()) {
            tracing::warn!("the supervisor is silent: driving on without it");
            attached = None;
        }
        if attached.is_none() && now() >= next {
            next = now() + RETRY;
            attached = Attached::join(instance).ok();
        }
    }
}
