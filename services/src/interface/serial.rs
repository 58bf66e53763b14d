//! The serial device.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use rustix::fs::OFlags;
use rustix::termios::{OptionalActions, QueueSelector, isatty, tcflush, tcgetattr, tcsetattr};

/// An open line: reads and writes without waiting.
#[derive(Debug)]
pub struct Line {
    device: File,
    /// Frames that the device did not take whole.
    pub cut: u64,
}

impl Line {
    /// Opens a serial device or pseudo-terminal, raw. What came before is thrown away: read now, it would carry the stamps
    /// of now, and counters are cumulative.
    ///
    /// # Errors
    /// Where there is none, or it cannot be set up.
    pub fn open(path: &Path, baud: u32) -> io::Result<Self> {
        let flags = OFlags::NOCTTY | OFlags::NONBLOCK;
        let flags = i32::try_from(flags.bits()).unwrap_or_default();
        let device = OpenOptions::new().read(true).write(true).custom_flags(flags).open(path)?;
        if isatty(&device) {
            make_raw(device.as_fd(), Some(baud))?;
            tcflush(&device, QueueSelector::IFlush)?;
        }
        Ok(Self { device, cut: 0 })
    }

    /// Reads what came; 0 where nothing did.
    ///
    /// # Errors
    /// Where the line broke: a device that was unplugged, the other end of a pseudo-terminal closed.
    pub fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.device.read(buffer) {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(0),
            other => other,
        }
    }

    /// Writes a frame. What the device does not take at once is lost: a late command is worse than none.
    ///
    /// # Errors
    /// Where the line broke.
    pub fn write(&mut self, frame: &[u8]) -> io::Result<()> {
        match self.device.write(frame) {
            Ok(written) if written == frame.len() => Ok(()),
            Err(error) if error.kind() != io::ErrorKind::WouldBlock => Err(error),
            _ => {
                self.cut += 1;
                Ok(())
            }
        }
    }
}

impl AsFd for Line {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.device.as_fd()
    }
}

/// Makes a terminal carry bytes as they are, at a speed where one is given.
///
/// # Errors
/// Where the terminal refuses.
pub fn make_raw(terminal: BorrowedFd<'_>, baud: Option<u32>) -> io::Result<()> {
    let mut attributes = tcgetattr(terminal)?;
    attributes.make_raw();
    if let Some(baud) = baud {
        attributes.set_speed(baud)?;
    }
    tcsetattr(terminal, OptionalActions::Now, &attributes)?;
    Ok(())
}
