//! A process's part in an instance: it opens what the supervisor created.

use core::time::Duration;

use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::subscriber::SubscriberCreateError;
use iceoryx2::prelude::{
    Config, FileName, FilePath, MessagingPattern, Node, NodeBuilder, NodeName, SemanticString,
    SignalHandlingMode, ipc,
};
use iceoryx2::service::Service as _;
use iceoryx2::service::builder::event::EventOpenError;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;
use iceoryx2::service::builder::request_response::RequestResponseOpenError;
use iceoryx2::service::port_factory::server::ServerCreateError;
use iceoryx2::service::port_factory::{event, publish_subscribe, request_response};
use iceoryx2::service::static_config::messaging_pattern::MessagingPattern as Pattern;
use kerbside_messages::{Message, Plan, Process, Topic};

use crate::error::{Context, RuntimeError};
use crate::publisher::{PlanPublisher, Publisher};
use crate::request::{Client, Server};
use crate::services::{NODES, service_name};
use crate::subscriber::{PlanSubscriber, Subscriber};
use crate::wait::{Listener, Notifier};
use crate::wire::{Wire, WirePoint};
use crate::{Instance, InstanceError};

/// Why a process cannot take part.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The instance itself.
    #[error(transparent)]
    Instance(InstanceError),
    /// Not there yet: wait for it.
    #[error("{what} of instance {instance} is not there yet")]
    Missing {
        /// What is awaited.
        what: String,
        /// Of which instance.
        instance: String,
    },
    /// The other side was built from other layouts.
    #[error(
        "topic {topic}: the running stack has {theirs}, this build has {ours}; stop the stack and start one build everywhere"
    )]
    Incompatible {
        /// Which topic.
        topic: &'static str,
        /// Type name and size of this build.
        ours: String,
        /// The same of the running stack.
        theirs: String,
    },
    /// Every place is taken.
    #[error("topic {topic}: all {places} places for {role} are taken{}", holders(.by))]
    Full {
        /// Which topic.
        topic: &'static str,
        /// Who may have such a place: `tools and other guests`.
        role: &'static str,
        /// How many there are.
        places: usize,
        /// Who has them, where that is known: pids.
        by: Vec<u32>,
    },
    /// The middleware refused.
    #[error(transparent)]
    Middleware(#[from] RuntimeError),
}

/// Who holds what is full, in words.
fn holders(pids: &[u32]) -> String {
    let pids: Vec<_> = pids.iter().map(u32::to_string).collect();
    if pids.is_empty() { String::new() } else { format!(", by process {}", pids.join(", ")) }
}

impl SessionError {
    /// Nobody has set the instance up.
    pub(crate) fn no_supervisor(instance: &Instance) -> Self {
        Self::Missing { what: "the supervisor".to_owned(), instance: instance.name().to_owned() }
    }

    /// Whether waiting may help.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Missing { .. })
    }
}

/// What a sweep of dead nodes did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SweepReport {
    /// Dead nodes that were removed.
    pub removed: u64,
    /// Dead nodes that could not be removed.
    pub left: u64,
}

/// A node of the middleware, and the ports made from it. It belongs to one thread.
pub struct Session {
    node: Node<ipc::Service>,
    instance: Instance,
    /// The life of the instance that it joined.
    prefix: FileName,
}

impl core::fmt::Debug for Session {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Session").field("instance", &self.instance.name()).finish_non_exhaustive()
    }
}

impl Session {
    /// Joins an instance as `process`.
    ///
    /// # Errors
    /// [`SessionError::Missing`] as long as no supervisor has set the instance up.
    pub fn join(instance: &Instance, process: Process) -> Result<Self, SessionError> {
        // What a supervisor that was killed left behind is no instance, until the next one has swept it away.
        if instance.supervisor().is_none() {
            return Err(SessionError::no_supervisor(instance));
        }
        Self::start(instance, process)
    }

