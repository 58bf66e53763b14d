//! The page of a soak's report.

use std::collections::BTreeMap;

use super::data::{SoakFault, SoakReport};
use crate::ReportError;
use crate::format::{self, UNKNOWN};
use crate::page::{Block, KeyFigure, Page, Row, Section, Table, Verdict};
use crate::svg::Tone;

impl SoakReport {
    /// The report as one HTML file.
    ///
    /// # Errors
    /// Where the page's template cannot be filled.
    pub fn render(&self) -> Result<String, ReportError> {
        self.page().render()
    }

    /// The report as a page, for those who want to add to it.
    #[must_use]
    pub fn page(&self) -> Page {
        let sections = vec![
            self.figure_section(),
            self.fault_section(),
            self.time_section(),
            self.leak_section(),
            self.provenance.section(),
        ];
        Page {
            title: "Soak".to_owned(),
            kind: "Soak report".to_owned(),
            subtitle: format!("{} minutes with real processes", format::fixed(self.minutes, 1)),
            verdict: self.verdict(),
            key_figures: self.key_figures(),
            sections,
            footer: self.provenance.footer(),
        }
    }

    fn verdict(&self) -> Verdict {
        let held = self.broken.is_empty() && self.figures.iter().all(|figure| figure.passed);
        let faults = format::plural(self.faults.len() as u64, "fault", "faults");
        let (tone, headline) = if held { (Tone::Good, "Held.") } else { (Tone::Bad, "Broken.") };
        let missed: Vec<String> = self
            .figures
            .iter()
            .filter(|figure| !figure.passed)
            .map(|figure| format!("{} {}", figure.name, format::significant(figure.value, 4)))
            .collect();
        let sentence = match (self.broken.is_empty(), missed.is_empty()) {
            (false, _) => self.broken.join(" "),
            (true, true) => format!("{faults}; every invariant held."),
            (true, false) => format!("{faults}; beyond its limit: {}.", missed.join(", ")),
        };
        Verdict { tone, headline: headline.to_owned(), sentence }
    }

    fn key_figures(&self) -> Vec<KeyFigure> {
        let manoeuvres: u64 = self.ends.iter().map(|(_, count)| count).sum();
        let used = |fault: &SoakFault| fault.stop.map(|(rolled, bound)| rolled / bound);
        let worst = self.faults.iter().filter_map(used).fold(f64::NAN, f64::max);
        let recovery = self.faults.iter().filter_map(|fault| fault.recovery);
        let slowest = recovery.fold(f64::NAN, f64::max);
        vec![
            KeyFigure::plain("Manoeuvres", format::count(manoeuvres), "parking and leaving"),
            KeyFigure::plain("Faults", format::count(self.faults.len() as u64), "injected"),
            KeyFigure::limited(
                "Worst stop",
                format::percent(worst),
                worst,
                1.0,
                "of the allowed distance",
            ),
            KeyFigure::plain("Slowest recovery", format::seconds(slowest), "from a death"),
        ]
    }

    fn figure_section(&self) -> Section {
        let rows = self.figures.iter().map(|figure| {
            Row::new([
                figure.name.clone(),
                format::significant(figure.value, 4),
                format::significant(figure.limit, 4),
            ])
            .toned(Tone::of(figure.passed))
        });
        let table = Table::new("Held against", &["what", "#is", "#at most"], "").with_rows(rows);
        let ends =
            self.ends.iter().map(|(end, count)| Row::new([end.clone(), format::count(*count)]));
        let ends =
            Table::new("How manoeuvres ended", &["end", "#number"], "None ended.").with_rows(ends);
        let blocks =
            vec![Block::Table(table), Block::Table(ends), Block::Facts(self.circumstances.clone())];
        Section::new("figures", "Figures", blocks)
    }

