//! `bindings`: the layouts of all messages for other languages, made from the descriptions that Rust's own come with.

mod c;
mod python;

use std::path::{Path, PathBuf};

use kerbside_messages::LAYOUT_VERSION;
use serde_json::json;

use crate::exit::{Exit, Failure};
use crate::output;

pub use c::header;
pub use python::module;

/// For which language.
#[derive(Clone, Debug, clap::Subcommand)]
pub enum BindingsVerb {
    /// A module of ctypes classes, for Python 3.8 or newer.
    #[command(after_help = "Example: kerbside bindings python --out kerbside_messages.py")]
    Python(BindingsArgs),
    /// A header for C99 and C++11.
    #[command(after_help = "Example: kerbside bindings c --out kerbside_messages.h")]
    C(BindingsArgs),
}

/// Where they go.
#[derive(Clone, Debug, clap::Args)]
pub struct BindingsArgs {
    /// File to write; standard output where not given.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Prints or writes the bindings.
///
/// # Errors
/// [`Failure`] where the file cannot be written.
pub fn run(verb: &BindingsVerb) -> Result<Exit, Failure> {
    kerbside_runtime::end_on_broken_pipe();
    let (language, text, args) = match verb {
        BindingsVerb::Python(args) => ("python", module(), args),
        BindingsVerb::C(args) => ("c", header(), args),
    };
    let path = args.out.as_deref().map(std::path::absolute).transpose();
    let path = path.map_err(|error| Failure::unavailable(format!("--out: {error}")))?;
    if let Some(path) = &path {
        output::write(path, &text)?;
    }
    match (args.json, &path) {
        (true, _) => println!("{}", object(language, &text, path.as_deref())),
        (false, Some(path)) => println!("{}", path.display()),
        (false, None) => print!("{text}"),
    }
    Ok(Exit::Good)
}

fn object(language: &str, text: &str, path: Option<&Path>) -> serde_json::Value {
    json!({
        "schema": "kerbside.bindings.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null,
        "passed": true, "figures": [], "language": language, "layout_version": LAYOUT_VERSION,
        "path": path, "text": path.is_none().then_some(text),
    })
}

/// `WheelStatus` as `WHEEL_STATUS`; words of several parts too: `no pose` as `NO_POSE`.
fn screaming(name: &str) -> String {
    let mut out = String::new();
    for letter in name.chars() {
        if letter.is_ascii_uppercase() && !out.is_empty() && !out.ends_with('_') {
            out.push('_');
        }
        out.push(if letter.is_ascii_alphanumeric() { letter.to_ascii_uppercase() } else { '_' });
    }
    out
}

/// `WheelStatus` as `wheel_status`.
fn snake(name: &str) -> String {
    screaming(name).to_ascii_lowercase()
}

/// A document's words without the marks that only Rust's documentation knows.
fn prose(doc: &str) -> String {
    let plain =
        doc.trim().replace("\\[", "[").replace("\\]", "]").replace("[`", "").replace("`]", "");
    plain.replace('`', "").replace("crate::", "").replace("*/", "* /")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_follow_the_languages_habits() {
        assert_eq!(screaming("WheelStatus"), "WHEEL_STATUS");
        assert_eq!(screaming("estimator"), "ESTIMATOR");
        assert_eq!(snake("PlanRequest"), "plan_request");
        assert_eq!(prose(" Speed, [`crate::Mode`] \\[m/s\\]."), "Speed, Mode [m/s].");
    }
}
