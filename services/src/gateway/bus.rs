//! The gateway's ports: the newest sample of each stream, and what clients may send.
//!
//! All ports are opened once, at the start, whatever clients do: what a publisher pays for a subscriber it pays once.

use std::cell::OnceCell;
use std::rc::Rc;

use kerbside_messages::layout::Described;
use kerbside_messages::schema::{ros_definition, tail_of};
use kerbside_messages::topics::layout_of;
use kerbside_messages::{
    Actuator, Command, Fix, Header, Heartbeat, Inhibit, Message, Odometry, OperatorAnswer,
    OperatorRequest, Permit, PlanAnswer, PlanRequest, Process, Raw, Restore, State, Travel,
};
use kerbside_runtime::{
    Client, Pending, PlanSubscriber, Publisher, RuntimeError, Session, SessionError, Subscriber,
};
use serde_json::{Value, json};

use super::request::Stream;
use crate::fields::to_json;

/// A request to the supervisor on its way.
pub type Asked = Pending<OperatorRequest, OperatorAnswer>;
/// A request to the planner on its way.
pub type Planning = Pending<PlanRequest, PlanAnswer>;

/// The newest sample of a stream.
#[derive(Debug)]
pub struct Slot {
    /// What it is of.
    pub stream: Stream,
    bytes: Vec<u8>,
    tail: Vec<u8>,
    /// Counts the samples seen; 0 before the first.
    count: u64,
    line: OnceCell<Rc<str>>,
}

impl Slot {
    fn new(topic: &'static kerbside_messages::Topic, process: Option<Process>) -> Self {
        Self {
            stream: Stream { topic, process },
            bytes: Vec::new(),
            tail: Vec::new(),
            count: 0,
            line: OnceCell::new(),
        }
    }

    fn take(&mut self, bytes: &[u8], tail: &[u8]) {
        self.bytes.clear();
        self.bytes.extend_from_slice(bytes);
        self.tail.clear();
        self.tail.extend_from_slice(tail);
        self.count += 1;
        self.line = OnceCell::new();
    }

    /// Which sample this is; 0 where none has come.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The sample as a line, made once however many clients want it.
    #[must_use]
    pub fn line(&self) -> Rc<str> {
        Rc::clone(self.line.get_or_init(|| {
            let mut line = self.to_json().to_string();
            line.push('\n');
            line.into()
        }))
    }

    fn to_json(&self) -> Value {
        let Stream { topic, process } = self.stream;
        let mut sample =
            layout_of(topic).map_or(Value::Null, |layout| to_json(layout, &self.bytes));
        if let (Some(element), Some(sample)) = (tail_of(topic), sample.as_object_mut()) {
            let points = self.tail.chunks_exact(element.size);
            let points: Value = points.map(|point| to_json(element, point)).collect();
            sample.insert("trajectory".to_owned(), points);
        }
        let mut line = json!({ "topic": topic.name, "sample": sample });
        if let (Some(process), Some(line)) = (process, line.as_object_mut()) {
            line.insert("process".to_owned(), json!(process.name()));
        }
        line
    }

    /// The sample itself, where one has come.
    fn message<M: Message>(&self) -> Option<M> {
        (self.bytes.len() == size_of::<M>()).then(|| bytemuck::pod_read_unaligned(&self.bytes))
    }
}

/// Takes in what came of one stream.
type Feed = Box<dyn FnMut(&mut Slot)>;

/// The gateway's ports.
pub struct Bus {
    feeds: Vec<Feed>,
    slots: Vec<Slot>,
    fix: Publisher<Fix>,
    inhibit: Publisher<Inhibit>,
    planner: Client<PlanRequest, PlanAnswer>,
    arm: Client<OperatorRequest, OperatorAnswer>,
    // A port of its own: whoever arms again and again is in nobody's way to stop.
    stop: Client<OperatorRequest, OperatorAnswer>,
}

impl core::fmt::Debug for Bus {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Bus({} streams)", self.slots.len())
    }
}

impl Bus {
    /// Opens all ports.
    ///
    /// # Errors
    /// [`SessionError`] where one is not there yet, or the middleware refuses.
    pub fn open(session: &Session) -> Result<Self, SessionError> {
        let mut bus = Self {
            feeds: Vec::new(),
            slots: Vec::new(),
            fix: session.publisher(None)?,
            inhibit: session.publisher(None)?,
            planner: session.client()?,
            arm: session.client()?,
            stop: session.client()?,
        };
        bus.add::<Raw>(session, None)?;
        bus.add::<Travel>(session, None)?;
        bus.add::<Odometry>(session, None)?;
        bus.add::<Restore>(session, None)?;
        bus.add::<Fix>(session, None)?;
        bus.add_plan(session)?;
        bus.add::<Command>(session, None)?;
        bus.add::<Permit>(session, None)?;
        bus.add::<Inhibit>(session, None)?;
        bus.add::<Actuator>(session, None)?;
        bus.add::<State>(session, None)?;
        for process in Process::SUPERVISED {
            bus.add::<Heartbeat>(session, Some(process))?;
        }
        Ok(bus)
    }

