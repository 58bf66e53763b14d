//! One case's answer held against its label. The rules are those by which anybody would score the files.

use core::f64::consts::{PI, TAU};
use std::collections::BTreeSet;

use kerbside_geometry::math;

use super::answer::Answer;
use super::label::{Label, Truth};

/// Largest set of alternatives that counts as an answer.
const LARGEST: usize = 3;

/// How one case came out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// The case.
    pub case: String,
    /// What was put in.
    pub label: Label,
    /// The verdict; none where there is no valid diagnosis.
    pub verdict: Option<String>,
    /// Effects that were named.
    pub named: Vec<String>,
    /// Exactly right: what was put in is named; where the runs cannot tell it from others, all of them.
    pub exact: bool,
    /// What is named is what was put in.
    pub right: bool,
    /// Exactly right, or among at most three alternatives.
    pub set: bool,
    /// Right links.
    pub link: bool,
    /// Every right link is among those that moved before any effect was fitted; of a case without effects, none moved.
    pub moved: bool,
    /// Errors of parameters, relative, beyond the spread of what was put in; of effects that were named rightly.
    pub errors: Vec<(String, f64)>,
    /// Whether each is within its interval, widened by that spread.
    pub covered: Vec<bool>,
    /// Probability that the answer gives itself.
    pub stated: Option<f64>,
    /// Probability that it gives to the truth.
    pub on_truth: f64,
    /// Whether the 90 % set holds the truth.
    pub in_set: bool,
    /// Size of that set.
    pub set_size: usize,
    /// Share of the explainable gap that is removed on runs that nobody saw; none where there is nothing to explain.
    pub removed: Option<f64>,
    /// What each rival of the diagnosis answers: see `rivals`.
    pub rivals: Vec<bool>,
    /// How long the diagnosis took \[s\].
    pub seconds: Option<f64>,
}

/// Judges the answer to a case; one that is missing or invalid is wrong.
#[must_use]
pub fn judge(case: &str, label: &Label, answer: Option<&Answer>) -> Row {
    let mut row = Row { case: case.to_owned(), label: label.clone(), ..Row::default() };
    let Some(answer) = answer else { return row };
    let truth: Vec<String> = label.ids().into_iter().map(str::to_owned).collect();
    row.verdict = Some(answer.verdict.clone());
    row.named = answer.ids();
    row.link = links(label, &answer.links) == links(label, &label.links);
    let (right, moved) = (links(label, &label.links), links(label, &answer.moved));
    row.moved = if right.is_empty() { moved.is_empty() } else { right.is_subset(&moved) };
    row.stated = answer.stated();
    match label.kind.as_str() {
        "null" => row.exact = answer.verdict == "none",
        "unknown" => row.exact = answer.verdict == "unknown",
        _ => {
            let sets = &answer.alternatives;
            let holds = sets.iter().any(|set| set.0 == truth);
            row.right = answer.verdict == "effects" && row.named == truth;
            let few = answer.verdict == "ambiguous" && sets.len() <= LARGEST && holds;
            let named = |twin: &Vec<String>| sets.iter().any(|set| set.0 == *twin);
            row.exact = match label.twins.as_slice() {
                [] => row.right,
                twins => few && twins.iter().take(LARGEST - 1).all(named),
            };
            row.set = row.exact || row.right || few;
            row.in_set = holds || sets.is_empty() && row.right;
            row.set_size = sets.len().max(usize::from(!row.named.is_empty()));
            row.on_truth = answer.probability_of(&label.ids());
            for effect in &label.effects {
                compare(effect, answer, &mut row);
            }
        }
    }
    row.set |= row.exact;
    row
}

/// Without a steering sensor steering actuation and ground count as one.
fn links(label: &Label, links: &[String]) -> BTreeSet<String> {
    let merged = |link: &String| match link.as_str() {
        "steering_actuation" | "ground" if !label.has_steering_sensor() => "steering".to_owned(),
        other => other.to_owned(),
    };
    links.iter().map(merged).collect()
}

fn compare(truth: &Truth, answer: &Answer, row: &mut Row) {
    let Some(found) = answer.effects.iter().find(|found| found.id == truth.id) else { return };
    if let Some(wheel) = &truth.wheel {
        let wrong = found.wheel.as_ref() != Some(wheel);
        row.errors.push((format!("{}.wheel", truth.id), f64::from(u8::from(wrong))));
    }
    for (name, value) in &truth.values {
        let Some([at, low, high]) = found.parameters.get(name) else { continue };
        let spread = truth.spread.get(name).copied().unwrap_or_default();
        let scale = scale(truth, name, *value);
        let off = if name == "direction" {
            ((at - value + PI).rem_euclid(TAU) - PI).abs()
        } else {
            ((at - value).abs() - spread).max(0.0)
        };
        row.errors.push((format!("{}.{name}", truth.id), off / scale));
        let turns = if name == "direction" { TAU * ((at - value) / TAU).round() } else { 0.0 };
        row.covered.push((low - spread..=high + spread).contains(&(value + turns)));
    }
}

/// What an error of a parameter is relative to: the truth's distance from neutral, with the exceptions of the rules.
fn scale(truth: &Truth, name: &str, value: f64) -> f64 {
    let of = |name: &str| truth.values.get(name).copied().unwrap_or_default();
    let neutral = |name: &str| {
        f64::from(u8::from(matches!(name, "gain" | "scale") || truth.id == "track_scale"))
    };
    let scale = match (truth.id.as_str(), name) {
        (_, "direction") => 1.0,
        (_, "limit") => value.abs(),
        ("floor_patch", "x" | "y") => of("radius"),
        ("radius_difference" | "track_scale", _) => {
            let away = ["front", "rear"].map(|name| (of(name) - neutral(name)).abs());
            away[0].max(away[1])
        }
        ("reference_marker", "x" | "y") => math::hypot(of("x"), of("y")),
        _ => (value - neutral(name)).abs(),
    };
    if scale > 0.0 { scale } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(words: &[&str]) -> Vec<String> {
        words.iter().map(|word| (*word).to_owned()).collect()
    }

    #[test]
    fn links_moved_where_they_hold_the_right_one_and_in_good_order_where_there_is_none() {
        let moved = |kind: &str, right: &[&str], said: &[&str]| {
            let label = Label {
                kind: kind.to_owned(),
                links: named(right),
                sensors: "cws".to_owned(),
                ..Label::default()
            };
            let answer = Answer { moved: named(said), ..Answer::default() };
            judge("case", &label, Some(&answer)).moved
        };
        assert!(moved("single", &["ground"], &["sensing", "ground"]));
        assert!(!moved("single", &["ground"], &["sensing", "steering_actuation"]));
        assert!(!moved("single", &["ground"], &[]));
        assert!(moved("null", &[], &[]) && !moved("null", &[], &["sensing"]));
    }
}
