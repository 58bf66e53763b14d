//! What is wrong with a file: where, what was found, what is allowed.

use core::fmt;
use core::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// How bad a problem is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The configuration is used, the reader should know.
    Warning,
    /// The configuration is refused.
    Error,
}

/// Why a value is a problem.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Cause {
    /// The file is not TOML.
    #[error("not valid TOML: {0}")]
    Syntax(String),
    /// No such key is declared.
    #[error("unknown key")]
    UnknownKey,
    /// A required key is not there.
    #[error("missing")]
    Missing,
    /// The value is of another type.
    #[error("wrong type, {found}")]
    WrongType {
        /// The TOML type found.
        found: &'static str,
    },
    /// The value is outside what is allowed.
    #[error("out of range")]
    OutOfRange,
    /// The text is not one that is allowed.
    #[error("not allowed")]
    NotAllowed,
    /// A list is too short or too long.
    #[error("a list of {0}")]
    Elements(usize),
    /// Keys contradict one another.
    #[error("{0}")]
    Conflict(String),
    /// No such vehicle can exist.
    #[error("impossible geometry: {0}")]
    ImpossibleGeometry(String),
    /// Such a vehicle may exist; a slip of the pen is likelier.
    #[error("suspicious geometry: {0}")]
    SuspiciousGeometry(String),
    /// The vehicle cannot stop within the promised distance.
    #[error("the vehicle needs {needed:.3} m to stop from full speed after a fault")]
    StopDistance {
        /// Distance needed \[m\].
        needed: f64,
    },
    /// A pose leaves the map.
    #[error("the footprint leaves the map by {0:.3} m")]
    OutsideMap(f64),
    /// A pose touches an obstacle or is too near.
    #[error("{0}")]
    Blocked(String),
    /// A file that this one names is not there.
    #[error("{0}")]
    NotFound(String),
    /// The file itself cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(String),
}

/// A problem at one place of one file.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// How bad.
    pub severity: Severity,
    /// The file, as it was named.
    pub file: String,
    /// The whole text of the file.
    pub source: Arc<str>,
    /// Bytes of the text that the problem is about.
    pub span: Range<usize>,
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1.
    pub column: usize,
    /// Dotted key; empty where the text is no TOML.
    pub key: String,
    /// The value found, as TOML; none where there is none.
    pub value: Option<String>,
    /// What is wrong.
    pub cause: Cause,
    /// What is allowed.
    pub allowed: String,
    /// What to do about it, beyond what is allowed.
    pub help: Option<String>,
}

impl Problem {
    /// One sentence without the place: key, value, cause, what is allowed.
    #[must_use]
    pub fn message(&self) -> String {
        let subject = match &self.value {
            _ if self.key.is_empty() => String::new(),
            Some(value) => format!("{} = {value}: ", self.key),
            None => format!("{}: ", self.key),
        };
        let allowed = match self.allowed.as_str() {
            "" => String::new(),
            allowed => format!("; allowed: {allowed}"),
        };
        format!("{subject}{}{allowed}", self.cause)
    }
}

impl fmt::Display for Problem {
    /// `file:line:column: key = value: cause; allowed: ... (help)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}: ", self.file, self.line, self.column)?;
        if self.severity == Severity::Warning {
            f.write_str("warning: ")?;
        }
        f.write_str(&self.message())?;
        self.help.as_ref().map_or(Ok(()), |help| write!(f, " ({help})"))
    }
}

/// Why a configuration could not be used.
#[derive(Clone, Debug, thiserror::Error)]
pub enum SettingsError {
    /// There is no file of that name where one is looked for.
    #[error(
        "no {kind} named \"{name}\"; looked in {}; there are: {}",
        searched.join(", "),
        known.join(", ")
    )]
    NotFound {
        /// `stack`, `vehicle` or `scenario`.
        kind: &'static str,
        /// The name asked for.
        name: String,
        /// Where it was looked for.
        searched: Vec<String>,
        /// What is there.
        known: Vec<String>,
    },
    /// A file could not be read.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// Files have problems; at least one is an error.
    #[error("{}", list(.0))]
    Refused(Vec<Problem>),
    /// `explain` was asked for a key that is not declared.
    #[error("no key \"{key}\"{}", meant(nearest.as_deref()))]
    UnknownKey {
        /// The key asked for.
        key: String,
        /// The declared key nearest to it.
        nearest: Option<String>,
    },
}

impl SettingsError {
    /// The problems of a refused configuration; none for other errors.
    #[must_use]
    pub fn problems(&self) -> &[Problem] {
        match self {
            Self::Refused(problems) => problems,
            _ => &[],
        }
    }
}

fn meant(key: Option<&str>) -> String {
    key.map_or_else(String::new, |key| format!("; did you mean \"{key}\"?"))
}

fn list(problems: &[Problem]) -> String {
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}
