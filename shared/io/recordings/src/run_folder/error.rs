//! What can be wrong with a run folder.

use std::path::PathBuf;

/// Why a run folder was not read or written. Every text names the file and, where there is one,
/// the line.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// Nothing says how the wheels turned.
    #[error(
        "{}: neither encoders.csv nor wheels.csv is there; one of the two is required",
        path.display()
    )]
    NoWheels {
        /// The run's folder.
        path: PathBuf,
    },
    /// Bytes that are no text.
    #[error("{}:{line}: not UTF-8; allowed: text in UTF-8", path.display())]
    NotUtf8 {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
    },
    /// A file without even a header.
    #[error("{}: empty; allowed: a header line naming t and {columns}, then rows", path.display())]
    NoHeader {
        /// File.
        path: PathBuf,
        /// What the header may name.
        columns: String,
    },
    /// A header that lacks a column.
    #[error("{}:1: found the columns {found}; {needed}", path.display())]
    NoColumn {
        /// File.
        path: PathBuf,
        /// The header.
        found: String,
        /// What is needed.
        needed: String,
    },
    /// A header that names a column twice.
    #[error("{}:1: column {column} is named twice", path.display())]
    Twice {
        /// File.
        path: PathBuf,
        /// Its name.
        column: String,
    },
    /// A row that is longer or shorter than the header.
    #[error(
        "{}:{line}: found {found} fields; allowed: {expected}, as in the header",
        path.display()
    )]
    Fields {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Fields of the row.
        found: usize,
        /// Fields of the header.
        expected: usize,
    },
    /// A field that is not what its column holds.
    #[error("{}:{line}: column {column}: found {found:?}; allowed: {allowed}", path.display())]
    Value {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// The field.
        found: String,
        /// What it may be.
        allowed: String,
    },
    /// A stamp that does not follow the one before.
    #[error(
        "{}:{line}: t = {t} does not follow t = {previous} of the row before; \
         allowed: stamps that increase",
        path.display()
    )]
    Order {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// The stamp \[s\].
        t: f64,
        /// The stamp before \[s\].
        previous: f64,
    },
    /// A header and nothing else.
    #[error("{}: no rows after the header", path.display())]
    NoRows {
        /// File.
        path: PathBuf,
    },
    /// run.toml is not what it should be.
    #[error(transparent)]
    About(#[from] kerbside_settings::SettingsError),
    /// The name inside is not the folder's.
    #[error(
        "{}: name = {found:?}; allowed: {expected:?}, the name of the run's folder",
        path.display()
    )]
    Name {
        /// run.toml.
        path: PathBuf,
        /// The name inside.
        found: String,
        /// The folder's name.
        expected: String,
    },
}
