//! An instance: one name, one root path and prefix, one user, one supervisor.

use core::time::Duration;
use std::fs;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use iceoryx2::prelude::{Config, FileName, SemanticString};
use kerbside_messages::{LAYOUT_VERSION, Process};

use crate::Ticker;
use crate::lock::{FileLock, LockError};

/// Longest name of an instance.
pub const MAX_NAME: usize = 24;

/// Bytes that a Unix socket's path may have; the middleware puts its sockets below the root.
const SOCKET_PATH: usize = 107;
/// Bytes that the middleware's socket names need behind the root: a slash, prefix, number and suffix.
const SOCKET_NAME: usize = 1 + 15 + 39 + 6;

/// Attempts to remove a folder in which somebody may be at work.
const REMOVALS: u32 = 50;
/// Time between them.
const PAUSE: Duration = Duration::from_millis(2);

/// How the line of the prefix begins in the middleware's configuration.
const PREFIX_KEY: &str = "prefix = \"";

/// Why an instance cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum InstanceError {
    /// A name that is no name.
    #[error("instance name {name:?}: found {} characters, allowed are 1 to {MAX_NAME} of a-z, 0-9 and -", name.len())]
    Name {
        /// What was given.
        name: String,
    },
    /// The run-time folder is too deep for socket paths.
    #[error(
        "{folder}: {length} bytes of path, {allowed} leave room for the sockets in it; set XDG_RUNTIME_DIR to a shorter folder, or take a shorter name for the instance"
    )]
    TooDeep {
        /// The folder.
        folder: PathBuf,
        /// Its length.
        length: usize,
        /// What fits.
        allowed: usize,
    },
    /// The folder belongs to somebody else.
    #[error(
        "{folder} belongs to user {owner}, an instance is for one user and this is user {user}"
    )]
    Foreign {
        /// The folder.
        folder: PathBuf,
        /// Its owner.
        owner: u32,
        /// Who asks.
        user: u32,
    },
    /// A file operation failed.
    #[error("{path}: {source}")]
    File {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Another supervisor has it.
    #[error("instance {name} is already supervised by process {pid}")]
    Busy {
        /// Its name.
        name: String,
        /// Its supervisor.
        pid: u32,
    },
}

/// Where an instance lives: a folder of its own in the user's run-time folder, and a prefix in shared memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance {
    name: String,
    folder: PathBuf,
}

impl Instance {
    /// The instance of that name; nothing is created.
    ///
    /// # Errors
    /// [`InstanceError::Name`] or [`InstanceError::TooDeep`].
    pub fn named(name: &str) -> Result<Self, InstanceError> {
        Self::below(&run_time_folder(), name)
    }

    /// The instance of that name below a run-time folder.
    ///
    /// # Errors
    /// [`InstanceError::Name`] or [`InstanceError::TooDeep`].
    pub fn below(base: &Path, name: &str) -> Result<Self, InstanceError> {
        let valid = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
        if name.is_empty() || name.len() > MAX_NAME || !name.bytes().all(valid) {
            return Err(InstanceError::Name { name: name.to_owned() });
        }
        let instance = Self { name: name.to_owned(), folder: base.join(name) };
        let (length, allowed) = (instance.root().as_os_str().len(), SOCKET_PATH - SOCKET_NAME);
        if length > allowed {
            return Err(InstanceError::TooDeep { folder: instance.root(), length, allowed });
        }
        Ok(instance)
    }

