//! Kernel, cores, clock, and the rights to real-time scheduling and locked memory.

use std::fs;

use kerbside_runtime::{RealtimeRequest, enter_realtime};
use kerbside_settings::{RealtimeMode, RealtimeSettings, Stack};
use rustix::process::{Resource, getrlimit};

use super::Check;

/// Descriptors that a process of a stack may come to need: the supervisor was seen to hold 174, a port of the middleware
/// has some each.
const DESCRIPTORS: u64 = 1024;
/// Clocks that are read without a system call.
const FAST_CLOCKS: [&str; 5] =
    ["tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page", "riscv_clocksource"];
/// Bit of the right to lock memory among a process's capabilities, `CAP_IPC_LOCK`.
const IPC_LOCK: u32 = 14;

/// What follows from the machine and from how this process was started.
pub(super) fn of_machine(stack: Option<&Stack>) -> Vec<Check> {
    let realtime = stack.map(|stack| stack.realtime.clone()).unwrap_or_default();
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
    let mut found = vec![
        kernel(&first_line("/proc/sys/kernel/osrelease"), &first_line("/proc/sys/kernel/version")),
        processors(cores),
        clock(&first_line("/sys/devices/system/clocksource/clocksource0/current_clocksource")),
    ];
    let governor = first_line("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
    found.extend((!governor.is_empty()).then(|| frequency(&governor)));
    found.push(scheduling(&realtime, &refusals(&realtime)));
    found.push(memory(&realtime, locked_limit()));
    found.push(descriptors(getrlimit(Resource::Nofile).current));
    found
}

/// The first line of a file; nothing where it cannot be read.
fn first_line(path: &str) -> String {
    let text = fs::read_to_string(path).unwrap_or_default();
    text.lines().next().unwrap_or_default().trim().to_owned()
}

fn kernel(release: &str, version: &str) -> Check {
    let model = ["PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT"]
        .into_iter()
        .find(|model| version.split_whitespace().any(|word| word == *model));
    let model = model.map_or_else(String::new, |model| format!(", {model}"));
    Check::good("kernel", format!("Linux {release}{model}"))
}

fn processors(cores: usize) -> Check {
    match cores {
        1 => Check::note(
            "cores",
            "1",
            "with two or more the control path has one of its own where realtime.enabled asks for it",
        ),
        cores => Check::good("cores", cores.to_string()),
    }
}

fn clock(source: &str) -> Check {
    const NAME: &str = "clock source";
    match source {
        "" => {
            Check::note(NAME, "unknown", "/sys does not say; each sample is stamped several times")
        }
        fast if FAST_CLOCKS.contains(&fast) => Check::good(NAME, fast),
        slow => Check::note(
            NAME,
            format!("{slow}: reading the time takes a system call, several times a sample"),
            "see /sys/devices/system/clocksource/clocksource0/available_clocksource for a faster one",
        ),
    }
}

fn frequency(governor: &str) -> Check {
    const NAME: &str = "frequency governor";
    match governor {
        "performance" => Check::good(NAME, governor),
        other => Check::note(
            NAME,
            format!("{other}: a core that sleeps deeply wakes late"),
            "cpupower frequency-set -g performance",
        ),
    }
}

/// What is refused of the scheduling that the configuration names, tried on a thread that ends at once.
fn refusals(settings: &RealtimeSettings) -> Vec<String> {
    let request = RealtimeRequest {
        priority: Some(settings.priority),
        lock_memory: false,
        cores: settings.cores.clone().unwrap_or_default(),
    };
    std::thread::scope(|scope| scope.spawn(|| enter_realtime(&request).refused).join())
        .unwrap_or_else(|_| vec!["the attempt ended badly".to_owned()])
}

fn scheduling(settings: &RealtimeSettings, refused: &[String]) -> Check {
    const NAME: &str = "real-time scheduling";
    let priority = settings.priority;
    let advice = format!(
        "LimitRTPRIO={priority} in the unit, or rtprio {priority} for the user in \
         /etc/security/limits.d; the shorter time-outs come with it"
    );
    let found = refused.join("; ");
    match (settings.enabled, refused) {
        (RealtimeMode::Off, []) => Check::note(
            NAME,
            format!("SCHED_FIFO {priority} is granted, and realtime.enabled = \"off\""),
            "realtime.enabled = \"auto\" on a vehicle computer",
        ),
        (RealtimeMode::Off, _) => Check::good(NAME, "not asked for: realtime.enabled = \"off\""),
        (_, []) => Check::good(NAME, format!("SCHED_FIFO {priority} is granted")),
        (RealtimeMode::Auto, _) => Check::note(NAME, found, advice),
        (RealtimeMode::On, _) => Check::lacking(NAME, found, advice),
    }
}

/// How much memory this process may lock \[byte\]; none for as much as it likes.
fn locked_limit() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    if may_lock(&status) { None } else { getrlimit(Resource::Memlock).current }
}

