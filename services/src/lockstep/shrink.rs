//! Delta debugging of schedules (Zeller, Hildebrandt: "Simplifying and isolating failure-inducing input", 2002): the
//! shortest schedule that still fails, as far as leaving faults out and shortening them leads.

use kerbside_messages::Nanos;

use super::schedule::{Fault, Schedule};

/// Spans are not shortened below this \[ns\].
const SHORTEST: Nanos = 1_000_000;

/// Shrinks a schedule that fails; `fails` says whether another one still does.
///
/// Faults are left out one by one until none can be, then each is halved in length as long as it still fails. Both
/// repeat until neither helps.
pub fn shrink(schedule: &Schedule, mut fails: impl FnMut(&Schedule) -> bool) -> Schedule {
    let mut faults = schedule.faults().to_vec();
    loop {
        let before = faults.clone();
        leave_out(&mut faults, &mut fails);
        shorten(&mut faults, &mut fails);
        if faults == before {
            return Schedule::new(faults);
        }
    }
}

fn leave_out(faults: &mut Vec<Fault>, fails: &mut impl FnMut(&Schedule) -> bool) {
    let mut index = 0;
    while index < faults.len() {
        let mut fewer = faults.clone();
        fewer.remove(index);
        if fails(&Schedule::new(fewer.clone())) {
            *faults = fewer;
        } else {
            index += 1;
        }
    }
}

fn shorten(faults: &mut [Fault], fails: &mut impl FnMut(&Schedule) -> bool) {
    for index in 0..faults.len() {
        while let Some(kind) = halved(&faults[index]) {
            let mut shorter = faults.to_vec();
            shorter[index].kind = kind;
            if !fails(&Schedule::new(shorter.clone())) {
                break;
            }
            faults.clone_from_slice(&shorter);
        }
    }
}

fn halved(fault: &Fault) -> Option<super::schedule::Kind> {
    let half = fault.kind.span() / 2 / SHORTEST * SHORTEST;
    if half < SHORTEST { None } else { fault.kind.lasting(half) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lockstep::Kind;
    use kerbside_messages::Process;

    const MS: Nanos = 1_000_000;

    #[test]
    fn what_does_not_matter_is_left_out_and_what_does_is_shortened() {
        let stall = |at: Nanos, process, span: Nanos| Fault {
            at: at * MS,
            kind: Kind::Stall { process, span: span * MS },
        };
        let kill = |at: Nanos, process| Fault { at: at * MS, kind: Kind::Kill(process) };
        let schedule = Schedule::new(vec![
            kill(1, Process::Recorder),
            stall(5, Process::Tracker, 1000),
            kill(6, Process::Planner),
            kill(7, Process::Ingest),
        ]);
        // It takes a stall of the tracker of more than 100 ms, and ingest's death.
        let mut runs = 0;
        let shrunk = shrink(&schedule, |schedule| {
            runs += 1;
            let has = |wanted: &dyn Fn(&Kind) -> bool| {
                schedule.faults().iter().any(|fault| wanted(&fault.kind))
            };
            has(
                &|kind| matches!(kind, Kind::Stall { process: Process::Tracker, span } if *span > 100 * MS),
            ) && has(&|kind| *kind == Kind::Kill(Process::Ingest))
        });
        assert_eq!(shrunk.faults(), [stall(5, Process::Tracker, 125), kill(7, Process::Ingest)]);
        assert!(runs < 30, "{runs}");
    }

    #[test]
    fn a_failure_without_faults_leaves_none() {
        let schedule = Schedule::kills(&[(MS, Process::Tracker), (2 * MS, Process::Ingest)]);
        assert_eq!(shrink(&schedule, |_| true).faults(), []);
    }
}
