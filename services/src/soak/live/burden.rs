//! What else the machine and the instance have to bear: processes of their own, ended with the soak.

use core::time::Duration;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

use kerbside_messages::{
    Command as CommandSample, Fix, Nanos, Odometry, OperatorRequest, Process, text,
};
use kerbside_runtime::{Instance, Session, Ticker, now};

use super::super::{Burden, BurdenArgs};
use crate::exit::{Exit, Failure};
use crate::life::stop_flag;
use crate::parent;

/// Part of the memory that is available which the pressure takes.
const SHARE: u64 = 2;
/// Most of it \[bytes\].
const MOST: u64 = 2 << 30;
/// Time between two samples of rubbish.
const FLOOD: Duration = Duration::from_millis(1);
/// A hostile peer is killed and started anew after so long \[ns\].
const PEER_LIFE: Nanos = 7_000_000_000;
/// Period of the bare thread, and how late it may be before that counts as a miss.
const PULSE: Duration = Duration::from_millis(5);

/// Processes that burden the machine.
#[derive(Debug)]
pub struct Burdens {
    children: Vec<(Burden, Child, Nanos)>,
    instance: Instance,
}

impl Burdens {
    /// Starts one process each.
    ///
    /// # Errors
    /// [`Failure`] where one cannot be started.
    pub fn start(kinds: &[Burden], instance: &Instance) -> Result<Self, Failure> {
        let mut burdens = Self { children: Vec::new(), instance: instance.clone() };
        for kind in kinds {
            let child = burdens.spawn(*kind)?;
            burdens.children.push((*kind, child, now()));
        }
        Ok(burdens)
    }

    fn spawn(&self, kind: Burden) -> Result<Child, Failure> {
        kerbside_runtime::close_inherited_on_exec();
        Command::new("/proc/self/exe")
            .arg0("kerbside")
            .args(["soak", "--burden", kind.name(), "--instance", self.instance.name()])
            .args(["--with-parent", &std::process::id().to_string()])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0)
            .spawn()
            .map_err(Failure::internal)
    }

    /// Kills a hostile peer in the middle of what it does, and starts another one; whether it did.
    ///
    /// # Errors
    /// [`Failure`] where one cannot be started.
    pub fn renew(&mut self) -> Result<bool, Failure> {
        let now = now();
        for index in 0..self.children.len() {
            let (kind, child, since) = &mut self.children[index];
            let ended = matches!(child.try_wait(), Ok(Some(_)));
            if *kind != Burden::Peer || (!ended && now - *since < PEER_LIFE) {
                continue;
            }
            let _ = child.kill();
            let _ = child.wait();
            let another = self.spawn(Burden::Peer)?;
            self.children[index] = (Burden::Peer, another, now);
            return Ok(true);
        }
        Ok(false)
    }
}

impl Drop for Burdens {
    fn drop(&mut self) {
        for (_, child, _) in &mut self.children {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Runs one burden until it is ended.
///
/// # Errors
/// [`Failure`] where it cannot be.
pub fn run(args: &BurdenArgs) -> Result<Exit, Failure> {
    if let Some(parent) = args.with_parent {
        parent::die_with_parent(parent);
    }
    let stop = stop_flag()?;
    match args.burden {
        Some(Burden::Cpu) => spin(&stop),
        Some(Burden::Memory) => press(&stop),
        Some(Burden::Peer) => annoy(args, &stop)?,
        Some(Burden::Disk) | None => {}
    }
    Ok(Exit::Good)
}

fn spin(stop: &Arc<AtomicBool>) {
    let cores = std::thread::available_parallelism().map_or(1, core::num::NonZero::get);
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                let mut value = 1_u64;
                while !stop.load(Ordering::Relaxed) {
                    value = core::hint::black_box(value.wrapping_mul(0x9e37_79b9_7f4a_7c15));
                }
            });
        }
    });
}

