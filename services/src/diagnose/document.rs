//! diagnosis.json, diagnosis.overlay.toml and next.csv: what others read.

use std::fmt::Write as _;

use kerbside_diagnosis::{Alternative, Diagnosis, FoundEffect, Interval, LinkGap, Next, Verdict};
use serde_json::{Map, Value, json};

/// Names of the files of a diagnosis.
pub const DIAGNOSIS: &str = "diagnosis.json";
/// Effects, ready for the simulator.
pub const OVERLAY: &str = "diagnosis.overlay.toml";
/// The vehicle's file with what it can absorb.
pub const VEHICLE: &str = "diagnosis.vehicle.toml";
/// Commands of the next manoeuvre.
pub const NEXT: &str = "next.csv";
/// For people.
pub const REPORT: &str = "report.html";

/// What [`of`] makes a document from, besides the diagnosis.
#[derive(Clone, Copy, Debug)]
pub struct Facts<'a> {
    /// What else is to be known of the input.
    pub notices: &'a [String],
    /// The overlay that was given by hand, as it was named.
    pub model: Option<&'a str>,
    /// How long it took \[s\].
    pub seconds: f64,
}

/// The document. What is not a number is null.
pub fn of(found: &Diagnosis, facts: &Facts<'_>) -> Value {
    let pair = |rival: &kerbside_diagnosis::Rival| json!([rival.name, rival.probability]);
    let gain = |rival: &kerbside_diagnosis::Rival| json!({ "name": rival.name, "probability": rival.probability, "gain": rival.gain, "left_out": rival.left_out });
    let smallest: Map<String, Value> =
        found.smallest_seen.iter().map(|(id, size)| ((*id).to_owned(), json!(size))).collect();
    let notices: Vec<&String> = found.notices.iter().chain(facts.notices).collect();
    json!({
        "schema": "kerbside.diagnose.v1",
        "version": env!("CARGO_PKG_VERSION"),
        "seed": null,
        "passed": true,
        "figures": [],
        "case": found.case,
        "verdict": found.verdict.name(),
        "sentence": found.sentence,
        "where": place(found),
        "moved": found.moved.iter().map(|link| link.name()).collect::<Vec<_>>(),
        "effects": found.effects.iter().map(effect).collect::<Vec<_>>(),
        "alternatives": found.alternatives.iter().map(alternative).collect::<Vec<_>>(),
        "ranking": found.ranking.iter().map(pair).collect::<Vec<_>>(),
        "unseen": found.unseen,
        "rivals": found.ranking.iter().map(gain).collect::<Vec<_>>(),
        "mistake": found.mistake.as_ref().map(|mistake| json!({ "kind": mistake.kind, "detail": mistake.detail })),
        "links": found.links.iter().map(link).collect::<Vec<_>>(),
        "gap": gap(found),
        "regime": found.regime,
        "not_excited": found.not_excited,
        "smallest_seen": smallest,
        "next": found.next.as_ref().map(next),
        "overlay": (!found.effects.is_empty()).then_some(OVERLAY),
        "report": REPORT,
        "notices": notices,
        "model": facts.model,
        "duration_s": found.duration,
        "seconds": facts.seconds,
    })
}

/// A link, a list of links where there are several, null where there is none.
fn place(found: &Diagnosis) -> Value {
    match &found.links_named[..] {
        [] => Value::Null,
        [one] => json!(one.name()),
        several => several.iter().map(|link| link.name()).collect(),
    }
}

fn effect(effect: &FoundEffect) -> Value {
    let parameters = effect.parameters.iter();
    let mut parameters: Map<String, Value> = parameters
        .map(|parameter| {
            let Interval { value, low, high } = closed(&parameter.value);
            let entry = json!({ "value": value, "low": low, "high": high, "unit": parameter.unit });
            (parameter.name.to_owned(), entry)
        })
        .collect();
    if let Some(wheel) = effect.wheel {
        parameters.insert("wheel".to_owned(), json!({ "value": wheel }));
    }
    json!({
        "id": effect.id, "link": effect.link.name(), "probability": effect.probability, "parameters": parameters,
    })
}

/// An interval that JSON can hold: an open end is the largest number there is.
fn closed(interval: &Interval) -> Interval {
    let end = |value: f64| if value.is_infinite() { f64::MAX.copysign(value) } else { value };
    Interval { value: end(interval.value), low: end(interval.low), high: end(interval.high) }
}

fn alternative(set: &Alternative) -> Value {
    json!({ "ids": set.ids, "probability": set.probability })
}

fn link(link: &LinkGap) -> Value {
    json!({
        "name": link.link.name(), "unit": link.unit, "signal": link.signal, "measured": link.measured, "gap": link.gap,
        "floor": link.floor, "allowance": link.allowance, "excess": link.excess, "low": link.low, "high": link.high,
    })
}