    pub(crate) fn start(instance: &Instance, process: Process) -> Result<Self, SessionError> {
        let config = instance.middleware_config()?;
        let config = config.ok_or_else(|| SessionError::no_supervisor(instance))?;
        let file = instance.configuration();
        let file = FilePath::new(file.as_os_str().as_encoded_bytes())
            .context("name configuration", "all")?;
        // The clean-up of half-created nodes looks at the process-wide configuration, not at the node's.
        Config::setup_global_config_from_file(&file).context("read configuration", "all")?;
        let name = NodeName::new(process.name()).context("name node", "all")?;
        let node = NodeBuilder::new()
            .name(&name)
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .context("create node", "all")?;
        if instance.middleware_config()?.is_none_or(|now| now.global.prefix != config.global.prefix)
        {
            // The instance ended meanwhile, and the node has brought to life again what its end had removed.
            drop(node);
            instance.remove_life(&config).map_err(SessionError::Instance)?;
            return Err(SessionError::no_supervisor(instance));
        }
        Ok(Self { node, instance: instance.clone(), prefix: config.global.prefix })
    }

    /// The instance.
    #[must_use]
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// Whether the life of the instance that was joined goes on: its supervisor lives, and is the one it was.
    #[must_use]
    pub fn is_live(&self) -> bool {
        let config = self.instance.middleware_config().ok().flatten();
        self.instance.supervisor().is_some()
            && config.is_some_and(|config| config.global.prefix == self.prefix)
    }

    /// Removes what dead processes left in the middleware. Only the supervisor does this, and on a thread that nothing
    /// waits for: it takes milliseconds.
    #[must_use]
    pub fn sweep(&self) -> SweepReport {
        let state = self.node.blocking_cleanup_dead_nodes(Duration::from_millis(100));
        SweepReport { removed: state.cleanups, left: state.failed_cleanups }
    }

    pub(crate) fn node(&self) -> &Node<ipc::Service> {
        &self.node
    }

