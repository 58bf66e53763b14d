//! Subscribing: samples are checked before anybody sees them.

use iceoryx2::port::subscriber::Subscriber as Port;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use kerbside_messages::{Admission, Message, Nanos, Plan, Refusals, TrajectoryPoint};

use crate::now;
use crate::wire::{Wire, WirePoint, points};

/// A sample in shared memory that passed its checks.
pub struct Received<M: Message> {
    sample: Sample<ipc::Service, Wire<M>, ()>,
    /// Samples of this epoch that never came before this one.
    pub missing: u64,
    /// First sample of a new life of the publisher.
    pub new_epoch: bool,
}

impl<M: Message> core::ops::Deref for Received<M> {
    type Target = M;

    fn deref(&self) -> &M {
        &self.sample.payload().0
    }
}

impl<M: Message> core::fmt::Debug for Received<M> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Received({}, {:?})", M::TOPIC.name, self.header())
    }
}

/// Receives the samples of a topic in order.
pub struct Subscriber<M: Message> {
    port: Port<ipc::Service, Wire<M>, ()>,
    admission: Admission<M>,
    failures: u64,
}

impl<M: Message> Subscriber<M> {
    pub(crate) fn new(port: Port<ipc::Service, Wire<M>, ()>) -> Self {
        Self { port, admission: Admission::default(), failures: 0 }
    }

    /// The next sample that passes its checks; what does not is counted by reason and skipped.
    pub fn receive(&mut self) -> Option<Received<M>> {
        loop {
            let sample = match self.port.receive() {
                Ok(sample) => sample?,
                Err(_) => {
                    // A connection that cannot be made or a held sample too many: counted, tried again next time.
                    self.failures += 1;
                    return None;
                }
            };
            if let Ok(admitted) = self.admission.admit(&sample.payload().0, &[], now()) {
                return Some(Received {
                    sample,
                    missing: admitted.missing,
                    new_epoch: admitted.new_epoch,
                });
            }
        }
    }

    /// What was refused so far.
    #[must_use]
    pub fn refusals(&self) -> &Refusals {
        self.admission.counts()
    }

    /// Calls of the middleware that failed.
    #[must_use]
    pub fn failures(&self) -> u64 {
        self.failures
    }
}

impl<M: Message> core::fmt::Debug for Subscriber<M> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Subscriber({})", M::TOPIC.name)
    }
}

/// Keeps a copy of the newest sample of a topic.
#[derive(Debug)]
pub struct Newest<M: Message> {
    subscriber: Subscriber<M>,
    value: Option<M>,
    fresh: bool,
}

impl<M: Message> Newest<M> {
    /// The newest of what `subscriber` receives.
    #[must_use]
    pub fn of(subscriber: Subscriber<M>) -> Self {
        Self { subscriber, value: None, fresh: false }
    }

    /// Takes in what came; whether anything did.
    pub fn update(&mut self) -> bool {
        self.fresh = false;
        while let Some(sample) = self.subscriber.receive() {
            self.value = Some(*sample);
            self.fresh = true;
        }
        self.fresh
    }

    /// The newest sample, however old.
    #[must_use]
    pub fn get(&self) -> Option<&M> {
        self.value.as_ref()
    }

    /// Age of the newest sample by its time of sending; none where there is none.
    #[must_use]
    pub fn age(&self, now: Nanos) -> Option<Nanos> {
        self.value.map(|value| now.saturating_sub(value.header().sent))
    }

    /// What was refused so far.
    #[must_use]
    pub fn refusals(&self) -> &Refusals {
        self.subscriber.refusals()
    }
}

/// A plan that stands: the sample is held, not copied.
pub struct Standing {
    sample: Sample<ipc::Service, [WirePoint], Wire<Plan>>,
}

impl Standing {
    /// Its head and its points.
    #[must_use]
    pub fn get(&self) -> (&Plan, &[TrajectoryPoint]) {
        (&self.sample.user_header().0, points(self.sample.payload()))
    }
}

impl core::fmt::Debug for Standing {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Standing(plan {})", self.get().0.id)
    }
}

/// Holds the newest plan.
#[derive(Debug)]
pub struct PlanSubscriber {
    port: PlanPort,
    admission: Admission<Plan>,
    standing: Option<Standing>,
}

/// The port, with a name of its own for `Debug`.
struct PlanPort(Port<ipc::Service, [WirePoint], Wire<Plan>>);

impl core::fmt::Debug for PlanPort {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("PlanPort")
    }
}

impl PlanSubscriber {
    pub(crate) fn new(port: Port<ipc::Service, [WirePoint], Wire<Plan>>) -> Self {
        Self { port: PlanPort(port), admission: Admission::default(), standing: None }
    }

    /// Takes in what came; whether a new plan stands.
    pub fn update(&mut self) -> bool {
        let mut fresh = false;
        while let Ok(Some(sample)) = self.port.0.receive() {
            let candidate = Standing { sample };
            let (head, plan) = candidate.get();
            let admitted = self.admission.admit(head, bytemuck::cast_slice(plan), now());
            if admitted.is_ok() && head.validate_points(plan).is_ok() {
                self.standing = Some(candidate);
                fresh = true;
            }
        }
        fresh
    }

    /// The standing plan.
    #[must_use]
    pub fn get(&self) -> Option<(&Plan, &[TrajectoryPoint])> {
        self.standing.as_ref().map(Standing::get)
    }

    /// What was refused so far.
    #[must_use]
    pub fn refusals(&self) -> &Refusals {
        self.admission.counts()
    }
}
