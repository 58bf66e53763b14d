//! `bench hostile`: what it costs the control path that somebody beside it means harm.
//!
//! One stack drives. Of every three seconds it drives one alone, one beside a rogue, and one beside hostile clients of
//! its gateway. The rogue is a process of the instance: it holds samples for ever, publishes rubbish on whatever anyone
//! may publish, and is killed in the midst of it. The clients ask without end and read nothing.

use core::time::Duration;
use std::io::{BufRead, BufReader, ErrorKind, Write, stdout};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use kerbside_messages::{
    Command, Fix, Header, Inhibit, Odometry, PlanAnswer, PlanRequest, Process, State,
};
use kerbside_runtime::{Instance, Session, Subscriber, Ticker};
use serde_json::json;

use super::drive::Drive;
use super::pipeline::Scheduling;
use super::rows::{Told, tell};
use super::side::{Side, WINDOW, all_measured};
use crate::exit::{Exit, Failure};
use crate::life::stop_flag;

/// Latency at p50 and p99 beside somebody hostile may be so many times that alone.
const LIMIT: f64 = 1.5;
/// The same at p99, which a single pause of the machine decides.
const LIMIT_P99: f64 = 3.0;
/// Time between two rounds of rubbish.
const ROUND: Duration = Duration::from_millis(1);
/// Hostile clients of the gateway.
const CLIENTS: usize = 3;
/// Samples of a topic that a subscriber can hold at once.
const HELD: usize = 2;

/// What `bench hostile` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct HostileArgs {
    /// Scenario that is driven.
    #[arg(default_value = "garage")]
    scenario: String,
    /// Seconds of driving that are measured: a third alone, a third beside a rogue, a third beside hostile clients.
    #[arg(long, default_value_t = 18, value_parser = clap::value_parser!(u32).range(3..))]
    seconds: u32,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Where the rogue is.
#[derive(Clone, Debug, clap::Args)]
pub struct RogueArgs {
    /// Name of the instance.
    #[arg(long, value_name = "NAME")]
    instance: String,
    /// End together with the process that started this one.
    #[arg(long, value_name = "PID")]
    with_parent: u32,
}

/// Whoever is beside the control path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Beside {
    Nobody,
    Rogue,
    Clients,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the stack cannot be started, or the manoeuvre is over too early.
pub fn run(args: &HostileArgs) -> Result<Exit, Failure> {
    let folder = tempfile::Builder::new().prefix("kbh").tempdir().map_err(Failure::internal)?;
    let socket = folder.path().join("hostile.gateway");
    let stack = format!(
        "{}[gateway]\nenabled = true\nsocket = \"{}\"\npatience = 1\n",
        Scheduling::ordinary().stack(),
        socket.display()
    );
    let mut drive = Drive::start(&args.scenario, &stack)?;
    let (session, mut watch) = drive.join()?;
    let mut tick = Ticker::new(WINDOW);
    let mut sides = [Side::default(), Side::default(), Side::default()];
    let mut kept = 0;
    while kept < args.seconds && drive.goes_on(&mut watch, &mut tick)? {
        let beside = [Beside::Nobody, Beside::Rogue, Beside::Clients][kept as usize % sides.len()];
        let harm = Harm::start(beside, &drive.instance, &socket)?;
        kept += u32::from(sides[beside as usize].measure(&mut watch, &mut tick, harm));
    }
    drop((watch, session));
    all_measured(&sides)?;
    Ok(tell(&told(&sides), args.json))
}

fn told([alone, rogue, clients]: &[Side; 3]) -> Told {
    let mut rows = Vec::new();
    let mut figures = Vec::new();
    for (name, side) in [("beside a rogue", rogue), ("beside hostile clients", clients)] {
        let [latency, work] = side.against(alone, name, "alone");
        figures.extend(latency.figures(LIMIT, Some(LIMIT_P99)));
        rows.extend([latency, work]);
    }
    Told { verb: "hostile", figures, rows, notes: vec![], more: json!({}) }
}

/// Harm that is done until this is dropped.
enum Harm {
    Nobody,
    Rogue(Child),
    Clients(Arc<AtomicBool>, Vec<JoinHandle<()>>),
}

