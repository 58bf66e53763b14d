//! `hz`: how often a topic comes, how evenly, how old, and what of it is lost.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kerbside_messages::topics::{Delivery, TABLE};
use kerbside_messages::{Nanos, Refusals, nanos};
use kerbside_runtime::now;
use serde_json::{Value, json};

use super::pace::{Pace, Spread};
use super::tap::Tap;
use super::{Named, Out, Place};
use crate::exit::{Exit, Failure};
use crate::tables;

/// Samples that wait for this tool at most: a topic of 1000 Hz fills it in 64 ms.
const BUFFER: usize = 64;

/// What `hz` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct HzArgs {
    /// Topics; every one with a rate of its own where none is named.
    #[arg(value_parser = Named::parse)]
    topics: Vec<Named>,
    /// Time that is measured [s].
    #[arg(long, value_name = "SECONDS", default_value = "2", value_parser = super::seconds)]
    window: f64,
    /// Measure window after window, until Ctrl-C or the end of the stack.
    #[arg(long, conflicts_with = "json")]
    watch: bool,
    /// Name of the instance; the only live one where not given.
    #[arg(long, value_name = "NAME")]
    instance: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Measures; exit code 1 where a topic was silent all the time.
///
/// # Errors
/// [`Failure`] where there is no stack, or it ended before the time was over.
pub fn run(args: &HzArgs) -> Result<Exit, Failure> {
    let mut place = Place::open(args.instance.as_deref())?;
    let topics = if args.topics.is_empty() { regular() } else { args.topics.clone() };
    let mut taps = Vec::new();
    for named in topics {
        taps.push((named, Tap::open(&place.session, named, BUFFER)?));
    }
    let mut out = Out::new();
    loop {
        let measured = measure(&mut place, &mut taps, args.window);
        if !place.lives {
            return Err(place.ended());
        }
        let Some(measured) = measured else { return Ok(Exit::Good) };
        let heard = heard(args, &measured);
        let text = if args.json { object(args, &place, &measured) } else { table(&measured) };
        let read = out.print(&text)?;
        if !args.watch || !read {
            return Ok(if heard { Exit::Good } else { Exit::Bad });
        }
    }
}

/// Whether everything that was asked for was heard; of all topics some may be silent, as commands are at standstill.
fn heard(args: &HzArgs, measured: &[Measured]) -> bool {
    let mut heard = measured.iter().map(|one| one.pace.samples() > 0);
    if args.topics.is_empty() { heard.any(|heard| heard) } else { heard.all(|heard| heard) }
}

/// The topics that are to come at a rate.
fn regular() -> Vec<Named> {
    let comes = |topic: &&kerbside_messages::Topic| {
        topic.rate > 0.0 && topic.delivery != Delivery::RequestResponse
    };
    TABLE.iter().filter(comes).map(|topic| Named { topic, process: None }).collect()
}

/// What was heard of a topic.
struct Measured {
    named: Named,
    pace: Pace,
    refusals: Refusals,
}

/// Listens for so long; none where a person ended it.
fn measure(place: &mut Place, taps: &mut [(Named, Tap)], window: f64) -> Option<Vec<Measured>> {
    // What came before is of another window.
    taps.iter_mut().for_each(|(_, tap)| tap.take(|_| {}));
    let mut paces = vec![Pace::default(); taps.len()];
    let (begin, length) = (now(), nanos(window));
    let bar = bar(length);
    while now() < begin + length {
        if !place.goes_on() {
            bar.finish_and_clear();
            return None;
        }
        for ((_, tap), pace) in taps.iter_mut().zip(&mut paces) {
            // A standing sample says what was, not how often it comes.
            tap.take(|sample| {
                if sample.header.sent >= begin {
                    pace.take(sample.process, sample.header);
                }
            });
        }
        bar.set_position((now() - begin) / 1_000_000);
    }
    bar.finish_and_clear();
    let one = |((named, tap), pace): (&(Named, Tap), Pace)| Measured {
        named: *named,
        pace,
        refusals: tap.refusals(),
    };
    Some(taps.iter().zip(paces).map(one).collect())
}

fn bar(length: Nanos) -> ProgressBar {
    let bar = ProgressBar::new(length / 1_000_000);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    if let Ok(style) = ProgressStyle::with_template("listening {wide_bar} {pos}/{len} ms") {
        bar.set_style(style);
    }
    bar
}

fn table(measured: &[Measured]) -> String {
    let header = ["topic", "Hz", "of", "jitter", "p99", "max", "age", "p99", "lost"];
    let mut table = tables::dense_figures(&header, &[1, 2, 3, 4, 5, 6, 7, 8]);
    let number = |value: Option<f64>, digits: usize| {
        value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
    };
    let ms = |spread: Option<Spread>, of: fn(&Spread) -> f64| {
        number(spread.as_ref().map(|spread| 1e3 * of(spread)), 2)
    };
    for one in measured {
        let (pace, jitter, age) = (&one.pace, one.pace.jitter(), one.pace.age());
        table.add_row([
            one.named.name(),
            number(pace.rate(), 1),
            number(one.named.nominal(), 0),
            ms(jitter, |spread| spread.p50),
            ms(jitter, |spread| spread.p99),
            ms(jitter, |spread| spread.max),
            ms(age, |spread| spread.p50),
            ms(age, |spread| spread.p99),
            pace.lost().to_string(),
        ]);
    }
    let mut text = format!(
        "{table}\njitter: off the median interval; age: of the content when sent; both in ms"
    );
    for one in measured {
        if let Some(refusal) = one.refusals.newest {
            let (name, count) = (one.named.name(), one.refusals.total());
            text.push_str(&format!("\n{name}: {count} refused, the newest: {refusal}"));
        }
    }
    text
}

fn object(args: &HzArgs, place: &Place, measured: &[Measured]) -> String {
    let ms = |spread: Option<Spread>| {
        spread.map(|spread| {
            json!({ "p50": 1e3 * spread.p50, "p99": 1e3 * spread.p99, "max": 1e3 * spread.max })
        })
    };
    let one = |one: &Measured| -> Value {
        let pace = &one.pace;
        json!({
            "name": one.named.name(), "samples": pace.samples(), "rate_hz": pace.rate(),
            "nominal_hz": one.named.nominal(), "period_ms": ms(pace.period()),
            "jitter_ms": ms(pace.jitter()), "age_ms": ms(pace.age()), "lost": pace.lost(),
            "refused": one.refusals.total(), "refusal": one.refusals.newest.map(|why| why.to_string()),
        })
    };
    json!({
        "schema": "kerbside.hz.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null,
        "passed": heard(args, measured), "figures": [],
        "instance": place.instance.name(), "window_s": args.window,
        "topics": measured.iter().map(one).collect::<Vec<_>>(),
    })
    .to_string()
}
