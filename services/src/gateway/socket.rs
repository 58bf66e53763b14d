//! Where the gateway's socket is, how it is made, and how clients find it.
//!
//! Shared memory and the instance's folder are closed to other users, so the socket cannot lie there: it lies in a
//! folder that everybody may look into and nobody but the instance's user may write to. The socket itself may be
//! connected to by everybody; whoever has no right is told so and disconnected.

use std::fs::{self, DirBuilder, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

/// The folder of instances that an init system starts.
const SYSTEM: &str = "/run/kerbside";
/// How the folders of other users' instances begin, before the number of the user.
const USERS: &str = "/tmp/kerbside-gateway-";
/// Names a folder that is used in place of both, by gateways and by those who look for them.
const FOLDER: &str = "KERBSIDE_GATEWAYS";
/// How sockets are called, behind the instance's name.
const SUFFIX: &str = ".gateway";

/// Why there is no socket.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    File {
        /// Folder or socket.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// Others could put a socket of theirs in its place.
    #[error("{}: {found}, allowed is a folder of user {user} or root that nobody else may write to", path.display())]
    Unsafe {
        /// The folder.
        path: PathBuf,
        /// Owner and mode.
        found: String,
        /// The instance's user.
        user: u32,
    },
    /// Another gateway listens there.
    #[error("{}: another gateway listens there; gateway.socket names another place", path.display())]
    Busy {
        /// The socket.
        path: PathBuf,
    },
}

/// The gateway's socket; removed when dropped.
#[derive(Debug)]
pub struct Socket {
    path: PathBuf,
    listener: UnixListener,
}

impl Socket {
    /// Makes the socket at `path`, else where clients look for that of instance `name`; what a gateway that was killed
    /// left there is replaced.
    ///
    /// # Errors
    /// [`SocketError`].
    pub fn bind(path: Option<&Path>, name: &str) -> Result<Self, SocketError> {
        let user = rustix::process::geteuid().as_raw();
        let path = path.map_or_else(|| own_folder(user).join(file_name(name)), Path::to_owned);
        let wrap = |source| SocketError::File { path: path.clone(), source };
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        DirBuilder::new().recursive(true).mode(0o755).create(folder).map_err(wrap)?;
        check_folder(folder, user)?;
        let listener = match UnixListener::bind(&path) {
            Err(error) if error.kind() == io::ErrorKind::AddrInUse => {
                make_room(&path)?;
                UnixListener::bind(&path)
            }
            other => other,
        };
        let listener = listener.map_err(wrap)?;
        let socket = Self { path, listener };
        let wrap = |source| SocketError::File { path: socket.path.clone(), source };
        // Whatever the mask: who may do what is decided by the peer's credentials.
        fs::set_permissions(&socket.path, Permissions::from_mode(0o666)).map_err(wrap)?;
        socket.listener.set_nonblocking(true).map_err(wrap)?;
        Ok(socket)
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Another handle of the listener.
    ///
    /// # Errors
    /// Where there are too many descriptors.
    pub fn listener(&self) -> io::Result<UnixListener> {
        self.listener.try_clone()
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
        if let Some(folder) = self.path.parent()
            && folder.as_os_str().as_encoded_bytes().starts_with(USERS.as_bytes())
        {
            // Refused where another instance of the user has its socket there.
            let _ = fs::remove_dir(folder);
        }
    }
}

fn named_folder() -> Option<PathBuf> {
    std::env::var_os(FOLDER).filter(|folder| !folder.is_empty()).map(PathBuf::from)
}

fn own_folder(user: u32) -> PathBuf {
    if let Some(folder) = named_folder() {
        return folder;
    }
    let system = Path::new(SYSTEM);
    let own = fs::symlink_metadata(system).is_ok_and(|found| found.is_dir() && found.uid() == user);
    if own { system.to_owned() } else { PathBuf::from(format!("{USERS}{user}")) }
}

fn file_name(instance: &str) -> String {
    format!("{instance}{SUFFIX}")
}

/// Nobody else may be able to replace what is in the folder.
fn check_folder(folder: &Path, user: u32) -> Result<(), SocketError> {
    let found = fs::symlink_metadata(folder)
        .map_err(|source| SocketError::File { path: folder.to_owned(), source })?;
    let (owner, mode) = (found.uid(), found.mode() & 0o7777);
    // In a sticky folder each may remove their own files alone.
    let closed = mode & 0o022 == 0 || mode & 0o1000 != 0;
    if found.is_dir() && (owner == user || owner == 0) && closed {
        return Ok(());
    }
    let kind = if found.is_dir() { "a folder" } else { "no folder" };
    let found = format!("{kind} of user {owner}, mode {mode:o}");
    Err(SocketError::Unsafe { path: folder.to_owned(), found, user })
}

/// Removes a socket on which nobody listens any more; anything else stays.
fn make_room(path: &Path) -> Result<(), SocketError> {
    let wrap = |source| SocketError::File { path: path.to_owned(), source };
    if !fs::symlink_metadata(path).map_err(wrap)?.file_type().is_socket() {
        return Err(wrap(io::ErrorKind::AlreadyExists.into()));
    }
    match UnixStream::connect(path) {
        Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => {
            fs::remove_file(path).map_err(wrap)
        }
        Err(source) => Err(wrap(source)),
        Ok(_) => Err(SocketError::Busy { path: path.to_owned() }),
    }
}

/// Sockets of gateways on this machine, those of instances named `name` alone where one is: path, and the user whose
/// gateway is to be found there.
#[must_use]
pub fn discover(name: Option<&str>) -> Vec<(PathBuf, u32)> {
    let owner = |path: &Path| {
        let found = fs::symlink_metadata(path).ok().filter(fs::Metadata::is_dir);
        found.map(|found| found.uid())
    };
    let folders = match named_folder() {
        Some(folder) => vec![folder],
        None => folders_of_users().chain([PathBuf::from(SYSTEM)]).collect(),
    };
    let wanted = name.map(file_name);
    let mut found: Vec<_> = folders
        .into_iter()
        .filter_map(|folder| owner(&folder).map(|owner| (folder, owner)))
        .flat_map(|(folder, owner)| {
            let entries = fs::read_dir(folder).into_iter().flatten().flatten();
            entries.map(move |entry| (entry.path(), owner))
        })
        .filter(|(path, _)| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            wanted.as_ref().map_or(name.ends_with(SUFFIX), |wanted| *wanted == name)
        })
        .collect();
    found.sort();
    found
}

