//! The services of an instance, as the supervisor creates and keeps them.

use core::any::Any;

use iceoryx2::prelude::{CallbackProgression, Node};
use iceoryx2::prelude::{NodeState, ServiceName, ipc};
use kerbside_messages::{
    Actuator, Command, Delivery, Fix, Heartbeat, Inhibit, Message, Odometry, OperatorAnswer,
    OperatorRequest, Permit, Plan, PlanAnswer, PlanRequest, Process, Publisher, Raw, Restore,
    State, Topic, Travel, Truth, Uptake,
};

use crate::error::{Context, RuntimeError};
use crate::session::{Session, SessionError};
use crate::wire::{Wire, WirePoint};
use crate::{Instance, InstanceError};

/// Nodes that may take part: the processes, and tools beside them.
pub(crate) const NODES: usize = 40;
/// Subscribers of a topic that the table does not name: tools, and processes that others wrote.
pub const GUESTS: usize = 6;
/// Subscribers beyond those of the table: guests, the gateway, and those whose dead predecessor is not swept yet.
const SPARE_SUBSCRIBERS: usize = GUESTS + 3;
/// Publishers of a topic that anybody may publish.
const ANY_PUBLISHERS: usize = 16;
/// A process and its dead predecessors: where the machine is full, several die before the first is swept.
const ONE_PUBLISHER: usize = 4;
/// Time over which a topic of which the newest counts is kept, for subscribers that want every sample \[s\].
const NEWEST_SPAN: f64 = 1.28;
/// Samples that are kept of a topic that speaks seldom.
const SELDOM_DEPTH: usize = 16;
/// The same for plans, which are large.
const PLAN_DEPTH: usize = 2;
/// Samples a subscriber may hold at once.
const BORROWED: usize = 2;

/// The services of an instance. Dropping it ends them.
pub struct Services {
    session: Session,
    // Held so that the services live as long as the supervisor does, whoever else comes and goes.
    _factories: Vec<Box<dyn Any>>,
}

impl core::fmt::Debug for Services {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Services")
            .field("factories", &self._factories.len())
            .finish_non_exhaustive()
    }
}

impl Services {
    /// Wipes what an earlier life of the instance left, and creates every service of the table with its quality.
    ///
    /// The caller holds the instance's lock, and no process of it is alive but perhaps its simulated vehicle.
    ///
    /// # Errors
    /// [`SessionError`] where a file or a service cannot be created.
    pub fn create(instance: &Instance) -> Result<Self, SessionError> {
        instance.wipe()?;
        instance.write_configuration()?;
        let session = Session::start(instance, Process::Supervisor)?;
        // The middleware opens the counter of its nodes to everybody.
        instance.close_to_others()?;
        let factories = create_all(session.node())?;
        Ok(Self { session, _factories: factories })
    }

    /// The supervisor's own ports come from here.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// How many nodes of this instance are alive, and how many dead.
    ///
    /// # Errors
    /// [`SessionError`] where the middleware cannot list them.
    pub fn nodes(instance: &Instance) -> Result<(usize, usize), SessionError> {
        let config = instance.middleware_config()?;
        let config = config.ok_or_else(|| SessionError::no_supervisor(instance))?;
        let (mut alive, mut dead) = (0, 0);
        Node::<ipc::Service>::list(&config, |node| {
            match node {
                NodeState::Alive(_) => alive += 1,
                _ => dead += 1,
            }
            CallbackProgression::Continue
        })
        .context("list nodes", "all")?;
        Ok((alive, dead))
    }
}

/// The middleware's name of a topic's service; heartbeats have one service per process.
pub(crate) fn service_name(
    topic: &Topic,
    process: Option<Process>,
) -> Result<ServiceName, RuntimeError> {
    let name = match process {
        Some(process) => format!("{}/{}", topic.name, process.name()),
        None => topic.name.to_owned(),
    };
    ServiceName::new(&name).context("name service", topic.name)
}

fn create_all(node: &Node<ipc::Service>) -> Result<Vec<Box<dyn Any>>, SessionError> {
    let mut made = Vec::new();
    create::<Raw>(node, None, &mut made)?;
    create::<Travel>(node, None, &mut made)?;
    create::<Odometry>(node, None, &mut made)?;
    create::<Restore>(node, None, &mut made)?;
    create::<Fix>(node, None, &mut made)?;
    create_plan(node, &mut made)?;
    create::<Command>(node, None, &mut made)?;
    create::<Permit>(node, None, &mut made)?;
    create::<Inhibit>(node, None, &mut made)?;
    create::<Actuator>(node, None, &mut made)?;
    create::<State>(node, None, &mut made)?;
    for process in Process::SUPERVISED {
        create::<Heartbeat>(node, Some(process), &mut made)?;
    }
    create::<Truth>(node, None, &mut made)?;
    create::<Uptake>(node, None, &mut made)?;
    create_door::<PlanRequest, PlanAnswer>(node, &mut made)?;
    create_door::<OperatorRequest, OperatorAnswer>(node, &mut made)?;
    Ok(made)
}

