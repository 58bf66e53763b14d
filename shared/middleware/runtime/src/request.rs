//! Requests and answers.

use core::time::Duration;

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::Client as ClientPort;
use iceoryx2::port::server::Server as ServerPort;
use iceoryx2::prelude::ipc;
use kerbside_messages::{Admission, Message, Nanos, seal};

use crate::error::{Context, RuntimeError};
use crate::wait::Notifier;
use crate::wire::Wire;
use crate::{Ticker, now};

/// A request that waits for its answer.
pub struct Asked<Q: Message, A: Message> {
    request: ActiveRequest<ipc::Service, Wire<Q>, (), Wire<A>, ()>,
}

impl<Q: Message, A: Message> Asked<Q, A> {
    /// The request.
    #[must_use]
    pub fn request(&self) -> &Q {
        &self.request.payload().0
    }

    /// Answers it.
    ///
    /// # Errors
    /// [`RuntimeError`] where the client is gone or the middleware refuses.
    pub fn answer(self, mut answer: A) -> Result<(), RuntimeError> {
        let now = now();
        seal(&mut answer, &[], now, 1, now);
        self.request.send_copy(Wire(answer)).context("answer", A::TOPIC.name)
    }
}

impl<Q: Message, A: Message> core::fmt::Debug for Asked<Q, A> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Asked({})", Q::TOPIC.name)
    }
}

/// Receives requests.
pub struct Server<Q: Message, A: Message> {
    port: ServerPort<ipc::Service, Wire<Q>, (), Wire<A>, ()>,
    admission: Admission<Q>,
}

impl<Q: Message, A: Message> Server<Q, A> {
    pub(crate) fn new(port: ServerPort<ipc::Service, Wire<Q>, (), Wire<A>, ()>) -> Self {
        Self { port, admission: Admission::default() }
    }

    /// The next request that passes its checks.
    pub fn receive(&mut self) -> Option<Asked<Q, A>> {
        loop {
            let request = self.port.receive().ok()??;
            if self.admission.admit(&request.payload().0, &[], now()).is_ok() {
                return Some(Asked { request });
            }
        }
    }
}

impl<Q: Message, A: Message> core::fmt::Debug for Server<Q, A> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Server({})", Q::TOPIC.name)
    }
}

/// Sends requests.
pub struct Client<Q: Message, A: Message> {
    port: ClientPort<ipc::Service, Wire<Q>, (), Wire<A>, ()>,
    notifier: Notifier,
}

impl<Q: Message, A: Message> Client<Q, A> {
    pub(crate) fn new(
        port: ClientPort<ipc::Service, Wire<Q>, (), Wire<A>, ()>,
        notifier: Notifier,
    ) -> Self {
        Self { port, notifier }
    }

    /// Sends `request`; its answer is looked for with [`Pending::poll`].
    ///
    /// # Errors
    /// [`RuntimeError`] where the request cannot be sent.
    pub fn send(&self, mut request: Q) -> Result<Pending<Q, A>, RuntimeError> {
        let sent = now();
        seal(&mut request, &[], sent, 1, sent);
        let pending = self.port.send_copy(Wire(request)).context("send", Q::TOPIC.name)?;
        self.notifier.notify();
        Ok(Pending { pending, admission: Admission::default() })
    }

    /// Sends `request` and waits for its answer, at most `patience`; none where nobody answered in time.
    ///
    /// # Errors
    /// [`RuntimeError`] where the request cannot be sent.
    pub fn ask(&self, request: Q, patience: Duration) -> Result<Option<A>, RuntimeError> {
        let deadline: Nanos = now() + u64::try_from(patience.as_nanos()).unwrap_or(u64::MAX / 2);
        let mut pending = self.send(request)?;
        let mut poll = Ticker::new(Duration::from_millis(1));
        while now() < deadline {
            if let Some(answer) = pending.poll() {
                return Ok(Some(answer));
            }
            poll.wait();
        }
        Ok(None)
    }
}

/// A request on its way.
pub struct Pending<Q: Message, A: Message> {
    pending: PendingResponse<ipc::Service, Wire<Q>, (), Wire<A>, ()>,
    admission: Admission<A>,
}

impl<Q: Message, A: Message> Pending<Q, A> {
    /// The answer, once it is there.
    pub fn poll(&mut self) -> Option<A> {
        let response = self.pending.receive().ok()??;
        let answer = response.payload().0;
        self.admission.admit(&answer, &[], now()).is_ok().then_some(answer)
    }
}

impl<Q: Message, A: Message> core::fmt::Debug for Pending<Q, A> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Pending({})", Q::TOPIC.name)
    }
}

impl<Q: Message, A: Message> core::fmt::Debug for Client<Q, A> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Client({})", Q::TOPIC.name)
    }
}
