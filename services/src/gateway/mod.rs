//! The gateway: the door for processes of other users.
//!
//! Topics in: every recorded one but the truth. Topics out: `fix` and `inhibit`, requests to planner and supervisor;
//! each for clients that have the right to. It speaks newline-delimited JSON on a Unix-domain socket, as
//! `docs/gateway.md` says. A client costs itself at worst: the gateway holds one line of it, sends it the newest or
//! nothing, and makes it wait where it asks too often; and a gateway that dies costs its clients alone.

mod budget;
mod bus;
mod conversation;
mod lines;
pub mod remote;
pub mod request;
mod rights;
mod socket;

use core::time::Duration;
use std::cell::RefCell;
use std::io::Write;
use std::rc::Rc;
use std::sync::Arc;

use kerbside_runtime::{Peer, Session, SessionError, Ticker, now};
use kerbside_settings::GatewaySettings;
use serde_json::Value;
use tokio::net::{UnixListener, UnixStream};
use tokio::runtime::Runtime;
use tokio::sync::watch;
use tokio::task::LocalSet;
use tokio::time::{Interval, MissedTickBehavior};

use crate::exit::{Exit, Failure};
use crate::life::{self, Service, Worker};
use budget::{Accounts, Crowded};
use bus::Bus;
use conversation::{Conversation, End, failure};
pub use lines::{Lines, TooLong};
use request::Complaint;
use rights::Granted;
pub use rights::Rights;
use socket::Socket;

/// Time between looks at the topics; also the least time between two samples of one for a client.
const TICK: Duration = Duration::from_millis(10);
/// Clients that are let in, or turned away, between two looks.
const ACCEPTED: usize = 16;
/// Whatever clients ask of the gateway, the processes of the control path come first.
const NICE: i32 = 10;

/// Runs the gateway.
///
/// # Errors
/// [`Failure`] where the process cannot take part, or the configuration names users that are not there.
pub fn run(service: &Service) -> Result<Exit, Failure> {
    let settings = &service.stack.gateway;
    let rights = Rights::of(settings, rustix::process::geteuid().as_raw())?;
    if let Err(error) = rustix::process::setpriority_process(None, NICE) {
        tracing::warn!(%error, "the gateway runs with the priority of the others");
    }
    // Without a socket it is of no use, but dying of it again and again would stop the stack.
    let socket = Socket::bind(settings.socket.as_deref(), service.instance.name());
    let socket = Arc::new(socket.map_err(|error| error.to_string()));
    let open = move |session: &Session, service: &Service| {
        Gateway::open(session, service, rights.clone(), &socket)
    };
    life::run_with_worker(service, open, Gateway::turn)
}

/// What all conversations share.
pub struct Shared {
    instance: String,
    settings: GatewaySettings,
    rights: Rights,
    bus: RefCell<Bus>,
    accounts: RefCell<Accounts>,
    tick: watch::Sender<()>,
}

struct Gateway {
    door: Result<Door, String>,
    pause: Ticker,
}

/// An open door.
struct Door {
    // Its tasks end first.
    tasks: LocalSet,
    interval: Interval,
    shared: Rc<Shared>,
    runtime: Runtime,
    place: String,
}

impl Gateway {
    fn open(
        session: &Session,
        service: &Service,
        rights: Rights,
        socket: &Result<Socket, String>,
    ) -> Result<Self, SessionError> {
        let settings = service.stack.gateway.clone();
        let (tick, _) = watch::channel(());
        let shared = Shared {
            instance: service.instance.name().to_owned(),
            rights,
            bus: RefCell::new(Bus::open(session)?),
            accounts: RefCell::new(Accounts::new(&settings)),
            settings,
            tick,
        };
        let door = match socket {
            Ok(socket) => Door::open(socket, shared).map_err(|error| error.to_string()),
            Err(error) => Err(error.clone()),
        };
        match &door {
            Ok(door) => tracing::info!(socket = door.place, "listening"),
            Err(error) => tracing::error!(error, "no gateway; everything else goes on"),
        }
        Ok(Self { door, pause: Ticker::new(TICK) })
    }

