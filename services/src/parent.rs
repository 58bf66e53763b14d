//! Children that end together with who started them.

use rustix::process::{Signal, getppid, set_parent_process_death_signal};

/// Asks the kernel for SIGTERM when `parent`, which started this process, dies; if it is dead already, sends it now.
pub fn die_with_parent(parent: u32) {
    if let Err(error) = set_parent_process_death_signal(Some(Signal::TERM)) {
        tracing::warn!(%error, "will not end with the parent process");
    }
    if !is_alive(parent) {
        kerbside_runtime::terminate(std::process::id());
    }
}

/// Whether `parent`, which started this process, still lives: orphans are handed on to another process.
#[must_use]
pub fn is_alive(parent: u32) -> bool {
    getppid().is_some_and(|pid| pid.as_raw_pid().cast_unsigned() == parent)
}
