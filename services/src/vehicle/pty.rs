//! The vehicle's end of a pseudo-terminal, linked under a name that the interface opens.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};

use rustix::fs::OFlags;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use crate::interface::serial;

/// A pseudo-terminal; both ends are kept open, so that the line survives an interface that comes and goes.
#[derive(Debug)]
pub struct Pty {
    master: File,
    _slave: File,
    link: PathBuf,
    name: PathBuf,
}

impl Pty {
    /// Opens a pseudo-terminal and links its line end as `link`, replacing what an earlier life left there.
    ///
    /// # Errors
    /// Where the terminal or the link cannot be made.
    pub fn create(link: &Path) -> io::Result<Self> {
        let master: OwnedFd =
            openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        rustix::fs::fcntl_setfl(&master, rustix::fs::fcntl_getfl(&master)? | OFlags::NONBLOCK)?;
        let name = ptsname(&master, Vec::new())?;
        let name = PathBuf::from(std::ffi::OsStr::from_bytes(name.as_bytes()));
        let flags = i32::try_from(OFlags::NOCTTY.bits()).unwrap_or_default();
        let slave = OpenOptions::new().read(true).write(true).custom_flags(flags).open(&name)?;
        serial::make_raw(slave.as_fd(), None)?;
        let part = link.with_extension("part");
        let _ = fs::remove_file(&part);
        symlink(&name, &part)?;
        fs::rename(&part, link)?;
        Ok(Self { master: master.into(), _slave: slave, link: link.to_owned(), name })
    }

    /// The terminal's own name.
    #[must_use]
    pub fn name(&self) -> &Path {
        &self.name
    }

    /// Reads what came, without waiting.
    ///
    /// # Errors
    /// Where the terminal broke.
    pub fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.master.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(0),
            other => other,
        }
    }

    /// Writes a frame; false where the line is full, because nobody reads: the frame is lost, as on a real line.
    ///
    /// # Errors
    /// Where the terminal broke.
    pub fn write(&mut self, frame: &[u8]) -> io::Result<bool> {
        match self.master.write(frame) {
            Ok(written) => Ok(written == frame.len()),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(false),
            Err(error) => Err(error),
        }
    }
}

impl AsFd for Pty {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.master.as_fd()
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        // Only our own link: a successor may have replaced it.
        if fs::read_link(&self.link).is_ok_and(|target| target == self.name) {
            let _ = fs::remove_file(&self.link);
        }
    }
}
