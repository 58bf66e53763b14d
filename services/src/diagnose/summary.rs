//! What `diagnose` says at the end: a page of a terminal, or one JSON object.

use std::path::Path;

use kerbside_diagnosis::{Diagnosis, FoundEffect, LinkGap, Shrinkage, Verdict};
use kerbside_reports::format;
use serde_json::{Value, json};

use super::document::{NEXT, OVERLAY, REPORT, VEHICLE};
use super::{DiagnoseArgs, Diagnosed};

/// Columns of a terminal that everything but paths keeps to.
const WIDTH: usize = 80;
/// Columns of the names at the left.
const NAME: usize = 11;
/// Rivals told.
const RIVALS: usize = 5;

/// Tells what was found; `document` is diagnosis.json.
pub fn tell(args: &DiagnoseArgs, diagnosed: &Diagnosed, mut document: Value, folder: &Path) {
    if args.json {
        document["out"] = json!(folder);
        println!("{document}");
        return;
    }
    print!("{}", page(diagnosed));
    let found = &diagnosed.found;
    let file = |name: &str, file: &str| println!("{name:NAME$}{}", folder.join(file).display());
    if !found.effects.is_empty() {
        file("overlay", OVERLAY);
    }
    if !diagnosed.absorbed().lines.is_empty() {
        file("vehicle", VEHICLE);
    }
    if found.next.as_ref().is_some_and(|next| !next.commands.is_empty()) {
        file("commands", NEXT);
    }
    file("report", REPORT);
    if let Some(case) = &args.case {
        println!("{:NAME$}{}", "repeat", args.command_line(case));
    }
}

/// All but the paths.
fn page(diagnosed: &Diagnosed) -> String {
    let found = &diagnosed.found;
    let mut lines = wrapped(&format!("{}: {}", found.case, found.sentence), WIDTH);
    lines.extend(chain(&found.links));
    let mut say = |name: &str, words: &str| lines.extend(named(name, words));
    say("where", &place(found));
    if !found.moved.is_empty() {
        let links: Vec<&str> = found.moved.iter().map(|link| link.name()).collect();
        say("moved", &format!("{}, before any effect is fitted", links.join(" and ")));
    }
    for (index, rival) in found.ranking.iter().take(RIVALS).enumerate() {
        let name = if index == 0 { "which" } else { "" };
        say(name, &format!("{:6}  {}", format::probability(rival.probability), rival.name));
    }
    if found.unseen > 0.0 {
        let words = "another effect beside it, too small for these runs";
        say("", &format!("{:6}  {words}", format::probability(found.unseen)));
    }
    for effect in &found.effects {
        say("size", &sizes(effect));
    }
    if let Some(mistake) = &found.mistake {
        say("mistake", &format!("{}: {}", mistake.kind, mistake.detail));
    }
    if let Some(gap) = &found.gap {
        say("how far", &how_far(gap, found.verdict));
    }
    if !found.not_excited.is_empty() {
        say("not shown", &format!("by these runs: {}", found.not_excited.join(", ")));
    }
    if let Some(next) = &found.next {
        let sets: Vec<String> = next.separates.iter().map(|set| set.join(" + ")).collect();
        let sigma = format!("{:.1} standard deviations", next.sigma);
        say("next", &format!("{}: separates {} by {sigma}", next.manoeuvre, sets.join(" from ")));
    }
    if let Some(words) = diagnosed.absorbed().in_words(VEHICLE) {
        say("way back", &words);
    }
    let notices = found.notices.iter().chain(&diagnosed.input.notices);
    notices.for_each(|notice| say("note", notice));
    let text: String = lines.iter().map(|line| format!("{line}\n")).collect();
    // What a page sets finely, a terminal sets as anyone would type it.
    text.replace('\u{202f}', " ").replace('\u{2212}', "-")
}

fn place(found: &Diagnosis) -> String {
    let links: Vec<&str> = found.links_named.iter().map(|link| link.name()).collect();
    match (links.is_empty(), found.regime.is_empty()) {
        (true, _) => "no link is beyond noise and what a car in good order may have".to_owned(),
        (false, true) => links.join(", "),
        (false, false) => format!("{}; {}", links.join(", "), found.regime),
    }
}

