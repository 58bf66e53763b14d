//! The page of a replay report.

use kerbside_geometry::math;

use super::data::{Drift, ReplayReport};
use crate::ReportError;
use crate::format::{self, UNKNOWN};
use crate::page::{Block, KeyFigure, Page, Row, Section, Table, Verdict};
use crate::svg::{Figure, Tone};

impl ReplayReport {
    /// The report as one HTML file.
    ///
    /// # Errors
    /// Where the page's template cannot be filled.
    pub fn render(&self) -> Result<String, ReportError> {
        self.page().render()
    }

    /// The map of the drive as an SVG file of its own.
    #[must_use]
    pub fn picture(&self) -> String {
        self.path_map().standalone()
    }

    /// The report as a page, for those who want to add to it.
    #[must_use]
    pub fn page(&self) -> Page {
        let mut sections = vec![self.path_section(), self.motion_section()];
        sections.extend(self.note_section());
        sections.push(self.model_section());
        sections.push(self.gap_section());
        sections.push(self.provenance.section());
        Page {
            title: self.input.clone(),
            kind: "Replay report".to_owned(),
            subtitle: format!("{}, {}", self.vehicle, self.mode),
            verdict: self.verdict(),
            key_figures: self.key_figures(),
            sections,
            footer: self.provenance.footer(),
        }
    }

    fn verdict(&self) -> Verdict {
        let drift = self.drift.as_ref().map_or_else(
            || "There is no reference to hold the odometry against.".to_owned(),
            |drift| {
                format!(
                    "Odometry drifts from the reference by {} of the distance.",
                    percent(drift.position_percent)
                )
            },
        );
        let (tone, headline, sentence) = match (&self.problem, &self.caution) {
            (Some(problem), _) => (Tone::Bad, "Not replayed.", problem.clone()),
            (None, Some(caution)) => (Tone::Warn, "Replayed.", format!("{drift} {caution}")),
            (None, None) => (Tone::Good, "Replayed.", drift),
        };
        Verdict { tone, headline: headline.to_owned(), sentence }
    }

    fn key_figures(&self) -> Vec<KeyFigure> {
        let drifted = self.drift.as_ref();
        let heading = drifted.map(|drift| drift.heading_per_metre);
        let gaps = self.gaps.len() as u64;
        let refused = self.refusals.iter().map(|refusal| refusal.count).sum();
        let speed = format!("{}\u{202f}\u{d7}", format::three_digits(self.speed_factor));
        let speed = if self.speed_factor.is_finite() { speed } else { UNKNOWN.to_owned() };
        let end = drifted.map(|drift| math::hypot(drift.end_error.x, drift.end_error.y));
        let drift = drifted.map(|drift| drift.position_percent);
        vec![
            KeyFigure::plain(
                "Position drift",
                format::optional(drift, percent),
                "of the distance, median",
            ),
            KeyFigure::plain("Heading drift", format::optional(heading, per_metre), "median"),
            KeyFigure::plain("End error", format::optional(end, format::metres), "position"),
            KeyFigure::plain("Distance", format::metres(self.distance), "both directions added"),
            KeyFigure::plain("Duration", format::seconds(self.duration), "of the drive"),
            KeyFigure::plain("Readings", format::count(self.samples), "replayed"),
            KeyFigure::plain("Replay speed", speed, "of real time"),
            KeyFigure {
                tone: if gaps + refused > 0 { Tone::Warn } else { Tone::Plain },
                ..KeyFigure::plain(
                    "Gaps",
                    format::count(gaps),
                    &format::plural(refused, "reading refused", "readings refused"),
                )
            },
        ]
    }

    fn path_section(&self) -> Section {
        let mut blocks = vec![Block::Figure(self.path_map())];
        if !self.reference.is_empty() {
            blocks.push(beside(self.error_charts()));
        }
        if let Some(drift) = &self.drift {
            blocks.push(Block::Table(drift_table(drift)));
            blocks.push(Block::Text(drift.basis.clone()));
        }
        Section::new("path", "Path", blocks)
    }

    fn motion_section(&self) -> Section {
        Section::new("wheels", "Wheels", vec![beside(self.motion_charts())])
            .with_lead("Shaded stretches are gaps: no motion is invented there.")
    }

    fn note_section(&self) -> Option<Section> {
        let blocks = vec![Block::List(self.notes.clone())];
        (!self.notes.is_empty()).then(|| Section::new("notes", "To be known", blocks))
    }

    fn model_section(&self) -> Section {
        let Self { model, odometry_sha256, .. } = self;
        let facts = [
            ("Model", model.name.clone()),
            ("Uses", model.uses.join(", ")),
            ("Odometry SHA-256", odometry_sha256.clone()),
        ];
        let facts = facts.into_iter().filter(|fact| !fact.1.is_empty());
        let facts = facts.map(|(name, value)| (name.to_owned(), value)).collect();
        let mut blocks = vec![Block::Facts(facts)];
        if !model.missing.is_empty() {
            blocks.push(Block::Text("What is missing:".to_owned()));
            blocks.push(Block::List(model.missing.clone()));
        }
        Section::new("model", "Odometry model", blocks)
    }

    fn gap_section(&self) -> Section {
        let gaps = self.gaps.iter().map(|gap| {
            let time = |seconds| format::with_unit(&format::fixed(seconds, 3), "s");
            Row::new([time(gap.start), time(gap.end), gap.text.clone()])
        });
        let refusals = self
            .refusals
            .iter()
            .map(|refusal| Row::new([refusal.reason.clone(), format::count(refusal.count)]));
        let gaps = Table::new("Gaps", &["#from", "#to", "what"], "No gaps.").with_rows(gaps);
        let columns = ["reason", "#how many"];
        let refusals =
            Table::new("Refused readings", &columns, "Nothing was refused.").with_rows(refusals);
        let tables = vec![Block::Table(gaps), Block::Table(refusals)];
        Section::new("gaps", "Gaps and refusals", vec![Block::Beside(tables)])
    }
}

fn beside(figures: Vec<Figure>) -> Block {
    Block::Beside(figures.into_iter().map(Block::Figure).collect())
}

fn percent(value: f64) -> String {
    format::percent(0.01 * value)
}

fn per_metre(radians: f64) -> String {
    let degrees = kerbside_geometry::angle::degrees(radians);
    format::with_unit(&format::fixed(degrees, 3), "deg/m")
}

fn drift_table(drift: &Drift) -> Table {
    let end = &drift.end_error;
    let length = |metres| format::with_unit(&format::signed(metres, 3), "m");
    let columns = ["#of the distance", "#heading per metre", "#end x", "#end y", "#end heading"];
    let row = Row::new([
        percent(drift.position_percent),
        per_metre(drift.heading_per_metre),
        length(end.x),
        length(end.y),
        format::degrees(end.yaw),
    ]);
    Table::new("Odometry against reference", &columns, "").with_rows([row])
}
