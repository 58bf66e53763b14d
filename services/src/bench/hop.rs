//! Both ends of a hop: in the stack's own code, in bare middleware, and through a Unix datagram socket.
//!
//! Every sample carries the instant right before it was sent as its stamp; what the receiving end reads from the clock
//! once it holds the checked sample, less this, is the latency of the hop.

use core::time::Duration;
use std::os::unix::net::UnixDatagram;
use std::path::PathBuf;
use std::rc::Rc;

use kerbside_messages::{
    Actuator, Command, MAX_PLAN_POINTS, Message, Nanos, Odometry, Plan, Raw, TrackingPhase,
    TrajectoryPoint, Travel,
};
use kerbside_runtime::{
    BarePlanPublisher, BarePlanSubscriber, BarePublisher, BareServices, BareSubscriber, Instance,
    Listener, Notifier, PlanPublisher, PlanSubscriber, Publisher, Session, SessionError,
    Subscriber, bare_listener, bare_notifier, now,
};
use serde::{Deserialize, Serialize};

use crate::exit::Failure;

/// Longest wait of a receiving end, as the processes of the control path wait.
const WAIT: Duration = crate::ingest::WAIT;

/// What carries a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Carrier {
    /// The stack's own ports.
    Stack,
    /// The middleware alone.
    Bare,
    /// A Unix datagram socket.
    Datagram,
}

impl Carrier {
    /// Its name in rows.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stack => "stack",
            Self::Bare => "iceoryx2",
            Self::Datagram => "datagram",
        }
    }
}

/// Which topic's samples are carried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Subject {
    /// `raw`.
    Raw,
    /// `travel`.
    Travel,
    /// `odometry`.
    Odometry,
    /// `command`.
    Command,
    /// `actuator`.
    Actuator,
    /// `plan` with all the points it may have.
    Plan,
}

impl Subject {
    /// The hops of the control path.
    pub const PATH: [Self; 5] =
        [Self::Raw, Self::Travel, Self::Odometry, Self::Command, Self::Actuator];

    /// Its name in rows.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Raw => Raw::TOPIC.name,
            Self::Travel => Travel::TOPIC.name,
            Self::Odometry => Odometry::TOPIC.name,
            Self::Command => Command::TOPIC.name,
            Self::Actuator => Actuator::TOPIC.name,
            Self::Plan => "plan of 4096 points",
        }
    }

    /// Bytes of its payload.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Raw => size_of::<Raw>(),
            Self::Travel => size_of::<Travel>(),
            Self::Odometry => size_of::<Odometry>(),
            Self::Command => size_of::<Command>(),
            Self::Actuator => size_of::<Actuator>(),
            Self::Plan => size_of::<Plan>() + MAX_PLAN_POINTS * size_of::<TrajectoryPoint>(),
        }
    }
}

/// How the receiving end waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Way {
    /// Blocks on the topic's event, bounded.
    Event,
    /// Polls the event's descriptor, bounded, and drains it: what waiting for several things at once takes.
    Poll,
    /// Looks for samples without sleeping for 200 us, then blocks on the event.
    Spin,
}

impl Way {
    /// Its name in rows.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Event => "event",
            Self::Poll => "poll and drain",
            Self::Spin => "spin 200 us, then event",
        }
    }
}

/// The services that hops need besides those of the stack.
///
/// # Errors
/// [`SessionError`] where the middleware refuses.
pub fn create_bare(session: &Session) -> Result<BareServices, SessionError> {
    let mut services = BareServices::default();
    services.create::<Raw>(session)?;
    services.create::<Travel>(session)?;
    services.create::<Odometry>(session)?;
    services.create::<Command>(session)?;
    services.create::<Actuator>(session)?;
    services.create_plan(session)?;
    Ok(services)
}

/// The sending end.
pub trait Sending {
    /// Sends a sample stamped `at`.
    ///
    /// # Errors
    /// [`Failure`] where it cannot be sent.
    fn send(&mut self, at: Nanos) -> Result<(), Failure>;
}

/// The receiving end.
pub trait Receiving {
    /// Waits, bounded.
    fn wait(&mut self, way: Way);

    /// The stamp of the next sample.
    fn receive(&mut self) -> Option<Nanos>;
}

