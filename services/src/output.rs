//! Where files go, and what their names are.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use crate::exit::{Exit, Failure};

/// The user's folder for results: the XDG state folder.
#[must_use]
pub fn state_folder() -> PathBuf {
    let from =
        |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    from("XDG_STATE_HOME")
        .or_else(|| from("HOME").map(|home| home.join(".local/state")))
        .unwrap_or_else(std::env::temp_dir)
        .join("kerbside")
}

/// The folder for the results of one run: `out`, or a new one in the state folder.
///
/// # Errors
/// [`Failure`] where it cannot be made.
pub fn folder(out: Option<&Path>, verb: &str) -> Result<PathBuf, Failure> {
    let folder = place(out, verb)?;
    make(&folder).map(|()| folder)
}

/// Where [`folder`] makes it; nothing is made yet.
///
/// # Errors
/// [`Failure`] where the path is none.
pub fn place(out: Option<&Path>, verb: &str) -> Result<PathBuf, Failure> {
    let folder =
        out.map_or_else(|| state_folder().join(format!("{verb}-{}", stamp())), Path::to_path_buf);
    // Error messages and reports are read elsewhere: name files in full.
    std::path::absolute(&folder).map_err(|error| cannot_write(&folder, &error))
}

/// Makes a folder for results, with those above it, and makes sure that it can be written to.
///
/// # Errors
/// [`Failure`] where it cannot.
pub fn make(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| cannot_write(folder, &error))?;
    rustix::fs::access(folder, rustix::fs::Access::WRITE_OK)
        .map_err(|error| cannot_write(folder, &error.into()))
}

/// Writes a file of results: whole, or not at all. What was there under that name stays until it is.
///
/// # Errors
/// [`Failure`] naming the file.
pub fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    let written = fs::write(&part, text).and_then(|()| fs::rename(&part, path));
    written.map_err(|error| {
        let _ = fs::remove_file(&part);
        cannot_write(path, &error)
    })
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Failure {
    Failure::new(Exit::Unavailable, format!("cannot write to {}: {error}", path.display()))
}

/// Columns of the terminal on standard output; none where it is a pipe or a file.
#[must_use]
pub fn terminal_width() -> Option<u16> {
    let size = rustix::termios::tcgetwinsize(std::io::stdout()).ok()?;
    Some(size.ws_col).filter(|columns| *columns > 0)
}

/// The present moment for names of files: seconds of the epoch and the pid, so that two runs never share one.
#[must_use]
pub fn stamp() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |passed| passed.as_secs());
    format!("{seconds}-{}", std::process::id())
}

/// A word as a shell takes it, in quotes where it needs them.
#[must_use]
pub fn quoted(word: impl AsRef<std::ffi::OsStr>) -> String {
    let word = word.as_ref().to_string_lossy();
    let plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.into_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_is_quoted_where_a_shell_would_part_it() {
        assert_eq!(quoted("data/case-5"), "data/case-5");
        assert_eq!(quoted("bad/case 5"), "'bad/case 5'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
    }

    #[test]
    fn a_file_is_whole_or_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.html");
        write(&path, "one").unwrap();
        write(&path, "two").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "two");
        // A folder cannot be replaced by a file: the last step of writing fails.
        let taken = folder.path().join("taken");
        fs::create_dir(&taken).unwrap();
        let said = write(&taken, "three").unwrap_err().report.to_string();
        assert!(said.contains("taken"), "{said}");
        let left: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
        assert_eq!(left.len(), 2, "{left:?}");
    }
}