fn gap(found: &Diagnosis) -> Value {
    let Some(gap) = &found.gap else { return Value::Null };
    let removed = gap.removed.as_ref();
    let [before, after, floor] = gap.yaw;
    json!({
        "before": gap.before, "after": gap.after, "floor": gap.floor,
        "explainable_removed": removed.map(|removed| removed.value),
        "low": removed.map(|removed| removed.low), "high": removed.map(|removed| removed.high),
        "judged_on": gap.judged.words(),
        "yaw": { "before": before, "after": after, "floor": floor }, "steps": gap.steps,
    })
}

fn next(next: &Next) -> Value {
    let file = (!next.commands.is_empty()).then_some(NEXT);
    json!({
        "manoeuvre": next.manoeuvre, "file": file, "separates": next.separates, "sigma": next.sigma,
    })
}

/// What is wrong with a diagnosis: what nobody could read, or what contradicts itself.
///
/// # Errors
/// A sentence for each.
pub fn check(found: &Diagnosis) -> Result<(), String> {
    let mut wrong: Vec<String> = found.effects.iter().flat_map(wrong_with_effect).collect();
    let is_probability = |value: f64| (0.0..=1.0).contains(&value);
    let sets = &found.alternatives;
    if sets.iter().any(|set| set.ids.is_empty() || !is_probability(set.probability)) {
        wrong.push("an alternative without effects or probability".to_owned());
    }
    if sets.iter().map(|set| set.probability).sum::<f64>() > 1.001 {
        wrong.push("the probabilities of the alternatives exceed 1".to_owned());
    }
    let contradiction = match found.verdict {
        Verdict::Effects => found.effects.is_empty(),
        Verdict::Ambiguous => sets.len() < 2,
        Verdict::None | Verdict::Unknown => !found.effects.is_empty(),
        Verdict::Mistake => found.mistake.is_none(),
    };
    if contradiction {
        wrong.push(format!("the verdict {} contradicts what was found", found.verdict.name()));
    }
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("; ")) }
}

fn wrong_with_effect(effect: &FoundEffect) -> Vec<String> {
    let ordered =
        |interval: &Interval| interval.low <= interval.value && interval.value <= interval.high;
    let parameters = effect.parameters.iter().filter(|parameter| !ordered(&parameter.value));
    let mut wrong: Vec<String> = parameters
        .map(|parameter| format!("{}.{} lies outside its interval", effect.id, parameter.name))
        .collect();
    if !(0.0..=1.0).contains(&effect.probability) {
        wrong.push(format!("{} has no probability", effect.id));
    }
    wrong
}

/// The effects as an overlay, with a comment that says where they come from.
pub fn overlay(found: &Diagnosis) -> String {
    let mut text = format!(
        "# Found by kerbside {} in the case {}: {}.\n# Intervals hold the truth nine times in ten.\n",
        env!("CARGO_PKG_VERSION"),
        one_line(&found.case),
        verdict_in_words(found)
    );
    for effect in &found.effects {
        // Writing into a String cannot fail.
        let _ = write!(text, "\n[[effect]]\nid = \"{}\"", effect.id);
        let _ = writeln!(text, "   # probability {:.2}", effect.probability);
        if let Some(wheel) = effect.wheel {
            let _ = writeln!(text, "wheel = \"{wheel}\"");
        }
        for parameter in &effect.parameters {
            let Interval { value, low, high } = parameter.value;
            // Debug keeps the point of a whole number, as a float in TOML needs.
            let _ = write!(text, "{} = {value:?}", parameter.name);
            let unit = if parameter.unit.is_empty() {
                String::new()
            } else {
                format!(" {}", parameter.unit)
            };
            let _ = writeln!(text, "   # {low:.6} to {high:.6}{unit}");
        }
    }
    text
}

fn verdict_in_words(found: &Diagnosis) -> String {
    match found.verdict {
        Verdict::Ambiguous => {
            let sets: Vec<String> =
                found.alternatives.iter().map(|set| set.ids.join(" + ")).collect();
            format!("the likeliest of {}", sets.join(", "))
        }
        verdict => format!("verdict {}", verdict.name()),
    }
}

/// A comment ends where its line does.
pub fn one_line(text: &str) -> String {
    text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}

/// The commands of the next manoeuvre, as a run's commands.csv.
pub fn commands(next: &Next) -> String {
    let mut text = "t,speed,steering\n".to_owned();
    for (t, speed, steering) in &next.commands {
        let _ = writeln!(text, "{t},{speed},{steering}");
    }
    text
}
