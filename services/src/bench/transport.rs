//! `bench transport`: one hop in the stack's own code against the middleware alone, and the ways to wait.
//!
//! Sender and receiver are processes of their own. Blocks of the rivals take turns, so that whatever else the machine
//! does meets all of them; a ratio is the median over blocks of the blocks' ratios, with its bootstrap interval.

use core::time::Duration;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Stdio};

use kerbside_messages::{Command, MAX_PLAN_POINTS, Odometry, Plan, Raw, TrajectoryPoint, Travel};
use kerbside_messages::{Message, check_sum};
use kerbside_runtime::{Instance, RealtimeRequest, Services, Session, Ticker, enter_realtime, now};
use serde_json::{Value, json};

use super::hop::{Carrier, Sending, Subject, Way, create_bare, sending};
use super::peer::{Block, WARM_UP};
use super::rows::{Row, Told, tell};
use super::statistics::Blocks;
use crate::exit::{Exit, Failure};

/// A hop of ours may take so many times the bare hop at p50.
const LIMIT_P50: f64 = 1.25;
/// The same at p99.
const LIMIT_P99: f64 = 2.0;
/// Priority of both ends.
const PRIORITY: u8 = 50;
/// Time between plans: each keeps two caches busy for a while.
const PLAN_GAP: Duration = Duration::from_millis(3);

/// What `bench transport` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct TransportArgs {
    /// Interleaved blocks of each rival.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u32).range(2..))]
    blocks: u32,
    /// Samples of a block.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(10..))]
    samples: u32,
    /// Time between samples [us].
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(300..))]
    gap: u64,
    /// Leave both ends to the ordinary scheduler, even where the rights for SCHED_FIFO are there.
    #[arg(long)]
    ordinary: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the two ends cannot be set up.
pub fn run(args: &TransportArgs) -> Result<Exit, Failure> {
    let instance = Instance::named(&Instance::fresh_name("bench"))?;
    let lock = instance.lock()?;
    let told = {
        let services = Services::create(&instance)?;
        let bare = create_bare(services.session())?;
        let told = measure(args, services.session());
        drop((bare, services));
        told
    };
    instance.remove()?;
    drop(lock);
    Ok(tell(&told?, args.json))
}

fn measure(args: &TransportArgs, session: &Session) -> Result<Told, Failure> {
    let cores = Cores::of_machine(args.ordinary);
    let mut bench = Bench::start(args, session, &cores)?;
    let mut told = Told {
        verb: "transport",
        rows: Vec::new(),
        figures: Vec::new(),
        notes: cores.notes(),
        more: json!({ "check_sums": check_sums() }),
    };
    for subject in Subject::PATH {
        bench.rivals(subject, &mut told)?;
    }
    bench.plan(&mut told)?;
    bench.ways(&mut told)?;
    bench.end()?;
    told.notes.push(check_sums_in_words(&told.more["check_sums"]));
    Ok(told)
}

/// Where and how the two ends run; the same for every rival.
struct Cores {
    sender: usize,
    other: usize,
    priority: Option<u8>,
}

impl Cores {
    /// The first core and the last; under SCHED_FIFO where it is granted: the tail is then the hop's own, and not
    /// that of whoever else runs on the machine.
    fn of_machine(ordinary: bool) -> Self {
        let count = std::thread::available_parallelism().map_or(1, core::num::NonZero::get);
        let request = RealtimeRequest { priority: Some(PRIORITY), ..RealtimeRequest::default() };
        let granted = std::thread::spawn(move || enter_realtime(&request).scheduled).join();
        let priority = (!ordinary && granted.unwrap_or(false)).then_some(PRIORITY);
        Self { sender: 0, other: count - 1, priority }
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = vec![
            "iceoryx2: a bare publish and event of the same size; datagram: a Unix datagram socket"
                .to_owned(),
        ];
        notes.push(match self.priority {
            Some(_) => "both ends under SCHED_FIFO".to_owned(),
            None => "both ends under the ordinary scheduler".to_owned(),
        });
        if self.other == self.sender {
            notes.push("one core: sender and receiver share it".to_owned());
        }
        notes
    }
}