impl Harm {
    fn start(beside: Beside, instance: &Instance, socket: &Path) -> Result<Self, Failure> {
        match beside {
            Beside::Nobody => Ok(Self::Nobody),
            Beside::Rogue => start_rogue(instance).map(Self::Rogue),
            Beside::Clients => {
                let end = Arc::new(AtomicBool::new(false));
                let start = |_| {
                    let (end, socket) = (Arc::clone(&end), socket.to_owned());
                    std::thread::Builder::new()
                        .name("client".to_owned())
                        .spawn(move || ask_without_end(&socket, &end))
                        .map_err(Failure::internal)
                };
                let threads: Result<Vec<_>, _> = (0..CLIENTS).map(start).collect();
                Ok(Self::Clients(Arc::clone(&end), threads?))
            }
        }
    }
}

impl Drop for Harm {
    fn drop(&mut self) {
        match self {
            Self::Nobody => {}
            Self::Rogue(child) => {
                // In the midst of whatever it does.
                let _ = child.kill();
                let _ = child.wait();
            }
            Self::Clients(end, threads) => {
                end.store(true, Ordering::Relaxed);
                for thread in threads.drain(..) {
                    let _ = thread.join();
                }
            }
        }
    }
}

fn start_rogue(instance: &Instance) -> Result<Child, Failure> {
    let mut command = super::own_executable();
    command.args(["bench", "rogue", "--instance", instance.name()]);
    command.args(["--with-parent", &std::process::id().to_string()]);
    kerbside_runtime::close_inherited_on_exec();
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn();
    let mut child = child.map_err(Failure::internal)?;
    let mut word = String::new();
    let read = child.stdout.take().map(|out| BufReader::new(out).read_line(&mut word));
    if matches!(read, Some(Ok(length)) if length > 0) {
        return Ok(child);
    }
    let _ = child.kill();
    let _ = child.wait();
    Err(Failure::internal("the rogue did not start"))
}

/// Subscribes, then asks as fast as the socket takes it, and reads nothing; comes again when it is thrown out.
fn ask_without_end(socket: &Path, end: &AtomicBool) {
    let mut pause = Ticker::new(Duration::from_millis(20));
    while !end.load(Ordering::Relaxed) {
        pause.wait();
        let Ok(mut stream) = UnixStream::connect(socket) else { continue };
        if stream.set_write_timeout(Some(Duration::from_millis(50))).is_err() {
            continue;
        }
        let _ = stream.write_all(b"{\"request\":\"subscribe\",\"topic\":\"odometry\"}\n");
        while !end.load(Ordering::Relaxed) {
            match stream.write(b"{\"request\":\"status\"}\n\x00rubbish\n") {
                Ok(_) => {}
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(_) => break,
            }
        }
    }
}

/// The rogue: holds samples, and publishes what nobody may use.
///
/// # Errors
/// [`Failure`] where the middleware refuses.
pub fn run_rogue(args: &RogueArgs) -> Result<Exit, Failure> {
    crate::parent::die_with_parent(args.with_parent);
    let stop = stop_flag()?;
    let session = Session::join(&Instance::named(&args.instance)?, Process::Operator)?;
    let mut odometry: Subscriber<Odometry> = session.subscriber(None, HELD)?;
    let mut command: Subscriber<Command> = session.subscriber(None, HELD)?;
    let mut state: Subscriber<State> = session.subscriber(None, HELD)?;
    let mut fix = session.publisher::<Fix>(None)?;
    let mut inhibit = session.publisher::<Inhibit>(None)?;
    let planner = session.client::<PlanRequest, PlanAnswer>()?;
    let mut held = (Vec::new(), Vec::new(), Vec::new());
    let mut out = stdout().lock();
    writeln!(out, "ready").and_then(|()| out.flush()).map_err(Failure::internal)?;
    let mut round = Ticker::new(ROUND);
    while !stop.load(Ordering::Relaxed) {
        // As many as it gets, for ever; what it cannot hold it does not take.
        held.0.extend(odometry.receive().filter(|_| held.0.len() < HELD));
        held.1.extend(command.receive().filter(|_| held.1.len() < HELD));
        held.2.extend(state.receive().filter(|_| held.2.len() < HELD));
        // Sealed, and no numbers; not sealed at all; sealed, and no goal.
        fix.send(|fix| {
            *fix = Fix { header: Header::default(), x: f64::NAN, ..Fix::default() };
            true
        })?;
        inhibit.send_sealed(&Inhibit { expiry: u64::MAX, ..Inhibit::default() })?;
        drop(planner.send(PlanRequest { speed: f64::INFINITY, ..PlanRequest::default() }));
        round.wait();
    }
    Ok(Exit::Good)
}