/// Takes a share of the memory that is available, and touches every page of it again and again.
fn press(stop: &AtomicBool) {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let available = text
        .lines()
        .find_map(|line| line.strip_prefix("MemAvailable:"))
        .and_then(|rest| rest.split_whitespace().next()?.parse::<u64>().ok())
        .unwrap_or(0);
    let size = (available * 1024 / SHARE).min(MOST);
    let mut held = vec![0_u8; usize::try_from(size).unwrap_or(0)];
    let mut round = 0_u8;
    while !stop.load(Ordering::Relaxed) {
        round = round.wrapping_add(1);
        for page in held.chunks_mut(4096) {
            page[0] = core::hint::black_box(round);
            if stop.load(Ordering::Relaxed) {
                return;
            }
        }
    }
}

/// A peer of the instance that holds what it receives, publishes rubbish and is killed anywhere.
fn annoy(args: &BurdenArgs, stop: &AtomicBool) -> Result<(), Failure> {
    let name = args.instance.as_deref().unwrap_or_default();
    let session = Session::join(&Instance::named(name)?, Process::Operator)?;
    let mut odometry = session.subscriber::<Odometry>(None, 2)?;
    let mut commands = session.subscriber::<CommandSample>(None, 2)?;
    let (mut held, mut held_commands) = (Vec::new(), Vec::new());
    let mut fix = session.publisher::<Fix>(None)?;
    let client = session.client::<OperatorRequest, kerbside_messages::OperatorAnswer>()?;
    let mut tick = Ticker::new(FLOOD);
    let mut round = 0_u64;
    while !stop.load(Ordering::Relaxed) {
        tick.wait();
        round += 1;
        // What is received is never given back, as long as the middleware hands out any.
        held.extend(odometry.receive());
        held_commands.extend(commands.receive());
        let content = rubbish(round);
        let _ = fix.send(|out| {
            *out = content;
            true
        });
        if round.is_multiple_of(100) {
            let request = OperatorRequest { id: round, verb: 200, ..OperatorRequest::default() };
            let _ = client.send(request);
        }
    }
    Ok(())
}

/// A fix that must be refused, each for another reason.
fn rubbish(round: u64) -> Fix {
    let mut fix = Fix { source: text::from_str("hostile"), ..Fix::default() };
    match round % 4 {
        0 => fix.x = f64::NAN,
        1 => fix.yaw = f64::INFINITY,
        2 => fix.covariance = [-1.0; 9],
        _ => fix.x = 1e300,
    }
    fix.header.stamp = now();
    fix
}

/// A bare thread beside the stack that sleeps to absolute times: what the machine does to anybody.
#[derive(Debug)]
pub struct Pulse {
    misses: Arc<AtomicU64>,
    beats: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Pulse {
    /// Starts it; a beat that is later than `deadline` is a miss.
    ///
    /// # Errors
    /// [`Failure`] where the thread cannot be started.
    pub fn start(deadline: Duration) -> Result<Self, Failure> {
        let (misses, beats, stop): (Arc<AtomicU64>, Arc<AtomicU64>, Arc<AtomicBool>) =
            Default::default();
        let shared = (Arc::clone(&misses), Arc::clone(&beats), Arc::clone(&stop));
        let limit = crate::life::nanos(deadline);
        let body = move || {
            let (misses, beats, stop) = shared;
            let mut tick = Ticker::new(PULSE);
            while !stop.load(Ordering::Relaxed) {
                let due = tick.next();
                tick.wait();
                beats.fetch_add(1, Ordering::Relaxed);
                if now().saturating_sub(due) > limit {
                    misses.fetch_add(1, Ordering::Relaxed);
                }
            }
        };
        let thread = std::thread::Builder::new()
            .name("pulse".to_owned())
            .spawn(body)
            .map_err(Failure::internal)?;
        Ok(Self { misses, beats, stop, thread: Some(thread) })
    }

    /// Misses so far.
    #[must_use]
    pub fn misses(&self) -> u64 {
        self.misses.load(Ordering::Relaxed)
    }

    /// Beats so far.
    #[must_use]
    pub fn beats(&self) -> u64 {
        self.beats.load(Ordering::Relaxed)
    }
}

impl Drop for Pulse {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
