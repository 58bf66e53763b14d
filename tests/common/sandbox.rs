//! A run-time and a state folder of its own, and the proof that nothing is left of what ran there.

use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use kerbside_runtime::Instance;
use tempfile::TempDir;

/// Tells whose a process is; children inherit it.
const MARK: &str = "KERBSIDE_TEST_SANDBOX";
/// Stacks at once: more would measure each other.
const STACKS: usize = 2;

static RUNNING: Mutex<usize> = Mutex::new(0);
static ENDED: Condvar = Condvar::new();

/// Room for a stack; waits until there is some.
#[derive(Debug)]
pub(crate) struct Sandbox {
    folder: Arc<TempDir>,
    name: &'static str,
}

impl Sandbox {
    /// Takes one of the two places for stacks.
    pub(crate) fn new() -> Self {
        take_place();
        // Sockets live below it, and their paths have to be short.
        let folder = tempfile::Builder::new().prefix("kb").tempdir_in("/tmp").unwrap();
        for part in ["run", "state", "work", "doors"] {
            fs::create_dir(folder.path().join(part)).unwrap();
        }
        Self { folder: Arc::new(folder), name: "one" }
    }

    /// Takes the other place, for a second instance in the same run-time folder.
    pub(crate) fn beside(&self) -> Self {
        take_place();
        Self { folder: Arc::clone(&self.folder), name: "two" }
    }

    /// The executable, at home here.
    pub(crate) fn kerbside(&self) -> Command {
        self.at_home(Command::new(env!("CARGO_BIN_EXE_kerbside")))
    }

    /// `command`, with run-time and state folder here and no configuration in its working directory.
    pub(crate) fn at_home(&self, mut command: Command) -> Command {
        command
            .env(MARK, self.mark())
            .env("XDG_RUNTIME_DIR", self.run_time())
            .env("XDG_STATE_HOME", self.folder.path().join("state"))
            .env("KERBSIDE_GATEWAYS", self.gateways())
            .env_remove("RUST_LOG")
            .env_remove("NOTIFY_SOCKET")
            .current_dir(self.folder.path().join("work"));
        command
    }

    /// A file of this instance's stack.
    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(format!("{}-{name}", self.name))
    }

    /// The instance of this sandbox.
    pub(crate) fn instance(&self) -> Instance {
        Instance::below(&self.run_time().join("kerbside"), self.name).unwrap()
    }

    /// The folder of this sandbox's gateways, where its verbs look for those of others.
    pub(crate) fn gateways(&self) -> PathBuf {
        self.folder.path().join("doors")
    }

    fn run_time(&self) -> PathBuf {
        self.folder.path().join("run")
    }

    fn mark(&self) -> String {
        format!("{}/{}", self.folder.path().display(), self.name)
    }

    /// Processes that were started here, with what they are.
    pub(crate) fn processes(&self) -> Vec<(u32, String)> {
        let mark = format!("{MARK}={}\0", self.mark());
        let entries = fs::read_dir("/proc").unwrap().flatten();
        let pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        pids.filter(|pid| *pid != std::process::id())
            .filter(|pid| contains(&read(*pid, "environ"), mark.as_bytes()))
            .map(|pid| (pid, String::from_utf8_lossy(&read(pid, "cmdline")).replace('\0', " ")))
            .collect()
    }

    /// Segments of the instance in shared memory.
    pub(crate) fn segments(&self) -> Vec<String> {
        let prefix = self.instance().prefix();
        let names = fs::read_dir("/dev/shm").unwrap().flatten();
        let names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
        names.filter(|name| name.starts_with(&prefix)).collect()
    }

    /// Holds what ran here against having left nothing.
    ///
    /// # Panics
    /// Where a process, a segment or a file is left.
    pub(crate) fn assert_empty(&self) {
        assert_eq!(self.processes(), [], "processes are left");
        assert_eq!(self.segments(), Vec::<String>::new(), "segments are left");
        assert!(!self.instance().folder().exists(), "the instance's folder is left");
    }
}

impl Drop for Sandbox {
    /// Whatever a failed test left is ended here, so that it fails alone.
    fn drop(&mut self) {
        for (pid, _) in self.processes() {
            kerbside_runtime::kill(pid);
        }
        let _ = self.instance().wipe();
        *running() -= 1;
        ENDED.notify_one();
    }
}

fn take_place() {
    let room = ENDED.wait_while(running(), |running| *running >= STACKS);
    *room.unwrap_or_else(PoisonError::into_inner) += 1;
}

fn running() -> MutexGuard<'static, usize> {
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}

fn read(pid: u32, file: &str) -> Vec<u8> {
    fs::read(format!("/proc/{pid}/{file}")).unwrap_or_default()
}

fn contains(text: &[u8], part: &[u8]) -> bool {
    text.windows(part.len()).any(|window| window == part)
}