/// Samples that a subscriber of `topic` can keep at most.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // rates are small and positive
pub fn depth(topic: &Topic) -> usize {
    match topic.delivery {
        Delivery::InOrder { depth } => depth,
        Delivery::Newest | Delivery::RequestResponse => {
            ((topic.rate * NEWEST_SPAN) as usize).max(SELDOM_DEPTH)
        }
    }
}

/// Places for subscribers of a topic.
pub(crate) fn subscribers(topic: &Topic) -> usize {
    topic.subscribers.len() + SPARE_SUBSCRIBERS
}

/// Places for publishers of a topic.
pub(crate) fn publishers(topic: &Topic) -> usize {
    match topic.publisher {
        Publisher::Any => ANY_PUBLISHERS,
        Publisher::One(_) | Publisher::Each => ONE_PUBLISHER,
    }
}

fn create<M: Message>(
    node: &Node<ipc::Service>,
    process: Option<Process>,
    made: &mut Vec<Box<dyn Any>>,
) -> Result<(), SessionError> {
    let topic = M::TOPIC;
    let factory = node
        .service_builder(&service_name(topic, process)?)
        .publish_subscribe::<Wire<M>>()
        .enable_safe_overflow(true)
        .history_size(usize::from(topic.delivery == Delivery::Newest))
        .subscriber_max_buffer_size(depth(topic))
        .subscriber_max_borrowed_samples(BORROWED)
        .max_subscribers(subscribers(topic))
        .max_publishers(publishers(topic))
        .max_nodes(NODES)
        .create()
        .context("create service", topic.name)?;
    made.push(Box::new(factory));
    create_event(node, topic, process, made)
}

fn create_plan(
    node: &Node<ipc::Service>,
    made: &mut Vec<Box<dyn Any>>,
) -> Result<(), SessionError> {
    let topic = Plan::TOPIC;
    let factory = node
        .service_builder(&service_name(topic, None)?)
        .publish_subscribe::<[WirePoint]>()
        .user_header::<Wire<Plan>>()
        .enable_safe_overflow(true)
        .history_size(1)
        .subscriber_max_buffer_size(PLAN_DEPTH)
        .subscriber_max_borrowed_samples(BORROWED)
        .max_subscribers(subscribers(topic))
        .max_publishers(ONE_PUBLISHER)
        .max_nodes(NODES)
        .create()
        .context("create service", topic.name)?;
    made.push(Box::new(factory));
    Ok(())
}

fn create_door<Q: Message, A: Message>(
    node: &Node<ipc::Service>,
    made: &mut Vec<Box<dyn Any>>,
) -> Result<(), SessionError> {
    let topic = Q::TOPIC;
    let factory = node
        .service_builder(&service_name(topic, None)?)
        .request_response::<Wire<Q>, Wire<A>>()
        .enable_safe_overflow_for_requests(true)
        .enable_safe_overflow_for_responses(true)
        .max_active_requests_per_client(2)
        .max_response_buffer_size(2)
        .max_servers(ONE_PUBLISHER)
        .max_clients(ANY_PUBLISHERS)
        .max_nodes(NODES)
        .create()
        .context("create service", topic.name)?;
    made.push(Box::new(factory));
    create_event(node, topic, None, made)
}

fn create_event(
    node: &Node<ipc::Service>,
    topic: &'static Topic,
    process: Option<Process>,
    made: &mut Vec<Box<dyn Any>>,
) -> Result<(), SessionError> {
    if topic.wakes.is_none() {
        return Ok(());
    }
    let factory = node
        .service_builder(&service_name(topic, process)?)
        .event()
        .max_listeners(2)
        .max_notifiers(ANY_PUBLISHERS)
        .max_nodes(NODES)
        .event_id_max_value(1)
        .disable_deadline()
        .disable_notifier_created_event()
        .disable_notifier_dropped_event()
        .disable_notifier_dead_event()
        .create()
        .context("create event of", topic.name)?;
    made.push(Box::new(factory));
    Ok(())
}

impl From<InstanceError> for SessionError {
    fn from(error: InstanceError) -> Self {
        Self::Instance(error)
    }
}
