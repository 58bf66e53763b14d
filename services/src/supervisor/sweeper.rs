//! Sweeps what dead processes left in the middleware, on a thread of its own: a sweep takes milliseconds, and the
//! supervisor's permits live for 40.

use core::time::Duration;
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;

use kerbside_messages::Process;
use kerbside_runtime::{Instance, Session};

use crate::exit::Failure;

/// Tools and processes that others wrote die unseen: what they left is swept after so long at most.
const UNASKED: Duration = Duration::from_secs(5);
/// A sweep that left something is followed by another after so long.
const AGAIN: Duration = Duration::from_millis(200);

/// The sweeping thread; ends when dropped.
#[derive(Debug)]
pub struct Sweeper {
    sender: Option<SyncSender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Sweeper {
    /// Starts the thread with a node of its own.
    pub fn start(instance: &Instance) -> Result<Self, Failure> {
        let (sender, receiver) = sync_channel(1);
        let instance = instance.clone();
        let thread = std::thread::Builder::new()
            .name("sweeper".to_owned())
            .spawn(move || {
                let session = match Session::join(&instance, Process::Supervisor) {
                    Ok(session) => session,
                    Err(error) => return tracing::error!(%error, "no sweeping"),
                };
                let mut wait = UNASKED;
                while receiver.recv_timeout(wait) != Err(RecvTimeoutError::Disconnected) {
                    let report = session.sweep();
                    tracing::debug!(?report, "swept");
                    wait = if report.left > 0 { AGAIN } else { UNASKED };
                }
            })
            .map_err(Failure::internal)?;
        Ok(Self { sender: Some(sender), thread: Some(thread) })
    }

    /// Asks for a sweep; one that waits already serves this one too.
    pub fn sweep(&self) {
        if let Some(sender) = &self.sender {
            let _ = sender.try_send(());
        }
    }
}

impl Drop for Sweeper {
    fn drop(&mut self) {
        self.sender = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
