//! `recording`: check and recover.

use std::path::{Path, PathBuf};

use kerbside_messages::seconds;
use kerbside_recordings::recording::{CheckReport, RecordingError, RecoverReport, check, recover};
use serde_json::{Map, Value, json};

use crate::exit::{Exit, Failure};

/// What to do with a recording.
#[derive(Clone, Debug, clap::Subcommand)]
pub enum RecordingVerb {
    /// Read the whole file, verify every check sum, and say what is wrong.
    #[command(after_help = "Example: kerbside recording check recording.mcap")]
    Check {
        /// The recording.
        path: PathBuf,
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Write what can be read of a recording to a new, complete file.
    #[command(after_help = "Example: kerbside recording recover broken.mcap whole.mcap")]
    Recover {
        /// The recording.
        path: PathBuf,
        /// The new file; it must not exist.
        out: PathBuf,
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the file cannot be read as a recording.
pub fn run(verb: &RecordingVerb) -> Result<Exit, Failure> {
    match verb {
        RecordingVerb::Check { path, json } => {
            let report = check(path).map_err(refused)?;
            let sound = report.is_sound();
            if *json {
                println!("{}", check_as_json(&report, sound));
            } else {
                print_check(&report);
            }
            Ok(if sound { Exit::Good } else { Exit::Bad })
        }
        RecordingVerb::Recover { path, out, json } => {
            let report = recover(path, out).map_err(refused)?;
            if *json {
                println!("{}", recover_as_json(out, &report));
            } else {
                print_recover(out, &report);
            }
            Ok(Exit::Good)
        }
    }
}

fn object(schema: &str, passed: bool, more: Value) -> Value {
    let mut object = json!({
        "schema": format!("kerbside.{schema}.v1"), "version": env!("CARGO_PKG_VERSION"), "seed": null,
        "passed": passed, "figures": [],
    });
    if let (Some(object), Value::Object(more)) = (object.as_object_mut(), more) {
        object.extend(more);
    }
    object
}

fn check_as_json(report: &CheckReport, sound: bool) -> Value {
    let topics: Map<String, Value> =
        report.topics.iter().map(|topic| (topic.channel.clone(), json!(topic.messages))).collect();
    let more = json!({
        "recording": report.path, "bytes": report.bytes, "chunks": report.chunks, "messages": topics,
        "problems": report.problems(),
    });
    object("recording", sound, more)
}

fn print_check(report: &CheckReport) {
    let seconds = report.time.map_or(0.0, |(first, last)| seconds(last.saturating_sub(first)));
    println!("{}", report.path.display());
    println!("{} messages in {} chunks over {seconds:.1} s", report.messages(), report.chunks);
    for topic in &report.topics {
        println!("{:>9}  {}", topic.messages, topic.channel);
    }
    let problems = report.problems();
    for problem in &problems {
        println!("problem: {problem}");
    }
    if problems.is_empty() {
        println!("complete and undamaged");
    } else if report.messages() > 0 {
        println!("kerbside recording recover writes what can be read to a new file");
    }
}

fn recover_as_json(out: &Path, report: &RecoverReport) -> Value {
    let lost: Vec<_> = report.lost.iter().map(ToString::to_string).collect();
    let more = json!({
        "recording": out, "messages": report.messages, "chunks": report.chunks,
        "from_torn_chunk": report.from_torn_chunk, "unnamed": report.unnamed, "lost": lost,
    });
    object("recovered", true, more)
}

fn print_recover(out: &Path, report: &RecoverReport) {
    println!("{}", out.display());
    println!("{} messages recovered", report.messages);
    if report.from_torn_chunk > 0 {
        println!("{} of them from a torn chunk, without check sum", report.from_torn_chunk);
    }
    for lost in &report.lost {
        println!("lost: {lost}");
    }
}

fn refused(error: RecordingError) -> Failure {
    Failure::new(Exit::Data, error)
}
