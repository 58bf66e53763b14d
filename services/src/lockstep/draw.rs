//! Random schedules of faults: the same seed, the same schedule.

use kerbside_messages::{Nanos, Process};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::mishap::Mishap;
use super::schedule::{Fault, Kind, LineMishap, Schedule, Way, Wire};

const MS: Nanos = 1_000_000;
/// Faults begin within so long of a manoeuvre's beginning \[ns\].
const WITHIN: Nanos = 45_000 * MS;
/// Where a fault lasts, it does from so long ... \[ms\]
const SHORTEST: f64 = 10.0;
/// ... to so long \[ms\], each order of magnitude as likely.
const LONGEST: f64 = 3_000.0;
/// Two faults at once lie no farther apart than this \[ns\].
const AT_ONCE: Nanos = 400 * MS;

/// The processes that faults strike: those of a stack without a gateway, whose deaths are its own tests' matter.
pub const VICTIMS: [Process; 7] = [
    Process::Interface,
    Process::Ingest,
    Process::Estimator,
    Process::Planner,
    Process::Tracker,
    Process::Actuation,
    Process::Recorder,
];

/// The schedule of `seed`.
#[must_use]
pub fn draw(seed: u64) -> Schedule {
    // A stream of its own, independent of the vehicle's noise and of the start.
    let mut random = Pcg64::seed_from_u64(seed ^ 0xfa01_75ca_1e00_0000);
    let mut faults = Vec::new();
    let instants = 1 + random.random_range(0..4_u32);
    for _ in 0..instants {
        let at = random.random_range(0..WITHIN / MS) * MS;
        faults.push(Fault { at, kind: kind(&mut random) });
        // Every fourth time a second one comes before the first is over.
        if random.random_range(0..4) == 0 {
            let later = random.random_range(0..=AT_ONCE / MS) * MS;
            faults.push(Fault { at: at + later, kind: kind(&mut random) });
        }
    }
    Schedule::new(faults)
}

fn kind(random: &mut impl Rng) -> Kind {
    match random.random_range(0..100) {
        0..24 => Kind::Kill(victim(random)),
        24..40 => Kind::Stall { process: victim(random), span: span(random) },
        40..70 => samples(random),
        70..83 => line(random),
        83 => Kind::Kill(Process::Supervisor),
        84..88 => Kind::Stall { process: Process::Supervisor, span: span(random) },
        88..91 => Kind::Stall { process: Process::Vehicle, span: span(random) },
        91 => Kind::Reboot,
        92..94 => Kind::CounterReset,
        94..97 => Kind::ClockStep(clock_step(random)),
        _ => Kind::Inhibit(span(random)),
    }
}

fn victim(random: &mut impl Rng) -> Process {
    VICTIMS[random.random_range(0..VICTIMS.len())]
}

/// Each order of magnitude is as likely.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 10 to 3000
fn span(random: &mut impl Rng) -> Nanos {
    use kerbside_geometry::math;
    let exponent = random.random::<f64>() * math::ln(LONGEST / SHORTEST);
    (SHORTEST * math::exp(exponent)) as Nanos * MS
}

fn samples(random: &mut impl Rng) -> Kind {
    let wire = match random.random_range(0..8) {
        index @ 0..6 => Wire::PATH[index],
        _ => Wire::Heartbeat(victim(random)),
    };
    let readers = wire.readers();
    // Half of the time everybody is concerned, else one reader alone.
    let reader = random.random_bool(0.5).then(|| readers[random.random_range(0..readers.len())]);
    Kind::Samples { wire, reader, mishap: mishap(random, wire), span: span(random) }
}

fn mishap(random: &mut impl Rng, wire: Wire) -> Mishap {
    let number = random.random::<u32>();
    match random.random_range(0..8) {
        0 => Mishap::Lost,
        1 => Mishap::Late(random.random_range(1..=400) * MS),
        2 => Mishap::Repeated,
        3 => Mishap::Swapped,
        4 => Mishap::OldEpoch,
        5 => Mishap::NotFinite(number),
        6 => Mishap::OutOfRange(number),
        // Heartbeats carry no check sum: a bit of theirs cannot be told from another one.
        _ if matches!(wire, Wire::Heartbeat(_)) => Mishap::Lost,
        _ => Mishap::Flipped(number),
    }
}

fn line(random: &mut impl Rng) -> Kind {
    let way = if random.random_bool(0.5) { Way::ToHost } else { Way::ToVehicle };
    let mishap = match random.random_range(0..3) {
        0 => LineMishap::Silence,
        1 => LineMishap::Hurt(random.random()),
        _ => {
            let length = random.random_range(1..=300);
            LineMishap::Garbage((0..length).map(|_| random.random()).collect())
        }
    };
    let span = if matches!(mishap, LineMishap::Garbage(_)) { MS } else { span(random) };
    Kind::Line { way, mishap, span }
}

/// Up to ten seconds in either direction, never none.
fn clock_step(random: &mut impl Rng) -> i64 {
    let size = random.random_range(1..=10_000_i64) * 1_000_000;
    if random.random_bool(0.5) { size } else { -size }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn a_seed_gives_its_schedule_and_seeds_differ() {
        assert_eq!(draw(7), draw(7));
        assert_ne!(draw(7), draw(8));
    }

    #[test]
    fn every_kind_of_fault_comes_up_alone_and_at_once_with_another() {
        let schedules: Vec<_> = (0..3_000).map(draw).collect();
        let faults: Vec<_> = schedules.iter().flat_map(|schedule| schedule.faults()).collect();
        let kinds: BTreeSet<_> = faults.iter().map(|fault| fault.kind.name()).collect();
        assert_eq!(kinds.len(), 17, "{kinds:?}");
        let killed: BTreeSet<_> = faults
            .iter()
            .filter_map(|fault| match fault.kind {
                Kind::Kill(process) => Some(process),
                _ => None,
            })
            .collect();
        assert_eq!(killed.len(), VICTIMS.len() + 1, "and the supervisor");
        let at_once = |schedule: &&Schedule| {
            schedule.faults().windows(2).any(|pair| pair[1].at - pair[0].at <= AT_ONCE)
        };
        assert!(schedules.iter().filter(at_once).count() > 500);
        assert!(schedules.iter().filter(|schedule| schedule.faults().len() == 1).count() > 300);
    }
}
