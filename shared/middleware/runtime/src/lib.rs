//! Ports, waiting, instances: the only crate that knows iceoryx2.
//!
//! What iceoryx2 0.10 asks of us shapes this crate, and each rule was a failure seen:
//!
//! - One long-lived process, the supervisor, creates every service and holds the factories ([`Services`]); all others
//!   only open them ([`Session`]). A process killed while it creates a service would leave it unopenable for good.
//! - Dead nodes are swept by the supervisor alone ([`Session::sweep`]): a sweep takes milliseconds.
//! - Safe overflow everywhere: a stopped subscriber must never block its publisher.
//! - A notification is a hint; the sample is in the queue. Every wait is bounded.
//! - The prefix and root path of an instance are set for the process as well as for its nodes: the clean-up of
//!   half-created nodes looks at the process-wide configuration.

// Shared memory wants promises that the compiler cannot check: each block says why it holds.
#![allow(unsafe_code)]

mod bare;
mod census;
mod clock;
mod error;
mod instance;
mod lock;
mod peer;
mod process;
mod publisher;
mod realtime;
mod request;
mod services;
mod session;
mod subscriber;
mod wait;
mod wire;

pub use bare::{
    BarePlanPublisher, BarePlanSubscriber, BarePublisher, BareReceived, BareServices,
    BareSubscriber, bare_listener, bare_notifier,
};
pub use census::{Census, Participant};
pub use clock::{Ticker, now, processor_time};
pub use error::RuntimeError;
pub use instance::{Instance, InstanceError, MAX_NAME};
pub use lock::{FileLock, LockError};
pub use peer::Peer;
pub use process::{
    close_inherited_on_exec, end_on_broken_pipe, kill, release_memory, resume, suspend, terminate,
};
pub use publisher::{PlanPublisher, Publisher};
pub use realtime::{RealtimeReport, RealtimeRequest, enter_realtime, last_core};
pub use request::{Asked, Client, Pending, Server};
pub use services::{GUESTS, Services, depth};
pub use session::{Session, SessionError, SweepReport};
pub use subscriber::{Newest, PlanSubscriber, Received, Standing, Subscriber};
pub use wait::{Listener, Notifier, Readiness, poll_readable};

/// Lets the log of iceoryx2 pass only warnings and errors: below that it prints whole structures.
pub fn quieten_middleware_log() {
    iceoryx2::prelude::set_log_level(iceoryx2::prelude::LogLevel::Error);
}
