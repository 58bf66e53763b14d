//! `bench pipeline`: from the encoder reading to the command, in a running stack that drives.
//!
//! Latencies come from the commands' stamps. The pipeline's own work is what the kernel accounts to the processes of
//! the control path, system calls included, per reading; its rival is the same of a chain of bare hops that runs beside
//! the stack every other second, reads a line and writes to it. Both are told with and without real-time rights.

use core::time::Duration;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};

use kerbside_messages::{Actuator, Command, Mode, Nanos, Odometry, Process, Raw, State, Travel};
use kerbside_runtime::{
    BareServices, BareSubscriber, Instance, Newest, RealtimeRequest, Session, SessionError,
    Subscriber, Ticker, enter_realtime, now,
};
use serde_json::{Value, json};

use super::chain::{Chain, PATH};
use super::rows::{Row, Told, tell};
use super::statistics::{Blocks, median, ratio_of_medians};
use crate::exit::{Exit, Failure};
use crate::output;

/// The pipeline's own work may be so many times that of bare hops.
const LIMIT: f64 = 1.5;
/// Windows of accounted work.
const WINDOW: Duration = Duration::from_millis(100);
/// Windows of a slice with or without the rival.
const SLICE: u32 = 10;
/// Longest wait for the car to drive \[ns\].
const START: Nanos = 30_000_000_000;
/// Priority of the control path.
const PRIORITY: u8 = 50;

/// What `bench pipeline` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct PipelineArgs {
    /// Scenario that is driven.
    #[arg(default_value = "garage")]
    scenario: String,
    /// Seconds of driving that are measured, for each way of scheduling.
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(2..))]
    seconds: u32,
    /// Leave real-time scheduling out.
    #[arg(long)]
    ordinary: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// A way of scheduling the control path.
#[derive(Clone, Debug)]
struct Scheduling {
    name: &'static str,
    request: RealtimeRequest,
}

impl Scheduling {
    /// Without rights; and with, on any core and on one.
    fn all() -> Vec<Self> {
        let cores = std::thread::available_parallelism().map_or(1, core::num::NonZero::get);
        let real_time =
            |cores| RealtimeRequest { priority: Some(PRIORITY), lock_memory: true, cores };
        let mut all = vec![
            Self { name: "ordinary scheduling", request: RealtimeRequest::default() },
            Self { name: "real time, any core", request: real_time((0..cores).collect()) },
        ];
        if cores > 1 {
            let request = real_time(vec![cores - 1]);
            all.push(Self { name: "real time, one core", request });
        }
        all
    }

    /// What of it is refused; tried on a thread that ends at once.
    fn refused(&self) -> Vec<String> {
        let request = RealtimeRequest { lock_memory: false, ..self.request.clone() };
        std::thread::scope(|scope| scope.spawn(|| enter_realtime(&request).refused).join())
            .unwrap_or_default()
    }

    /// A stack of the 1:6 car with this scheduling.
    fn stack(&self) -> String {
        let enabled = if self.request.priority.is_some() { "on" } else { "off" };
        let cores = match &self.request.cores[..] {
            [] => String::new(),
            cores => format!("cores = {cores:?}\n"),
        };
        format!(
            "vehicle = \"paper-1-6\"\n[safety]\nstop_distance = 0.65\n[interface]\nkind = \"line\"\n\
             [realtime]\nenabled = \"{enabled}\"\npriority = {PRIORITY}\n{cores}[log]\nlevel = \"warn\"\n"
        )
    }
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where a stack cannot be started.
pub fn run(args: &PipelineArgs) -> Result<Exit, Failure> {
    let mut told =
        Told { verb: "pipeline", rows: vec![], figures: vec![], notes: vec![], more: json!({}) };
    let mut ways = Vec::new();
    let all = Scheduling::all().into_iter().take(if args.ordinary { 1 } else { usize::MAX });
    for scheduling in all {
        let refused = scheduling.refused();
        if !refused.is_empty() {
            told.notes.push(format!("{}: skipped: {}", scheduling.name, refused.join("; ")));
            continue;
        }
        let measured = measure(args, &scheduling)?;
        measured.tell(scheduling.name, &mut told);
        ways.push(measured.as_json(scheduling.name));
    }
    told.more = json!({ "ways": ways });
    Ok(tell(&told, args.json))
}

/// A stack that drives, in an instance of its own.
struct Drive {
    park: Child,
    instance: Instance,
    folder: PathBuf,
}

impl Drive {
    fn start(args: &PipelineArgs, scheduling: &Scheduling) -> Result<Self, Failure> {
        let folder = std::env::temp_dir().join(format!("kerbside-bench-{}", output::stamp()));
        fs::create_dir_all(&folder).map_err(Failure::internal)?;
        let stack = folder.join("stack.toml");
        output::write(&stack, &scheduling.stack())?;
        // The same name each time: a process takes part in one instance only.
        let name = Instance::fresh_name("bench");
        let mut command = super::own_executable();
        command.args([
            "park",
            &args.scenario,
            "--headless",
            "--rearm",
            "--json",
            "--instance",
            &name,
        ]);
        command.arg("--config").arg(&stack).arg("--out").arg(folder.join("out"));
        kerbside_runtime::close_inherited_on_exec();
        let park = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .map_err(Failure::internal)?;
        Ok(Self { park, instance: Instance::named(&name)?, folder })
    }