fn sizes(effect: &FoundEffect) -> String {
    let wheel = effect.wheel.map(|wheel| format!(" {wheel}")).unwrap_or_default();
    let parameters = effect.parameters.iter().map(|parameter| {
        let value = parameter.value;
        let value = format::interval([value.value, value.low, value.high]);
        format!("{} {}", parameter.name, format::with_unit(&value, parameter.unit))
    });
    let parameters: Vec<String> = parameters.collect();
    format!("{}{wheel}: {}", effect.id, parameters.join(", "))
}

fn how_far(gap: &Shrinkage, verdict: Verdict) -> String {
    let metres = |value: f64| format!("{} m", format::significant(value, 2));
    let (before, after, floor) = (metres(gap.before), metres(gap.after), metres(gap.floor));
    let steps = match verdict {
        Verdict::None | Verdict::Unknown | Verdict::Mistake => format!("{before} of position"),
        Verdict::Effects | Verdict::Ambiguous => format!("{before} of position to {after}"),
    };
    let removed = match &gap.removed {
        Some(removed) => {
            let [value, low, high] = [removed.value, removed.low, removed.high].map(|v| 100.0 * v);
            let between = if low.is_finite() {
                format!("({low:.0} to {high:.0} %)")
            } else {
                format!("(on {})", gap.judged.words())
            };
            format!("; {value:.0} % {between} of what can be explained")
        }
        None => String::new(),
    };
    format!("{steps}, {floor} by noise alone{removed}")
}

/// The links, a line each under a header.
fn chain(links: &[LinkGap]) -> Vec<String> {
    let line = |name: &str, unit: &str, figures: [&str; 4], interval: &str| {
        let [gap, floor, allowance, excess] = figures;
        let left = format!("{name:19}{unit:6}{gap:>9}{floor:>9}{allowance:>11}{excess:>8}");
        format!("{left}  {interval:>16}").trim_end().to_owned()
    };
    let show = |value: f64| match value {
        0.0 => "0".to_owned(),
        value => format::significant(value, 2),
    };
    let row = |link: &LinkGap| {
        if !link.measured {
            return line(link.link.name(), "", [""; 4], "not measured");
        }
        let figures = [link.gap, link.floor, link.allowance, link.excess].map(show);
        let interval = format!("{} to {}", show(link.low), show(link.high));
        let figures = figures.each_ref().map(String::as_str);
        line(link.link.name(), link.unit, figures, &interval)
    };
    let header = line("link", "", ["gap", "floor", "allowance", "excess"], "90 % interval");
    let rule = "─".repeat(WIDTH);
    let rows = links.iter().map(row);
    let all = [rule.clone(), header].into_iter().chain(rows).chain([rule]);
    if links.is_empty() { Vec::new() } else { all.collect() }
}

/// A name, and words beside it over as many lines as they need.
fn named(name: &str, words: &str) -> Vec<String> {
    let lines = wrapped(words, WIDTH - NAME);
    let named = |(index, line): (usize, &String)| {
        let name = if index == 0 { name } else { "" };
        format!("{name:NAME$}{line}")
    };
    lines.iter().enumerate().map(named).collect()
}

/// Words in lines of at most `width` columns; a word that is longer has a line of its own.
fn wrapped(words: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in words.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::made_up;

    #[test]
    fn a_summary_fits_a_terminal_and_says_it_all() {
        for found in made_up::of_every_verdict() {
            let verdict = found.verdict;
            let text = page(&made_up::diagnosed(found));
            for line in text.lines() {
                assert!(line.chars().count() <= WIDTH, "{line:?} of\n{text}");
            }
            for words in ["car07: ", "where      ", "speed_actuation", "90 % interval"] {
                assert!(text.contains(words), "{words:?} of {verdict:?} is missing in\n{text}");
            }
        }
    }

    #[test]
    fn the_answer_is_told_with_its_interval_and_its_reach() {
        let text = page(&made_up::diagnosed(made_up::two_effects()));
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        for words in [
            "which 0.96 count_loss + speed_gain",
            "size count_loss rl: fraction 0.0820 (0.0780 to 0.0860)",
            "96 % (93 to 99 %)",
            "0.20 m of position to 0.013 m, 0.0061 m by noise alone",
        ] {
            assert!(text.contains(words), "{words:?} is missing in\n{text}");
        }
        let text = page(&made_up::diagnosed(made_up::ambiguous()));
        assert!(text.contains("next       circle"), "{text}");
    }

    #[test]
    fn words_are_wrapped_between_them() {
        assert_eq!(wrapped("one two three", 7), ["one two", "three"]);
        assert_eq!(wrapped("a-long-word b", 5), ["a-long-word", "b"]);
    }
}
