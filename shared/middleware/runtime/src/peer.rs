//! Who is at the other end of a Unix-domain socket, as the kernel vouches for it.

use std::io;
use std::os::fd::{AsFd, AsRawFd};

/// Most groups of a process that are asked for: the kernel's own limit.
const MOST_GROUPS: usize = 65_536;

/// A peer's credentials, as they were when it connected or began to listen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Peer {
    /// Its pid.
    pub pid: u32,
    /// Its user.
    pub user: u32,
    /// Its groups, the effective one first.
    pub groups: Vec<u32>,
}

impl Peer {
    /// The peer of a connected Unix-domain socket (`SO_PEERCRED` and `SO_PEERGROUPS`, unix(7) and Linux 4.13).
    ///
    /// # Errors
    /// Where the descriptor is no such socket.
    pub fn of(socket: &impl AsFd) -> io::Result<Self> {
        // A `ucred` is pid, user and group, each of 32 bits.
        let mut found = [0, u32::MAX, u32::MAX];
        if option(socket, libc::SO_PEERCRED, &mut found)? != found.len() {
            return Err(io::Error::other("the kernel tells nothing of the peer"));
        }
        let [pid, user, group] = found;
        let mut groups = vec![group];
        groups.extend(supplementary(socket)?);
        Ok(Self { pid, user, groups })
    }
}

/// The supplementary groups; as many as there are.
fn supplementary(socket: &impl AsFd) -> io::Result<Vec<u32>> {
    let mut room = 64;
    loop {
        let mut groups = vec![0; room];
        match option(socket, libc::SO_PEERGROUPS, &mut groups) {
            Ok(count) => {
                groups.truncate(count);
                return Ok(groups);
            }
            Err(error) if error.raw_os_error() == Some(libc::ERANGE) && room < MOST_GROUPS => {
                room *= 4;
            }
            Err(error) => return Err(error),
        }
    }
}

/// Reads an option of a socket into `values`; how many of them were filled.
fn option(socket: &impl AsFd, option: libc::c_int, values: &mut [u32]) -> io::Result<usize> {
    let mut length =
        libc::socklen_t::try_from(size_of_val(values)).map_err(|_| io::ErrorKind::InvalidInput)?;
    // SAFETY: the descriptor is open while it is borrowed; the kernel writes at most `length` bytes, which are those
    // of `values`, and reports how many it wrote.
    let result = unsafe {
        libc::getsockopt(
            socket.as_fd().as_raw_fd(),
            libc::SOL_SOCKET,
            option,
            values.as_mut_ptr().cast(),
            &raw mut length,
        )
    };
    if result != 0 {
        return Err(io::Error::last_os_error());
    }
    Ok((length as usize / size_of::<u32>()).min(values.len()))
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixStream;

    use super::*;

    #[test]
    fn a_peer_in_this_process_is_this_process() {
        let (one, _two) = UnixStream::pair().unwrap();
        let peer = Peer::of(&one).unwrap();
        assert_eq!(peer.pid, std::process::id());
        assert_eq!(peer.user, rustix::process::geteuid().as_raw());
        assert_eq!(peer.groups[0], rustix::process::getegid().as_raw());
        let mut ours: Vec<_> =
            rustix::process::getgroups().unwrap().iter().map(|group| group.as_raw()).collect();
        let mut theirs = peer.groups[1..].to_vec();
        ours.sort_unstable();
        theirs.sort_unstable();
        assert_eq!(theirs, ours);
    }

    #[test]
    fn what_is_no_socket_has_no_peer() {
        assert!(Peer::of(&std::fs::File::open("/dev/null").unwrap()).is_err());
    }
}