/// The sending process, and its line to the receiving one.
struct Bench<'a> {
    args: &'a TransportArgs,
    session: &'a Session,
    cores: &'a Cores,
    child: Child,
    to: Option<ChildStdin>,
    from: BufReader<ChildStdout>,
    ends: BTreeMap<(Subject, Carrier), Box<dyn Sending>>,
}

impl<'a> Bench<'a> {
    fn start(
        args: &'a TransportArgs,
        session: &'a Session,
        cores: &'a Cores,
    ) -> Result<Self, Failure> {
        let mut command = super::own_executable();
        command.args(["bench", "peer", "--instance", session.instance().name()]);
        if let Some(priority) = cores.priority {
            command.args(["--priority", &priority.to_string()]);
        }
        kerbside_runtime::close_inherited_on_exec();
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(Failure::internal)?;
        let (Some(to), Some(from)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(Failure::internal("no pipes to the receiving process"));
        };
        let request = RealtimeRequest {
            priority: cores.priority,
            cores: vec![cores.sender],
            ..RealtimeRequest::default()
        };
        let _ = enter_realtime(&request);
        let from = BufReader::new(from);
        Ok(Self { args, session, cores, child, to: Some(to), from, ends: BTreeMap::new() })
    }

    fn end(mut self) -> Result<(), Failure> {
        // The end of its input is the end of the receiving process.
        self.to = None;
        let status = self.child.wait().map_err(Failure::internal)?;
        if status.success() { Ok(()) } else { Err(Failure::internal(status)) }
    }

    fn gap(&self) -> Duration {
        Duration::from_micros(self.args.gap)
    }

    fn block(
        &self,
        subject: Subject,
        carrier: Carrier,
        way: Way,
        core: usize,
        samples: u32,
    ) -> Block {
        Block { subject, carrier, way, core, count: samples as usize + WARM_UP }
    }

    /// Runs one block; its latencies.
    fn run(&mut self, block: &Block, gap: Duration) -> Result<Vec<u64>, Failure> {
        let order = serde_json::to_string(block).map_err(Failure::internal)?;
        let Some(to) = &mut self.to else { return Err(Failure::internal("ended")) };
        writeln!(to, "{order}").map_err(Failure::internal)?;
        self.line()?;
        let key = (block.subject, block.carrier);
        let end = match self.ends.entry(key) {
            std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
            std::collections::btree_map::Entry::Vacant(entry) => {
                entry.insert(sending(self.session, block.subject, block.carrier)?)
            }
        };
        let mut tick = Ticker::new(gap);
        for _ in 0..block.count {
            tick.wait();
            end.send(now())?;
        }
        let latencies: Vec<u64> = serde_json::from_str(&self.line()?).map_err(Failure::internal)?;
        // Of plans the newest counts: where the receiver was late, one stands for two.
        if 2 * latencies.len() >= block.count {
            Ok(latencies)
        } else {
            let (got, of) = (latencies.len() + WARM_UP, block.count);
            Err(Failure::internal(format!("{block:?}: {got} of {of} samples arrived")))
        }
    }

    fn line(&mut self) -> Result<String, Failure> {
        let mut line = String::new();
        match self.from.read_line(&mut line) {
            Ok(0) => Err(Failure::internal("the receiving process ended")),
            Ok(_) => Ok(line),
            Err(error) => Err(Failure::internal(error)),
        }
    }

    /// Runs `kinds` in turns, each turn beginning with another one.
    fn interleave(&mut self, kinds: &[Block], gap: Duration) -> Result<Vec<Blocks>, Failure> {
        let mut measured = vec![Blocks::default(); kinds.len()];
        for turn in 0..self.args.blocks as usize {
            for offset in 0..kinds.len() {
                let index = (turn + offset) % kinds.len();
                let latencies = self.run(&kinds[index], gap)?;
                measured[index].0.push(latencies);
            }
        }
        Ok(measured)
    }

