//! Memory, descriptors and shared-memory segments over time, and whether one of them grows.

use std::collections::BTreeMap;
use std::fs;

use kerbside_messages::{Nanos, Process, seconds};
use kerbside_runtime::Instance;

/// A life's first seconds are not looked at: a process that starts grows \[s\].
const START: f64 = 30.0;
/// Nor do the next ones tell a slope, in which it does everything for the first time \[min\].
const WARM_UP: f64 = 1.5;
/// Samples are averaged over so long before the fit: neighbours are not independent \[s\].
const BLOCK: f64 = 10.0;
/// Fewer blocks tell no slope.
const BLOCKS: usize = 9;
/// More lives tell by themselves how surely.
const LIVES: usize = 4;
/// What the index of an open recording takes \[KiB a minute\]: an entry for each chunk and topic, written at its end, which
/// `recorder.file_bytes` bounds.
const INDEX: f64 = 100.0;
/// Bytes of a page.
const PAGE: f64 = 4096.0;

/// What may leak.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Resource {
    /// Resident memory of its own \[KiB\]: pages of shared memory, of fixed size, count where they are first touched.
    Memory,
    /// Open descriptors.
    Descriptors,
    /// Segments in shared memory, of the whole instance.
    Segments,
}

impl Resource {
    /// Name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Memory => "memory [KiB]",
            Self::Descriptors => "descriptors",
            Self::Segments => "segments",
        }
    }

    /// A slope below this is none, of `process` \[per minute\].
    #[must_use]
    pub fn flat(self, process: &str) -> f64 {
        match self {
            Self::Memory if process == Process::Recorder.name() => INDEX,
            Self::Memory => 1.0,
            Self::Descriptors | Self::Segments => 0.05,
        }
    }
}

/// How fast something grows \[per minute\], with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    /// Most likely.
    pub value: f64,
    /// At least.
    pub low: f64,
    /// At most.
    pub high: f64,
}

impl Slope {
    /// Whether it grows: the interval lies above zero, and the slope is worth a word.
    #[must_use]
    pub fn leaks(&self, process: &str, resource: Resource) -> bool {
        self.low > 0.0 && self.value >= resource.flat(process)
    }
}

/// A value at a time, of a life of its process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The life.
    pub pid: u32,
    /// When \[s since the soak's beginning\].
    pub at: f64,
    /// How much.
    pub value: f64,
}

/// Everything that was sampled.
#[derive(Debug)]
pub struct Resources {
    began: Nanos,
    born: BTreeMap<u32, f64>,
    samples: BTreeMap<(String, Resource), Vec<Sample>>,
}

impl Resources {
    /// Nothing yet.
    #[must_use]
    pub fn new(began: Nanos) -> Self {
        Self { began, born: BTreeMap::new(), samples: BTreeMap::new() }
    }

    /// Looks at every process, as (name, pid), and at the instance.
    pub fn look(&mut self, now: Nanos, processes: &[(String, u32)], instance: &Instance) {
        let at = seconds(now.saturating_sub(self.began));
        for (name, pid) in processes.iter().filter(|(_, pid)| *pid > 0) {
            let born = *self.born.entry(*pid).or_insert(at);
            if at - born < START {
                continue;
            }
            self.note(name, Resource::Memory, *pid, at, memory(*pid));
            self.note(name, Resource::Descriptors, *pid, at, descriptors(*pid));
        }
        if at >= START {
            self.note("instance", Resource::Segments, 0, at, segments(instance));
        }
    }

    fn note(&mut self, name: &str, resource: Resource, pid: u32, at: f64, value: Option<f64>) {
        if let Some(value) = value {
            let samples = self.samples.entry((name.to_owned(), resource)).or_default();
            samples.push(Sample { pid, at, value });
        }
    }

    /// Of each process and resource its slope; none where there was too little to tell.
    #[must_use]
    pub fn slopes(&self) -> Vec<(String, Resource, Option<Slope>)> {
        let each = |((name, resource), samples): (&(String, Resource), &Vec<Sample>)| {
            (name.clone(), *resource, slope(samples))
        };
        self.samples.iter().map(each).collect()
    }

