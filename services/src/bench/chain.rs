//! The rival of the pipeline: as many processes as the control path has, which pass a reading on in bare hops and do
//! nothing else. The first one reads a line and writes to it, as the interface does.

use std::io::{BufRead, BufReader, Write, stdout};
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

use kerbside_messages::{Actuator, Command, Header, Message, Odometry, Process, Raw, Travel};
use kerbside_runtime::{
    BarePublisher, BareSubscriber, Instance, RealtimeRequest, Session, Ticker, bare_listener,
    enter_realtime, now, poll_readable,
};

use crate::exit::{Exit, Failure};
use crate::ingest::WAIT;
use crate::interface::serial::Line;
use crate::life::{nanos, stop_flag};
use crate::vehicle::pty::Pty;

/// The processes of the control path, in the order of a sample's way.
pub const PATH: [Process; 5] =
    [Process::Interface, Process::Ingest, Process::Estimator, Process::Tracker, Process::Actuation];

/// Bytes of a reading and of a command on the line.
const READING: usize = 64;
const COMMAND: usize = 24;
/// Time between readings.
const PERIOD: core::time::Duration = core::time::Duration::from_millis(5);

/// Where a link stands.
#[derive(Clone, Debug, clap::Args)]
pub struct LinkArgs {
    /// Name of the instance.
    #[arg(long, value_name = "NAME")]
    instance: String,
    /// The process whose place it takes.
    #[arg(long, value_name = "NAME", value_parser = process_named)]
    place: Process,
    /// The line.
    #[arg(long, value_name = "FILE")]
    line: PathBuf,
    /// Priority under SCHED_FIFO.
    #[arg(long)]
    priority: Option<u8>,
    /// Cores to run on.
    #[arg(long, value_delimiter = ',')]
    cores: Vec<usize>,
    /// End together with the process that started this one.
    #[arg(long, value_name = "PID")]
    with_parent: u32,
}

fn process_named(name: &str) -> Result<Process, String> {
    let places = PATH.map(Process::name).join(", ");
    Process::from_name(name)
        .filter(|process| PATH.contains(process))
        .ok_or_else(|| format!("allowed are {places}"))
}

/// Runs one link until it is told to end.
///
/// # Errors
/// [`Failure`] where the middleware refuses.
pub fn run_link(args: &LinkArgs) -> Result<Exit, Failure> {
    crate::parent::die_with_parent(args.with_parent);
    let stop = stop_flag()?;
    let session = Session::join(&Instance::named(&args.instance)?, Process::Operator)?;
    let _ = enter_realtime(&RealtimeRequest {
        priority: args.priority,
        lock_memory: args.priority.is_some(),
        cores: args.cores.clone(),
    });
    match args.place {
        Process::Interface => first_link(&session, args, &stop),
        Process::Ingest => link::<Raw, Travel>(&session, &stop),
        Process::Estimator => link::<Travel, Odometry>(&session, &stop),
        Process::Tracker => link::<Odometry, Command>(&session, &stop),
        _ => link::<Command, Actuator>(&session, &stop),
    }?;
    Ok(Exit::Good)
}

fn ready() -> Result<(), Failure> {
    let mut out = stdout().lock();
    writeln!(out, "ready").and_then(|()| out.flush()).map_err(Failure::internal)
}

fn link<I: Message, O: Message>(session: &Session, stop: &AtomicBool) -> Result<(), Failure> {
    let input = BareSubscriber::<I>::open(session)?;
    let listener = bare_listener::<I>(session)?;
    let output = BarePublisher::<O>::open(session)?;
    let mut message = O::default();
    ready()?;
    while !stop.load(Ordering::Relaxed) {
        listener.wait(WAIT);
        while let Some(sample) = input.receive() {
            *message.header_mut() = passed_on(sample.header());
            output.send(&message)?;
        }
    }
    Ok(())
}

fn passed_on(header: &Header) -> Header {
    Header { sent: now(), ..Header::stamped(header.stamp, header.origin) }
}

