//! Waking and waiting. A notification is a hint: whoever wakes drains its subscribers, and every wait is bounded.

use core::time::Duration;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use iceoryx2::port::listener::Listener as ListenerPort;
use iceoryx2::port::notifier::Notifier as NotifierPort;
use iceoryx2::prelude::{FileDescriptorBased, ipc};
use kerbside_messages::Nanos;
use rustix::event::{PollFd, PollFlags, poll};
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

use crate::clock::{now, timespec};

/// Wakes the listeners of a topic.
pub struct Notifier(NotifierPort<ipc::Service>);

impl Notifier {
    pub(crate) fn new(port: NotifierPort<ipc::Service>) -> Self {
        Self(port)
    }

    /// Wakes whoever listens. Failure is no loss: listeners look for themselves soon after.
    pub fn notify(&self) {
        let _ = self.0.notify();
    }
}

impl core::fmt::Debug for Notifier {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Notifier")
    }
}

/// Waits for samples of a topic.
pub struct Listener {
    port: ListenerPort<ipc::Service>,
    topic: &'static str,
}

impl Listener {
    pub(crate) fn new(port: ListenerPort<ipc::Service>, topic: &'static str) -> Self {
        Self { port, topic }
    }

    /// Waits for a notification, at most `bound`. The kernel rounds the bound up to its ticks: it is no timer.
    pub fn wait(&self, bound: Duration) {
        let _ = self.port.timed_wait(|_| {}, bound);
    }

    /// Waits for a notification or the instant `deadline`, which is kept to some 0.1 ms.
    pub fn wait_until(&self, deadline: Nanos) {
        poll_readable(&[self.as_fd()], deadline);
        self.drain();
    }

    /// Forgets the notifications so far: call it before draining the subscribers, after each wake-up from
    /// [`poll_readable`].
    pub fn drain(&self) {
        while self.port.try_wait(|_| {}).unwrap_or(0) > 0 {}
    }
}

impl AsFd for Listener {
    fn as_fd(&self) -> BorrowedFd<'_> {
        // SAFETY: the descriptor belongs to the port and stays open as long as it; the borrow ends before that.
        unsafe { BorrowedFd::borrow_raw(self.port.file_descriptor().native_handle()) }
    }
}

impl core::fmt::Debug for Listener {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Listener({})", self.topic)
    }
}

/// A listener's descriptor in a tokio reactor: for the slow edges, never for a control step. A wake-up may get lost, so
/// whoever waits here wakes by a timer too.
#[derive(Debug)]
pub struct Readiness(AsyncFd<OwnedFd>);

impl Readiness {
    /// Registers `listener` with the reactor of the current runtime.
    ///
    /// # Errors
    /// Where the descriptor cannot be copied or registered.
    pub fn of(listener: &Listener) -> io::Result<Self> {
        let descriptor = listener.as_fd().try_clone_to_owned()?;
        // SAFETY: the descriptor is owned by the registration, which gives out no way to close or replace it.
        Ok(Self(unsafe { AsyncFd::register_with_interest(descriptor, Interest::READABLE)? }))
    }

    /// Waits for a notification. Drain the listener afterwards: readiness is cleared before, as the reactor wants it.
    pub async fn wait(&self) {
        if let Ok(mut guard) = self.0.readable().await {
            guard.clear_ready();
        }
    }
}

/// Waits until one of at most four descriptors is readable (or broken), or the instant `deadline` has come; the bits
/// of the result tell which ones are.
pub fn poll_readable(descriptors: &[BorrowedFd<'_>], deadline: Nanos) -> u32 {
    let interest = PollFlags::IN | PollFlags::ERR | PollFlags::HUP;
    let Some(first) = descriptors.first() else { return 0 };
    let at =
        |index: usize| PollFd::from_borrowed_fd(*descriptors.get(index).unwrap_or(first), interest);
    let mut polled = [at(0), at(1), at(2), at(3)];
    let polled = &mut polled[..descriptors.len().min(4)];
    let timeout = timespec(deadline.saturating_sub(now()));
    if poll(polled, Some(&timeout)).is_err() {
        return 0;
    }
    let ready = |(index, fd): (usize, &PollFd<'_>)| u32::from(!fd.revents().is_empty()) << index;
    polled.iter().enumerate().map(ready).sum()
}
