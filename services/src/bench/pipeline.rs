//! `bench pipeline`: from the encoder reading to the command, in a running stack that drives.
//!
//! Latencies come from the commands' stamps. The pipeline's own work is what the kernel accounts to the processes of
//! the control path, system calls included, per reading; its rival is the same of a chain of bare hops that runs beside
//! the stack every other second, reads a line and writes to it. Both are told with and without real-time rights.

use core::time::Duration;

use kerbside_messages::{Actuator, Command, Nanos, Odometry, Process, Raw, Travel};
use kerbside_runtime::{
    BareServices, BareSubscriber, RealtimeRequest, Session, SessionError, Ticker, enter_realtime,
};
use serde_json::{Value, json};

use super::chain::{Chain, PATH};
use super::drive::{Account, Drive, Watch};
use super::rows::{Row, Told, tell};
use super::statistics::{Blocks, median, ratio_of_medians};
use crate::exit::{Exit, Failure};

/// The pipeline's own work may be so many times that of bare hops.
const LIMIT: f64 = 1.5;
/// Windows of accounted work.
const WINDOW: Duration = Duration::from_millis(100);
/// Windows of a slice with or without the rival.
const SLICE: u32 = 10;
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
pub struct Scheduling {
    name: &'static str,
    request: RealtimeRequest,
}

impl Scheduling {
    /// Without rights.
    #[must_use]
    pub fn ordinary() -> Self {
        Self { name: "ordinary scheduling", request: RealtimeRequest::default() }
    }

    /// Without rights; and with, on any core and on one.
    fn all() -> Vec<Self> {
        let cores = std::thread::available_parallelism().map_or(1, core::num::NonZero::get);
        let real_time =
            |cores| RealtimeRequest { priority: Some(PRIORITY), lock_memory: true, cores };
        let mut all = vec![
            Self::ordinary(),
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
    #[must_use]
    pub fn stack(&self) -> String {
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
    let mut drive = Drive::start(&args.scenario, &scheduling.stack())?;
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
#[must_use]
pub fn ends(values: &[f64]) -> (f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let high = sorted.get(last.saturating_sub(values.len() / 100)).copied();
    (median(sorted), high.unwrap_or(f64::NAN))
}