    fn join(&mut self) -> Result<(Session, Watch), Failure> {
        let deadline = now() + START;
        let mut look = Ticker::new(Duration::from_millis(10));
        loop {
            let joined = Session::join(&self.instance, Process::Operator)
                .and_then(|session| Watch::open(&session).map(|watch| (session, watch)));
            match joined {
                Ok(joined) => return Ok(joined),
                Err(error) if !error.is_missing() => return Err(error.into()),
                Err(error) if now() > deadline => return Err(Failure::unavailable(error)),
                Err(_) => {}
            }
            if !matches!(self.park.try_wait(), Ok(None)) {
                return Err(Failure::unavailable("the stack ended at its start"));
            }
            look.wait();
        }
    }
}

impl Drive {
    /// Waits until the car drives; false when the manoeuvre is over. A car that a busy machine stops is armed again.
    fn goes_on(&mut self, watch: &mut Watch, tick: &mut Ticker) -> Result<bool, Failure> {
        let deadline = now() + START;
        loop {
            watch.take_in();
            if watch.drives() {
                return Ok(true);
            }
            if !matches!(self.park.try_wait(), Ok(None)) || watch.mode() == Some(Mode::Done) {
                return Ok(false);
            }
            if now() > deadline {
                return Err(Failure::unavailable("the car did not drive"));
            }
            tick.wait();
        }
    }
}

impl Drop for Drive {
    fn drop(&mut self) {
        kerbside_runtime::terminate(self.park.id());
        let _ = self.park.wait();
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// What is watched of the stack.
struct Watch {
    state: Newest<State>,
    raw: Subscriber<Raw>,
    command: Subscriber<Command>,
    readings: u64,
}

impl Watch {
    fn open(session: &Session) -> Result<Self, SessionError> {
        Ok(Self {
            state: Newest::of(session.subscriber(None, 1)?),
            raw: session.subscriber(None, 512)?,
            command: session.subscriber(None, 256)?,
            readings: 0,
        })
    }

    /// Takes in what came; the latencies of the commands among it.
    fn take_in(&mut self) -> Vec<Nanos> {
        self.state.update();
        while let Some(raw) = self.raw.receive() {
            self.readings = raw.header.sequence;
        }
        let latency = |command: kerbside_runtime::Received<Command>| {
            command.header.sent.saturating_sub(command.header.origin)
        };
        core::iter::from_fn(|| self.command.receive()).map(latency).collect()
    }

    fn mode(&self) -> Option<Mode> {
        self.state.get().map(State::mode)
    }

    fn drives(&self) -> bool {
        self.mode() == Some(Mode::Driving)
    }

    fn pids(&self) -> Vec<(Process, u32)> {
        let rows = self.state.get().map(State::rows).unwrap_or_default();
        let pid_of = |process: Process| {
            let row = rows.iter().find(|row| row.process == process as u8)?;
            Some((process, row.pid))
        };
        PATH.into_iter().filter_map(pid_of).collect()
    }
}

/// What was measured of one way of scheduling.
#[derive(Debug, Default)]
struct Measured {
    /// From reading to command: alone, beside the chain, and of the chain.
    alone: Blocks,
    beside: Blocks,
    chain: Blocks,
    /// Work per reading of each window beside the chain \[us\]: the pipeline's, the chain's.
    work: Vec<f64>,
    chain_work: Vec<f64>,
    /// The pipeline's work per reading, alone \[us\], by process.
    by_process: Vec<Vec<f64>>,
    /// The chain's work per reading \[us\], by place.
    by_place: Vec<Vec<f64>>,
}

fn measure(args: &PipelineArgs, scheduling: &Scheduling) -> Result<Measured, Failure> {
    let mut drive = Drive::start(args, scheduling)?;
    let (session, mut watch) = drive.join()?;
    let bare = create_bare(&session)?;
    let chain = Chain::start(&drive.instance, &scheduling.request)?;
    let chain_commands = BareSubscriber::<Command>::open(&session)?;
    let mut tick = Ticker::new(WINDOW);
    let mut measured = Measured::default();
    let mut kept = 0;
    while kept < args.seconds && drive.goes_on(&mut watch, &mut tick)? {
        let beside = kept % 2 == 1;
        chain.feed(beside);
        tick.wait();
        watch.take_in();
        while chain_commands.receive().is_some() {}
        let slice = Slice::measure(&mut watch, &chain, &chain_commands, &mut tick);
        // What was measured while a fault stopped the car says nothing of a car that drives.
        if watch.drives() && !slice.latencies.is_empty() && slice.of_chain.is_empty() != beside {
            measured.keep(beside, slice);
            kept += 1;
        }
    }
    drop((chain, chain_commands, bare, watch, session));
    if measured.chain.0.is_empty() || measured.alone.0.is_empty() {
        return Err(Failure::unavailable(
            "the manoeuvre was over before there was anything to compare",
        ));
    }
    Ok(measured)
}

fn create_bare(session: &Session) -> Result<BareServices, SessionError> {
    let mut services = BareServices::default();
    services.create::<Raw>(session)?;
    services.create::<Travel>(session)?;
    services.create::<Odometry>(session)?;
    services.create::<Command>(session)?;
    services.create::<Actuator>(session)?;
    Ok(services)
}

/// What the kernel accounts to processes so far, and the readings they worked on.
struct Account {
    work: Vec<Nanos>,
    readings: u64,
}

impl Account {
    fn of(pids: &[(Process, u32)], readings: u64) -> Self {
        Self { work: pids.iter().map(|(_, pid)| execution_time(*pid)).collect(), readings }
    }

    /// Work of each process per reading since `before` \[us\].
    fn since(&self, before: &Self) -> Option<Vec<f64>> {
        let readings = self.readings.checked_sub(before.readings).filter(|count| *count > 0)?;
        #[allow(clippy::cast_precision_loss)] // far below 2^53
        let each = |(now, before): (&Nanos, &Nanos)| {
            now.saturating_sub(*before) as f64 / readings as f64 / 1e3
        };
        Some(self.work.iter().zip(&before.work).map(each).collect())
    }
}

/// Time a process spent executing, in user code and in the kernel \[ns\].
fn execution_time(pid: u32) -> Nanos {
    let text = fs::read_to_string(Path::new("/proc").join(pid.to_string()).join("schedstat"));
    text.ok()
        .and_then(|text| text.split_whitespace().next().and_then(|word| word.parse().ok()))
        .unwrap_or(0)
}

/// What a slice of time gave: latencies, and work per reading by process in each window.
#[derive(Debug, Default)]
struct Slice {
    latencies: Vec<Nanos>,
    of_chain: Vec<Nanos>,
    work: Vec<Vec<f64>>,
    work_of_chain: Vec<Vec<f64>>,
}

impl Slice {
    fn measure(
        watch: &mut Watch,
        chain: &Chain,
        chain_commands: &BareSubscriber<Command>,
        tick: &mut Ticker,
    ) -> Self {
        let (pids, chain_pids) = (watch.pids(), chain.pids());
        let account = |watch: &Watch| {
            (Account::of(&pids, watch.readings), Account::of(&chain_pids, chain.fed()))
        };
        let mut slice = Self::default();
        let mut before = account(watch);
        for _ in 0..SLICE - 1 {
            tick.wait();
            slice.latencies.extend(watch.take_in());
            let after = account(watch);
            slice.work.extend(after.0.since(&before.0));
            slice.work_of_chain.extend(after.1.since(&before.1));
            before = after;
            while let Some(command) = chain_commands.receive() {
                slice.of_chain.push(command.header.sent.saturating_sub(command.header.origin));
            }
        }
        slice
    }
}

impl Measured {
    fn keep(&mut self, beside: bool, slice: Slice) {
        if !beside {
            self.alone.0.push(slice.latencies);
            self.by_process.extend(slice.work);
            return;
        }
        let sum = |each: &Vec<f64>| each.iter().sum::<f64>();
        self.beside.0.push(slice.latencies);
        self.chain.0.push(slice.of_chain);
        self.work.extend(slice.work.iter().map(sum));
        self.chain_work.extend(slice.work_of_chain.iter().map(sum));
        self.by_place.extend(slice.work_of_chain);
    }

    /// The pipeline's work per reading while it runs alone \[us\].
    fn work_alone(&self) -> f64 {
        median(self.by_process.iter().map(|each| each.iter().sum()).collect())
    }

    fn tell(&self, name: &str, told: &mut Told) {
        let rival = "bare chain";
        let latency = format!("reading to command, {name}");
        told.rows.push(Row::of(&latency, 0, &self.beside, rival, &self.chain));
        let work = Row {
            name: format!("own work, {name}"),
            bytes: 0,
            ours: ends(&self.work),
            rival: rival.to_owned(),
            rivals: ends(&self.chain_work),
            ratio: ratio_of_medians(&self.work, &self.chain_work),
        };
        told.figures.extend(work.figures(LIMIT, None));
        told.rows.push(work);
        told.notes.push(format!(
            "{name}: reading to command alone p50 {:.0} us, p99 {:.0}, p99.9 {:.0}, max {:.0}; own work alone {:.0} us: {}; of the chain: {}",
            self.alone.percentile(0.5),
            self.alone.percentile(0.99),
            self.alone.percentile(0.999),
            self.alone.percentile(1.0),
            self.work_alone(),
            Self::in_words(&self.by_process, &PATH),
            Self::in_words(&self.by_place, &chain_places()),
        ));
    }

    /// Each process's work per reading \[us\].
    fn each(windows: &[Vec<f64>], places: &[Process]) -> Vec<(Process, f64)> {
        let of =
            |index: usize| windows.iter().filter_map(|each| each.get(index).copied()).collect();
        let each = |(index, process): (usize, &Process)| (*process, median(of(index)));
        places.iter().enumerate().map(each).collect()
    }

    fn in_words(windows: &[Vec<f64>], places: &[Process]) -> String {
        let each = Self::each(windows, places);
        each.iter().map(|(process, us)| format!("{process} {us:.0}")).collect::<Vec<_>>().join(", ")
    }

    fn as_json(&self, name: &str) -> Value {
        let latency = |blocks: &Blocks| {
            json!({
                "p50": blocks.percentile(0.5), "p99": blocks.percentile(0.99),
                "p999": blocks.percentile(0.999), "max": blocks.percentile(1.0),
                "samples": blocks.0.iter().map(Vec::len).sum::<usize>(),
            })
        };
        let each = |windows: &[Vec<f64>], places: &[Process]| {
            let each = Self::each(windows, places).into_iter();
            each.map(|(process, us)| (process.name().to_owned(), json!(us)))
                .collect::<serde_json::Map<_, _>>()
        };
        json!({
            "name": name, "latency_us": latency(&self.alone), "latency_beside_chain_us": latency(&self.beside),
            "chain_latency_us": latency(&self.chain), "work_us": self.work_alone(),
            "work_by_process_us": each(&self.by_process, &PATH),
            "chain_work_by_process_us": each(&self.by_place, &chain_places()),
        })
    }
}

/// The places of the chain, in the order in which its links are started.
fn chain_places() -> Vec<Process> {
    PATH.into_iter().rev().collect()
}

/// Median and 99th percentile of windows \[us\].
fn ends(values: &[f64]) -> (f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let high = sorted.get(last.saturating_sub(values.len() / 100)).copied();
    (median(sorted), high.unwrap_or(f64::NAN))
}