/// The folders that are their users', as their names say.
fn folders_of_users() -> impl Iterator<Item = PathBuf> {
    let parent = Path::new(USERS).parent().unwrap_or(Path::new("/"));
    let entries = fs::read_dir(parent).into_iter().flatten().flatten().map(|entry| entry.path());
    entries.filter(|path| {
        let user = path.to_str().and_then(|path| path.strip_prefix(USERS)?.parse::<u32>().ok());
        user.is_some() && fs::symlink_metadata(path).ok().map(|found| found.uid()) == user
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> tempfile::TempDir {
        tempfile::tempdir().unwrap()
    }

    #[test]
    fn a_socket_is_open_to_all_and_gone_with_its_gateway() {
        let folder = folder();
        let path = folder.path().join("deep").join("one.gateway");
        let socket = Socket::bind(Some(&path), "one").unwrap();
        assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o666);
        assert!(UnixStream::connect(&path).is_ok());
        drop(socket);
        assert!(!path.exists());
    }

    #[test]
    fn what_a_killed_gateway_left_is_replaced_and_a_living_one_is_not() {
        let folder = folder();
        let path = folder.path().join("one.gateway");
        // A listener that is dropped leaves its file.
        drop(UnixListener::bind(&path).unwrap());
        let _socket = Socket::bind(Some(&path), "one").unwrap();
        let error = Socket::bind(Some(&path), "one").unwrap_err();
        assert!(matches!(error, SocketError::Busy { .. }), "{error}");
        assert!(UnixStream::connect(&path).is_ok());
    }

    #[test]
    fn a_file_of_another_kind_stays() {
        let folder = folder();
        let path = folder.path().join("one.gateway");
        fs::write(&path, "mine").unwrap();
        let error = Socket::bind(Some(&path), "one").unwrap_err();
        assert!(matches!(error, SocketError::File { .. }), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    }

    #[test]
    fn a_folder_that_others_may_write_to_is_refused() {
        let folder = folder();
        let open = folder.path().join("open");
        fs::create_dir(&open).unwrap();
        fs::set_permissions(&open, Permissions::from_mode(0o777)).unwrap();
        let error = Socket::bind(Some(&open.join("s")), "one").unwrap_err();
        assert!(error.to_string().contains("mode 777"), "{error}");
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(folder.path(), &link).unwrap();
        let error = Socket::bind(Some(&link.join("s")), "one").unwrap_err();
        assert!(error.to_string().contains("no folder"), "{error}");
    }
}
