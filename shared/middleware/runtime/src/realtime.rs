//! Real-time scheduling, locked memory and core pinning, as far as the rights go.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// What is asked for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RealtimeRequest {
    /// Priority under `SCHED_FIFO`, 1 to 99; none: stay with the ordinary scheduler.
    pub priority: Option<u8>,
    /// Lock all memory.
    pub lock_memory: bool,
    /// Cores to run on; empty: any.
    pub cores: Vec<usize>,
}

/// What was granted; each refusal in words.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RealtimeReport {
    /// The thread runs under `SCHED_FIFO`.
    pub scheduled: bool,
    /// What was refused.
    pub refused: Vec<String>,
}

/// Gives the calling thread what `request` asks for, as far as the rights go.
#[must_use]
pub fn enter_realtime(request: &RealtimeRequest) -> RealtimeReport {
    let mut report = RealtimeReport::default();
    if !request.cores.is_empty() {
        let mut set = CpuSet::new();
        request
            .cores
            .iter()
            .filter(|core| **core < CpuSet::MAX_CPU)
            .for_each(|core| set.set(*core));
        if let Err(error) = sched_setaffinity(None, &set) {
            report.refused.push(format!("cores {:?}: {error}", request.cores));
        }
    }
    if request.lock_memory
        && let Err(error) = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)
    {
        report.refused.push(format!("locked memory: {error}"));
    }
    if let Some(priority) = request.priority {
        match schedule(priority) {
            Ok(()) => report.scheduled = true,
            Err(error) => report.refused.push(format!("SCHED_FIFO priority {priority}: {error}")),
        }
    }
    report
}

/// The calling thread alone: threads and processes that it starts begin with the ordinary scheduler again, else a search
/// or a recording would run before the control path.
/// The last of the cores the calling thread may run on; none where it has no choice.
#[must_use]
pub fn last_core() -> Option<usize> {
    let allowed = sched_getaffinity(None).ok()?;
    let mut cores = (0..CpuSet::MAX_CPU).filter(|core| allowed.is_set(*core)).rev();
    let last = cores.next()?;
    cores.next().map(|_| last)
}

fn schedule(priority: u8) -> std::io::Result<()> {
    let parameter = libc::sched_param { sched_priority: libc::c_int::from(priority) };
    let policy = libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK;
    // SAFETY: the parameter outlives the call, which only reads it; 0 means the calling thread.
    match unsafe { libc::sched_setscheduler(0, policy, &raw const parameter) } {
        0 => Ok(()),
        _ => Err(std::io::Error::last_os_error()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_on_one_core_has_no_choice() {
        let choice = last_core();
        assert_eq!(choice.is_some(), std::thread::available_parallelism().unwrap().get() > 1);
        if let Some(last) = choice {
            let request = RealtimeRequest { cores: vec![last], ..RealtimeRequest::default() };
            let pinned = std::thread::spawn(move || (enter_realtime(&request), last_core()));
            assert_eq!(pinned.join().unwrap(), (RealtimeReport::default(), None));
            assert_eq!(last_core(), choice, "only the other thread was pinned");
        }
    }
}
