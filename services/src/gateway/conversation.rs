//! One client: its lines in, replies and samples out.
//!
//! A conversation holds one line that is read and one that is written, whatever the client does; of each stream it
//! sends the newest sample when the client takes it. Whoever is slow misses samples, whoever takes nothing for
//! `gateway.patience` is disconnected, whoever asks too often waits.

use std::io;
use std::rc::Rc;
use std::time::Duration;

use kerbside_messages::{
    FixVerdict, Mode, Nanos, OperatorAnswer, OperatorRequest, PlanAnswer, PlanVerdict, Verb, nanos,
    text,
};
use kerbside_runtime::{Peer, now};
use serde_json::{Map, Value, json};
use tokio::net::UnixStream;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until, timeout};

use super::Shared;
use super::bus::{Asked, Planning, described};
use super::lines::Lines;
use super::request::{Complaint, Request, Stream, parse};
use super::rights::Granted;
use crate::commands::status_object;
use crate::fields::to_json;
use crate::lockstep::words_of;

/// Longest wait for the supervisor's answer and for the estimator's verdict \[s\].
const ANSWER: f64 = 1.0;
/// Longest wait for a plan \[s\].
const PLAN: f64 = 30.0;
/// Requests of a client that may wait for an answer at once.
const MOST_AWAITED: usize = 4;
/// Bytes read at once.
const PIECE: usize = 4096;

/// How a conversation ends.
#[derive(Debug, thiserror::Error)]
pub enum End {
    /// The client went.
    #[error("gone")]
    Gone,
    /// It said something after which nothing can be understood.
    #[error("{0}")]
    Unreadable(Complaint),
    /// It does not take what it is sent.
    #[error("took nothing for gateway.patience = {0} s")]
    Stalled(f64),
}

impl From<io::Error> for End {
    /// Whatever the operating system says of a socket whose other end is a stranger: the stranger is gone.
    fn from(_: io::Error) -> Self {
        Self::Gone
    }
}

/// A conversation with a client.
pub struct Conversation {
    shared: Rc<Shared>,
    stream: UnixStream,
    peer: Peer,
    granted: Granted,
    tick: watch::Receiver<()>,
    lines: Lines,
    subscriptions: Vec<Subscription>,
    awaited: Vec<Awaited>,
}

struct Subscription {
    stream: Stream,
    period: Nanos,
    next: Nanos,
    seen: u64,
}

/// A request whose answer is on its way.
struct Awaited {
    id: Value,
    what: Waiting,
    deadline: Nanos,
}

enum Waiting {
    Operator(Asked, Verb),
    Plan(Planning),
    /// The resets and the judged fix of the estimate before.
    Fix(u32, u64),
}

impl Conversation {
    /// A conversation with `peer`, which has been let in and has some right.
    #[must_use]
    pub fn new(shared: Rc<Shared>, stream: UnixStream, peer: Peer, granted: Granted) -> Self {
        let lines = Lines::new(shared.settings.line_length as usize);
        let tick = shared.tick.subscribe();
        let (subscriptions, awaited) = (Vec::new(), Vec::new());
        Self { shared, stream, peer, granted, tick, lines, subscriptions, awaited }
    }

    /// Talks until the client goes or has to.
    pub async fn run(mut self) -> End {
        let end = match self.talk().await {
            Ok(never) => match never {},
            Err(end) => end,
        };
        if let End::Unreadable(complaint) = &end {
            let _ = self.write(&failure(&Value::Null, complaint)).await;
        } else if let End::Stalled(_) = &end {
            let complaint = Complaint {
                what: "client".to_owned(),
                found: "one that takes nothing".to_owned(),
                allowed: "gateway.patience".to_owned(),
            };
            // Half a line may have gone out before it; a reader that wakes up sees that this is the end.
            let _ = self.stream.try_write(line_of(&failure(&Value::Null, &complaint)).as_bytes());
        }
        end
    }

    async fn talk(&mut self) -> Result<core::convert::Infallible, End> {
        self.write(&self.greeting()).await?;
        loop {
            let has_line = self.lines.has_line();
            if !has_line {
                // Nothing is whole, and no more fits: it will not become a line.
                self.take_line()?;
            }
            let ready = self.shared.accounts.borrow_mut().ready_at(self.peer.user, now());
            let expects = !self.subscriptions.is_empty() || !self.awaited.is_empty();
            tokio::select! {
                () = until(ready), if has_line => self.hear().await?,
                readable = self.stream.readable(), if !has_line => {
                    readable?;
                    self.read()?;
                }
                _ = self.tick.changed(), if expects => self.deliver().await?,
            }
        }
    }