    /// What was sampled, by process and resource.
    #[must_use]
    pub fn samples(&self) -> &BTreeMap<(String, Resource), Vec<Sample>> {
        &self.samples
    }
}

/// The common slope of the later halves of all lives, each with a level of its own (ordinary least squares on means of
/// blocks): a leak goes on where an allocator that finds its size comes to rest. Where there are several lives its interval
/// is by what differs from life to life, since memory comes in steps and the blocks of one life are no independent
/// witnesses (Liang and Zeger 1986).
#[must_use]
pub fn slope(samples: &[Sample]) -> Option<Slope> {
    let lives: Vec<Centred> = blocks(samples).iter().filter_map(|life| Centred::of(life)).collect();
    let sum = |of: fn(&Centred) -> f64| lives.iter().map(of).sum::<f64>();
    let (xx, xy, count) = (sum(|life| life.xx), sum(|life| life.xy), sum(|life| life.count));
    #[allow(clippy::cast_precision_loss)] // a few
    let (levels, least) = (lives.len() as f64, BLOCKS as f64);
    if count < least || xx <= 0.0 {
        return None;
    }
    let value = xy / xx;
    let variance = if lives.len() > LIVES {
        let apart = lives.iter().map(|life| (life.xy - value * life.xx).powi(2)).sum::<f64>();
        levels / (levels - 1.0) * apart / (xx * xx)
    } else {
        (sum(|life| life.yy) - value * xy).max(0.0) / (count - levels - 1.0).max(1.0) / xx
    };
    let spread = 1.96 * variance.sqrt();
    Some(Slope { value, low: value - spread, high: value + spread })
}

/// Sums of a life's blocks about their mean: times, times by values, values.
struct Centred {
    xx: f64,
    xy: f64,
    yy: f64,
    count: f64,
}

impl Centred {
    /// None of a single block.
    fn of(life: &[(f64, f64)]) -> Option<Self> {
        #[allow(clippy::cast_precision_loss)] // blocks of a life
        let count = life.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| life.iter().map(of).sum::<f64>() / count;
        let (x, y) = (mean(|point| point.0), mean(|point| point.1));
        let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            life.iter().map(|point| of(point.0 - x, point.1 - y)).sum()
        };
        (life.len() > 1).then(|| Self {
            xx: sum(&|x, _| x * x),
            xy: sum(&|x, y| x * y),
            yy: sum(&|_, y| y * y),
            count,
        })
    }
}

/// Means of blocks as (minute, value), by life.
fn blocks(samples: &[Sample]) -> Vec<Vec<(f64, f64)>> {
    let mut sums: BTreeMap<(u32, u64), (f64, f64, f64)> = BTreeMap::new();
    for sample in samples {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // seconds of a soak
        let block = (sample.at / BLOCK) as u64;
        let sum = sums.entry((sample.pid, block)).or_default();
        *sum = (sum.0 + sample.at / 60.0, sum.1 + sample.value, sum.2 + 1.0);
    }
    let mut lives: BTreeMap<u32, Vec<(f64, f64)>> = BTreeMap::new();
    for ((pid, _), (at, value, count)) in sums {
        lives.entry(pid).or_default().push((at / count, value / count));
    }
    let later = |mut life: Vec<(f64, f64)>| {
        let warm = life.first().map_or(0.0, |first| first.0 + WARM_UP);
        life.retain(|block| block.0 >= warm);
        life.split_off(life.len() / 2)
    };
    lives.into_values().map(later).collect()
}

fn memory(pid: u32) -> Option<f64> {
    let text = fs::read_to_string(format!("/proc/{pid}/statm")).ok()?;
    let mut pages = text.split_whitespace().skip(1).map(str::parse::<f64>);
    let (resident, shared) = (pages.next()?.ok()?, pages.next()?.ok()?);
    Some((resident - shared) * PAGE / 1024.0)
}

