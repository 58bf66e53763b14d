//! `doctor`: what the machine has and lacks for kerbside, as the configuration asks for it, and what to do about it.

mod checks;
mod device;
mod folders;

use std::path::PathBuf;

use kerbside_settings::{Stack, check};
use serde_json::{Value, json};

use crate::configuration;
use crate::exit::{Exit, Failure};
use crate::output::terminal_width;
use crate::tables;

/// Columns where no terminal says how many there are.
const WIDTH: u16 = 80;

/// What `doctor` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct DoctorArgs {
    /// Configuration whose demands are looked at: a stack's file, or a folder like config/.
    #[arg(long, value_name = "PATH")]
    config: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// How a thing stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Standing {
    /// As it should be.
    Good,
    /// kerbside works with it, and would work better otherwise.
    Note,
    /// What the configuration asks for does not work with it.
    Lacking,
}

impl Standing {
    const fn name(self) -> &'static str {
        match self {
            Self::Good => "ok",
            Self::Note => "note",
            Self::Lacking => "lacking",
        }
    }
}

/// One thing that was looked at.
#[derive(Clone, Debug, PartialEq)]
struct Check {
    name: &'static str,
    standing: Standing,
    /// What was found.
    found: String,
    /// What to do about it; empty where nothing is to be done.
    advice: String,
}

impl Check {
    fn good(name: &'static str, found: impl Into<String>) -> Self {
        Self { name, standing: Standing::Good, found: found.into(), advice: String::new() }
    }

    fn note(name: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { name, standing: Standing::Note, found: found.into(), advice: advice.into() }
    }

    fn lacking(name: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { name, standing: Standing::Lacking, found: found.into(), advice: advice.into() }
    }
}

/// Runs the verb: exit code 1 where something is lacking.
///
/// # Errors
/// [`Failure`] where `--config` is not there.
pub fn run(args: &DoctorArgs) -> Result<Exit, Failure> {
    let (configured, stack) = configuration(args)?;
    let stack = stack.as_ref();
    let mut found = vec![configured];
    found.extend(checks::of_machine(stack));
    found.extend(folders::all(stack));
    found.push(device::line(stack));
    let lacking = found.iter().any(|check| check.standing == Standing::Lacking);
    if args.json {
        println!("{}", as_json(&found, !lacking));
    } else {
        print(&found);
    }
    Ok(if lacking { Exit::Bad } else { Exit::Good })
}

/// The configuration in force, as far as it is not refused.
fn configuration(args: &DoctorArgs) -> Result<(Check, Option<Stack>), Failure> {
    const NAME: &str = "configuration";
    let sources = configuration::sources(args.config.as_deref())?;
    let advice = "kerbside config check shows every problem where it stands";
    Ok(match sources.stack_for(None) {
        Ok(loaded) => {
            let problems = check(&sources);
            let vehicle = &loaded.value.vehicle.name;
            let words = format!("{}, vehicle {vehicle}", loaded.file);
            let check = match problems.first() {
                Some(problem) => Check::note(NAME, format!("{words}; {problem}"), advice),
                None => Check::good(NAME, words),
            };
            (check, Some(loaded.value))
        }
        Err(error) => {
            let first = error.problems().first().map_or(error.to_string(), ToString::to_string);
            (Check::lacking(NAME, first, advice), None)
        }
    })
}

fn as_json(found: &[Check], passed: bool) -> Value {
    let one = |check: &Check| {
        json!({
            "name": check.name, "state": check.standing.name(), "found": check.found,
            "advice": (!check.advice.is_empty()).then_some(&check.advice),
        })
    };
    json!({
        "schema": "kerbside.doctor.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null,
        "passed": passed, "figures": [], "checks": found.iter().map(one).collect::<Vec<_>>(),
    })
}

fn print(found: &[Check]) {
    let mut table = tables::framed_within(Some(terminal_width().unwrap_or(WIDTH)));
    table.set_header(["", "what", "found"]);
    for check in found {
        let words = match check.advice.as_str() {
            "" => check.found.clone(),
            advice => format!("{}\n-> {advice}", check.found),
        };
        table.add_row([check.standing.name(), check.name, &words]);
    }
    println!("{table}");
    let count = |standing| found.iter().filter(|check| check.standing == standing).count();
    match (count(Standing::Lacking), count(Standing::Note)) {
        (0, 0) => println!("nothing is lacking"),
        (0, notes) => println!("nothing is lacking; {notes} could be better"),
        (lacking, notes) => println!("{lacking} lacking, {notes} could be better"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_holds_every_check() {
        let checks = [
            Check::good("cores", "2"),
            Check::note("clock", "hpet", "boot with tsc"),
            Check::lacking("line", "/dev/ttyACM0 is not there", "plug it in"),
        ];
        let object = as_json(&checks, false);
        assert_eq!(
            (&object["passed"], object["checks"].as_array().unwrap().len()),
            (&json!(false), 3)
        );
        assert_eq!(object["checks"][0]["advice"], Value::Null);
        assert_eq!(object["checks"][1]["state"], "note");
        assert_eq!(object["checks"][2]["found"], "/dev/ttyACM0 is not there");
    }
}
