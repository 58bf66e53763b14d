//! The page of a parking report.

use super::charts::latency_figures;
use super::data::{JudgedOn, Latency, ParkReport};
use super::tables::latency_table;
use crate::page::{Block, Page, Section, Verdict};
use crate::svg::{Figure, Tone};
use crate::{ReportError, format};

impl ParkReport {
    /// The report as one HTML file.
    ///
    /// # Errors
    /// Where the page's template cannot be filled.
    pub fn render(&self) -> Result<String, ReportError> {
        self.page().render()
    }

    /// The map of the manoeuvre as an SVG file of its own.
    #[must_use]
    pub fn picture(&self) -> String {
        self.scene_map().standalone()
    }

    /// The report as a page, for those who want to add to it.
    #[must_use]
    pub fn page(&self) -> Page {
        let mut sections = vec![self.path_section(), self.motion_section()];
        sections.extend(self.estimate_section());
        sections.extend(self.latency.as_ref().map(latency_section));
        sections.push(Section::new("events", "Events", vec![Block::Table(self.event_table())]));
        sections.push(self.process_section());
        sections.push(self.provenance.section());
        Page {
            title: format!("{}, {}", self.scenario, self.vehicle),
            kind: "Parking report".to_owned(),
            subtitle: self.run.clone(),
            verdict: self.verdict(),
            key_figures: self.key_figures(),
            sections,
            footer: self.provenance.footer(),
        }
    }

    fn verdict(&self) -> Verdict {
        let outcome = &self.outcome;
        let headline = if outcome.parked { "Parked." } else { "Not parked." };
        let mut sentence = outcome.cause.as_deref().map(as_sentence).unwrap_or_default();
        if outcome.collision {
            sentence.push_str("The vehicle touched an obstacle. ");
        }
        sentence.push_str(&self.end_sentence());
        Verdict { tone: Tone::of(outcome.parked), headline: headline.to_owned(), sentence }
    }

    fn end_sentence(&self) -> String {
        let judge = match self.outcome.judged_on {
            JudgedOn::Truth => "judged on the true pose",
            JudgedOn::Estimate => "judged on the estimate, there being no truth",
        };
        let Some(end) = self.judged_error() else {
            return format!("The end pose is not known; {judge}.");
        };
        let touched = if self.outcome.collision { "" } else { ", without a collision" };
        format!(
            "The vehicle stands {} along, {} across and {} off the goal{touched}; {judge}.",
            format::millimetres(end.x),
            format::millimetres(end.y),
            format::degrees(end.yaw),
        )
    }

    fn path_section(&self) -> Section {
        let tables = vec![
            Block::Figure(self.end_map()),
            Block::Stack(vec![Block::Table(self.error_table()), Block::Table(self.figure_table())]),
        ];
        let blocks = vec![Block::Figure(self.scene_map()), Block::Beside(tables)];
        Section::new("path", "Path", blocks)
    }

    fn motion_section(&self) -> Section {
        let mut figures = self.motion_charts();
        figures.extend(self.tracking_charts());
        Section::new("motion", "Motion", vec![beside(figures)]).with_lead(
            "Shading shows the modes of the stack; dashed verticals are faults and restarts. \
             Tracking errors are plan minus estimate, in the plan's own frame.",
        )
    }

    fn estimate_section(&self) -> Option<Section> {
        let is_known = !self.truth.is_empty() && !self.estimate.is_empty();
        let section = || {
            Section::new("estimate", "Estimate", vec![beside(self.estimate_charts())]).with_lead(
                "Estimate minus truth, in the true body frame. A filter that knows itself stays \
                 inside its band about 95 % of the time.",
            )
        };
        is_known.then(section)
    }

    fn process_section(&self) -> Section {
        let table = Block::Table(self.process_table());
        Section::new("processes", "Processes", vec![table])
    }
}

fn beside(figures: Vec<Figure>) -> Block {
    Block::Beside(figures.into_iter().map(Block::Figure).collect())
}

fn latency_section(latency: &Latency) -> Section {
    let blocks = vec![beside(latency_figures(latency)), Block::Table(latency_table(latency))];
    Section::new("latency", "Latency", blocks)
        .with_lead("From the stamp of an encoder reading to the command that it caused.")
}

/// `text` with a capital at its beginning and a full stop at its end.
fn as_sentence(text: &str) -> String {
    let text = text.trim().trim_end_matches('.');
    let mut letters = text.chars();
    match letters.next() {
        Some(first) => format!("{}{}. ", first.to_uppercase(), letters.as_str()),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_become_sentences() {
        assert_eq!(as_sentence("estimator died"), "Estimator died. ");
        assert_eq!(as_sentence(" Line lost. "), "Line lost. ");
        assert_eq!(as_sentence(""), "");
    }
}
