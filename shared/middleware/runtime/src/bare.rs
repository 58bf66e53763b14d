//! The rival of the benches: the middleware alone, with nothing of ours around it.
//!
//! The same bytes in services of the same quality, sent, notified, waited for and received as the middleware's own
//! examples do it: no header is filled in, no check sum, nothing is judged on arrival. What a hop of ours costs beyond
//! this is the price of our promises; `kerbside bench transport` measures it. No process of a stack uses it.

use core::any::Any;
use core::marker::PhantomData;

use iceoryx2::port::publisher::Publisher as PublisherPort;
use iceoryx2::port::subscriber::Subscriber as SubscriberPort;
use iceoryx2::prelude::{ServiceName, ipc};
use iceoryx2::sample::Sample;
use kerbside_messages::{Message, Plan, TrajectoryPoint};

use crate::error::{Context, RuntimeError};
use crate::session::{Session, SessionError};
use crate::wait::{Listener, Notifier};
use crate::wire::{Wire, WirePoint, points};

/// Samples kept for a subscriber, as on the control path.
const DEPTH: usize = 512;

/// The services of bare topics, kept by whoever created them.
#[derive(Default)]
pub struct BareServices(Vec<Box<dyn Any>>);

impl core::fmt::Debug for BareServices {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "BareServices({})", self.0.len())
    }
}

impl BareServices {
    /// Creates the bare service and event of `M`.
    ///
    /// # Errors
    /// [`SessionError`] where the middleware refuses.
    pub fn create<M: Message>(&mut self, session: &Session) -> Result<(), SessionError> {
        let factory = session
            .node()
            .service_builder(&name::<M>()?)
            .publish_subscribe::<Wire<M>>()
            .enable_safe_overflow(true)
            .subscriber_max_buffer_size(DEPTH)
            .create()
            .context("create bare service", M::TOPIC.name)?;
        self.0.push(Box::new(factory));
        self.create_event::<M>(session)
    }

    /// Creates the bare service and event of plans.
    ///
    /// # Errors
    /// [`SessionError`] where the middleware refuses.
    pub fn create_plan(&mut self, session: &Session) -> Result<(), SessionError> {
        let factory = session
            .node()
            .service_builder(&name::<Plan>()?)
            .publish_subscribe::<[WirePoint]>()
            .user_header::<Wire<Plan>>()
            .enable_safe_overflow(true)
            .subscriber_max_buffer_size(2)
            .create()
            .context("create bare service", Plan::TOPIC.name)?;
        self.0.push(Box::new(factory));
        self.create_event::<Plan>(session)
    }

    fn create_event<M: Message>(&mut self, session: &Session) -> Result<(), SessionError> {
        let factory = session
            .node()
            .service_builder(&name::<M>()?)
            .event()
            .event_id_max_value(1)
            .disable_deadline()
            .disable_notifier_created_event()
            .disable_notifier_dropped_event()
            .disable_notifier_dead_event()
            .create()
            .context("create bare event", M::TOPIC.name)?;
        self.0.push(Box::new(factory));
        Ok(())
    }
}

fn name<M: Message>() -> Result<ServiceName, RuntimeError> {
    ServiceName::new(&format!("bare/{}", M::TOPIC.name)).context("name bare service", M::TOPIC.name)
}

/// Sends as the middleware's examples do.
pub struct BarePublisher<M: Message> {
    port: PublisherPort<ipc::Service, Wire<M>, ()>,
    notifier: Notifier,
}

impl<M: Message> BarePublisher<M> {
    /// Opens a publisher and a notifier.
    ///
    /// # Errors
    /// [`SessionError`] where the middleware refuses.
    pub fn open(session: &Session) -> Result<Self, SessionError> {
        let factory = session
            .node()
            .service_builder(&name::<M>()?)
            .publish_subscribe::<Wire<M>>()
            .open()
            .context("open bare service", M::TOPIC.name)?;
        let port =
            factory.publisher_builder().create().context("create publisher", M::TOPIC.name)?;
        Ok(Self { port, notifier: notifier::<M>(session)? })
    }

    /// Loans, writes, sends, notifies.
    ///
    /// # Errors
    /// [`RuntimeError`] where the middleware refuses.
    pub fn send(&self, message: &M) -> Result<(), RuntimeError> {
        let loan = self.port.loan_uninit().context("loan", M::TOPIC.name)?;
        loan.write_payload(Wire(*message)).send().context("send", M::TOPIC.name)?;
        self.notifier.notify();
        Ok(())
    }
}

impl<M: Message> core::fmt::Debug for BarePublisher<M> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "BarePublisher({})", M::TOPIC.name)
    }
}

/// A sample as the middleware hands it over.
pub struct BareReceived<M: Message>(Sample<ipc::Service, Wire<M>, ()>);

impl<M: Message> core::ops::Deref for BareReceived<M> {
    type Target = M;

    fn deref(&self) -> &M {
        &self.0.payload().0
    }
}

impl<M: Message> core::fmt::Debug for BareReceived<M> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "BareReceived({})", M::TOPIC.name)
    }
}