/// Opens the sending end of a hop.
///
/// # Errors
/// [`Failure`] where the middleware refuses or nobody receives.
pub fn sending(
    session: &Session,
    subject: Subject,
    carrier: Carrier,
) -> Result<Box<dyn Sending>, Failure> {
    match subject {
        Subject::Raw => sending_of(session, carrier, Raw::default()),
        Subject::Travel => sending_of(session, carrier, Travel::default()),
        Subject::Odometry => sending_of(session, carrier, Odometry::default()),
        Subject::Command => sending_of(session, carrier, command()),
        Subject::Actuator => sending_of(session, carrier, Actuator::default()),
        Subject::Plan => sending_plan(session, carrier),
    }
}

fn sending_of<M: Message + 'static>(
    session: &Session,
    carrier: Carrier,
    message: M,
) -> Result<Box<dyn Sending>, Failure> {
    Ok(match carrier {
        Carrier::Stack => Box::new((session.publisher::<M>(None)?, message)),
        Carrier::Bare => Box::new((BarePublisher::<M>::open(session)?, message)),
        Carrier::Datagram => {
            let socket = UnixDatagram::unbound().map_err(Failure::internal)?;
            socket.connect(socket_path::<M>(session.instance())).map_err(Failure::internal)?;
            Box::new((socket, message))
        }
    })
}

/// A command that passes its checks.
fn command() -> Command {
    Command { phase: TrackingPhase::Tracking.code(), ..Command::default() }
}

fn sending_plan(session: &Session, carrier: Carrier) -> Result<Box<dyn Sending>, Failure> {
    let content = PlanContent::largest();
    Ok(match carrier {
        Carrier::Stack => {
            Box::new((session.plan_publisher()?, bare_notifier::<Plan>(session)?, content))
        }
        Carrier::Bare => Box::new((BarePlanPublisher::open(session)?, content)),
        Carrier::Datagram => return Err(too_large()),
    })
}

fn too_large() -> Failure {
    Failure::internal("a plan is larger than a datagram may be")
}

/// Where the receiving end of a topic's datagrams is bound.
fn socket_path<M: Message>(instance: &Instance) -> PathBuf {
    instance.folder().join(format!("{}.socket", M::TOPIC.name))
}

impl<M: Message> Sending for (Publisher<M>, M) {
    fn send(&mut self, at: Nanos) -> Result<(), Failure> {
        let (publisher, message) = self;
        publisher.send(|out| {
            *out = *message;
            out.header_mut().stamp = at;
            true
        })?;
        Ok(())
    }
}

impl<M: Message> Sending for (BarePublisher<M>, M) {
    fn send(&mut self, at: Nanos) -> Result<(), Failure> {
        self.1.header_mut().stamp = at;
        Ok(self.0.send(&self.1)?)
    }
}

impl<M: Message> Sending for (UnixDatagram, M) {
    fn send(&mut self, at: Nanos) -> Result<(), Failure> {
        self.1.header_mut().stamp = at;
        self.0.send(bytemuck::bytes_of(&self.1)).map(|_| ()).map_err(Failure::internal)
    }
}

/// A plan of the greatest length.
struct PlanContent {
    head: Plan,
    points: Vec<TrajectoryPoint>,
}

impl PlanContent {
    fn largest() -> Self {
        let interval = 0.02;
        #[allow(clippy::cast_precision_loss)] // some thousand points
        let point = |index: usize| TrajectoryPoint {
            time: index as f64 * interval,
            ..TrajectoryPoint::default()
        };
        let points: Vec<_> = (0..MAX_PLAN_POINTS).map(point).collect();
        #[allow(clippy::cast_possible_truncation)] // some thousand points
        let head = Plan { id: 1, interval, points: points.len() as u32, ..Plan::default() };
        Self { head, points }
    }
}

impl Sending for (PlanPublisher, Notifier, PlanContent) {
    fn send(&mut self, at: Nanos) -> Result<(), Failure> {
        let (publisher, notifier, content) = self;
        content.head.header.stamp = at;
        publisher.send(&content.head, &content.points)?;
        notifier.notify();
        Ok(())
    }
}

impl Sending for (BarePlanPublisher, PlanContent) {
    fn send(&mut self, at: Nanos) -> Result<(), Failure> {
        let (publisher, content) = self;
        content.head.header.stamp = at;
        Ok(publisher.send(&content.head, &content.points)?)
    }
}

/// Opens receiving ends; both ends of plans share the bench's one listener.
pub struct Receivers<'a> {
    session: &'a Session,
    plans: Option<Rc<Listener>>,
}