    fn greeting(&self) -> Value {
        json!({
            "schema": "kerbside.gateway.v1", "version": env!("CARGO_PKG_VERSION"),
            "layout": kerbside_messages::LAYOUT_VERSION, "instance": self.shared.instance,
            "user": self.peer.user, "rights": self.granted.names(), "now": now(),
        })
    }

    fn read(&mut self) -> Result<(), End> {
        let mut piece = [0; PIECE];
        let room = self.lines.room().min(PIECE);
        match self.stream.try_read(&mut piece[..room]) {
            Ok(0) => Err(End::Gone),
            Ok(count) => {
                self.lines.push(&piece[..count]);
                Ok(())
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    fn take_line(&mut self) -> Result<Option<Vec<u8>>, End> {
        self.lines.take().map_err(|error| {
            End::Unreadable(Complaint {
                what: "line".to_owned(),
                found: format!("{} bytes without a newline", error.found),
                allowed: format!("at most gateway.line_length = {} bytes", error.longest),
            })
        })
    }

    /// The next line, unless another client of the user was faster.
    async fn hear(&mut self) -> Result<(), End> {
        {
            let mut accounts = self.shared.accounts.borrow_mut();
            let now = now();
            if accounts.ready_at(self.peer.user, now) > now {
                return Ok(());
            }
            accounts.take(self.peer.user, now);
        }
        let Some(line) = self.take_line()? else { return Ok(()) };
        let (id, request) = parse(&line, now(), &self.shared.settings);
        let reply = match request.and_then(|request| self.permitted(request)) {
            Ok(request) => self.obey(&id, request),
            Err(complaint) => Some(failure(&id, &complaint)),
        };
        match reply {
            Some(reply) => self.write(&reply).await,
            None => Ok(()),
        }
    }

    fn permitted(&self, request: Request) -> Result<Request, Complaint> {
        let right = request.right();
        if self.granted.has(right) {
            return Ok(request);
        }
        Err(Complaint {
            what: "rights".to_owned(),
            found: format!("user {} without the right {}", self.peer.user, right.name()),
            allowed: format!("who is named in gateway.rights.{}", right.name()),
        })
    }

    /// Does what is asked; the reply, unless it is still to come.
    fn obey(&mut self, id: &Value, request: Request) -> Option<Value> {
        let user = self.peer.user;
        match request {
            Request::Status => Some(self.status(id)),
            Request::Topics => Some(success(id, json!({ "topics": described() }))),
            Request::Subscribe { stream, rate } => {
                self.subscriptions.retain(|subscription| subscription.stream != stream);
                let period = nanos(1.0 / rate);
                self.subscriptions.push(Subscription { stream, period, next: now(), seen: 0 });
                Some(success(id, json!({ "rate": rate })))
            }
            Request::Unsubscribe { stream } => {
                self.subscriptions.retain(|subscription| subscription.stream != stream);
                Some(success(id, json!({})))
            }
            Request::Inhibit(mut inhibit) => {
                inhibit.who = text::from_str(&format!("user {user}"));
                tracing::info!(user, why = text::as_str(&inhibit.why), "inhibits");
                let sent = self.shared.bus.borrow_mut().send_inhibit(&inhibit);
                Some(sent.map_or_else(
                    |error| failure(id, &middleware("inhibit", &error)),
                    |()| success(id, json!({ "expiry": inhibit.expiry })),
                ))
            }
            waiting => self.ask(id, waiting).err().map(|complaint| failure(id, &complaint)),
        }
    }

    /// Passes on what somebody else answers.
    fn ask(&mut self, id: &Value, request: Request) -> Result<(), Complaint> {
        if self.awaited.len() >= MOST_AWAITED {
            return Err(Complaint {
                what: "line".to_owned(),
                found: format!("{MOST_AWAITED} requests without an answer"),
                allowed: "to wait for one of their answers".to_owned(),
            });
        }
        let user = self.peer.user;
        let mut bus = self.shared.bus.borrow_mut();
        let operator = |verb: Verb| OperatorRequest {
            id: now(),
            pid: self.peer.pid,
            verb: verb.code(),
            ..OperatorRequest::default()
        };
        let (what, patience) = match request {
            Request::Arm => {
                tracing::info!(user, "arms");
                let asked = bus.arm(operator(Verb::Arm)).map_err(|e| middleware("arm", &e))?;
                (Waiting::Operator(asked, Verb::Arm), ANSWER)
            }
            Request::Stop => {
                tracing::info!(user, "stops");
                let asked = bus.stop(operator(Verb::Stop)).map_err(|e| middleware("stop", &e))?;
                (Waiting::Operator(asked, Verb::Stop), ANSWER)
            }
            Request::Plan(mut plan) => {
                plan.id = now();
                tracing::info!(user, x = plan.x, y = plan.y, yaw = plan.yaw, "asks for a plan");
                let asked = bus.plan(*plan).map_err(|error| middleware("plan", &error))?;
                (Waiting::Plan(asked), PLAN)
            }
            Request::Fix(mut fix) => {
                let odometry = bus.odometry().ok_or_else(|| Complaint {
                    what: "fix".to_owned(),
                    found: "no estimate yet".to_owned(),
                    allowed: "a fix once odometry comes".to_owned(),
                })?;
                fix.source = text::from_str(&format!("user {user}"));
                bus.send_fix(&fix).map_err(|error| middleware("fix", &error))?;
                (Waiting::Fix(odometry.resets, odometry.fix_sequence), ANSWER)
            }
            // All others are answered at once.
            _ => return Ok(()),
        };
        drop(bus);
        self.awaited.push(Awaited { id: id.clone(), what, deadline: now() + nanos(patience) });
        Ok(())
    }

    fn status(&self, id: &Value) -> Value {
        let Some(state) = self.shared.bus.borrow().state() else {
            let found = "no state yet".to_owned();
            let allowed = "to ask again".to_owned();
            return failure(id, &Complaint { what: "status".to_owned(), found, allowed });
        };
        let layout = <kerbside_messages::State as kerbside_messages::layout::Described>::LAYOUT;
        success(
            id,
            json!({
                "status": status_object(&self.shared.instance, &state),
                "state": to_json(layout, bytemuck::bytes_of(&state)),
            }),
        )
    }

    /// Sends what has come: answers first, then the newest sample of each stream that is due.
    async fn deliver(&mut self) -> Result<(), End> {
        let mut index = 0;
        while index < self.awaited.len() {
            match self.answer(index) {
                Some(reply) => {
                    self.awaited.remove(index);
                    self.write(&reply).await?;
                }
                None => index += 1,
            }
        }
        for index in 0..self.subscriptions.len() {
            if let Some(line) = self.due(index) {
                self.write_line(&line).await?;
            }
        }
        Ok(())
    }

    fn due(&mut self, index: usize) -> Option<Rc<str>> {
        let subscription = self.subscriptions.get_mut(index)?;
        let now = now();
        let bus = self.shared.bus.borrow();
        let slot = bus.slot(subscription.stream)?;
        if slot.count() == subscription.seen || now < subscription.next {
            return None;
        }
        subscription.seen = slot.count();
        // At its rate, and no burst after a pause.
        subscription.next = (subscription.next + subscription.period).max(now);
        Some(slot.line())
    }

    /// The reply to a request that has been answered, or has waited too long.
    fn answer(&mut self, index: usize) -> Option<Value> {
        let Awaited { id, what, deadline } = self.awaited.get_mut(index)?;
        let reply = match what {
            Waiting::Operator(asked, verb) => {
                asked.poll().map(|answer| operated(id, *verb, &answer))
            }
            Waiting::Plan(planning) => planning.poll().map(|answer| planned(id, &answer)),
            Waiting::Fix(resets, judged) => {
                let odometry = self.shared.bus.borrow().odometry();
                let odometry = odometry.filter(|odometry| {
                    (odometry.resets, odometry.fix_sequence) != (*resets, *judged)
                });
                odometry.map(|odometry| fixed(id, odometry.fix_verdict))
            }
        };
        let overdue = now() > *deadline;
        reply.or_else(|| {
            overdue.then(|| {
                let (what, who) = match what {
                    Waiting::Operator(_, verb) => (verb.name(), "the supervisor"),
                    Waiting::Plan(_) => ("plan", "the planner"),
                    Waiting::Fix(..) => ("fix", "the estimator"),
                };
                let found = format!("no answer of {who} in time");
                let allowed = "to ask for the status, and again".to_owned();
                failure(id, &Complaint { what: what.to_owned(), found, allowed })
            })
        })
    }

    async fn write(&self, value: &Value) -> Result<(), End> {
        self.write_line(&line_of(value)).await
    }

    async fn write_line(&self, line: &str) -> Result<(), End> {
        let patience = self.shared.settings.patience;
        let writing = async {
            let mut rest = line.as_bytes();
            while !rest.is_empty() {
                self.stream.writable().await?;
                match self.stream.try_write(rest) {
                    Ok(count) => rest = rest.get(count..).unwrap_or_default(),
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                    Err(error) => return Err(error),
                }
            }
            Ok::<(), io::Error>(())
        };
        match timeout(patience, writing).await {
            Ok(written) => written.map_err(End::from),
            Err(_) => Err(End::Stalled(patience.as_secs_f64())),
        }
    }
}

/// Waits until a time of the monotonic clock.
async fn until(at: Nanos) {
    sleep_until(Instant::now() + Duration::from_nanos(at.saturating_sub(now()))).await;
}

fn line_of(value: &Value) -> String {
    let mut line = value.to_string();
    line.push('\n');
    line
}

fn reply(id: &Value, ok: bool, more: Value) -> Value {
    let mut reply = Map::new();
    reply.insert("id".to_owned(), id.clone());
    reply.insert("ok".to_owned(), Value::Bool(ok));
    if let Value::Object(more) = more {
        reply.extend(more);
    }
    Value::Object(reply)
}

fn success(id: &Value, more: Value) -> Value {
    reply(id, true, more)
}

/// The reply that says what is wrong.
#[must_use]
pub fn failure(id: &Value, complaint: &Complaint) -> Value {
    let Complaint { what, found, allowed } = complaint;
    let error = json!({
        "what": what, "found": found, "allowed": allowed, "message": complaint.to_string(),
    });
    reply(id, false, json!({ "error": error }))
}

fn refused(id: &Value, what: &str, found: &str, allowed: &str, mut more: Value) -> Value {
    let complaint =
        Complaint { what: what.to_owned(), found: found.to_owned(), allowed: allowed.to_owned() };
    if let (Some(more), Value::Object(mut said)) = (more.as_object_mut(), failure(id, &complaint)) {
        more.append(&mut said);
    }
    more
}

fn middleware(what: &str, error: &kerbside_runtime::RuntimeError) -> Complaint {
    Complaint {
        what: what.to_owned(),
        found: error.to_string(),
        allowed: "two such requests of all clients at once".to_owned(),
    }
}

fn operated(id: &Value, verb: Verb, answer: &OperatorAnswer) -> Value {
    let mode = Mode::from_code(answer.mode).unwrap_or(Mode::Faulted);
    let more = json!({ "mode": mode.name(), "arms": answer.arms });
    if answer.accepted == 1 {
        return success(id, more);
    }
    refused(id, verb.name(), text::as_str(&answer.text), "what the mode permits", more)
}

fn fixed(id: &Value, verdict: u8) -> Value {
    let verdict = FixVerdict::from_code(verdict).unwrap_or(FixVerdict::None);
    let more = json!({ "verdict": verdict.name() });
    if verdict == FixVerdict::Accepted {
        return success(id, more);
    }
    refused(id, "fix", verdict.name(), "a fix that the estimator accepts", more)
}

fn planned(id: &Value, answer: &PlanAnswer) -> Value {
    let verdict = PlanVerdict::from_code(answer.verdict);
    let clearance = answer.clearance.is_finite().then_some(answer.clearance);
    let more = json!({
        "verdict": verdict.map_or("unknown", PlanVerdict::name), "plan": answer.id,
        "search_time": answer.search_time, "length": answer.length, "duration": answer.duration,
        "clearance": clearance, "gear_changes": answer.gear_changes,
    });
    if verdict == Some(PlanVerdict::Found) {
        return success(id, more);
    }
    refused(
        id,
        "plan",
        &words_of(answer),
        "a goal that can be reached from where the vehicle stands",
        more,
    )
}
