//! What the kernel accounts to a process.

use std::fs;
use std::path::PathBuf;

use kerbside_messages::{Nanos, seconds};
use kerbside_runtime::now;

/// Memory and processor time of a process.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Usage {
    /// Resident memory, shared memory included \[MiB\]; none where the process is gone.
    pub memory: Option<f64>,
    /// Share of one processor since the last look \[%\].
    pub processor: Option<f64>,
}

/// Looks at a process again and again.
#[derive(Clone, Copy, Debug, Default)]
pub struct Meter {
    pid: u32,
    last: Option<(Nanos, Nanos)>,
}

impl Meter {
    /// What process `pid` uses; of a new pid there is no share of a processor yet.
    #[allow(clippy::cast_precision_loss)] // far below 2^53
    pub fn read(&mut self, pid: u32) -> Usage {
        if pid != self.pid {
            *self = Self { pid, last: None };
        }
        let used = execution_time(pid).map(|time| (now(), time));
        let share = |(now, time): (Nanos, Nanos), (then, before): (Nanos, Nanos)| {
            let span = now.saturating_sub(then);
            (span > 0).then(|| 100.0 * seconds(time.saturating_sub(before)) / seconds(span))
        };
        let processor = used.zip(self.last).and_then(|(used, last)| share(used, last));
        self.last = used;
        Usage { memory: resident(pid).map(|kib| kib as f64 / 1024.0), processor }
    }
}

fn folder(pid: u32) -> PathBuf {
    PathBuf::from(format!("/proc/{pid}"))
}

/// Resident memory \[KiB\].
fn resident(pid: u32) -> Option<u64> {
    let text = fs::read_to_string(folder(pid).join("status")).ok()?;
    text.lines()
        .find_map(|line| line.strip_prefix("VmRSS:")?.split_whitespace().next()?.parse().ok())
}

/// Time that all threads spent executing, in user code and in the kernel \[ns\]; a thread that ended takes its own along.
fn execution_time(pid: u32) -> Option<Nanos> {
    let threads = fs::read_dir(folder(pid).join("task")).ok()?.flatten();
    let time = |path: PathBuf| -> Option<Nanos> {
        fs::read_to_string(path.join("schedstat")).ok()?.split_whitespace().next()?.parse().ok()
    };
    Some(threads.filter_map(|thread| time(thread.path())).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_uses_memory_and_time_and_one_that_is_gone_uses_none() {
        let mut meter = Meter::default();
        let first = meter.read(std::process::id());
        assert!(first.memory.unwrap() > 1.0 && first.processor.is_none(), "{first:?}");
        let mut sum = 0_u64;
        let begun = now();
        while now() < begun + 20_000_000 {
            sum = core::hint::black_box(sum.wrapping_mul(31).wrapping_add(7));
        }
        assert!(meter.read(std::process::id()).processor.unwrap() > 1.0);
        assert_eq!(meter.read(u32::MAX), Usage::default());
        assert_eq!(meter.read(std::process::id()).processor, None, "another pid begins anew");
    }
}
