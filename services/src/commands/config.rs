//! `config`: check, show and explain.

use std::path::PathBuf;

use kerbside_settings::{Severity, check, explain, explain_all, reference};
use serde_json::json;

use crate::configuration::{Refused, sources};
use crate::exit::{Exit, Failure};

/// What to do with the configuration.
#[derive(Clone, Debug, clap::Subcommand)]
pub enum ConfigVerb {
    /// List every problem of every stack, vehicle and scenario that is found.
    #[command(after_help = "Example: kerbside config check --config config/")]
    Check {
        /// A stack's file, or a folder like config/.
        #[arg(long, value_name = "PATH")]
        config: Option<PathBuf>,
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Print what is in force, each value with where it comes from.
    #[command(after_help = "Example: kerbside config show --scenario garage")]
    Show {
        /// A stack's file, or a folder like config/.
        #[arg(long, value_name = "PATH")]
        config: Option<PathBuf>,
        /// Show a scenario with the stack that suits it.
        #[arg(long, value_name = "NAME")]
        scenario: Option<String>,
    },
    /// Say what a key means, its unit, range and default.
    #[command(after_help = "Example: kerbside config explain tracker.gain_across")]
    Explain {
        /// The key, or a table for all keys below it.
        #[arg(required_unless_present_any = ["all", "reference"])]
        key: Option<String>,
        /// Every key.
        #[arg(long)]
        all: bool,
        /// Every key, as a Markdown page.
        #[arg(long, conflicts_with = "all")]
        reference: bool,
    },
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the configuration is refused or the key is unknown.
pub fn run(verb: &ConfigVerb) -> Result<Exit, Failure> {
    match verb {
        ConfigVerb::Check { config, json } => check_all(config.as_deref(), *json),
        ConfigVerb::Show { config, scenario } => show(config.as_deref(), scenario.as_deref()),
        ConfigVerb::Explain { reference: true, .. } => {
            print!("{}", reference());
            Ok(Exit::Good)
        }
        ConfigVerb::Explain { key: Some(key), .. } => {
            println!("{}", explain(key)?);
            Ok(Exit::Good)
        }
        ConfigVerb::Explain { .. } => {
            println!("{}", explain_all());
            Ok(Exit::Good)
        }
    }
}

fn check_all(config: Option<&std::path::Path>, as_json: bool) -> Result<Exit, Failure> {
    let problems = check(&sources(config)?);
    let refused = problems.iter().any(|problem| problem.severity == Severity::Error);
    if as_json {
        let list: Vec<_> = problems.iter().map(ToString::to_string).collect();
        let object = json!({
            "schema": "kerbside.config.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null, "passed": !refused,
            "figures": [], "problems": list,
        });
        println!("{object}");
    } else if problems.is_empty() {
        println!("no problem found");
    } else {
        eprintln!("{:?}", miette::Report::new(Refused::new(&problems)));
    }
    Ok(if refused { Exit::Configuration } else { Exit::Good })
}

fn show(config: Option<&std::path::Path>, scenario: Option<&str>) -> Result<Exit, Failure> {
    let sources = sources(config)?;
    match scenario {
        Some(scenario) => {
            let parking = sources.parking(scenario, None)?;
            println!("{}\n{}", parking.scenario.show(), parking.stack.show());
        }
        None => println!("{}", sources.stack()?.show()),
    }
    Ok(Exit::Good)
}
