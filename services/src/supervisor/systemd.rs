//! What the service manager is told, by the protocol of `sd_notify(3)`: that the supervisor is at work, its mode, and a
//! sign of life for the watchdog.
//!
//! It is ready once it supervises and answers, not once the vehicle is there: a vehicle that is switched off is no
//! failure of the service. What is still waited for stands in the status.

use core::fmt::Write;
use std::ffi::OsStr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};

use kerbside_messages::{Mode, Nanos, State, text};
use sd_notify::NotifyState;

use crate::life::nanos;
use crate::manoeuvre::cause_of;

/// Time between looks whether the status is another \[ns\].
const LOOK: Nanos = 500_000_000;
/// Signs of life in the time after which the watchdog would bite: one may be lost.
const SIGNS: Nanos = 3;

/// The service manager, where one listens.
pub(super) struct Systemd {
    listener: Option<Listener>,
    watched: bool,
    every: Nanos,
    due: Nanos,
    mode: Option<Mode>,
    status: String,
}

impl Systemd {
    /// The one that the environment names: `NOTIFY_SOCKET`, `WATCHDOG_USEC`, `WATCHDOG_PID`.
    pub(super) fn from_environment() -> Self {
        let listener = std::env::var_os("NOTIFY_SOCKET").and_then(|name| {
            let opened = Listener::open(&name);
            let failed = |error: &std::io::Error| {
                tracing::warn!(%error, ?name, "the service manager cannot be told anything");
            };
            opened.inspect_err(failed).ok()
        });
        let watchdog = sd_notify::watchdog_enabled();
        let every = watchdog.map_or(LOOK, |bite| (nanos(bite) / SIGNS).min(LOOK));
        let watched = watchdog.is_some();
        Self { listener, watched, every, due: 0, mode: None, status: String::new() }
    }

    /// Says what is due: at once where the mode is another, else every so often. `fill` tells the state.
    pub(super) fn tell(&mut self, now: Nanos, mode: Mode, fill: impl FnOnce(&mut State)) {
        let Some(listener) = &self.listener else { return };
        if self.mode == Some(mode) && now < self.due {
            return;
        }
        let mut state = State::default();
        fill(&mut state);
        let status = status(&state);
        let ready = self.mode.is_none().then_some(NotifyState::Ready);
        let news = (status != self.status).then_some(NotifyState::Status(&status));
        let alive = self.watched.then_some(NotifyState::Watchdog);
        let said: Vec<NotifyState<'_>> = [ready, news, alive].into_iter().flatten().collect();
        // What was not taken is said again.
        if listener.send(&said) {
            self.mode = Some(mode);
            self.status = status;
            self.due = now + self.every;
        }
    }

    /// The end begins.
    pub(super) fn stopping(&self) {
        if let Some(listener) = &self.listener {
            listener.send(&[NotifyState::Stopping]);
        }
    }
}

/// The mode, its cause, and while the stack starts what is waited for; a line.
fn status(state: &State) -> String {
    let mode = state.mode();
    let cause = cause_of(state);
    if !cause.is_empty() {
        return format!("{mode}: {cause}");
    }
    let waiting = state.rows().iter().find(|row| row.waiting_for[0] != 0);
    match waiting.filter(|_| mode == Mode::Starting) {
        Some(row) => format!("{mode}: waiting for {}", text::as_str(&row.waiting_for)),
        None => mode.to_string(),
    }
}

/// The socket of the service manager. Sending never waits: a service manager that hangs must not stop the car.
struct Listener {
    socket: UnixDatagram,
    address: SocketAddr,
}

impl Listener {
    /// A path, or the name of an abstract socket behind an `@`.
    fn open(name: &OsStr) -> std::io::Result<Self> {
        let address = match name.as_bytes() {
            [b'@', name @ ..] => SocketAddr::from_abstract_name(name)?,
            _ => SocketAddr::from_pathname(name)?,
        };
        let socket = UnixDatagram::unbound()?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, address })
    }

    /// Whether it was taken; nothing to say is.
    fn send(&self, said: &[NotifyState<'_>]) -> bool {
        let mut lines = String::new();
        for line in said {
            // Writing into a String cannot fail.
            let _ = writeln!(lines, "{line}");
        }
        lines.is_empty() || self.socket.send_to_addr(lines.as_bytes(), &self.address).is_ok()
    }
}

#[cfg(test)]
mod tests {
    use kerbside_messages::{Cause, ProcessRow};

    use super::*;

    #[test]
    fn the_status_says_what_is_waited_for_and_why_it_stopped() {
        let mut state = State { mode: Mode::Starting.code(), rows: 2, ..State::default() };
        assert_eq!(status(&state), "starting");
        state.processes[1] = ProcessRow {
            waiting_for: text::from_str("the vehicle on /dev/ttyACM0"),
            ..ProcessRow::default()
        };
        assert_eq!(status(&state), "starting: waiting for the vehicle on /dev/ttyACM0");
        (state.mode, state.cause) = (Mode::Faulted.code(), Cause::Died.code());
        state.text = text::from_str("tracker died");
        assert!(status(&state).starts_with("faulted: ") && status(&state).contains("tracker"));
        (state.mode, state.cause) = (Mode::Driving.code(), Cause::None.code());
        assert_eq!(status(&state), "driving");
    }

    #[test]
    fn a_manager_that_does_not_listen_is_asked_again_and_never_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let manager = UnixDatagram::bind(&path).unwrap();
        let listener = Some(Listener::open(path.as_os_str()).unwrap());
        let mut systemd = Systemd {
            listener,
            watched: true,
            every: 0,
            due: 0,
            mode: None,
            status: String::new(),
        };
        // A queue has room for so many datagrams as the machine says, ten or some hundred; then no more are taken.
        for now in 0..10_000 {
            systemd.tell(now, Mode::Ready, |state| state.mode = Mode::Ready.code());
        }
        let mut buffer = [0; 256];
        let length = manager.recv(&mut buffer).unwrap();
        assert_eq!(&buffer[..length], b"READY=1\nSTATUS=ready\nWATCHDOG=1\n");
        drop(manager);
        systemd.tell(10_001, Mode::Driving, |state| state.mode = Mode::Driving.code());
        assert_eq!(systemd.mode, Some(Mode::Ready), "nobody was there to hear of the other mode");
    }
}
