//! Who takes part in a topic, as the middleware knows it.

use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::prelude::{CallbackProgression, ipc};
use iceoryx2::service::Service;
use iceoryx2::service::dynamic_config::publish_subscribe::DynamicConfig;
use iceoryx2::service::port_factory::PortFactory;
use kerbside_messages::topics::{
    OPERATOR_ANSWER, OPERATOR_REQUEST, PLAN, PLAN_ANSWER, PLAN_REQUEST, Visitor, visit,
};
use kerbside_messages::{
    Message, OperatorAnswer, OperatorRequest, PlanAnswer, PlanRequest, Process, Topic,
};

use crate::services::GUESTS;
use crate::session::{Session, SessionError};
use crate::{FileLock, Instance};

/// One who takes part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Participant {
    /// Its pid; 0 where the middleware does not tell.
    pub pid: u32,
    /// Which process of the instance it is; none for tools and for processes that others wrote.
    pub process: Option<Process>,
}

impl core::fmt::Display for Participant {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.process {
            Some(process) => f.write_str(process.name()),
            None => write!(f, "process {}", self.pid),
        }
    }
}

/// Who takes part in a topic; one that died counts until it is swept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// Who publishes; of a request, who may ask it; of an answer, who gives it.
    pub publishers: Vec<Participant>,
    /// Who subscribes; of a request, who answers it; of an answer, who may ask for it.
    pub subscribers: Vec<Participant>,
}

impl Census {
    /// The census of the other direction.
    fn turned(self) -> Self {
        Self { publishers: self.subscribers, subscribers: self.publishers }
    }

    /// Subscribers that the line of the table does not name; the gateway reads every topic and is no guest.
    pub fn guests(&self, topic: &Topic) -> impl Iterator<Item = &Participant> {
        let expected =
            |process| topic.subscribers.contains(&process) || process == Process::Gateway;
        self.subscribers.iter().filter(move |one| !one.process.is_some_and(expected))
    }
}

impl Session {
    /// Who takes part in `topic`; in `process`'s own service of it, where each process has one.
    ///
    /// # Errors
    /// [`SessionError`] where the topic is not there or has another layout.
    pub fn census(
        &self,
        topic: &'static Topic,
        process: Option<Process>,
    ) -> Result<Census, SessionError> {
        let is = |other: &Topic| topic.id == other.id;
        if is(&PLAN) {
            Ok(self.ports(self.plans()?.dynamic_config()))
        } else if is(&PLAN_REQUEST) {
            self.door_census::<PlanRequest, PlanAnswer>()
        } else if is(&PLAN_ANSWER) {
            self.door_census::<PlanRequest, PlanAnswer>().map(Census::turned)
        } else if is(&OPERATOR_REQUEST) {
            self.door_census::<OperatorRequest, OperatorAnswer>()
        } else if is(&OPERATOR_ANSWER) {
            self.door_census::<OperatorRequest, OperatorAnswer>().map(Census::turned)
        } else {
            visit(topic, OfTopic(self, process)).unwrap_or_else(|| Ok(Census::default()))
        }
    }

    /// Whether a tool may subscribe to `topic`: the places of the instance's own processes are not for it, whichever of
    /// them are there. Call it before making the subscriber.
    ///
    /// # Errors
    /// [`SessionError::Full`] where all places for guests are taken.
    pub fn admit_guest(
        &self,
        topic: &'static Topic,
        process: Option<Process>,
    ) -> Result<(), SessionError> {
        let census = self.census(topic, process)?;
        // Pids of another name space tell nobody apart: then everybody whom the table does not expect is a guest.
        let guests = if pid_of(*self.node().id()) == std::process::id() {
            census.guests(topic).count()
        } else {
            census.subscribers.len().saturating_sub(topic.subscribers.len())
        };
        if guests < GUESTS {
            return Ok(());
        }
        let by = census.guests(topic).map(|participant| participant.pid).collect();
        let role = "tools and other guests";
        Err(SessionError::Full { topic: topic.name, role, places: GUESTS, by })
    }

    fn door_census<Q: Message, A: Message>(&self) -> Result<Census, SessionError> {
        let factory = self.door::<Q, A>()?;
        let (present, mut census) = (Present::of(self.instance()), Census::default());
        factory.dynamic_config().list_clients(|client| {
            census.publishers.push(present.participant(client.node_id));
            CallbackProgression::Continue
        });
        factory.dynamic_config().list_servers(|server| {
            census.subscribers.push(present.participant(server.node_id));
            CallbackProgression::Continue
        });
        Ok(census)
    }

    fn ports(&self, service: &DynamicConfig<<ipc::Service as Service>::Bag>) -> Census {
        let (present, mut census) = (Present::of(self.instance()), Census::default());
        service.list_publishers(|publisher| {
            census.publishers.push(present.participant(publisher.node_id));
            CallbackProgression::Continue
        });
        service.list_subscribers(|subscriber| {
            census.subscribers.push(present.participant(subscriber.node_id));
            CallbackProgression::Continue
        });
        census
    }
}

/// The census of a topic that is published.
struct OfTopic<'a>(&'a Session, Option<Process>);

impl Visitor for OfTopic<'_> {
    type Output = Result<Census, SessionError>;

    fn visit<M: Message>(self) -> Self::Output {
        Ok(self.0.ports(self.0.topic::<M>(self.1)?.dynamic_config()))
    }
}

/// The instance's processes by pid: each holds its lock as long as it lives.
struct Present(Vec<(Process, u32)>);

impl Present {
    fn of(instance: &Instance) -> Self {
        let holder = |process| Some((process, FileLock::holder(&instance.process_lock(process))?));
        Self(Process::ALL.into_iter().filter_map(holder).collect())
    }

    fn participant(&self, node: UniqueNodeId) -> Participant {
        let pid = pid_of(node);
        let process = self.0.iter().find(|(_, holder)| *holder == pid).map(|(process, _)| *process);
        Participant { pid, process }
    }
}

fn pid_of(node: UniqueNodeId) -> u32 {
    node.pid::<ipc::Service>().ok().and_then(|pid| u32::try_from(pid.value()).ok()).unwrap_or(0)
}
