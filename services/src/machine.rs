//! What is known of the machine, for reports.

use std::fs;

/// Facts as (name, value); what cannot be read is left out.
#[must_use]
pub fn facts() -> Vec<(String, String)> {
    let cores = std::thread::available_parallelism().ok().map(|cores| cores.to_string());
    let kernel = fs::read_to_string("/proc/sys/kernel/osrelease").ok();
    let processor = fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| model_name(&text));
    [("Cores", cores), ("Processor", processor), ("Kernel", kernel)]
        .into_iter()
        .filter_map(|(name, value)| Some((name.to_owned(), value?.trim().to_owned())))
        .collect()
}

fn model_name(cpuinfo: &str) -> Option<String> {
    let line = cpuinfo.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
