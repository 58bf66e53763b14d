//! `topics`: the table of topics, with who takes part in each and how often it comes.

use kerbside_messages::topics::{Delivery, TABLE};
use kerbside_messages::{Publisher, Topic, nanos};
use kerbside_runtime::{Census, Instance, Session, SessionError, now};
use serde_json::{Value, json};

use super::pace::Pace;
use super::tap::Tap;
use super::{Named, Out, Place};
use crate::exit::{Exit, Failure};
use crate::tables;

/// Rates come from sequences: the newest samples are enough.
const BUFFER: usize = 4;

/// What `topics` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct TopicsArgs {
    /// Time over which rates are measured [s].
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = super::seconds)]
    window: f64,
    /// Name of the instance; the only live one where not given, and the table alone where none is.
    #[arg(long, value_name = "NAME")]
    instance: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// A topic of a running stack.
struct Live {
    census: Census,
    /// None where its places for guests are taken.
    pace: Option<Pace>,
}

/// Lists the topics.
///
/// # Errors
/// [`Failure`] where the named instance is not running, or several are and none is named.
pub fn run(args: &TopicsArgs) -> Result<Exit, Failure> {
    let mut out = Out::new();
    if args.instance.is_none() && Instance::live().is_empty() {
        let text = if args.json { object(None, &[]) } else { table(&[]) };
        out.print(&text)?;
        eprintln!("no instance is running: this is the table alone");
        return Ok(Exit::Good);
    }
    let mut place = Place::open(args.instance.as_deref())?;
    let live = look(&mut place, args.window)?;
    if !place.lives {
        return Err(place.ended());
    }
    let name = place.instance.name();
    out.print(&if args.json { object(Some(name), &live) } else { table(&live) })?;
    Ok(Exit::Good)
}

fn look(place: &mut Place, window: f64) -> Result<Vec<Live>, Failure> {
    let censuses: Vec<_> =
        TABLE.iter().map(|topic| census(&place.session, topic)).collect::<Result<_, _>>()?;
    let mut taps = Vec::new();
    for topic in TABLE {
        taps.push(listen(&place.session, topic)?);
    }
    let mut paces = vec![Pace::default(); TABLE.len()];
    let end = now() + nanos(window);
    while now() < end && place.goes_on() {
        for (tap, pace) in taps.iter_mut().zip(&mut paces) {
            if let Some(tap) = tap {
                tap.take(|sample| pace.take(sample.process, sample.header));
            }
        }
    }
    let live = |((census, tap), pace): ((Census, Option<Tap>), Pace)| Live {
        census,
        pace: tap.map(|_| pace),
    };
    Ok(censuses.into_iter().zip(taps).zip(paces).map(live).collect())
}

/// Who takes part in all services of a topic; this tool itself does not.
fn census(session: &Session, topic: &'static Topic) -> Result<Census, SessionError> {
    let services = match topic.publisher {
        Publisher::Each => kerbside_messages::Process::SUPERVISED.map(Some).to_vec(),
        _ => vec![None],
    };
    let mut all = Census::default();
    for process in services {
        let one = session.census(topic, process)?;
        all.publishers.extend(one.publishers);
        for subscriber in one.subscribers {
            if !all.subscribers.contains(&subscriber) {
                all.subscribers.push(subscriber);
            }
        }
    }
    Ok(all)
}

/// Subscribes to what can be listened to; none where all places are taken.
fn listen(session: &Session, topic: &'static Topic) -> Result<Option<Tap>, SessionError> {
    if topic.delivery == Delivery::RequestResponse {
        return Ok(None);
    }
    match Tap::open(session, Named { topic, process: None }, BUFFER) {
        Ok(tap) => Ok(Some(tap)),
        Err(SessionError::Full { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Who is expected, by the table.
fn expected(topic: &Topic) -> String {
    match topic.publisher {
        Publisher::One(process) => process.name().to_owned(),
        Publisher::Each => "every process".to_owned(),
        Publisher::Any => "anyone".to_owned(),
    }
}

fn names<T: ToString>(all: &[T]) -> String {
    if all.is_empty() {
        return "-".to_owned();
    }
    all.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

fn table(live: &[Live]) -> String {
    let mut table = tables::framed();
    if live.is_empty() {
        table.set_header(["topic", "payload", "from", "to", "Hz"]);
    } else {
        table.set_header(["topic", "payload", "from", "to", "Hz", "of"]);
    }
    let mut live = live.iter();
    for topic in TABLE {
        let nominal = Named { topic, process: None }.nominal();
        let nominal = nominal.map(|rate| format!("{rate:.0}")).unwrap_or_default();
        let head = [topic.name.to_owned(), topic.payload.to_owned()];
        let rest = match live.next() {
            None => vec![expected(topic), names(topic.subscribers), nominal],
            Some(live) => {
                let from = match topic.publisher {
                    Publisher::Each => format!("{} processes", live.census.publishers.len()),
                    _ => names(&live.census.publishers),
                };
                let rate = match &live.pace {
                    None => String::new(),
                    Some(pace) => pace.rate().map_or("-".to_owned(), |rate| format!("{rate:.1}")),
                };
                vec![from, names(&live.census.subscribers), rate, nominal]
            }
        };
        table.add_row(head.into_iter().chain(rest));
    }
    table.to_string()
}

fn object(instance: Option<&str>, live: &[Live]) -> String {
    let row = |(index, topic): (usize, &'static Topic)| -> Value {
        let live = live.get(index);
        let all = |all: &[kerbside_runtime::Participant]| -> Vec<Value> {
            let one = |one: &kerbside_runtime::Participant| json!({ "pid": one.pid, "process": one.process.map(|process| process.name()) });
            all.iter().map(one).collect()
        };
        json!({
            "name": topic.name, "number": topic.id, "payload": topic.payload,
            "type_name": kerbside_messages::topics::type_name_of(topic),
            "bytes": kerbside_messages::topics::layout_of(topic).map(|layout| layout.size),
            "from": expected(topic),
            "to": topic.subscribers.iter().map(|process| process.name()).collect::<Vec<_>>(),
            "nominal_hz": Named { topic, process: None }.nominal(),
            "fresh_for_ms": topic.freshness.map(|limit| limit.as_millis()),
            "what": topic.doc,
            "publishers": live.map(|live| all(&live.census.publishers)),
            "subscribers": live.map(|live| all(&live.census.subscribers)),
            "rate_hz": live.and_then(|live| live.pace.as_ref()?.rate()),
        })
    };
    json!({
        "schema": "kerbside.topics.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null,
        "passed": true, "figures": [], "instance": instance,
        "layout_version": kerbside_messages::LAYOUT_VERSION,
        "topics": TABLE.iter().enumerate().map(row).collect::<Vec<_>>(),
    })
    .to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_stack_the_table_is_told() {
        let shown = table(&[]);
        assert!(shown.contains("odometry") && shown.contains("every process"), "{shown}");
        let object: Value = serde_json::from_str(&object(None, &[])).unwrap();
        let topics = object["topics"].as_array().unwrap();
        assert_eq!(topics.len(), TABLE.len());
        assert_eq!((&topics[0]["name"], &topics[0]["publishers"]), (&"raw".into(), &Value::Null));
    }
}