fn first_link(session: &Session, args: &LinkArgs, stop: &AtomicBool) -> Result<(), Failure> {
    let input = BareSubscriber::<Actuator>::open(session)?;
    let listener = bare_listener::<Actuator>(session)?;
    let output = BarePublisher::<Raw>::open(session)?;
    let mut line = Line::open(&args.line, 921_600).map_err(Failure::internal)?;
    let mut buffer = [0; 4096];
    let mut message = Raw::default();
    ready()?;
    while !stop.load(Ordering::Relaxed) {
        let ready = poll_readable(&[line.as_fd(), listener.as_fd()], now() + nanos(PERIOD));
        let arrival = now();
        if ready & 1 != 0 && line.read(&mut buffer).map_err(Failure::internal)? > 0 {
            message.header = Header::stamped(arrival, arrival);
            output.send(&message)?;
        }
        if ready & 1 == 0 {
            listener.drain();
        }
        while input.receive().is_some() {
            line.write(&[0x55; COMMAND]).map_err(Failure::internal)?;
        }
    }
    Ok(())
}

/// The chain, and the line that feeds it.
pub struct Chain {
    links: Vec<(Process, Child)>,
    feeder: Option<JoinHandle<()>>,
    shared: Arc<Shared>,
}

#[derive(Default)]
struct Shared {
    feeding: AtomicBool,
    fed: AtomicU64,
    end: AtomicBool,
}

impl Chain {
    /// Starts the links and the line; nothing is fed yet.
    ///
    /// # Errors
    /// [`Failure`] where a link cannot be started.
    pub fn start(instance: &Instance, request: &RealtimeRequest) -> Result<Self, Failure> {
        let path = instance.folder().join("bare-line");
        let pty = Pty::create(&path).map_err(Failure::internal)?;
        let shared = Arc::new(Shared::default());
        let feeder = {
            let shared = Arc::clone(&shared);
            std::thread::Builder::new()
                .name("feeder".to_owned())
                .spawn(move || feed(pty, &shared))
                .map_err(Failure::internal)?
        };
        let mut chain = Self { links: Vec::new(), feeder: Some(feeder), shared };
        // The last link first: each finds who listens to it.
        for place in PATH.into_iter().rev() {
            chain.links.push((place, start_link(instance, place, &path, request)?));
        }
        Ok(chain)
    }

    /// Whether readings are fed from now on.
    pub fn feed(&self, on: bool) {
        self.shared.feeding.store(on, Ordering::Relaxed);
    }

    /// Readings fed so far.
    pub fn fed(&self) -> u64 {
        self.shared.fed.load(Ordering::Relaxed)
    }

    /// The links' pids.
    pub fn pids(&self) -> Vec<(Process, u32)> {
        self.links.iter().map(|(place, child)| (*place, child.id())).collect()
    }
}

fn start_link(
    instance: &Instance,
    place: Process,
    line: &std::path::Path,
    request: &RealtimeRequest,
) -> Result<Child, Failure> {
    let mut command = super::own_executable();
    command.args(["bench", "link", "--instance", instance.name(), "--place", place.name()]);
    command.arg("--line").arg(line);
    command.args(["--with-parent", &std::process::id().to_string()]);
    if let Some(priority) = request.priority {
        command.args(["--priority", &priority.to_string()]);
    }
    if !request.cores.is_empty() {
        let cores: Vec<_> = request.cores.iter().map(ToString::to_string).collect();
        command.args(["--cores", &cores.join(",")]);
    }
    kerbside_runtime::close_inherited_on_exec();
    let mut child =
        command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().map_err(Failure::internal)?;
    let mut word = String::new();
    let read = child.stdout.take().map(|out| BufReader::new(out).read_line(&mut word));
    if matches!(read, Some(Ok(length)) if length > 0) {
        return Ok(child);
    }
    let _ = child.kill();
    let _ = child.wait();
    Err(Failure::internal(format!("the bare {place} did not start")))
}

/// Writes readings at their rate while it is asked to, and takes what comes back.
fn feed(mut pty: Pty, shared: &Shared) {
    let mut tick = Ticker::new(PERIOD);
    let mut buffer = [0; 4096];
    while !shared.end.load(Ordering::Relaxed) {
        tick.wait();
        let _ = pty.read(&mut buffer);
        if shared.feeding.load(Ordering::Relaxed) && pty.write(&[0x55; READING]).is_ok() {
            shared.fed.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Drop for Chain {
    fn drop(&mut self) {
        for (_, child) in &self.links {
            kerbside_runtime::terminate(child.id());
        }
        for (_, child) in &mut self.links {
            let _ = child.wait();
        }
        self.shared.end.store(true, Ordering::Relaxed);
        if let Some(feeder) = self.feeder.take() {
            let _ = feeder.join();
        }
    }
}