fn may_lock(status: &str) -> bool {
    let capabilities = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    let bits = capabilities.and_then(|text| u64::from_str_radix(text.trim(), 16).ok());
    bits.is_some_and(|bits| bits >> IPC_LOCK & 1 == 1)
}

fn memory(settings: &RealtimeSettings, limit: Option<u64>) -> Check {
    const NAME: &str = "locked memory";
    let wanted = settings.enabled != RealtimeMode::Off && settings.lock_memory;
    match limit {
        None => Check::good(NAME, "no limit"),
        Some(bytes) if !wanted => {
            Check::good(NAME, format!("at most {}, not asked for", super::folders::size(bytes)))
        }
        Some(bytes) => Check::note(
            NAME,
            format!("at most {}: a page fault may delay a step", super::folders::size(bytes)),
            "LimitMEMLOCK=infinity in the unit, or memlock unlimited for the user in \
             /etc/security/limits.d",
        ),
    }
}

fn descriptors(limit: Option<u64>) -> Check {
    const NAME: &str = "open files";
    match limit {
        None => Check::good(NAME, "no limit"),
        Some(limit) if limit >= DESCRIPTORS => {
            Check::good(NAME, format!("at most {limit} a process"))
        }
        Some(limit) => Check::lacking(
            NAME,
            format!("at most {limit} a process, {DESCRIPTORS} are needed"),
            format!("ulimit -n {DESCRIPTORS}, or LimitNOFILE={DESCRIPTORS} in the unit"),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Standing::{Good, Lacking, Note};
    use super::*;

    #[test]
    fn rights_are_lacking_only_where_they_are_demanded() {
        let refused = ["SCHED_FIFO priority 50: not permitted".to_owned()];
        let standing = |enabled, refused: &[String]| {
            let settings = RealtimeSettings { enabled, ..RealtimeSettings::default() };
            scheduling(&settings, refused).standing
        };
        use RealtimeMode::{Auto, Off, On};
        assert_eq!([Off, Auto, On].map(|mode| standing(mode, &refused)), [Good, Note, Lacking]);
        assert_eq!([Off, Auto, On].map(|mode| standing(mode, &[])), [Note, Good, Good]);
    }

    #[test]
    fn locked_memory_counts_where_it_is_asked_for() {
        let settings = |enabled| RealtimeSettings { enabled, ..RealtimeSettings::default() };
        assert_eq!(memory(&settings(RealtimeMode::On), Some(8 << 20)).standing, Note);
        assert_eq!(memory(&settings(RealtimeMode::Off), Some(8 << 20)).standing, Good);
        assert_eq!(memory(&settings(RealtimeMode::On), None).standing, Good);
        assert!(may_lock("Name:\tx\nCapEff:\t000001ffffffffff\n"));
        assert!(may_lock("CapEff:\t0000000000004000\n"));
        assert!(!may_lock("CapEff:\t0000000000002000\nCapBnd:\t000001ffffffffff\n"));
        assert!(!may_lock(""));
    }

    #[test]
    fn clocks_kernels_and_cores_are_told_by_name() {
        assert_eq!(clock("tsc").standing, Good);
        assert_eq!(clock("acpi_pm").standing, Note);
        assert_eq!(clock("").standing, Note);
        assert_eq!((processors(1).standing, processors(2).standing), (Note, Good));
        let version = "#1 SMP PREEMPT_RT Debian 6.12.1-1 (2025-01-01)";
        assert_eq!(kernel("6.12.1-rt", version).found, "Linux 6.12.1-rt, PREEMPT_RT");
        assert_eq!(kernel("6.18.0", "#2 SMP").found, "Linux 6.18.0");
        assert_eq!(frequency("performance").standing, Good);
        assert!(frequency("powersave").advice.contains("performance"));
        assert_eq!((descriptors(Some(256)).standing, descriptors(None).standing), (Lacking, Good));
    }
}
