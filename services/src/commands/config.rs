//! `config`: check, show and explain.

use std::path::PathBuf;

use kerbside_settings::{
    Declaration, Setting, Severity, check, declarations, explain, explain_all, reference,
};
use serde_json::{Value, json};

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
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
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
        /// Print one JSON object.
        #[arg(long, conflicts_with = "reference")]
        json: bool,
    },
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the configuration is refused or the key is unknown.
pub fn run(verb: &ConfigVerb) -> Result<Exit, Failure> {
    match verb {
        ConfigVerb::Check { config, json } => check_all(config.as_deref(), *json),
        ConfigVerb::Show { config, scenario, json } => {
            show(config.as_deref(), scenario.as_deref(), *json)
        }
        ConfigVerb::Explain { reference: true, .. } => {
            print!("{}", reference());
            Ok(Exit::Good)
        }
        ConfigVerb::Explain { key, json, .. } => {
            let text = key.as_deref().map_or_else(|| Ok(explain_all()), explain)?;
            if *json {
                println!("{}", object("config-keys", true, "keys", keys(key.as_deref())));
            } else {
                print!("{text}");
            }
            Ok(Exit::Good)
        }
    }
}

fn object(schema: &str, passed: bool, name: &str, content: Value) -> Value {
    json!({
        "schema": format!("kerbside.{schema}.v1"), "version": env!("CARGO_PKG_VERSION"), "seed": null,
        "passed": passed, "figures": [], name: content,
    })
}

/// The declarations of a key, of a table's keys, or of all.
fn keys(wanted: Option<&str>) -> Value {
    let is_wanted = |path: &str| {
        wanted.is_none_or(|wanted| {
            path.strip_prefix(wanted).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        })
    };
    let one = |key: Declaration| {
        json!({
            "key": key.path, "file": key.file, "doc": key.doc, "allowed": key.kind.to_string(),
            "default": key.default.map(|value| value.to_string()),
        })
    };
    declarations().into_iter().filter(|key| is_wanted(&key.path)).map(one).collect()
}

fn check_all(config: Option<&std::path::Path>, as_json: bool) -> Result<Exit, Failure> {
    let problems = check(&sources(config)?);
    let refused = problems.iter().any(|problem| problem.severity == Severity::Error);
    if as_json {
        let list = problems.iter().map(ToString::to_string).collect();
        println!("{}", object("config", !refused, "problems", list));
    } else if problems.is_empty() {
        println!("no problem found");
    } else {
        let report = miette::Report::new(Refused::new(&problems));
        let exit = if refused { Exit::Configuration } else { Exit::Good };
        return Ok(Failure { exit, report }.tell(false));
    }
    Ok(if refused { Exit::Configuration } else { Exit::Good })
}

fn show(
    config: Option<&std::path::Path>,
    scenario: Option<&str>,
    as_json: bool,
) -> Result<Exit, Failure> {
    let sources = sources(config)?;
    let (mut texts, mut settings) = (Vec::new(), Vec::new());
    let mut add = |text: String, list: &[Setting]| {
        texts.push(text);
        settings.extend(list.iter().map(setting));
    };
    if let Some(scenario) = scenario {
        let parking = sources.parking(scenario, None)?;
        add(parking.scenario.show(), &parking.scenario.settings);
        add(parking.stack.show(), &parking.stack.settings);
    } else {
        let stack = sources.stack()?;
        add(stack.show(), &stack.settings);
    }
    if as_json {
        println!("{}", object("config-values", true, "settings", settings.into()));
    } else {
        print!("{}", texts.join("\n"));
    }
    Ok(Exit::Good)
}

fn setting(setting: &Setting) -> Value {
    json!({
        "key": setting.key, "value": setting.value.to_string(), "from": setting.origin.to_string(),
        "note": setting.note,
    })
}