    fn add<M: Message>(
        &mut self,
        session: &Session,
        process: Option<Process>,
    ) -> Result<(), SessionError> {
        let mut subscriber: Subscriber<M> = session.subscriber(process, 1)?;
        self.slots.push(Slot::new(M::TOPIC, process));
        self.feeds.push(Box::new(move |slot| {
            while let Some(sample) = subscriber.receive() {
                slot.take(bytemuck::bytes_of(&*sample), &[]);
            }
        }));
        Ok(())
    }

    fn add_plan(&mut self, session: &Session) -> Result<(), SessionError> {
        let mut subscriber: PlanSubscriber = session.plan_subscriber()?;
        self.slots.push(Slot::new(kerbside_messages::Plan::TOPIC, None));
        self.feeds.push(Box::new(move |slot| {
            if subscriber.update()
                && let Some((head, points)) = subscriber.get()
            {
                slot.take(bytemuck::bytes_of(head), bytemuck::cast_slice(points));
            }
        }));
        Ok(())
    }

    /// Takes in what came.
    pub fn poll(&mut self) {
        for (feed, slot) in self.feeds.iter_mut().zip(&mut self.slots) {
            feed(slot);
        }
    }

    /// The stream's slot.
    #[must_use]
    pub fn slot(&self, stream: Stream) -> Option<&Slot> {
        self.slots.iter().find(|slot| slot.stream == stream)
    }

    fn newest<M: Message>(&self) -> Option<M> {
        self.slot(Stream { topic: M::TOPIC, process: None })?.message()
    }

    /// The newest state.
    #[must_use]
    pub fn state(&self) -> Option<State> {
        self.newest()
    }

    /// The newest estimate.
    #[must_use]
    pub fn odometry(&self) -> Option<Odometry> {
        self.newest()
    }

    /// Publishes a fix.
    ///
    /// # Errors
    /// [`RuntimeError`] where the middleware refuses.
    pub fn send_fix(&mut self, fix: &Fix) -> Result<(), RuntimeError> {
        send(&mut self.fix, fix)
    }

    /// Publishes an inhibit.
    ///
    /// # Errors
    /// [`RuntimeError`] where the middleware refuses.
    pub fn send_inhibit(&mut self, inhibit: &Inhibit) -> Result<(), RuntimeError> {
        send(&mut self.inhibit, inhibit)
    }

    /// Asks the planner.
    ///
    /// # Errors
    /// [`RuntimeError`] where too many requests are under way, or the middleware refuses.
    pub fn plan(&self, request: PlanRequest) -> Result<Planning, RuntimeError> {
        self.planner.send(request)
    }

    /// Asks the supervisor to arm.
    ///
    /// # Errors
    /// As [`Bus::plan`].
    pub fn arm(&self, request: OperatorRequest) -> Result<Asked, RuntimeError> {
        self.arm.send(request)
    }

    /// Asks the supervisor to stop.
    ///
    /// # Errors
    /// As [`Bus::plan`].
    pub fn stop(&self, request: OperatorRequest) -> Result<Asked, RuntimeError> {
        self.stop.send(request)
    }
}

fn send<M: Message>(publisher: &mut Publisher<M>, message: &M) -> Result<(), RuntimeError> {
    publisher.send(|out| {
        let Header { stamp, origin, .. } = *message.header();
        *out = *message;
        *out.header_mut() = Header::stamped(stamp, origin);
        true
    })?;
    Ok(())
}

/// The streams with their rates and schemas, as `topics` replies.
#[must_use]
pub fn described() -> Value {
    let mut described: Vec<Value> = Vec::new();
    let mut last = None;
    for Stream { topic, .. } in super::request::streams() {
        if last == Some(topic.id) {
            continue;
        }
        last = Some(topic.id);
        described.push(json!({
            "topic": topic.name, "payload": topic.payload, "rate": topic.rate, "doc": topic.doc,
            "schema": ros_definition(topic),
        }));
    }
    // What is asked rather than published has a schema too.
    described.push(json!({
        "topic": PlanRequest::TOPIC.name, "payload": PlanRequest::LAYOUT.name, "rate": 0.0,
        "doc": PlanRequest::TOPIC.doc, "schema": ros_definition(PlanRequest::TOPIC),
    }));
    Value::Array(described)
}
