//! Real-time scheduling, locked memory and core pinning, as far as the rights go.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity};
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

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

fn schedule(priority: u8) -> Result<(), String> {
    let value = priority.try_into().map_err(|error: &str| error.to_owned())?;
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
        .map_err(|error| format!("{error:?}"))
}