#[allow(clippy::cast_precision_loss)] // descriptors
fn descriptors(pid: u32) -> Option<f64> {
    Some(fs::read_dir(format!("/proc/{pid}/fd")).ok()?.count() as f64)
}

/// Segments of the instance in shared memory.
#[allow(clippy::cast_precision_loss)] // segments
fn segments(instance: &Instance) -> Option<f64> {
    Some(segments_of(instance).len() as f64)
}

/// Names of the instance's segments in shared memory.
#[must_use]
pub fn segments_of(instance: &Instance) -> Vec<String> {
    let prefix = instance.prefix();
    let names = fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    let names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.filter(|name| name.starts_with(&prefix)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(lives: u32, value: impl Fn(u32, f64) -> f64) -> Vec<Sample> {
        let of_life = |pid: u32| {
            let begin = f64::from(pid) * 200.0;
            (0..180_u32).map(move |second| (pid, begin + f64::from(second)))
        };
        (0..lives)
            .flat_map(of_life)
            .map(|(pid, at)| Sample { pid, at, value: value(pid, at) })
            .collect()
    }

    /// Something that looks like noise: at most half in either direction.
    fn wobble(at: f64) -> f64 {
        (at * 0.731).fract() - 0.5
    }

    #[test]
    fn a_leak_is_found_through_restarts_and_level_changes_are_none() {
        // Each life begins at another level; within each 3 KiB a minute are added.
        let leaking = samples(3, |pid, at| {
            5_000.0
                + 700.0 * f64::from(pid)
                + 3.0 * (at - 200.0 * f64::from(pid)) / 60.0
                + wobble(at)
        });
        let slope = slope(&leaking).unwrap();
        assert!((slope.value - 3.0).abs() < 0.3, "{slope:?}");
        assert!(slope.low < slope.value && slope.value < slope.high);
        assert!(slope.leaks("tracker", Resource::Memory));
        assert!(!slope.leaks("recorder", Resource::Memory), "less than the index takes");
    }

    #[test]
    fn what_is_flat_does_not_leak() {
        let flat = samples(3, |pid, at| 5_000.0 + 700.0 * f64::from(pid) + 20.0 * wobble(at));
        let slope = slope(&flat).unwrap();
        assert!(!slope.leaks("tracker", Resource::Memory), "{slope:?}");
        assert!(slope.low < 0.0 && slope.high > 0.0);
    }

    #[test]
    fn what_comes_to_rest_does_not_leak() {
        let settles = |life: f64| 90.0 * (1.0 - (-life / 15.0).exp());
        let samples =
            samples(2, |pid, at| 8_000.0 + settles(at - 200.0 * f64::from(pid)) + wobble(at));
        let slope = slope(&samples).unwrap();
        assert!(!slope.leaks("tracker", Resource::Memory), "{slope:?}");
    }

    #[test]
    fn a_step_in_some_lives_is_no_leak_and_what_grows_in_all_is_one() {
        let own = |pid: u32, at: f64| at - 200.0 * f64::from(pid);
        let steps = samples(8, |pid, at| {
            let late = pid < 2 && own(pid, at) > 145.0;
            3_300.0 + if late { 32.0 } else { 0.0 } + 0.1 * wobble(at)
        });
        assert!(!slope(&steps).unwrap().leaks("supervisor", Resource::Memory));
        let grows = samples(8, |pid, at| 3_300.0 + 8.0 * own(pid, at) / 60.0 + wobble(at));
        assert!(slope(&grows).unwrap().leaks("supervisor", Resource::Memory));
    }

    #[test]
    fn too_little_tells_nothing() {
        assert_eq!(slope(&samples(1, |_, at| at)[..60]), None);
        assert_eq!(slope(&[]), None);
    }

    #[test]
    fn this_very_process_has_memory_and_descriptors() {
        let pid = std::process::id();
        assert!(memory(pid).unwrap() > 100.0 && descriptors(pid).unwrap() >= 3.0);
        assert_eq!(memory(u32::MAX), None);
    }
}
