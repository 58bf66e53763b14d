//! The answer in words.

use crate::case::Case;
use crate::decide::Decision;
use crate::diagnose::Found;
use crate::generic::Axis;
use crate::nuisance::is_partly_stated;
use crate::oscillation;
use crate::verdict::{Diagnosis, FoundEffect, Verdict};

/// One sentence for a tired engineer.
pub(crate) fn sentence(diagnosis: &Diagnosis, decision: &Decision) -> String {
    let percent = |p: f64| format!("{:.0} %", (100.0 * p).min(99.0));
    let judged = diagnosis.gap.as_ref().and_then(|gap| Some((gap.removed?.value, gap.judged)));
    let removed = judged.map_or(String::new(), |(value, judged)| {
        let them = if diagnosis.effects.len() > 1 { "them" } else { "it" };
        let (percent, runs) = (100.0 * value, judged.words());
        format!("; adding {them} removes {percent:.0} % of the explainable gap on {runs}")
    });
    match diagnosis.verdict {
        Verdict::Mistake => {
            let detail = diagnosis.mistake.as_ref().map_or("", |mistake| mistake.detail.as_str());
            format!("A mistake, not physics: {detail}.")
        }
        Verdict::None => format!(
            "No gap beyond the noise floor and what a car in good order may have ({}).",
            percent(decision.none)
        ),
        Verdict::Unknown if decision.doubt.is_some() => format!(
            "A real gap of unknown cause: what fits best does not hold up, since {} ({}).",
            decision.doubt.as_deref().unwrap_or_default(),
            percent(decision.unknown)
        ),
        Verdict::Unknown => {
            let shape = decision.shape.map_or(String::new(), |shape| {
                let entry = shape.entry.words();
                if let Axis::Oscillation { millihertz } = shape.axis {
                    let often = oscillation::words(millihertz);
                    return format!(": {entry} swings at {often}, as no listed effect does");
                }
                let on = shape.axis.words();
                format!(": {entry} depends on {on} in a way that no listed effect has")
            });
            format!("A real gap of unknown cause{shape} ({}).", percent(decision.unknown))
        }
        Verdict::Effects => {
            let names: Vec<String> = diagnosis.effects.iter().map(effect).collect();
            let probability = decision.sets.first().map_or(0.0, |set| set.probability + set.unseen);
            format!("{} ({}){removed}.", names.join(" and "), percent(probability))
        }
        Verdict::Ambiguous => {
            let names: Vec<String> = diagnosis
                .alternatives
                .iter()
                .map(|a| format!("{} ({})", a.ids.join(" and "), percent(a.probability)))
                .collect();
            format!("These runs cannot tell apart: {}{removed}.", names.join(", "))
        }
    }
}

fn effect(effect: &FoundEffect) -> String {
    let wheel = effect.wheel.map_or(String::new(), |wheel| format!(" of {wheel}"));
    let values: Vec<String> = effect
        .parameters
        .iter()
        .map(|p| {
            format!(
                "{} {:.4} ({:.4} to {:.4}){}",
                p.name,
                p.value.value,
                p.value.low,
                p.value.high,
                unit(p.unit)
            )
        })
        .collect();
    format!("{}{wheel}: {}", effect.id, values.join(", "))
}

fn unit(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}

/// Under which circumstances the gap shows.
pub(crate) fn regime(found: &Found<'_>, verdict: Verdict) -> String {
    if verdict == Verdict::None {
        return String::new();
    }
    let shape = if verdict == Verdict::Unknown {
        found.decision.shape
    } else {
        found.analysis.beside_nothing.first().copied()
    };
    let Some(shape) = shape.filter(|shape| shape.log_evidence > 3.0) else { return String::new() };
    let when = match shape.axis {
        Axis::Time => "changes with the time since the start of a run",
        Axis::Direction => "differs between forwards and reverse",
        Axis::Speed => "changes with the speed",
        Axis::Acceleration => "differs between speeding up and slowing down",
        Axis::Curvature => "changes with the curvature of the path",
        Axis::SteeringRate => "depends on which way the steering turns",
        Axis::Heading => "depends on the heading",
        Axis::Place | Axis::Spot => "depends on the place",
        Axis::Turn => "varies once a turn of the wheel",
        Axis::Oscillation { millihertz } => {
            return format!("{} swings at {}", shape.entry.words(), oscillation::words(millihertz));
        }
    };
    format!("{} {when}", shape.entry.words())
}

/// What narrows the answer.
pub(crate) fn notices(case: &Case) -> Vec<String> {
    let mut notices = Vec::new();
    let without = |have: &dyn Fn(&crate::case::Run) -> bool| {
        case.runs.iter().filter(|run| !have(run)).count()
    };
    let count = case.runs.len();
    let mut put = |missing: usize, what: &str, then: &str| {
        if missing > 0 {
            let which = if missing == count {
                "no run has".to_owned()
            } else {
                format!("{missing} of {count} runs have no")
            };
            notices.push(format!("{which} {what}: {then}"));
        }
    };
    put(
        without(&|run| run.has_commands()),
        "commands",
        "speed and steering actuation cannot be judged there",
    );
    put(
        without(&|run| !run.steering.is_empty()),
        "steering sensor",
        "steering actuation and ground are seen together only",
    );
    put(
        without(&|run| !run.gyro.is_empty()),
        "gyro",
        "sensing is judged by wheels and reference alone",
    );
    put(without(&|run| !run.reference.is_empty()), "reference", "the way over ground is not seen");
    if case.allowance.is_none() {
        notices.push("vehicle.toml states no [uncertainty]: the allowance of an ordinary car measured by tape is used".to_owned());
    }
    if is_partly_stated(case) {
        notices.push(
            "[uncertainty] states a part: the rest is as of an ordinary car measured by tape"
                .to_owned(),
        );
    }
    if count < 6 {
        let runs = if count == 1 { "one run".to_owned() } else { format!("{count} runs") };
        notices
            .push(format!("{runs}: six are asked for, fewer tell chance from cause less surely"));
    }
    notices
}
