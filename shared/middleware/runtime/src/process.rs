//! Processes as the supervisor handles them.

use rustix::process::{Pid, Signal, kill_process};

/// Marks every descriptor above the standard three as closed on exec: those of the middleware are not, and a child
/// must not keep its parent's sockets and locks open. Call it right before spawning.
pub fn close_inherited_on_exec() {
    // SAFETY: the call sets a flag on descriptors of this process; it closes none and touches no memory.
    unsafe {
        libc::close_range(3, libc::c_uint::MAX, libc::CLOSE_RANGE_CLOEXEC.cast_signed());
    }
}

/// Ends this process in silence when nobody reads its output any more, as people expect of a command in a pipe. Only
/// for a process that has nothing left to do but print.
pub fn end_on_broken_pipe() {
    // SAFETY: the default action takes the place of an ignored signal; no handler of ours runs.
    unsafe {
        libc::signal(libc::SIGPIPE, libc::SIG_DFL);
    }
}

/// Gives memory that was freed back to the system, where the allocator keeps it otherwise: after a job that needed much of
/// it once. Not for the control path.
pub fn release_memory() {
    #[cfg(target_env = "gnu")]
    // SAFETY: the call touches free memory of the allocator alone, under the allocator's own locks.
    unsafe {
        libc::malloc_trim(0);
    }
}

/// Asks a process to end.
pub fn terminate(pid: u32) {
    signal(pid, Signal::TERM);
}

/// Ends a process, stopped or not.
pub fn kill(pid: u32) {
    signal(pid, Signal::KILL);
}

/// Stops a process where it is; [`resume`] lets it go on.
pub fn suspend(pid: u32) {
    signal(pid, Signal::STOP);
}

/// Lets a stopped process go on, so that it hears what it was asked.
pub fn resume(pid: u32) {
    signal(pid, Signal::CONT);
}

fn signal(pid: u32, signal: Signal) {
    if let Some(pid) = i32::try_from(pid).ok().and_then(Pid::from_raw) {
        // A process that is gone already is what was wanted.
        let _ = kill_process(pid, signal);
    }
}
