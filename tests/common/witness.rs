//! A witness of what the machine does to the tests' processes: it looks, on every core and at every process of a stack,
//! for time in which somebody wanted to run and could not.
//!
//! Two kinds of evidence. A thread on each core ticks and is late: the core was taken away, by other work or by the
//! host of a virtual machine. And the kernel accounts to each process how long it waited for a core
//! (`/proc/PID/schedstat`, second figure).

use core::time::Duration;
use std::collections::BTreeMap;
use std::fs;
use std::sync::{Mutex, MutexGuard, Once, PoisonError};

use kerbside_messages::Nanos;
use kerbside_runtime::{RealtimeRequest, Ticker, enter_realtime, now};

/// Time between looks.
const LOOK: Duration = Duration::from_millis(5);
/// A core's tick that is so late, or waits of a stack's processes for a core that add up to so much within
/// [`WINDOW`], are a stall: the shortest time-out that a stack of the tests has is 100 ms \[ns\].
const STALL: Nanos = 30_000_000;
/// See [`STALL`] \[ns\].
const WINDOW: Nanos = 250_000_000;

static BEGIN: Once = Once::new();
static FOLLOWED: Mutex<BTreeMap<u32, Nanos>> = Mutex::new(BTreeMap::new());
static STALLS: Mutex<Vec<Stall>> = Mutex::new(Vec::new());

/// Somebody wanted to run and could not.
#[derive(Clone, Debug)]
struct Stall {
    at: Nanos,
    words: String,
}

/// Begins to look, once for all stacks of a test binary.
pub(crate) fn begin() {
    BEGIN.call_once(|| {
        let cores = std::thread::available_parallelism().map_or(1, core::num::NonZero::get);
        for core in 0..cores {
            std::thread::spawn(move || watch_core(core));
        }
        std::thread::spawn(watch_processes);
    });
}

/// A process of a stack, whose waits count from now on.
pub(crate) fn follow(pid: u32) {
    if pid > 0 {
        lock(&FOLLOWED).entry(pid).or_insert_with(|| waited(pid).unwrap_or_default());
    }
}

/// What stalled from `since` on, in words; none where nothing did.
pub(crate) fn stalled_since(since: Nanos) -> Option<String> {
    let stalls = lock(&STALLS);
    let words: Vec<_> = stalls.iter().filter(|stall| stall.at >= since).collect();
    let first = words.first()?;
    Some(format!("{} stalls, the first at {}: {}", words.len(), first.at, first.words))
}

fn watch_core(core: usize) {
    let _ = enter_realtime(&RealtimeRequest { cores: vec![core], ..RealtimeRequest::default() });
    let mut tick = Ticker::new(LOOK);
    let mut before = now();
    loop {
        tick.wait();
        let at = now();
        let late = (at - before).saturating_sub(LOOK.as_nanos() as u64);
        before = at;
        if late > STALL {
            note(at, format!("core {core} ran nothing of ours for {} ms", late / 1_000_000));
        }
    }
}

fn watch_processes() {
    let mut tick = Ticker::new(LOOK);
    let (mut begun, mut sum) = (now(), 0);
    loop {
        tick.wait();
        lock(&FOLLOWED).retain(|pid, before| {
            let Some(total) = waited(*pid) else { return false };
            sum += total.saturating_sub(*before);
            *before = total;
            true
        });
        let at = now();
        if sum > STALL {
            note(at, format!("processes of stacks waited {} ms for a core", sum / 1_000_000));
        }
        if sum > STALL || at - begun > WINDOW {
            (begun, sum) = (at, 0);
        }
    }
}

fn note(at: Nanos, words: String) {
    lock(&STALLS).push(Stall { at, words });
}

/// How long a process waited for a core since its start \[ns\]; none where it is gone.
fn waited(pid: u32) -> Option<Nanos> {
    let line = fs::read_to_string(format!("/proc/{pid}/schedstat")).ok()?;
    line.split_whitespace().nth(1)?.parse().ok()
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}
