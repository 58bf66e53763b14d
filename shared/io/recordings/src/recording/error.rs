//! What can be wrong with a recording that is read.

use std::path::PathBuf;

use kerbside_messages::LAYOUT_VERSION;

use super::WriteError;

/// Why a recording was not read, checked or recovered. Every text names the file.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// Another kind of file.
    #[error("{}: byte 0: not an MCAP file", path.display())]
    NotMcap {
        /// File.
        path: PathBuf,
    },
    /// Bytes that are not what was written.
    #[error("{}: byte {offset}: {problem}", path.display())]
    Damaged {
        /// File.
        path: PathBuf,
        /// Where the damaged record begins.
        offset: u64,
        /// What is wrong with it.
        problem: String,
    },
    /// Messages of another layout than this build's.
    #[error(
        "{}: topic {topic} was recorded in layout version {recorded}; this build reads version \
         {LAYOUT_VERSION}", path.display()
    )]
    Layout {
        /// File.
        path: PathBuf,
        /// The topic.
        topic: &'static str,
        /// The version that the file states, in words.
        recorded: String,
    },
    /// The file that was to be made is there.
    #[error("{}: exists already and is not overwritten", path.display())]
    Exists {
        /// File.
        path: PathBuf,
    },
    /// The file that was to be made could not be written.
    #[error("{}: {source}", path.display())]
    Write {
        /// File.
        path: PathBuf,
        /// Why not.
        source: WriteError,
    },
}
