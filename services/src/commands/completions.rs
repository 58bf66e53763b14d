//! `completions`: what a shell needs to complete verbs and options, from the same declaration as `--help`.

use clap::CommandFactory;
use clap_complete::Shell;
use serde_json::json;

use crate::exit::{Exit, Failure};

/// What `completions` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct CompletionsArgs {
    /// The shell.
    #[arg(value_parser = clap::value_parser!(Shell))]
    shell: Shell,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the script is not text, a defect.
pub fn run(args: &CompletionsArgs) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut super::Cli::command(), "kerbside", &mut script);
    let script = String::from_utf8(script).map_err(Failure::internal)?;
    if args.json {
        let object = json!({
            "schema": "kerbside.completions.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null,
            "passed": true, "figures": [], "shell": args.shell.to_string(), "script": script,
        });
        println!("{object}");
    } else {
        print!("{script}");
    }
    Ok(Exit::Good)
}