    fn fault_section(&self) -> Section {
        let mut groups: BTreeMap<(&str, &str), Vec<&SoakFault>> = BTreeMap::new();
        for fault in &self.faults {
            groups.entry((&fault.process, &fault.kind)).or_default().push(fault);
        }
        let rows = groups.into_iter().map(|((process, kind), faults)| {
            let stopped = faults.iter().filter(|fault| fault.effect == "stopped").count() as u64;
            let used = faults.iter().filter_map(|fault| fault.stop);
            let worst = used.map(|(rolled, bound)| rolled / bound).fold(f64::NAN, f64::max);
            let back = faults.iter().filter_map(|fault| fault.recovery).fold(f64::NAN, f64::max);
            let show =
                |value: f64, text: String| if value.is_nan() { UNKNOWN.to_owned() } else { text };
            Row::new([
                process.to_owned(),
                kind.to_owned(),
                format::count(faults.len() as u64),
                format::count(stopped),
                show(worst, format::percent(worst)),
                show(back, format::seconds(back)),
            ])
            .toned(Tone::of(faults.iter().all(|fault| fault.passed)))
        });
        let columns =
            ["process", "fault", "#number", "#stopped", "#worst of the bound", "#back after"];
        let table = Table::new("Faults", &columns, "None were injected.").with_rows(rows);
        let bad = self.faults.iter().filter(|fault| !fault.passed);
        let list: Vec<String> = bad
            .map(|fault| {
                format!("{} {} in {}: {}", fault.kind, fault.process, fault.mode, fault.effect)
            })
            .collect();
        let mut blocks = vec![Block::Table(table), Block::Figure(self.stop_chart())];
        if !list.is_empty() {
            blocks.push(Block::List(list));
        }
        Section::new("faults", "Faults", blocks)
    }

    fn time_section(&self) -> Section {
        let blocks = vec![Block::Figure(self.latency_chart())];
        Section::new("time", "Latency over time", blocks)
    }

    fn leak_section(&self) -> Section {
        let rows = self.slopes.iter().map(|slope| {
            let [value, low, high] = slope.slope.unwrap_or([f64::NAN; 3]);
            let show = |value: f64| {
                if value.is_nan() { UNKNOWN.to_owned() } else { format::significant(value, 3) }
            };
            Row::new([
                slope.process.clone(),
                slope.resource.clone(),
                show(value),
                show(low),
                show(high),
            ])
            .toned(if slope.leaks { Tone::Bad } else { Tone::Plain })
        });
        let columns = ["process", "what", "#a minute", "#at least", "#at most"];
        let table = Table::new("Growth", &columns, "Too short to tell.").with_rows(rows);
        Section::new(
            "leaks",
            "Memory, descriptors, segments",
            vec![Block::Figure(self.memory_chart()), Block::Table(table)],
        )
        .with_lead("One slope through all lives of a process, each with a level of its own; 95 % intervals.")
    }
}

#[cfg(test)]
mod tests {
    use super::super::{SoakFigure, SoakSlope};
    use super::*;

    fn report(passed: bool) -> SoakReport {
        let fault = SoakFault {
            kind: "kill".to_owned(),
            process: "tracker".to_owned(),
            mode: "driving".to_owned(),
            effect: if passed { "stopped" } else { "did not stop" }.to_owned(),
            stop: Some((0.1, 0.15)),
            recovery: Some(0.4),
            passed,
        };
        let slope = SoakSlope {
            process: "tracker".to_owned(),
            resource: "memory [KiB]".to_owned(),
            slope: Some([0.1, -0.1, 0.3]),
            leaks: false,
            points: vec![[0.0, 5000.0], [1.0, 5001.0]],
        };
        SoakReport {
            broken: if passed { Vec::new() } else { vec!["It <rolled> on.".to_owned()] },
            figures: vec![SoakFigure {
                name: "orphans".to_owned(),
                value: 0.0,
                limit: 0.0,
                passed: true,
            }],
            minutes: 2.0,
            ends: vec![("parking: plan completed".to_owned(), 3)],
            faults: vec![fault],
            latency: vec![[0.0, 80.0, 200.0, 900.0], [1.0, 80.0, 210.0, 700.0]],
            slopes: vec![slope],
            ..SoakReport::default()
        }
    }

    #[test]
    fn what_broke_is_the_verdict_and_what_held_is_too() {
        let held = report(true).render().unwrap();
        assert!(held.contains("Held.") && held.contains("66.7"), "{held}");
        let broken = report(false).render().unwrap();
        let escaped =
            ["&lt;rolled&gt;", "&#60;rolled&#62;"].iter().any(|text| broken.contains(text));
        assert!(broken.contains("Broken.") && escaped);
        assert!(broken.contains("kill tracker in driving: did not stop"));
    }

    #[test]
    fn a_soak_that_saw_nothing_is_a_page_too() {
        assert!(SoakReport::default().render().unwrap().contains("None were injected."));
    }
}