impl<'a> Receivers<'a> {
    /// Nothing is open yet.
    #[must_use]
    pub fn new(session: &'a Session) -> Self {
        Self { session, plans: None }
    }

    /// Opens the receiving end of a hop.
    ///
    /// # Errors
    /// [`Failure`] where the middleware refuses.
    pub fn open(
        &mut self,
        subject: Subject,
        carrier: Carrier,
    ) -> Result<Box<dyn Receiving>, Failure> {
        match subject {
            Subject::Raw => self.open_of::<Raw>(carrier),
            Subject::Travel => self.open_of::<Travel>(carrier),
            Subject::Odometry => self.open_of::<Odometry>(carrier),
            Subject::Command => self.open_of::<Command>(carrier),
            Subject::Actuator => self.open_of::<Actuator>(carrier),
            Subject::Plan => self.open_plan(carrier),
        }
    }

    fn open_of<M: Message + 'static>(
        &self,
        carrier: Carrier,
    ) -> Result<Box<dyn Receiving>, Failure> {
        let session = self.session;
        Ok(match carrier {
            Carrier::Stack => Box::new((
                session.listener::<M>()?,
                session.subscriber::<M>(None, kerbside_runtime::depth(M::TOPIC))?,
            )),
            Carrier::Bare => {
                Box::new((bare_listener::<M>(session)?, BareSubscriber::<M>::open(session)?))
            }
            Carrier::Datagram => {
                let socket = UnixDatagram::bind(socket_path::<M>(session.instance()))
                    .map_err(Failure::internal)?;
                socket.set_read_timeout(Some(WAIT)).map_err(Failure::internal)?;
                Box::new(Inbox::<M> { socket, message: M::default(), came: false })
            }
        })
    }

    fn open_plan(&mut self, carrier: Carrier) -> Result<Box<dyn Receiving>, Failure> {
        let listener = match &self.plans {
            Some(listener) => Rc::clone(listener),
            None => Rc::clone(self.plans.insert(Rc::new(bare_listener::<Plan>(self.session)?))),
        };
        Ok(match carrier {
            Carrier::Stack => Box::new((listener, self.session.plan_subscriber()?)),
            Carrier::Bare => Box::new((listener, BarePlanSubscriber::open(self.session)?)),
            Carrier::Datagram => return Err(too_large()),
        })
    }
}

fn wait(listener: &Listener, way: Way) {
    match way {
        Way::Event | Way::Spin => listener.wait(WAIT),
        Way::Poll => listener.wait_until(now() + crate::life::nanos(WAIT)),
    }
}

impl<M: Message> Receiving for (Listener, Subscriber<M>) {
    fn wait(&mut self, way: Way) {
        wait(&self.0, way);
    }

    fn receive(&mut self) -> Option<Nanos> {
        self.1.receive().map(|sample| sample.header().stamp)
    }
}

impl<M: Message> Receiving for (Listener, BareSubscriber<M>) {
    fn wait(&mut self, way: Way) {
        wait(&self.0, way);
    }

    fn receive(&mut self) -> Option<Nanos> {
        self.1.receive().map(|sample| sample.header().stamp)
    }
}

impl Receiving for (Rc<Listener>, PlanSubscriber) {
    fn wait(&mut self, way: Way) {
        wait(&self.0, way);
    }

    fn receive(&mut self) -> Option<Nanos> {
        if !self.1.update() {
            return None;
        }
        self.1.get().map(|(head, _)| head.header.stamp)
    }
}

impl Receiving for (Rc<Listener>, BarePlanSubscriber) {
    fn wait(&mut self, way: Way) {
        wait(&self.0, way);
    }

    fn receive(&mut self) -> Option<Nanos> {
        let mut stamp = 0;
        self.1.receive(|head, _| stamp = head.header.stamp).then_some(stamp)
    }
}

/// The receiving end of datagrams.
struct Inbox<M: Message> {
    socket: UnixDatagram,
    message: M,
    came: bool,
}

impl<M: Message> Receiving for Inbox<M> {
    fn wait(&mut self, _: Way) {
        let length = self.socket.recv(bytemuck::bytes_of_mut(&mut self.message)).unwrap_or(0);
        self.came = length == size_of::<M>();
    }

    fn receive(&mut self) -> Option<Nanos> {
        core::mem::take(&mut self.came).then(|| self.message.header().stamp)
    }
}
