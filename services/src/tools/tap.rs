//! A subscriber of any topic: samples as bytes that passed their checks.

use kerbside_messages::topics::{PLAN, Visitor, visit};
use kerbside_messages::{Header, Message, Process, Publisher, Refusals, Topic};
use kerbside_runtime::{PlanSubscriber, Session, SessionError, Subscriber, depth};

use super::Named;

/// A sample of any topic.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Whose service it came through, where each process has one.
    pub process: Option<Process>,
    /// Its header.
    pub header: &'a Header,
    /// The payload.
    pub bytes: &'a [u8],
    /// What follows the payload: a plan's points.
    pub tail: &'a [u8],
}

/// Subscriptions to all services of a topic.
pub struct Tap {
    /// The topic.
    pub topic: &'static Topic,
    sources: Vec<(Option<Process>, Box<dyn Source>)>,
}

impl core::fmt::Debug for Tap {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Tap({}, {} services)", self.topic.name, self.sources.len())
    }
}

impl Tap {
    /// Subscribes as a guest, with room for so many samples.
    ///
    /// # Errors
    /// [`SessionError`] where the places for guests are taken.
    pub fn open(session: &Session, named: Named, buffer: usize) -> Result<Self, SessionError> {
        let Named { topic, process } = named;
        let services = match (topic.publisher, process) {
            (Publisher::Each, None) => Process::SUPERVISED.map(Some).to_vec(),
            _ => vec![process],
        };
        let source =
            |process| open(session, topic, process, buffer).map(|source| (process, source));
        Ok(Self { topic, sources: services.into_iter().map(source).collect::<Result<_, _>>()? })
    }

    /// Shows what came, service by service.
    pub fn take(&mut self, mut see: impl FnMut(Sample<'_>)) {
        for (process, source) in &mut self.sources {
            let process = *process;
            source.take(&mut |header, bytes, tail| see(Sample { process, header, bytes, tail }));
        }
    }

    /// What was refused so far.
    #[must_use]
    pub fn refusals(&self) -> Refusals {
        let mut all = Refusals::default();
        for (_, source) in &self.sources {
            let one = source.refusals();
            all.by_reason.iter_mut().zip(one.by_reason).for_each(|(sum, count)| *sum += count);
            all.lost += one.lost;
            all.newest = one.newest.or(all.newest);
        }
        all
    }
}

/// What sees a sample: its header, its bytes, those that follow.
type See<'a> = dyn FnMut(&Header, &[u8], &[u8]) + 'a;

/// A subscriber whose payload's type is of no interest.
trait Source {
    fn take(&mut self, see: &mut See<'_>);
    fn refusals(&self) -> Refusals;
}

impl<M: Message> Source for Subscriber<M> {
    fn take(&mut self, see: &mut See<'_>) {
        while let Some(sample) = self.receive() {
            see(sample.header(), bytemuck::bytes_of(&*sample), &[]);
        }
    }

    fn refusals(&self) -> Refusals {
        *Self::refusals(self)
    }
}

impl Source for PlanSubscriber {
    fn take(&mut self, see: &mut See<'_>) {
        if self.update()
            && let Some((head, points)) = self.get()
        {
            see(&head.header, bytemuck::bytes_of(head), bytemuck::cast_slice(points));
        }
    }

    fn refusals(&self) -> Refusals {
        *Self::refusals(self)
    }
}

fn open(
    session: &Session,
    topic: &'static Topic,
    process: Option<Process>,
    buffer: usize,
) -> Result<Box<dyn Source>, SessionError> {
    session.admit_guest(topic, process)?;
    if topic.id == PLAN.id {
        return Ok(Box::new(session.plan_subscriber()?));
    }
    let opened = visit(topic, Open { session, process, buffer: buffer.min(depth(topic)) });
    opened.unwrap_or_else(|| {
        let instance = session.instance().name().to_owned();
        Err(SessionError::Missing { what: format!("topic {}", topic.name), instance })
    })
}

struct Open<'a> {
    session: &'a Session,
    process: Option<Process>,
    buffer: usize,
}

impl Visitor for Open<'_> {
    type Output = Result<Box<dyn Source>, SessionError>;

    fn visit<M: Message>(self) -> Self::Output {
        Ok(Box::new(self.session.subscriber::<M>(self.process, self.buffer)?))
    }
}
