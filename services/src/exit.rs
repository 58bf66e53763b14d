//! How a verb ends: exit codes, and failures that a person can act on.

use std::io::Write;
use std::process::ExitCode;

use crate::configuration::Refused;

/// Exit codes; the same for every verb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// Done, and the result is good.
    Good = 0,
    /// Ran, and the result is bad: not parked, over a limit.
    Bad = 1,
    /// The command line is wrong.
    Usage = 2,
    /// Input data were refused.
    Data = 65,
    /// A defect of kerbside.
    Internal = 70,
    /// The stack is not running, or busy.
    Unavailable = 75,
    /// The configuration was refused.
    Configuration = 78,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// A verb that could not do its work.
#[derive(Debug)]
pub struct Failure {
    /// The exit code.
    pub exit: Exit,
    /// What to tell the person.
    pub report: miette::Report,
}

impl Failure {
    /// A failure told in one sentence.
    pub fn new(exit: Exit, message: impl core::fmt::Display) -> Self {
        Self { exit, report: miette::miette!("{message}") }
    }

    /// A failure with a hint of what to do.
    pub fn with_help(
        exit: Exit,
        message: impl core::fmt::Display,
        help: impl core::fmt::Display,
    ) -> Self {
        Self { exit, report: miette::miette!(help = help.to_string(), "{message}") }
    }

    /// Tells the person on standard error, and, where `json`, who reads standard output; the exit code.
    #[must_use]
    pub fn tell(&self, json: bool) -> Exit {
        let report = &self.report;
        let refused = report.downcast_ref::<Refused>();
        if json {
            let problems: Vec<_> = refused.iter().flat_map(|refused| refused.lines()).collect();
            println!(
                "{}",
                serde_json::json!({
                    "schema": "kerbside.failure.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null,
                    "passed": false, "figures": [], "exit": self.exit as u8, "error": report.to_string(),
                    "help": report.help().map(|help| help.to_string()), "problems": problems,
                })
            );
        }
        let mut text = format!("{report:?}");
        for report in refused.iter().flat_map(|refused| refused.reports()) {
            text.push_str(&format!("\n{report:?}"));
        }
        // Nobody may read it any more; the exit code tells too.
        let _ = writeln!(std::io::stderr(), "{text}");
        self.exit
    }

    /// A failure of kerbside or of the machine.
    pub fn internal(message: impl core::fmt::Display) -> Self {
        Self::new(Exit::Internal, message)
    }

    /// The stack is not running, or busy.
    pub fn unavailable(message: impl core::fmt::Display) -> Self {
        Self::new(Exit::Unavailable, message)
    }
}

impl From<kerbside_runtime::SessionError> for Failure {
    fn from(error: kerbside_runtime::SessionError) -> Self {
        Self::unavailable(error)
    }
}

impl From<kerbside_runtime::InstanceError> for Failure {
    fn from(error: kerbside_runtime::InstanceError) -> Self {
        let exit = match error {
            kerbside_runtime::InstanceError::Name { .. } => Exit::Usage,
            _ => Exit::Unavailable,
        };
        Self::new(exit, error)
    }
}

impl From<kerbside_runtime::RuntimeError> for Failure {
    fn from(error: kerbside_runtime::RuntimeError) -> Self {
        Self::internal(error)
    }
}
