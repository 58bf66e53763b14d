//! `topics`, `echo`, `hz`, `top`: a running stack, looked at from shared memory.
//!
//! A tool is a guest: it subscribes with a small buffer that overflows safely, wakes nobody and is woken by nobody, and
//! takes none of the places that the instance's own processes need.

mod echo;
mod hz;
mod pace;
mod show;
mod tap;
mod top;
mod topics;

use core::time::Duration;
use std::io::{self, ErrorKind, Stdout, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use kerbside_messages::topics::TABLE;
use kerbside_messages::{Delivery, Process, Publisher, Topic};
use kerbside_runtime::{Instance, Session, Ticker, now};

pub use echo::{EchoArgs, run as echo};
pub use hz::{HzArgs, run as hz};
pub use top::{TopArgs, run as top};
pub use topics::{TopicsArgs, run as topics};

use crate::commands::instance_of;
use crate::exit::Failure;
use crate::life;

/// Time between looks at the topics: a topic of 1000 Hz brings ten samples meanwhile.
const LOOK: Duration = Duration::from_millis(10);
/// Time between looks whether the stack is still there.
const ALIVE: Duration = Duration::from_millis(200);

/// A topic as a person names it: `odometry`, or `heartbeat/tracker` for that of one process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Named {
    topic: &'static Topic,
    process: Option<Process>,
}

impl Named {
    /// What the name stands for; the error says what is allowed.
    ///
    /// # Errors
    /// Where no topic has that name, or nobody can listen to it.
    pub fn parse(name: &str) -> Result<Self, String> {
        let (topic, process) = name.split_once('/').map_or((name, None), |(a, b)| (a, Some(b)));
        let listenable = |topic: &&Topic| topic.delivery != Delivery::RequestResponse;
        let Some(topic) = Topic::named(topic) else {
            let names: Vec<_> = TABLE.iter().filter(listenable).map(|topic| topic.name).collect();
            return Err(format!("there is no such topic; there are {}", names.join(", ")));
        };
        if !listenable(&topic) {
            return Err(
                "a request and its answer are between two processes: nobody listens".to_owned()
            );
        }
        let Some(process) = process else { return Ok(Self { topic, process: None }) };
        let of = Process::SUPERVISED.into_iter().find(|one| one.name() == process);
        match (topic.publisher, of) {
            (Publisher::Each, Some(process)) => Ok(Self { topic, process: Some(process) }),
            (Publisher::Each, None) => {
                let names = Process::SUPERVISED.map(Process::name).join(", ");
                Err(format!("no process has that name; there are {names}"))
            }
            _ => Err(format!("{} has one service for all: leave /{process} out", topic.name)),
        }
    }

    /// The rate of the table; of topics of which each process has its own, that of all together \[Hz\].
    #[allow(clippy::cast_precision_loss)] // a handful of processes
    fn nominal(&self) -> Option<f64> {
        let services = match (self.topic.publisher, self.process) {
            (Publisher::Each, None) => Process::SUPERVISED.len(),
            _ => 1,
        };
        Some(self.topic.rate * services as f64).filter(|rate| *rate > 0.0)
    }

    fn name(&self) -> String {
        match self.process {
            Some(process) => format!("{}/{process}", self.topic.name),
            None => self.topic.name.to_owned(),
        }
    }
}

/// A tool's place at a running stack.
#[derive(Debug)]
struct Place {
    instance: Instance,
    session: Session,
    stop: Arc<AtomicBool>,
    look: Ticker,
    alive: Ticker,
    lives: bool,
}

impl Place {
    /// Joins the stack that is meant.
    fn open(name: Option<&str>) -> Result<Self, Failure> {
        let instance = instance_of(name)?;
        let stop = life::stop_flag()?;
        let session = Session::join(&instance, Process::Operator)?;
        let (look, alive) = (Ticker::new(LOOK), Ticker::new(ALIVE));
        Ok(Self { instance, session, stop, look, alive, lives: true })
    }

    /// Waits for the next look; false when a person ended the tool, or the stack ended.
    fn goes_on(&mut self) -> bool {
        self.look.wait();
        if self.alive.due(now()) {
            self.lives = self.session.is_live();
        }
        self.lives && !self.stop.load(Ordering::Relaxed)
    }

    /// The stack ended while it was looked at.
    fn ended(&self) -> Failure {
        Failure::unavailable(format!("instance {} ended", self.instance.name()))
    }
}

/// Standard output, until nobody reads it any more.
#[derive(Debug)]
struct Out {
    stream: Stdout,
    open: bool,
}

impl Out {
    fn new() -> Self {
        Self { stream: io::stdout(), open: true }
    }

    /// Prints lines; whether somebody reads on.
    fn print(&mut self, text: &str) -> Result<bool, Failure> {
        let mut stream = self.stream.lock();
        let written = writeln!(stream, "{text}").and_then(|()| stream.flush());
        match written {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::BrokenPipe => self.open = false,
            Err(error) => return Err(Failure::unavailable(format!("standard output: {error}"))),
        }
        Ok(self.open)
    }
}

/// A duration in seconds that a person gives.
fn seconds(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| (0.05..=86_400.0).contains(number));
    number.ok_or_else(|| "0.05 to 86400 seconds are allowed".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_named_as_in_the_table_and_heartbeats_by_process_too() {
        assert_eq!(Named::parse("odometry").unwrap().name(), "odometry");
        assert_eq!(Named::parse("heartbeat").unwrap().process, None);
        let one = Named::parse("heartbeat/tracker").unwrap();
        assert_eq!(
            (one.process, one.name().as_str()),
            (Some(Process::Tracker), "heartbeat/tracker")
        );
        let said = |name| Named::parse(name).unwrap_err();
        assert!(said("odometri").contains("raw, travel, odometry"));
        assert!(!said("odometri").contains("plan_request"));
        assert!(said("plan_request").contains("between two processes"));
        assert!(said("heartbeat/driver").contains("interface, ingest"));
        assert!(said("raw/tracker").contains("leave /tracker out"));
    }
}
