//! Publishing.

use iceoryx2::port::publisher::Publisher as Port;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ipc;
use kerbside_messages::{Message, Plan, TrajectoryPoint, seal};

use crate::error::{Context, RuntimeError};
use crate::now;
use crate::wait::Notifier;
use crate::wire::{Wire, WirePoint, points, wired};

/// Publishes `M`, written in place in shared memory.
pub struct Publisher<M: Message> {
    port: Port<ipc::Service, Wire<M>, ()>,
    notifier: Option<Notifier>,
    epoch: u64,
    sequence: u64,
}

impl<M: Message> Publisher<M> {
    pub(crate) fn new(port: Port<ipc::Service, Wire<M>, ()>, notifier: Option<Notifier>) -> Self {
        // The monotonic clock orders the lives of a publisher without anybody counting them.
        Self { port, notifier, epoch: now(), sequence: 0 }
    }

    /// Lets `fill` write a sample in place and sends it, unless `fill` returns false; then wakes who waits for it.
    /// `fill` finds all fields zero and leaves the header but `stamp` and `origin` to us.
    ///
    /// # Errors
    /// [`RuntimeError`] where no sample can be loaned or sent: the sample is lost, the publisher stays usable.
    pub fn send(&mut self, fill: impl FnOnce(&mut M) -> bool) -> Result<bool, RuntimeError> {
        let loan = self.port.loan_uninit().context("loan", M::TOPIC.name)?;
        let mut sample = loan.write_payload(Wire(M::default()));
        if !fill(&mut sample.payload_mut().0) {
            return Ok(false);
        }
        self.sequence += 1;
        seal(&mut sample.payload_mut().0, &[], self.epoch, self.sequence, now());
        sample.send().context("send", M::TOPIC.name)?;
        if let Some(notifier) = &self.notifier {
            notifier.notify();
        }
        Ok(true)
    }

    /// Sends bytes as they are, sealed by whoever made them: for replay and for tests of hostile peers.
    ///
    /// # Errors
    /// [`RuntimeError`] as for [`Self::send`].
    pub fn send_sealed(&mut self, message: &M) -> Result<(), RuntimeError> {
        self.port.send_copy(Wire(*message)).context("send", M::TOPIC.name)?;
        if let Some(notifier) = &self.notifier {
            notifier.notify();
        }
        Ok(())
    }

    /// Connects subscribers that came since the last sample; a publisher that speaks seldom calls it in its loop, so
    /// that late joiners get the standing sample.
    ///
    /// # Errors
    /// [`RuntimeError`] where a connection cannot be made.
    pub fn refresh(&self) -> Result<(), RuntimeError> {
        self.port.update_connections().context("connect", M::TOPIC.name)
    }
}

impl<M: Message> core::fmt::Debug for Publisher<M> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Publisher({}, {} sent)", M::TOPIC.name, self.sequence)
    }
}

/// Publishes plans: a head and its points.
pub struct PlanPublisher {
    port: Port<ipc::Service, [WirePoint], Wire<Plan>>,
    epoch: u64,
    sequence: u64,
}

impl PlanPublisher {
    pub(crate) fn new(port: Port<ipc::Service, [WirePoint], Wire<Plan>>) -> Self {
        Self { port, epoch: now(), sequence: 0 }
    }

    /// Sends a plan; `head.points` must be the number of points.
    ///
    /// # Errors
    /// [`RuntimeError`] where no memory can be loaned: more points than a plan may have, or the send failed.
    pub fn send(&mut self, head: &Plan, plan: &[TrajectoryPoint]) -> Result<(), RuntimeError> {
        let loan = self.port.loan_slice_uninit(plan.len()).context("loan", Plan::TOPIC.name)?;
        let mut sample = loan.write_from_slice(wired(plan));
        self.sequence += 1;
        let mut sealed = *head;
        let tail = bytemuck::cast_slice(points(sample.payload()));
        seal(&mut sealed, tail, self.epoch, self.sequence, now());
        sample.user_header_mut().0 = sealed;
        sample.send().context("send", Plan::TOPIC.name)?;
        Ok(())
    }

    /// As [`Publisher::refresh`].
    ///
    /// # Errors
    /// [`RuntimeError`] where a connection cannot be made.
    pub fn refresh(&self) -> Result<(), RuntimeError> {
        self.port.update_connections().context("connect", Plan::TOPIC.name)
    }
}

impl core::fmt::Debug for PlanPublisher {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "PlanPublisher({} sent)", self.sequence)
    }
}
