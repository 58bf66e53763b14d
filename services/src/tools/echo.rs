//! `echo`: the samples of a topic, as they come.

use kerbside_messages::Nanos;
use kerbside_runtime::now;

use super::show::{self, Path, Shown};
use super::tap::Tap;
use super::{Named, Out, Place};
use crate::exit::{Exit, Failure};

/// Samples that wait for this tool at most.
const BUFFER: usize = 64;

/// What `echo` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct EchoArgs {
    /// The topic; heartbeat/tracker is that of one process alone.
    #[arg(value_parser = Named::parse)]
    topic: Named,
    /// End after so many samples; else with Ctrl-C, or with the stack.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// Print these fields alone, a line per sample: x,y or header.stamp,covariance.0.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    fields: Vec<String>,
    /// Print every element of long lists.
    #[arg(long)]
    full: bool,
    /// Give up when no sample came for so long [s].
    #[arg(long, value_name = "SECONDS", value_parser = super::seconds)]
    timeout: Option<f64>,
    /// Name of the instance; the only live one where not given.
    #[arg(long, value_name = "NAME")]
    instance: Option<String>,
    /// Print a JSON object per sample, a line each.
    #[arg(long)]
    json: bool,
}

/// Prints samples until enough came, the stack ended, or nobody reads on.
///
/// # Errors
/// [`Failure`] where a field is not there, or there is no stack to listen to.
pub fn run(args: &EchoArgs) -> Result<Exit, Failure> {
    let topic = args.topic.topic;
    let fields: Vec<Path> = args
        .fields
        .iter()
        .map(|name| Path::parse(topic, name))
        .collect::<Result<_, _>>()
        .map_err(|words| Failure::new(Exit::Usage, words))?;
    let mut place = Place::open(args.instance.as_deref())?;
    let mut tap = Tap::open(&place.session, args.topic, BUFFER)?;
    let mut echo = Echo { out: Out::new(), left: args.count.unwrap_or(u64::MAX), heard: now() };
    let mut goes_on = true;
    while goes_on && echo.wants_more() {
        if args.timeout.is_some_and(|limit| echo.silence() > limit) {
            tell_losses(&tap);
            let limit = args.timeout.unwrap_or_default();
            let words = format!("no sample of {} came for {limit} s", args.topic.name());
            return Err(Failure::new(Exit::Bad, words));
        }
        goes_on = place.goes_on();
        let mut result = Ok(());
        tap.take(|sample| {
            if result.is_ok() && echo.wants_more() {
                let shown = show::sample(topic, sample.bytes, sample.tail);
                result = echo.print(&text(args, &fields, &shown));
            }
        });
        result?;
    }
    tell_losses(&tap);
    if !place.lives && args.count.is_some() && echo.wants_more() {
        return Err(place.ended());
    }
    Ok(Exit::Good)
}

/// Samples that are still wanted, and whether somebody wants them.
struct Echo {
    out: Out,
    left: u64,
    heard: Nanos,
}

impl Echo {
    fn wants_more(&self) -> bool {
        self.left > 0 && self.out.open
    }

    /// Time since the newest sample \[s\].
    fn silence(&self) -> f64 {
        kerbside_messages::seconds(now().saturating_sub(self.heard))
    }

    fn print(&mut self, text: &str) -> Result<(), Failure> {
        (self.left, self.heard) = (self.left - 1, now());
        self.out.print(text).map(|_| ())
    }
}

/// A sample as it is asked for.
fn text(args: &EchoArgs, fields: &[Path], sample: &Shown) -> String {
    let found = |path: &Path| path.find(sample).cloned();
    match (args.json, fields) {
        (true, []) => json(sample),
        (true, fields) => {
            let pairs: Vec<_> = fields
                .iter()
                .map(|path| format!("{}:{}", serde_json::json!(path.name), json(&found(path))))
                .collect();
            format!("{{{}}}", pairs.join(","))
        }
        (false, []) => format!("{}---", sample.lines(args.full)),
        (false, fields) => {
            let word = |path: &Path| found(path).map_or("-".to_owned(), |shown| shown.to_string());
            let words: Vec<_> =
                fields.iter().map(|path| format!("{}={}", path.name, word(path))).collect();
            words.join("  ")
        }
    }
}

/// Nothing here fails to become JSON: numbers that are none become null.
fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// Says on standard error what of the topic was not shown.
fn tell_losses(tap: &Tap) {
    let counts = tap.refusals();
    if counts.lost > 0 {
        eprintln!("{} samples came faster than they were printed, and are lost", counts.lost);
    }
    if let Some(newest) = counts.newest {
        eprintln!("{} samples were refused, the newest: {newest}", counts.total());
    }
}