    /// A name nobody uses, for a run of its own.
    #[must_use]
    pub fn fresh_name(verb: &str) -> String {
        format!("{verb}-{}", std::process::id())
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The middleware's root path.
    #[must_use]
    pub fn root(&self) -> PathBuf {
        self.folder.join("iox")
    }

    /// The middleware's configuration file.
    #[must_use]
    pub fn configuration(&self) -> PathBuf {
        self.folder.join("iox.toml")
    }

    /// The name under which the simulated vehicle links its end of the line.
    #[must_use]
    pub fn vehicle_link(&self) -> PathBuf {
        self.folder.join("vehicle")
    }

    /// The lock of one of its processes.
    #[must_use]
    pub fn process_lock(&self, process: Process) -> PathBuf {
        self.folder.join(format!("{}.pid", process.name()))
    }

    /// How everything of this instance begins in shared memory: made from the folder, so that two users and two
    /// run-time folders never share it.
    #[must_use]
    pub fn prefix(&self) -> String {
        // FNV-1a, 32 bit: short, and equal in every build.
        let hash = self
            .folder
            .as_os_str()
            .as_encoded_bytes()
            .iter()
            .fold(0x811c_9dc5_u32, |hash, byte| {
                (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193)
            });
        format!("kb{hash:08x}")
    }

    /// A prefix for one life of the instance, from its supervisor's start to its end. Who still holds services of an
    /// ended life removes them by name when it lets go: they must not be those of the next life.
    fn new_life(&self) -> String {
        let milliseconds = crate::now() / 1_000_000;
        format!("{}{:04x}_", self.prefix(), milliseconds & 0xffff)
    }

    /// The prefix of the present life; none where the instance has not been set up.
    fn life(&self) -> Result<Option<String>, InstanceError> {
        let path = self.configuration();
        let text = match fs::read_to_string(&path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            other => other.map_err(|source| InstanceError::File { path, source })?,
        };
        let prefix = text.lines().find_map(|line| line.strip_prefix(PREFIX_KEY)?.strip_suffix('"'));
        Ok(prefix.map(str::to_owned))
    }

    /// Makes the folder, for this user alone.
    ///
    /// # Errors
    /// [`InstanceError::File`] or [`InstanceError::Foreign`].
    pub fn create_folder(&self) -> Result<(), InstanceError> {
        let wrap = |source| InstanceError::File { path: self.folder.clone(), source };
        fs::DirBuilder::new().recursive(true).mode(0o700).create(&self.folder).map_err(wrap)?;
        let user = rustix::process::geteuid().as_raw();
        // The folder above too: who owns that could put another instance in the place of this one.
        for folder in self.folder.ancestors().take(2) {
            let owner = fs::metadata(folder).map_err(wrap)?.uid();
            if owner != user {
                return Err(InstanceError::Foreign { folder: folder.to_owned(), owner, user });
            }
        }
        Ok(())
    }

    /// Takes the supervisor's lock; who holds it owns the instance.
    ///
    /// # Errors
    /// [`InstanceError::Busy`] where it has a supervisor, [`InstanceError::File`] where the lock cannot be used.
    pub fn lock(&self) -> Result<FileLock, InstanceError> {
        self.create_folder()?;
        let taken = FileLock::take(&self.process_lock(Process::Supervisor));
        let lock = taken.map_err(|error| match error {
            LockError::Held { pid, .. } => InstanceError::Busy { name: self.name.clone(), pid },
            LockError::File { path, source } => InstanceError::File { path, source },
        })?;
        // From now on the instance counts as supervised: nobody may join what an earlier life left.
        remove_file(&self.configuration())?;
        Ok(lock)
    }

    /// The pid of its supervisor; none where it has none.
    #[must_use]
    pub fn supervisor(&self) -> Option<u32> {
        FileLock::holder(&self.process_lock(Process::Supervisor))
    }

    /// Removes what an earlier life left: the middleware's files and its segments in shared memory.
    ///
    /// # Errors
    /// [`InstanceError::File`].
    pub fn wipe(&self) -> Result<(), InstanceError> {
        // First what tells others how to join: who read it before undoes what it makes from it.
        remove_file(&self.configuration())?;
        remove_folder(&self.root())?;
        self.segments(&self.prefix()).try_for_each(|path| remove_file(&path))
    }

    /// Removes what came into being for a life that had ended already; its folders too, unless somebody else lives
    /// there by now.
    pub(crate) fn remove_life(&self, ended: &Config) -> Result<(), InstanceError> {
        let prefix = ended.global.prefix.to_string();
        self.segments(&prefix).try_for_each(|path| remove_file(&path))?;
        if self.supervisor().is_none() {
            remove_folder(&self.root())?;
            // Refused where anything is in it.
            let _ = fs::remove_dir(&self.folder);
        }
        Ok(())
    }

    /// Takes every right to the instance's segments from other users.
    pub(crate) fn close_to_others(&self) -> Result<(), InstanceError> {
        self.segments(&self.prefix()).try_for_each(|path| {
            match fs::set_permissions(&path, fs::Permissions::from_mode(0o600)) {
                // Somebody who held something of an earlier life let go of it.
                Err(source) if source.kind() == std::io::ErrorKind::NotFound => Ok(()),
                other => other.map_err(|source| InstanceError::File { path, source }),
            }
        })
    }

    /// What the instance has in shared memory under `prefix`: its own, or that of one of its lives.
    fn segments(&self, prefix: &str) -> impl Iterator<Item = PathBuf> {
        let entries = fs::read_dir("/dev/shm").into_iter().flatten().flatten();
        entries
            .filter(move |entry| {
                entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes())
            })
            .map(|entry| entry.path())
    }

    /// Removes everything of the instance, its folder included, unless a simulated vehicle still lives there.
    ///
    /// # Errors
    /// [`InstanceError::File`].
    pub fn remove(&self) -> Result<(), InstanceError> {
        self.wipe()?;
        if FileLock::holder(&self.process_lock(Process::Vehicle)).is_some() {
            return Ok(());
        }
        remove_folder(&self.folder)
    }

    /// The last one out: removes everything of an instance that has neither a supervisor nor any other process.
    ///
    /// # Errors
    /// [`InstanceError::File`].
    pub fn remove_if_deserted(&self) -> Result<(), InstanceError> {
        let Some(_blocked) = FileLock::block(&self.process_lock(Process::Supervisor)) else {
            return Ok(());
        };
        let lives = |process| FileLock::holder(&self.process_lock(process)).is_some();
        if Process::ALL.into_iter().any(lives) { Ok(()) } else { self.remove() }
    }

