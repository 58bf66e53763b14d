//! The other process of `bench transport`: receives block after block and tells the latencies.

use std::collections::BTreeMap;
use std::io::{BufRead, Write, stdin, stdout};

use kerbside_messages::{Nanos, Process};
use kerbside_runtime::{Instance, RealtimeRequest, Session, enter_realtime, now};
use serde::{Deserialize, Serialize};

use super::hop::{Carrier, Receivers, Receiving, Subject, Way};
use crate::exit::{Exit, Failure};

/// Longest time without a sample in a block \[ns\].
const SILENCE: Nanos = 500_000_000;
/// Time to look for samples without sleeping \[ns\].
const SPIN: Nanos = 200_000;
/// Samples at the beginning of a block that are not counted: connections are made, caches are cold.
pub const WARM_UP: usize = 5;

/// A block of samples of one hop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Block {
    /// Whose samples.
    pub subject: Subject,
    /// What carries them.
    pub carrier: Carrier,
    /// How the receiver waits.
    pub way: Way,
    /// The core it runs on.
    pub core: usize,
    /// How many samples come, those for warming up included.
    pub count: usize,
}

/// What the other process is told.
#[derive(Clone, Debug, clap::Args)]
pub struct PeerArgs {
    /// Name of the instance.
    #[arg(long, value_name = "NAME")]
    instance: String,
    /// Priority under SCHED_FIFO.
    #[arg(long)]
    priority: Option<u8>,
}

/// Receives blocks as they are announced on standard input, until it ends.
///
/// # Errors
/// [`Failure`] where the middleware refuses.
pub fn run(args: &PeerArgs) -> Result<Exit, Failure> {
    let session = Session::join(&Instance::named(&args.instance)?, Process::Operator)?;
    let mut receivers = Receivers::new(&session);
    let mut ends: BTreeMap<(Subject, Carrier), Box<dyn Receiving>> = BTreeMap::new();
    for line in stdin().lock().lines() {
        let block: Block =
            serde_json::from_str(&line.map_err(Failure::internal)?).map_err(Failure::internal)?;
        let end = match ends.entry((block.subject, block.carrier)) {
            std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
            std::collections::btree_map::Entry::Vacant(entry) => {
                entry.insert(receivers.open(block.subject, block.carrier)?)
            }
        };
        let _ = enter_realtime(&RealtimeRequest {
            priority: args.priority,
            cores: vec![block.core],
            ..RealtimeRequest::default()
        });
        say("ready")?;
        let latencies = receive(end.as_mut(), &block);
        say(&serde_json::to_string(&latencies).map_err(Failure::internal)?)?;
    }
    Ok(Exit::Good)
}

fn say(line: &str) -> Result<(), Failure> {
    let mut out = stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush()).map_err(Failure::internal)
}

fn receive(end: &mut dyn Receiving, block: &Block) -> Vec<Nanos> {
    let mut latencies = Vec::with_capacity(block.count);
    let mut newest = now();
    while latencies.len() < block.count && now().saturating_sub(newest) < SILENCE {
        if block.way == Way::Spin {
            let until = now() + SPIN;
            while now() < until && drain(end, &mut latencies) == 0 {
                core::hint::spin_loop();
            }
        }
        if latencies.len() < block.count {
            end.wait(block.way);
        }
        if drain(end, &mut latencies) > 0 {
            newest = now();
        }
    }
    latencies.drain(..WARM_UP.min(latencies.len()));
    latencies
}

fn drain(end: &mut dyn Receiving, latencies: &mut Vec<Nanos>) -> usize {
    let before = latencies.len();
    while let Some(stamp) = end.receive() {
        latencies.push(now().saturating_sub(stamp));
    }
    latencies.len() - before
}
