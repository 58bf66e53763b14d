//! What to drive next: the manoeuvre, what it separates, and its commands.

use kerbside_diagnosis::Next;

use super::data::{DiagnoseReport, plain};
use crate::format;
use crate::page::{Block, Section};
use crate::svg::{Chart, Figure, Ink, Line, Trace};

impl DiagnoseReport {
    pub(super) fn next_section(&self) -> Section {
        let title = "What to drive next";
        let Some(next) = &self.diagnosis.next else {
            let words = "Nothing is left that another manoeuvre would separate.";
            return Section::new("next", title, vec![Block::Text(words.to_owned())]);
        };
        let set = |ids: &Vec<&'static str>| {
            ids.iter().map(|id| plain(id)).collect::<Vec<_>>().join(" + ")
        };
        let sets: Vec<String> = next.separates.iter().map(set).collect();
        let duration = next.commands.last().map_or(f64::NAN, |command| command.0);
        let fact = |name: &str, value: String| (name.to_owned(), value);
        let facts = [
            fact("Manoeuvre", next.manoeuvre.clone()),
            fact("Separates", sets.join(" from ")),
            fact(
                "Difference",
                format!("{} standard deviations of the noise", format::fixed(next.sigma, 1)),
            ),
            fact("Duration", format::with_unit(&format::fixed(duration, 1), "s")),
            fact("Commands", self.next_file.clone()),
        ];
        let facts = facts.into_iter().filter(|fact| !fact.1.is_empty()).collect();
        let charts = [
            chart(next, "next-speed", "Speed", "speed [m/s]", |command| command.1),
            chart(next, "next-steering", "Steering", "steering [rad]", |command| command.2),
        ];
        let blocks = vec![Block::Facts(facts), Block::Beside(charts.map(Block::Figure).into())];
        Section::new("next", title, blocks).with_lead(
            "The cheapest manoeuvre that tells the remaining causes apart, each refitted.",
        )
    }
}

fn chart(
    next: &Next,
    id: &str,
    title: &str,
    y_title: &str,
    pick: fn(&(f64, f64, f64)) -> f64,
) -> Figure {
    let trace = Trace {
        label: String::new(),
        line: Line::new(Ink::Blue),
        points: held(next.commands.iter().map(|command| [command.0, pick(command)])),
    };
    Chart {
        id: id.to_owned(),
        title: format!("{title} commanded"),
        description: format!("{title} commanded over time."),
        x_title: "time [s]".to_owned(),
        y_title: y_title.to_owned(),
        y_least: 0.02,
        traces: vec![trace],
        limits: vec![0.0],
        ..Chart::default()
    }
    .figure()
}

/// Each value holds until the next: steps.
fn held(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut steps: Vec<[f64; 2]> = Vec::new();
    for [t, value] in points {
        if let Some([_, before]) = steps.last().copied() {
            steps.push([t, before]);
        }
        steps.push([t, value]);
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_holds_until_the_next() {
        let steps = held([[0.0, 1.0], [2.0, 3.0]].into_iter());
        assert_eq!(steps, [[0.0, 1.0], [2.0, 1.0], [2.0, 3.0]]);
    }
}