/// Receives as the middleware's examples do.
pub struct BareSubscriber<M: Message> {
    port: SubscriberPort<ipc::Service, Wire<M>, ()>,
    message: PhantomData<M>,
}

impl<M: Message> BareSubscriber<M> {
    /// Opens a subscriber.
    ///
    /// # Errors
    /// [`SessionError`] where the middleware refuses.
    pub fn open(session: &Session) -> Result<Self, SessionError> {
        let factory = session
            .node()
            .service_builder(&name::<M>()?)
            .publish_subscribe::<Wire<M>>()
            .open()
            .context("open bare service", M::TOPIC.name)?;
        let port = factory
            .subscriber_builder()
            .buffer_size(DEPTH)
            .create()
            .context("create subscriber", M::TOPIC.name)?;
        Ok(Self { port, message: PhantomData })
    }

    /// The next sample, as it is.
    pub fn receive(&self) -> Option<BareReceived<M>> {
        self.port.receive().ok().flatten().map(BareReceived)
    }
}

impl<M: Message> core::fmt::Debug for BareSubscriber<M> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "BareSubscriber({})", M::TOPIC.name)
    }
}

/// What bare samples of `M` wake.
///
/// # Errors
/// [`SessionError`] where the middleware refuses.
pub fn bare_listener<M: Message>(session: &Session) -> Result<Listener, SessionError> {
    let factory = session
        .node()
        .service_builder(&name::<M>()?)
        .event()
        .open()
        .context("open bare event", M::TOPIC.name)?;
    let port = factory.listener_builder().create().context("create listener", M::TOPIC.name)?;
    Ok(Listener::new(port, M::TOPIC.name))
}

/// Wakes who waits for bare samples of `M`; also the bench's way to wake for plans, which wake nobody in a stack.
///
/// # Errors
/// [`SessionError`] where the middleware refuses.
pub fn bare_notifier<M: Message>(session: &Session) -> Result<Notifier, SessionError> {
    Ok(notifier::<M>(session)?)
}

fn notifier<M: Message>(session: &Session) -> Result<Notifier, RuntimeError> {
    let factory = session
        .node()
        .service_builder(&name::<M>()?)
        .event()
        .open()
        .context("open bare event", M::TOPIC.name)?;
    let port = factory.notifier_builder().create().context("create notifier", M::TOPIC.name)?;
    Ok(Notifier::new(port))
}

/// Sends plans as the middleware's examples do.
pub struct BarePlanPublisher {
    port: PublisherPort<ipc::Service, [WirePoint], Wire<Plan>>,
    notifier: Notifier,
}

impl BarePlanPublisher {
    /// Opens a publisher and a notifier.
    ///
    /// # Errors
    /// [`SessionError`] where the middleware refuses.
    pub fn open(session: &Session) -> Result<Self, SessionError> {
        let factory = session
            .node()
            .service_builder(&name::<Plan>()?)
            .publish_subscribe::<[WirePoint]>()
            .user_header::<Wire<Plan>>()
            .open()
            .context("open bare service", Plan::TOPIC.name)?;
        let port = factory
            .publisher_builder()
            .initial_max_slice_len(kerbside_messages::MAX_PLAN_POINTS)
            .create()
            .context("create publisher", Plan::TOPIC.name)?;
        Ok(Self { port, notifier: notifier::<Plan>(session)? })
    }

    /// Loans, writes, sends, notifies.
    ///
    /// # Errors
    /// [`RuntimeError`] where the middleware refuses.
    pub fn send(&self, head: &Plan, plan: &[TrajectoryPoint]) -> Result<(), RuntimeError> {
        let loan = self.port.loan_slice_uninit(plan.len()).context("loan", Plan::TOPIC.name)?;
        let mut sample = loan.write_from_fn(|index| WirePoint(plan[index]));
        sample.user_header_mut().0 = *head;
        sample.send().context("send", Plan::TOPIC.name)?;
        self.notifier.notify();
        Ok(())
    }
}

impl core::fmt::Debug for BarePlanPublisher {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("BarePlanPublisher")
    }
}

/// Receives plans as the middleware's examples do.
pub struct BarePlanSubscriber(SubscriberPort<ipc::Service, [WirePoint], Wire<Plan>>);

impl BarePlanSubscriber {
    /// Opens a subscriber.
    ///
    /// # Errors
    /// [`SessionError`] where the middleware refuses.
    pub fn open(session: &Session) -> Result<Self, SessionError> {
        let factory = session
            .node()
            .service_builder(&name::<Plan>()?)
            .publish_subscribe::<[WirePoint]>()
            .user_header::<Wire<Plan>>()
            .open()
            .context("open bare service", Plan::TOPIC.name)?;
        let port =
            factory.subscriber_builder().create().context("create subscriber", Plan::TOPIC.name)?;
        Ok(Self(port))
    }

    /// The next plan goes to `take`, as it is; whether there was one.
    pub fn receive(&self, take: impl FnOnce(&Plan, &[TrajectoryPoint])) -> bool {
        let Some(sample) = self.0.receive().ok().flatten() else { return false };
        take(&sample.user_header().0, points(sample.payload()));
        true
    }
}

impl core::fmt::Debug for BarePlanSubscriber {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("BarePlanSubscriber")
    }
}