    /// A publisher of `M`; of `process`'s own service for topics of which each process has one.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn publisher<M: Message>(
        &self,
        process: Option<Process>,
    ) -> Result<Publisher<M>, SessionError> {
        let factory = self.topic::<M>(process)?;
        let port = factory
            .publisher_builder()
            .max_loaned_samples(2)
            .create()
            .map_err(|error| self.publisher_error(M::TOPIC, error))?;
        let notifier = M::TOPIC.wakes.map(|_| self.notifier::<M>()).transpose()?;
        Ok(Publisher::new(port, notifier))
    }

    /// A subscriber of `M` that keeps up to `buffer` samples.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn subscriber<M: Message>(
        &self,
        process: Option<Process>,
        buffer: usize,
    ) -> Result<Subscriber<M>, SessionError> {
        let factory = self.topic::<M>(process)?;
        let created = factory.subscriber_builder().buffer_size(buffer).create();
        Ok(Subscriber::new(created.map_err(|error| subscriber_error(M::TOPIC, error))?))
    }

    /// The publisher of plans.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn plan_publisher(&self) -> Result<PlanPublisher, SessionError> {
        let factory = self.plans()?;
        let port = factory
            .publisher_builder()
            .initial_max_slice_len(kerbside_messages::MAX_PLAN_POINTS)
            .create()
            .map_err(|error| self.publisher_error(Plan::TOPIC, error))?;
        Ok(PlanPublisher::new(port))
    }

    /// A subscriber of plans.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn plan_subscriber(&self) -> Result<PlanSubscriber, SessionError> {
        let factory = self.plans()?;
        let created = factory.subscriber_builder().buffer_size(1).create();
        Ok(PlanSubscriber::new(created.map_err(|error| subscriber_error(Plan::TOPIC, error))?))
    }

    /// The server that answers `Q` with `A`.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn server<Q: Message, A: Message>(&self) -> Result<Server<Q, A>, SessionError> {
        let factory = self.door::<Q, A>()?;
        let port = factory.server_builder().create().map_err(|error| match error {
            ServerCreateError::ExceedsMaxSupportedServers => self.no_place(Q::TOPIC, "server"),
            other => RuntimeError::of("create server", Q::TOPIC.name)(Box::new(other)).into(),
        })?;
        Ok(Server::new(port))
    }

    /// A client that asks `Q` and is answered `A`.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn client<Q: Message, A: Message>(&self) -> Result<Client<Q, A>, SessionError> {
        let factory = self.door::<Q, A>()?;
        let port = factory.client_builder().create().context("create client", Q::TOPIC.name)?;
        Ok(Client::new(port, self.notifier::<Q>()?))
    }

    /// The listener that samples of `M` wake.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn listener<M: Message>(&self) -> Result<Listener, SessionError> {
        let factory = self.event::<M>()?;
        Ok(Listener::new(
            factory.listener_builder().create().context("create listener", M::TOPIC.name)?,
            M::TOPIC.name,
        ))
    }

    fn notifier<M: Message>(&self) -> Result<Notifier, SessionError> {
        let factory = self.event::<M>()?;
        Ok(Notifier::new(
            factory.notifier_builder().create().context("create notifier", M::TOPIC.name)?,
        ))
    }

    pub(crate) fn topic<M: Message>(
        &self,
        process: Option<Process>,
    ) -> Result<publish_subscribe::PortFactory<ipc::Service, Wire<M>, ()>, SessionError> {
        self.node
            .service_builder(&service_name(M::TOPIC, process)?)
            .publish_subscribe::<Wire<M>>()
            .open()
            .map_err(|error| self.publish_subscribe_error::<M>(error, process))
    }

    pub(crate) fn plans(
        &self,
    ) -> Result<publish_subscribe::PortFactory<ipc::Service, [WirePoint], Wire<Plan>>, SessionError>
    {
        self.node
            .service_builder(&service_name(Plan::TOPIC, None)?)
            .publish_subscribe::<[WirePoint]>()
            .user_header::<Wire<Plan>>()
            .open()
            .map_err(|error| self.publish_subscribe_error::<Plan>(error, None))
    }

    #[allow(clippy::type_complexity)] // the middleware's own five parameters
    pub(crate) fn door<Q: Message, A: Message>(
        &self,
    ) -> Result<request_response::PortFactory<ipc::Service, Wire<Q>, (), Wire<A>, ()>, SessionError>
    {
        self.node
            .service_builder(&service_name(Q::TOPIC, None)?)
            .request_response::<Wire<Q>, Wire<A>>()
            .open()
            .map_err(|error| self.request_response_error::<Q>(error))
    }

    fn event<M: Message>(&self) -> Result<event::PortFactory<ipc::Service>, SessionError> {
        self.node
            .service_builder(&service_name(M::TOPIC, None)?)
            .event()
            .open()
            .map_err(|error| self.event_error::<M>(error))
    }

    fn missing<M: Message>(&self) -> SessionError {
        SessionError::Missing {
            what: format!("topic {}", M::TOPIC.name),
            instance: self.instance.name().to_owned(),
        }
    }

    fn publish_subscribe_error<M: Message>(
        &self,
        error: PublishSubscribeOpenError,
        process: Option<Process>,
    ) -> SessionError {
        match error {
            PublishSubscribeOpenError::ExceedsMaxNumberOfNodes => no_room(M::TOPIC),
            // Half made: whoever makes it waits for a busy machine.
            PublishSubscribeOpenError::DoesNotExist
            | PublishSubscribeOpenError::HangsInCreation => self.missing::<M>(),
            PublishSubscribeOpenError::IncompatibleTypes => {
                self.incompatible::<M>(process, MessagingPattern::PublishSubscribe)
            }
            other => SessionError::Middleware(RuntimeError::of("open service", M::TOPIC.name)(
                Box::new(other),
            )),
        }
    }

    /// Both layouts of a topic by name: this build's, and that of the running stack.
    fn incompatible<M: Message>(
        &self,
        process: Option<Process>,
        pattern: MessagingPattern,
    ) -> SessionError {
        let details = service_name(M::TOPIC, process).ok().and_then(|name| {
            ipc::Service::details(&name, self.node.config(), pattern).ok().flatten()
        });
        let theirs = details.map(|service| {
            let types = match service.static_details.messaging_pattern() {
                Pattern::PublishSubscribe(config) => config.message_type_details(),
                Pattern::RequestResponse(config) => config.request_message_type_details(),
                _ => return "a service of another kind".to_owned(),
            };
            // A plan's head is the header of its points.
            let plan = M::TOPIC.id == Plan::TOPIC.id;
            let found = if plan { &types.user_header } else { &types.payload };
            format!("{} of {} bytes", found.type_name(), found.size())
        });
        SessionError::Incompatible {
            topic: M::TOPIC.name,
            ours: format!("{} of {} bytes", M::TYPE_NAME, size_of::<M>()),
            theirs: theirs.unwrap_or_else(|| "another layout".to_owned()),
        }
    }

    fn request_response_error<M: Message>(&self, error: RequestResponseOpenError) -> SessionError {
        match error {
            RequestResponseOpenError::DoesNotExist | RequestResponseOpenError::HangsInCreation => {
                self.missing::<M>()
            }
            RequestResponseOpenError::ExceedsMaxNumberOfNodes => no_room(M::TOPIC),
            RequestResponseOpenError::IncompatibleRequestOrResponseType => {
                self.incompatible::<M>(None, MessagingPattern::RequestResponse)
            }
            other => SessionError::Middleware(RuntimeError::of("open service", M::TOPIC.name)(
                Box::new(other),
            )),
        }
    }

    fn publisher_error(&self, topic: &'static Topic, error: PublisherCreateError) -> SessionError {
        match error {
            PublisherCreateError::ExceedsMaxSupportedPublishers
                if topic.publisher == kerbside_messages::Publisher::Any =>
            {
                let places = crate::services::publishers(topic);
                SessionError::Full { topic: topic.name, role: "publishers", places, by: Vec::new() }
            }
            PublisherCreateError::ExceedsMaxSupportedPublishers => {
                self.no_place(topic, "publisher")
            }
            other => RuntimeError::of("create publisher", topic.name)(Box::new(other)).into(),
        }
    }

    /// The places belong to dead ones: what they left is not swept yet.
    fn no_place(&self, topic: &Topic, role: &str) -> SessionError {
        SessionError::Missing {
            what: format!("a free place for a {role} of topic {}", topic.name),
            instance: self.instance.name().to_owned(),
        }
    }

    fn event_error<M: Message>(&self, error: EventOpenError) -> SessionError {
        match error {
            EventOpenError::DoesNotExist | EventOpenError::HangsInCreation => self.missing::<M>(),
            EventOpenError::ExceedsMaxNumberOfNodes => no_room(M::TOPIC),
            other => SessionError::Middleware(RuntimeError::of("open event", M::TOPIC.name)(
                Box::new(other),
            )),
        }
    }
}

fn subscriber_error(topic: &'static Topic, error: SubscriberCreateError) -> SessionError {
    match error {
        SubscriberCreateError::ExceedsMaxSupportedSubscribers => SessionError::Full {
            topic: topic.name,
            role: "subscribers",
            places: crate::services::subscribers(topic),
            by: Vec::new(),
        },
        other => RuntimeError::of("create subscriber", topic.name)(Box::new(other)).into(),
    }
}

fn no_room(topic: &'static Topic) -> SessionError {
    SessionError::Full { topic: topic.name, role: "participants", places: NODES, by: Vec::new() }
}
