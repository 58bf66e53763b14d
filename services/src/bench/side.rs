//! The control path of a stack that drives, measured alone and with somebody beside it.

use core::time::Duration;

use kerbside_messages::Nanos;
use kerbside_runtime::Ticker;

use super::drive::{Account, Watch};
use super::pipeline::ends;
use super::rows::Row;
use super::statistics::{Blocks, ratio_of_medians};
use crate::exit::Failure;

/// Windows of accounted work.
pub const WINDOW: Duration = Duration::from_millis(100);
/// Windows of a slice.
const SLICE: u32 = 10;

/// What was measured with one of them beside it, or nobody.
#[derive(Debug, Default)]
pub struct Side {
    latencies: Blocks,
    /// Work per reading of each window \[us\].
    work: Vec<f64>,
}

impl Side {
    /// Measures a slice while `beside` is there, and ends it. False where nothing is kept: what was measured while a
    /// fault stopped the car says nothing of a car that drives.
    pub fn measure<T>(&mut self, watch: &mut Watch, tick: &mut Ticker, beside: T) -> bool {
        tick.wait();
        watch.take_in();
        let (latencies, work) = slice(watch, tick);
        drop(beside);
        let kept = watch.drives() && !latencies.is_empty();
        if kept {
            self.latencies.0.push(latencies);
            self.work.extend(work);
        }
        kept
    }

    /// Latency and work of this side against those of `other`, called `rival`.
    #[must_use]
    pub fn against(&self, other: &Self, name: &str, rival: &str) -> [Row; 2] {
        let latency = format!("reading to command, {name}");
        let work = Row {
            name: format!("own work, {name}"),
            bytes: 0,
            ours: ends(&self.work),
            rival: rival.to_owned(),
            rivals: ends(&other.work),
            ratio: ratio_of_medians(&self.work, &other.work),
        };
        [Row::of(&latency, 0, &self.latencies, rival, &other.latencies), work]
    }
}

/// # Errors
/// [`Failure`] where a side has nothing.
pub fn all_measured(sides: &[Side]) -> Result<(), Failure> {
    if sides.iter().any(|side| side.latencies.0.is_empty()) {
        let words = "the manoeuvre was over before there was anything to compare";
        return Err(Failure::unavailable(words));
    }
    Ok(())
}

/// Latencies, and work per reading of each window.
fn slice(watch: &mut Watch, tick: &mut Ticker) -> (Vec<Nanos>, Vec<f64>) {
    let pids = watch.pids();
    let (mut latencies, mut work) = (Vec::new(), Vec::new());
    let mut before = Account::of(&pids, watch.readings);
    for _ in 0..SLICE - 1 {
        tick.wait();
        latencies.extend(watch.take_in());
        let after = Account::of(&pids, watch.readings);
        work.extend(after.since(&before).map(|each| each.iter().sum::<f64>()));
        before = after;
    }
    (latencies, work)
}
