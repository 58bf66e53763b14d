//! Locks that die with their holder.

use core::time::Duration;
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};

use crate::Ticker;

/// Who asks for the holder has the lock itself for an instant: only what stays held is held.
const ATTEMPTS: u32 = 10;
/// Time between attempts.
const PAUSE: Duration = Duration::from_millis(2);

/// Why a lock was not taken.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// Another process has it.
    #[error("{path} is held by process {pid}")]
    Held {
        /// The lock.
        path: PathBuf,
        /// Who has it, as far as it says so.
        pid: u32,
    },
    /// The file could not be used.
    #[error("{path}: {source}")]
    File {
        /// The lock.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// An exclusive lock on a file that holds the owner's pid; the kernel releases it at the owner's death.
#[derive(Debug)]
pub struct FileLock {
    file: File,
    path: PathBuf,
}

impl FileLock {
    /// Takes the lock and writes our pid into the file.
    ///
    /// # Errors
    /// [`LockError::Held`] where another process has it, [`LockError::File`] where the file cannot be used.
    pub fn take(path: &Path) -> Result<Self, LockError> {
        let wrap = |source| LockError::File { path: path.to_owned(), source };
        let mut pause = Ticker::new(PAUSE);
        let mut attempts = 1;
        let mut file = loop {
            let mut file = open(path).map_err(wrap)?;
            let locked = flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok();
            // Its last owner may have removed the file meanwhile: nobody would see a lock on that.
            if locked && is_at(&file, path) {
                break file;
            }
            if attempts == ATTEMPTS {
                return Err(LockError::Held { path: path.to_owned(), pid: pid_in(&mut file) });
            }
            attempts += 1;
            pause.wait();
        };
        file.set_len(0).map_err(wrap)?;
        file.write_all(std::process::id().to_string().as_bytes()).map_err(wrap)?;
        Ok(Self { file, path: path.to_owned() })
    }

    /// Holds the lock at `path` without becoming its owner: nobody takes it meanwhile. None where it has an owner, or its
    /// folder is gone.
    #[must_use]
    pub fn block(path: &Path) -> Option<File> {
        let mut pause = Ticker::new(PAUSE);
        for _ in 0..ATTEMPTS {
            let mut file = open(path).ok()?;
            if flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok() {
                return is_at(&file, path).then_some(file);
            }
            if pid_in(&mut file) != 0 {
                return None;
            }
            pause.wait();
        }
        None
    }

    /// The pid of the process that holds the lock at `path`; none where nobody does.
    #[must_use]
    pub fn holder(path: &Path) -> Option<u32> {
        let mut file = OpenOptions::new().read(true).open(path).ok()?;
        match flock(&file, FlockOperation::NonBlockingLockShared) {
            Ok(()) => None,
            Err(_) => Some(pid_in(&mut file)).filter(|pid| *pid != 0),
        }
    }

    /// The locked file's path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for FileLock {
    fn drop(&mut self) {
        // The pid goes before the lock does, so that nobody reads a pid that may be somebody else's by then.
        let _ = self.file.set_len(0);
    }
}

fn is_at(file: &File, path: &Path) -> bool {
    let identity = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
    let there = std::fs::metadata(path).map(identity).ok();
    there.is_some() && there == file.metadata().map(identity).ok()
}

fn open(path: &Path) -> std::io::Result<File> {
    OpenOptions::new().read(true).write(true).create(true).truncate(false).mode(0o600).open(path)
}

fn pid_in(file: &mut File) -> u32 {
    let mut text = String::new();
    let _ = file.rewind().and_then(|()| file.read_to_string(&mut text));
    text.trim().parse().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_is_exclusive_and_ends_with_its_holder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.lock");
        assert_eq!(FileLock::holder(&path), None);
        let lock = FileLock::take(&path).unwrap();
        assert_eq!(FileLock::holder(&path), Some(std::process::id()));
        assert!(
            matches!(FileLock::take(&path), Err(LockError::Held { pid, .. }) if pid == std::process::id())
        );
        drop(lock);
        assert_eq!(FileLock::holder(&path), None);
        FileLock::take(&path).unwrap();
    }

    #[test]
    fn a_blocked_lock_is_nobodys_and_a_removed_one_counts_no_more() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.lock");
        assert!(FileLock::block(&folder.path().join("gone/x.lock")).is_none());
        assert!(FileLock::block(&path).is_some(), "nobody has owned it yet");
        drop(FileLock::take(&path).unwrap());
        let blocked = FileLock::block(&path).unwrap();
        assert_eq!(FileLock::holder(&path), None);
        assert!(matches!(FileLock::take(&path), Err(LockError::Held { pid: 0, .. })));
        let waiting = std::thread::spawn({
            let path = path.clone();
            move || FileLock::take(&path).map(|lock| is_at(&lock.file, &path))
        });
        std::fs::remove_file(&path).unwrap();
        drop(blocked);
        assert!(waiting.join().unwrap().unwrap(), "took a lock that counts no more");
    }

    #[test]
    fn a_lock_on_a_removed_file_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.lock");
        std::thread::scope(|scope| {
            let first = FileLock::take(&path).unwrap();
            let second = scope.spawn(|| FileLock::take(&path));
            std::fs::remove_file(&path).unwrap();
            drop(first);
            let _second = second.join().unwrap().unwrap();
            assert_eq!(FileLock::holder(&path), Some(std::process::id()), "all see it");
        });
    }

    #[test]
    fn who_asks_for_the_holder_keeps_nobody_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.lock");
        let done = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !done.load(std::sync::atomic::Ordering::Relaxed) {
                    let _ = FileLock::holder(&path);
                }
            });
            let taken = (0..2000).try_for_each(|_| FileLock::take(&path).map(drop));
            done.store(true, std::sync::atomic::Ordering::Relaxed);
            taken.unwrap();
        });
    }
}
