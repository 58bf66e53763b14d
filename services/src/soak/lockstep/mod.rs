//! `soak --lockstep`: random faults by seed on simulated time, on all cores.

mod one;
mod summary;
mod totals;

pub use one::{Atlas, Outcome, Scenes, manoeuvre};
pub use summary::tell;
pub use totals::{Failed, Totals};

use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::exit::Failure;
use crate::lockstep::{Broken, Schedule, draw, shrink};

/// Failing seeds whose schedules are shrunk; more say little more.
const SHRUNK: usize = 3;
/// A soak ends early after so many failing seeds.
const ENOUGH: usize = 20;

/// How long to soak.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// Minutes of manoeuvres, on simulated time.
    Minutes(f64),
    /// Manoeuvres.
    Manoeuvres(u64),
}

impl Amount {
    fn is_done(self, started: u64, minutes: f64) -> bool {
        match self {
            Self::Minutes(enough) => minutes >= enough,
            Self::Manoeuvres(enough) => started >= enough,
        }
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a bar's length
    fn length(self) -> u64 {
        match self {
            Self::Minutes(minutes) => minutes.ceil() as u64,
            Self::Manoeuvres(manoeuvres) => manoeuvres,
        }
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a bar's position
    fn position(self, totals: &Totals) -> u64 {
        match self {
            Self::Minutes(_) => totals.minutes() as u64,
            Self::Manoeuvres(_) => totals.manoeuvres(),
        }
    }
}

/// Soaks from `first` on, on so many threads, until `amount` is driven or `stop` is set.
///
/// # Errors
/// [`Failure`] where the shipped configuration is refused.
pub fn soak(
    first: u64,
    amount: Amount,
    threads: usize,
    stop: &AtomicBool,
) -> Result<Totals, Failure> {
    let (begun, worked) = (kerbside_runtime::now(), kerbside_runtime::processor_time());
    let (scenes, atlas) = (Scenes::load()?, Atlas::default());
    let (next, totals, bar) = (AtomicU64::new(0), Mutex::new(Totals::new(first)), bar(amount));
    let work = || -> Result<(), Failure> {
        loop {
            let seed = {
                let Ok(totals) = totals.lock() else { return Ok(()) };
                let started = next.load(Ordering::Relaxed);
                let enough = totals.failed.len() >= ENOUGH || stop.load(Ordering::Relaxed);
                if enough || amount.is_done(started, totals.minutes()) {
                    return Ok(());
                }
                first.wrapping_add(next.fetch_add(1, Ordering::Relaxed))
            };
            let outcome = manoeuvre(&scenes, &atlas, seed, &draw(seed))?;
            if let Ok(mut totals) = totals.lock() {
                totals.add(outcome);
                bar.set_position(amount.position(&totals));
                bar.set_message(format!("{} broken", totals.failed.len()));
            }
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        threads.into_iter().try_for_each(|thread| {
            thread.join().unwrap_or_else(|_| Err(Failure::internal("a soaking thread ended")))
        })
    })?;
    bar.finish_and_clear();
    let mut totals =
        totals.into_inner().map_err(|_| Failure::internal("a soaking thread ended"))?;
    totals.wall_seconds = kerbside_messages::seconds(kerbside_runtime::now() - begun);
    totals.processor_seconds =
        kerbside_messages::seconds(kerbside_runtime::processor_time() - worked);
    totals.threads = threads;
    totals.failed.sort_by_key(|failed| failed.seed);
    for failed in totals.failed.iter_mut().take(SHRUNK) {
        failed.shrunk = Some(shrunk(&scenes, &atlas, failed)?);
    }
    Ok(totals)
}

/// The shortest schedule that breaks the same invariant.
fn shrunk(scenes: &Scenes, atlas: &Atlas, failed: &Failed) -> Result<(Schedule, Broken), Failure> {
    let mut newest = failed.broken.clone();
    let mut failure = None;
    let schedule = shrink(&failed.schedule, |schedule| {
        match manoeuvre(scenes, atlas, failed.seed, schedule) {
            Ok(Outcome { broken: Some(broken), .. })
                if broken.invariant == failed.broken.invariant =>
            {
                newest = broken;
                true
            }
            Ok(_) => false,
            Err(error) => {
                failure = Some(error);
                false
            }
        }
    });
    failure.map_or(Ok((schedule, newest)), Err)
}

fn bar(amount: Amount) -> ProgressBar {
    let bar = ProgressBar::new(amount.length());
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let unit = match amount {
        Amount::Minutes(_) => "minutes",
        Amount::Manoeuvres(_) => "manoeuvres",
    };
    let template = format!("{{bar:30}} {{pos}}/{{len}} {unit}, {{msg}}, {{elapsed}}");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar
}
