//! `recording`: check and recover.

use std::path::PathBuf;

use kerbside_recordings::recording::{RecordingError, check, recover};
use serde_json::json;

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
                let topics: serde_json::Map<_, _> = report
                    .topics
                    .iter()
                    .map(|topic| (topic.channel.clone(), json!(topic.messages)))
                    .collect();
                let object = json!({
                    "schema": "kerbside.recording.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null,
                    "passed": sound, "figures": [], "recording": report.path, "bytes": report.bytes,
                    "chunks": report.chunks, "messages": topics, "problems": report.problems(),
                });
                println!("{object}");
            } else {
                println!(
                    "{}: {} messages in {} chunks",
                    path.display(),
                    report.messages(),
                    report.chunks
                );
                report
                    .topics
                    .iter()
                    .for_each(|topic| println!("{:>9}  {}", topic.messages, topic.channel));
                report.problems().iter().for_each(|problem| println!("problem: {problem}"));
            }
            Ok(if sound { Exit::Good } else { Exit::Bad })
        }
        RecordingVerb::Recover { path, out } => {
            let report = recover(path, out).map_err(refused)?;
            println!("{}: {} messages recovered", out.display(), report.messages);
            Ok(Exit::Good)
        }
    }
}

fn refused(error: RecordingError) -> Failure {
    Failure::new(Exit::Data, error)
}