    fn rivals(&mut self, subject: Subject, told: &mut Told) -> Result<(), Failure> {
        let carriers = [Carrier::Stack, Carrier::Bare, Carrier::Datagram];
        let kinds = carriers.map(|carrier| {
            self.block(subject, carrier, Way::Event, self.cores.other, self.args.samples)
        });
        let measured = self.interleave(&kinds, self.gap())?;
        for index in [1, 2] {
            let rival = carriers[index].name();
            let (ours, rivals) = (&measured[0], &measured[index]);
            let row = Row::of(subject.name(), subject.bytes(), ours, rival, rivals);
            if carriers[index] == Carrier::Bare {
                told.figures.extend(row.figures(LIMIT_P50, Some(LIMIT_P99)));
            }
            told.rows.push(row);
        }
        Ok(())
    }

    fn plan(&mut self, told: &mut Told) -> Result<(), Failure> {
        let subject = Subject::Plan;
        let kinds = [Carrier::Stack, Carrier::Bare].map(|carrier| {
            self.block(subject, carrier, Way::Event, self.cores.other, self.args.samples.min(40))
        });
        let measured = self.interleave(&kinds, PLAN_GAP)?;
        let rival = Carrier::Bare.name();
        told.rows.push(Row::of(subject.name(), subject.bytes(), &measured[0], rival, &measured[1]));
        told.notes.push(
            "a plan is shown, not held against a limit: once a manoeuvre, its receiver reads and checks every byte, of \
             which the bare one reads none"
                .to_owned(),
        );
        Ok(())
    }

    /// The ways to wait, on the other core and on the sender's, for the largest sample of the control path.
    fn ways(&mut self, told: &mut Told) -> Result<(), Failure> {
        let subject = Subject::Odometry;
        let mut kinds = Vec::new();
        let mut names = Vec::new();
        for (core, place) in [(self.cores.other, "other core"), (self.cores.sender, "same core")] {
            for way in [Way::Event, Way::Poll, Way::Spin] {
                kinds.push(self.block(subject, Carrier::Stack, way, core, self.args.samples));
                names.push(format!("{}, {place}", way.name()));
            }
        }
        let measured = self.interleave(&kinds, self.gap())?;
        for index in 1..kinds.len() {
            told.rows.push(Row::of(
                &names[index],
                subject.bytes(),
                &measured[index],
                &names[0],
                &measured[0],
            ));
        }
        Ok(())
    }
}

impl Drop for Bench<'_> {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What the check sum of a sample costs one end of a hop \[ns\].
fn check_sums() -> Vec<Value> {
    fn one<M: Message>(tail: &[u8]) -> Value {
        const ROUNDS: u32 = 5_000;
        let message = M::default();
        let begun = now();
        for _ in 0..ROUNDS {
            core::hint::black_box(check_sum(core::hint::black_box(&message), tail));
        }
        #[allow(clippy::cast_precision_loss)] // milliseconds
        let nanos = (now() - begun) as f64 / f64::from(ROUNDS);
        json!({ "name": M::TOPIC.name, "bytes": size_of::<M>() + tail.len(), "ns": nanos })
    }
    vec![one::<Raw>(&[]), one::<Travel>(&[]), one::<Odometry>(&[]), one::<Command>(&[]), {
        let points = vec![TrajectoryPoint::default(); MAX_PLAN_POINTS];
        one::<Plan>(bytemuck::cast_slice(&points))
    }]
}

fn check_sums_in_words(sums: &Value) -> String {
    let words = |sum: &Value| {
        let nanos = sum["ns"].as_f64().unwrap_or(f64::NAN);
        format!("{} {nanos:.0} ns", sum["name"].as_str().unwrap_or_default())
    };
    let each: Vec<_> = sums.as_array().into_iter().flatten().map(words).collect();
    format!("check sum, paid at both ends of a hop: {}", each.join(", "))
}
