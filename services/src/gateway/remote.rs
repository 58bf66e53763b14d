//! The command line's end of a gateway: for verbs of a user whose instance it is not.

use core::time::Duration;
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};

use kerbside_messages::layout::Described;
use kerbside_messages::{LAYOUT_VERSION, Message, Mode, Nanos, State, nanos};
use kerbside_runtime::{Instance, Peer, now};
use serde_json::{Value, json};

use super::socket::discover;
use crate::exit::{Exit, Failure};
use crate::fields::{Presence, from_json};
use crate::life;

/// Longest wait for a gateway's first line, and for it to take one of ours.
const PATIENCE: Duration = Duration::from_secs(2);
/// Longest line of a gateway: a plan of 4096 points takes a quarter of it.
const LONGEST: usize = 4 << 20;
/// Samples a second of what is watched \[Hz\].
const RATE: f64 = 20.0;

/// A connection to the gateway of an instance.
#[derive(Debug)]
pub struct Remote {
    stream: UnixStream,
    path: PathBuf,
    instance: String,
    bytes: Vec<u8>,
    asked: u64,
    replies: BTreeMap<u64, Value>,
    samples: BTreeMap<String, Value>,
}

impl Remote {
    /// The gateway that `name` means: a socket's path, or, where this user has no such instance, the only gateway of an
    /// instance of that name, or of any. None where this user has an instance, or nobody has a gateway.
    ///
    /// # Errors
    /// [`Failure`] where several are meant, or the one that is meant turns this user away.
    pub fn find(name: Option<&str>) -> Result<Option<Self>, Failure> {
        if let Some(path) = name.filter(|name| name.contains('/')) {
            return Self::connect(Path::new(path), None).map(Some);
        }
        let own = match name {
            Some(name) => Instance::named(name)?.supervisor().is_some(),
            None => !Instance::live().is_empty(),
        };
        if own {
            return Ok(None);
        }
        let listening = |(path, user): (PathBuf, u32)| {
            UnixStream::connect(&path).ok().map(|stream| Self::greet(stream, &path, Some(user)))
        };
        let (mut open, mut closed) = (Vec::new(), Vec::new());
        for found in discover(name).into_iter().filter_map(listening) {
            match found {
                Ok(remote) => open.push(remote),
                Err(failure) => closed.push(failure),
            }
        }
        if open.len() > 1 {
            let paths: Vec<_> = open.iter().map(|one| one.path.display().to_string()).collect();
            return Err(Failure::with_help(
                Exit::Unavailable,
                "several instances of other users have a gateway",
                format!("name one with --instance: {}", paths.join(", ")),
            ));
        }
        match (open.pop(), closed.into_iter().next()) {
            (Some(remote), _) => Ok(Some(remote)),
            (None, Some(failure)) => Err(failure),
            (None, None) => Ok(None),
        }
    }

    fn connect(path: &Path, user: Option<u32>) -> Result<Self, Failure> {
        let stream = UnixStream::connect(path)
            .map_err(|error| Failure::unavailable(format!("{}: {error}", path.display())))?;
        Self::greet(stream, path, user)
    }

    /// Reads the first line; `user` is whose gateway it must be, where that is known.
    fn greet(stream: UnixStream, path: &Path, user: Option<u32>) -> Result<Self, Failure> {
        let place = path.display();
        let peer = Peer::of(&stream).map_err(Failure::internal)?;
        if let Some(user) = user.filter(|user| *user != peer.user) {
            return Err(Failure::unavailable(format!(
                "{place}: found a gateway of user {}, allowed is one of user {user}",
                peer.user
            )));
        }
        let timeouts = stream.set_write_timeout(Some(PATIENCE));
        timeouts.map_err(Failure::internal)?;
        let mut remote = Self {
            stream,
            path: path.to_owned(),
            instance: String::new(),
            bytes: Vec::new(),
            asked: 0,
            replies: BTreeMap::new(),
            samples: BTreeMap::new(),
        };
        let greeting = remote.line(now() + life::nanos(PATIENCE))?;
        let greeting = greeting.ok_or_else(|| remote.silent(PATIENCE))?;
        if greeting["ok"] == false {
            return Err(remote.refused(&greeting));
        }
        if greeting["schema"] != "kerbside.gateway.v1" || greeting["layout"] != LAYOUT_VERSION {
            return Err(Failure::unavailable(format!(
                "{place}: found {} with layout version {}, allowed are kerbside.gateway.v1 and {LAYOUT_VERSION}",
                crate::fields::shown(&greeting["schema"]),
                crate::fields::shown(&greeting["layout"]),
            )));
        }
        remote.instance = greeting["instance"].as_str().unwrap_or("unnamed").to_owned();
        Ok(remote)
    }

    /// Name of the instance.
    #[must_use]
    pub fn instance(&self) -> &str {
        &self.instance
    }

    /// Asks, and waits for the reply.
    ///
    /// # Errors
    /// [`Failure`] where none comes.
    pub fn ask(&mut self, request: &Value, patience: Duration) -> Result<Value, Failure> {
        let id = self.send(request)?;
        let deadline = now() + life::nanos(patience);
        loop {
            if let Some(reply) = self.replies.remove(&id) {
                return Ok(reply);
            }
            if !self.receive(deadline)? {
                return Err(self.silent(patience));
            }
        }
    }

    /// Sends a request; its reply is found under the number that this returns.
    ///
    /// # Errors
    /// [`Failure`] where the gateway does not take it.
    pub fn send(&mut self, request: &Value) -> Result<u64, Failure> {
        self.asked += 1;
        let mut request = request.clone();
        if let Some(request) = request.as_object_mut() {
            request.insert("id".to_owned(), json!(self.asked));
        }
        self.stream
            .write_all(format!("{request}\n").as_bytes())
            .map_err(|error| Failure::unavailable(format!("{}: {error}", self.path.display())))?;
        Ok(self.asked)
    }