    fn turn(&mut self, worker: &Worker) {
        worker.progress();
        match &mut self.door {
            Ok(door) => {
                worker.says(&door.place);
                door.turn();
            }
            Err(error) => {
                worker.says(&format!("no gateway: {error}"));
                self.pause.wait();
            }
        }
    }
}

impl Door {
    fn open(socket: &Socket, shared: Shared) -> std::io::Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let inside = runtime.enter();
        let listener = UnixListener::from_std(socket.listener()?)?;
        let mut interval = tokio::time::interval(TICK);
        interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
        drop(inside);
        let (tasks, shared) = (LocalSet::new(), Rc::new(shared));
        tasks.spawn_local(accept(listener, Rc::clone(&shared)));
        let place = socket.path().display().to_string();
        Ok(Self { tasks, interval, shared, runtime, place })
    }

    /// Lets clients be served until the next look at the topics.
    fn turn(&mut self) {
        let Self { tasks, interval, shared, runtime, .. } = self;
        tasks.block_on(runtime, async {
            interval.tick().await;
            shared.bus.borrow_mut().poll();
            shared.tick.send_replace(());
        });
    }
}

async fn accept(listener: UnixListener, shared: Rc<Shared>) {
    let mut tick = shared.tick.subscribe();
    loop {
        for _ in 0..ACCEPTED {
            match listener.accept().await {
                Ok((stream, _)) => enter(stream, &shared),
                Err(error) => {
                    tracing::warn!(%error, "a client cannot come in");
                    break;
                }
            }
        }
        // Whatever comes faster than that waits at the door.
        if tick.changed().await.is_err() {
            return;
        }
    }
}

/// Lets a client in, or tells it why not.
fn enter(stream: UnixStream, shared: &Rc<Shared>) {
    let peer = match Peer::of(&stream) {
        Ok(peer) => peer,
        Err(error) => return tracing::warn!(%error, "a client without credentials"),
    };
    let entered = shared.accounts.borrow_mut().enter(peer.user, now());
    if let Err(crowded) = entered {
        tracing::debug!(user = peer.user, %crowded, "turned away");
        return turn_away(stream, &no_room(&crowded));
    }
    let granted = shared.rights.granted(&peer);
    if granted == Granted::default() {
        shared.accounts.borrow_mut().leave(peer.user);
        tracing::debug!(user = peer.user, "turned away: it has no right");
        return turn_away(stream, &no_right(&peer));
    }
    let shared = Rc::clone(shared);
    tokio::task::spawn_local(async move {
        let (user, pid) = (peer.user, peer.pid);
        tracing::debug!(user, pid, "comes in");
        match Conversation::new(Rc::clone(&shared), stream, peer, granted).run().await {
            End::Gone => tracing::debug!(user, pid, "goes"),
            end => tracing::info!(user, pid, %end, "disconnected"),
        }
        shared.accounts.borrow_mut().leave(user);
    });
}

fn turn_away(stream: UnixStream, complaint: &Complaint) {
    let line = format!("{}\n", failure(&Value::Null, complaint));
    // The socket does not block, and nobody waits for a client that does not listen.
    let _ = stream.into_std().and_then(|mut stream| stream.write_all(line.as_bytes()));
}

fn no_room(crowded: &Crowded) -> Complaint {
    Complaint {
        what: "client".to_owned(),
        found: crowded.to_string(),
        allowed: "to come again later".to_owned(),
    }
}

fn no_right(peer: &Peer) -> Complaint {
    Complaint {
        what: "rights".to_owned(),
        found: format!("user {} without any right", peer.user),
        allowed: "who is named in gateway.rights".to_owned(),
    }
}