    /// Writes the middleware's configuration for the instance's processes, with the version of the layouts for those in
    /// other languages.
    ///
    /// # Errors
    /// [`InstanceError::File`].
    pub fn write_configuration(&self) -> Result<(), InstanceError> {
        let path = self.configuration();
        let wrap = |source| InstanceError::File { path: path.clone(), source };
        fs::create_dir_all(self.root()).map_err(wrap)?;
        let text = format!(
            "# layout version {LAYOUT_VERSION}\n[global]\nroot-path = \"{}\"\n{PREFIX_KEY}{}\"\n",
            self.root().display(),
            self.new_life()
        );
        // Written beside and renamed: who finds it finds all of it.
        let part = self.folder.join("iox.toml.part");
        fs::write(&part, text).and_then(|()| fs::rename(&part, &path)).map_err(wrap)
    }

    /// The middleware's configuration: root and prefix of the instance's present life; only the supervisor sweeps dead
    /// nodes. None where the instance has not been set up.
    pub(crate) fn middleware_config(&self) -> Result<Option<Config>, InstanceError> {
        let wrap = |what: &str| InstanceError::File {
            path: self.folder.clone(),
            source: std::io::Error::other(format!("no path for the middleware: {what}")),
        };
        let Some(prefix) = self.life()? else { return Ok(None) };
        let mut config = Config::default();
        let root = self.root();
        let root = iceoryx2::prelude::Path::new(root.as_os_str().as_encoded_bytes());
        config.global.set_root_path(&root.map_err(|error| wrap(&format!("{error:?}")))?);
        config.global.prefix =
            FileName::new(prefix.as_bytes()).map_err(|error| wrap(&format!("{error:?}")))?;
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(Some(config))
    }

    /// Every instance of this user that has a supervisor, with its supervisor's pid.
    #[must_use]
    pub fn live() -> Vec<(Self, u32)> {
        let mut found: Vec<_> = fs::read_dir(run_time_folder())
            .into_iter()
            .flatten()
            .flatten()
            .filter_map(|entry| Self::named(entry.file_name().to_str()?).ok())
            .filter_map(|instance| instance.supervisor().map(|pid| (instance, pid)))
            .collect();
        found.sort_by(|a, b| a.0.name.cmp(&b.0.name));
        found
    }
}

/// The user's run-time folder for instances.
fn run_time_folder() -> PathBuf {
    match std::env::var_os("XDG_RUNTIME_DIR").filter(|folder| !folder.is_empty()) {
        Some(folder) => PathBuf::from(folder).join("kerbside"),
        None => PathBuf::from(format!("/tmp/kerbside-{}", rustix::process::geteuid().as_raw())),
    }
}

fn remove_folder(path: &Path) -> Result<(), InstanceError> {
    let mut attempts = REMOVALS;
    let mut pause = Ticker::new(PAUSE);
    loop {
        attempts -= 1;
        match fs::remove_dir_all(path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
            // Somebody put a file there while the others were removed.
            Err(error) if error.kind() == std::io::ErrorKind::DirectoryNotEmpty && attempts > 0 => {
                pause.wait();
            }
            other => {
                return other
                    .map_err(|source| InstanceError::File { path: path.to_owned(), source });
            }
        }
    }
}

fn remove_file(path: &Path) -> Result<(), InstanceError> {
    match fs::remove_file(path) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            Err(InstanceError::File { path: path.to_owned(), source })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_depth_are_checked() {
        let base = Path::new("/tmp/x");
        assert!(Instance::below(base, "park-12").is_ok());
        for bad in ["", "A", "a/b", "a b", "a234567890123456789012345"] {
            assert!(matches!(Instance::below(base, bad), Err(InstanceError::Name { .. })), "{bad}");
        }
        let deep = PathBuf::from(format!("/{}", "d".repeat(60)));
        assert!(matches!(Instance::below(&deep, "a"), Err(InstanceError::TooDeep { .. })));
    }

    #[test]
    fn folders_make_prefixes() {
        let one = Instance::below(Path::new("/tmp/a"), "x").unwrap();
        let two = Instance::below(Path::new("/tmp/b"), "x").unwrap();
        assert_ne!(one.prefix(), two.prefix());
        assert_eq!(one.prefix().len(), 10);
    }

    #[test]
    fn one_supervisor_at_a_time() {
        let base = tempfile::tempdir_in("/tmp").unwrap();
        let instance = Instance::below(base.path(), "one").unwrap();
        let lock = instance.lock().unwrap();
        assert_eq!(instance.supervisor(), Some(std::process::id()));
        assert!(matches!(instance.lock(), Err(InstanceError::Busy { .. })));
        drop(lock);
        assert_eq!(instance.supervisor(), None);
        instance.remove().unwrap();
        assert!(!instance.folder().exists());
    }
}