    /// The reply to a request that was sent, once it has come.
    pub fn reply(&mut self, id: u64) -> Option<Value> {
        self.replies.remove(&id)
    }

    /// Has samples of a topic sent from now on.
    ///
    /// # Errors
    /// [`Failure`] where the gateway refuses.
    pub fn watch(&mut self, topic: &str) -> Result<(), Failure> {
        let request = json!({ "request": "subscribe", "topic": topic, "rate": RATE });
        let reply = self.ask(&request, PATIENCE)?;
        if reply["ok"] == true { Ok(()) } else { Err(self.refused(&reply)) }
    }

    /// The newest sample of a topic that is watched, each one once.
    ///
    /// # Errors
    /// [`Failure`] where it is not laid out as ours.
    pub fn sample<M: Message>(&mut self) -> Result<Option<M>, Failure> {
        self.samples.remove(M::TOPIC.name).map(|sample| self.decode(&sample)).transpose()
    }

    fn decode<M: Message>(&self, sample: &Value) -> Result<M, Failure> {
        let mut message = M::default();
        let bytes = bytemuck::bytes_of_mut(&mut message);
        let place = self.path.display();
        from_json(<M as Described>::LAYOUT, sample, &|_| Presence::Optional, bytes).map_err(
            |error| Failure::unavailable(format!("{place}: {}: {error}", M::TOPIC.name)),
        )?;
        message
            .validate()
            .map(|()| message)
            .map_err(|error| Failure::unavailable(format!("{place}: {}: {error}", M::TOPIC.name)))
    }

    /// The state of the stack.
    ///
    /// # Errors
    /// [`Failure`] where this user may not see it, or none comes.
    pub fn state(&mut self) -> Result<State, Failure> {
        let reply = self.ask(&json!({ "request": "status" }), PATIENCE)?;
        if reply["ok"] == true { self.decode(&reply["state"]) } else { Err(self.refused(&reply)) }
    }

    /// Waits at most so many seconds until the vehicle stands.
    ///
    /// # Errors
    /// [`Failure`] where it does not come to rest, or this user may not see it.
    pub fn until_stopped(&mut self, seconds: f64) -> Result<Mode, Failure> {
        let deadline = now() + nanos(seconds);
        self.watch(State::TOPIC.name)?;
        loop {
            if let Some(state) = self.sample::<State>()?
                && state.mode() != Mode::Stopping
            {
                return Ok(state.mode());
            }
            if !self.receive(deadline)? {
                return Err(Failure::new(Exit::Bad, "the vehicle does not come to rest"));
            }
        }
    }

    /// What a reply refuses.
    #[must_use]
    pub fn refused(&self, reply: &Value) -> Failure {
        let words = reply["error"]["message"].as_str().unwrap_or("an answer that is none");
        Failure::new(Exit::Bad, format!("{}: {words}", self.path.display()))
    }

    fn silent(&self, patience: Duration) -> Failure {
        let (place, seconds) = (self.path.display(), patience.as_secs_f64());
        Failure::unavailable(format!("{place}: the gateway did not answer within {seconds} s"))
    }

    /// Takes in the next line; false where none comes before `deadline`.
    ///
    /// # Errors
    /// [`Failure`] where the gateway is gone.
    pub fn receive(&mut self, deadline: Nanos) -> Result<bool, Failure> {
        let Some(mut line) = self.line(deadline)? else { return Ok(false) };
        if let Some(topic) = line["topic"].as_str().map(str::to_owned) {
            self.samples.insert(topic, line["sample"].take());
        } else if let Some(id) = line["id"].as_u64() {
            self.replies.insert(id, line);
        } else {
            return Err(self.refused(&line));
        }
        Ok(true)
    }

    fn line(&mut self, deadline: Nanos) -> Result<Option<Value>, Failure> {
        let mut searched = 0;
        loop {
            let end = self.bytes[searched..].iter().position(|byte| *byte == b'\n');
            if let Some(end) = end.map(|end| searched + end) {
                let rest = self.bytes.split_off(end + 1);
                let line = core::mem::replace(&mut self.bytes, rest);
                let place = self.path.display();
                return serde_json::from_slice(&line).map(Some).map_err(|error| {
                    Failure::unavailable(format!("{place}: a line that is no JSON: {error}"))
                });
            }
            searched = self.bytes.len();
            if searched > LONGEST {
                let place = self.path.display();
                return Err(Failure::unavailable(format!("{place}: a line that does not end")));
            }
            let left = Duration::from_nanos(deadline.saturating_sub(now()));
            if left.is_zero() || !self.read(left)? {
                return Ok(None);
            }
        }
    }

    /// Reads what is there, at most for `left`; false where nothing came.
    fn read(&mut self, left: Duration) -> Result<bool, Failure> {
        let gone = |error: std::io::Error| {
            Failure::unavailable(format!("{}: the gateway is gone: {error}", self.path.display()))
        };
        self.stream.set_read_timeout(Some(left)).map_err(gone)?;
        let mut piece = [0; 16_384];
        match self.stream.read(&mut piece) {
            Ok(0) => Err(gone(ErrorKind::UnexpectedEof.into())),
            Ok(count) => {
                self.bytes.extend_from_slice(&piece[..count]);
                Ok(true)
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                Ok(false)
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => Ok(true),
            Err(error) => Err(gone(error)),
        }
    }
}
