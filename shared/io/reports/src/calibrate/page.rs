//! The page of a calibration report.

use kerbside_geometry::math;

use super::data::{CalibrateReport, CalibratedParameter, EndErrors, RunNote, RunResidual};
use crate::ReportError;
use crate::format::{self, UNKNOWN};
use crate::page::{Block, KeyFigure, Page, Row, Section, Table, Verdict};
use crate::svg::Tone;

impl CalibrateReport {
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
        let mut sections = vec![self.parameter_section(), self.left_out_section()];
        sections.extend(self.path_section());
        sections.push(self.run_section());
        sections.extend(self.note_section());
        sections.push(self.provenance.section());
        Page {
            title: self.vehicle.clone(),
            kind: "Calibration report".to_owned(),
            subtitle: self.method.clone(),
            verdict: self.verdict(),
            key_figures: self.key_figures(),
            sections,
            footer: self.provenance.footer(),
        }
    }

    fn verdict(&self) -> Verdict {
        let judged = match &self.judged {
            Some(rms) => {
                let (before, after) = (distance(&rms.before), distance(&rms.after));
                format!(
                    "Runs left out end {} from where they should, {} before.",
                    millimetres(after),
                    millimetres(before)
                )
            }
            None => "No run was left out: the result is not judged.".to_owned(),
        };
        let (tone, headline, sentence) = match (&self.problem, self.missing.is_empty()) {
            (Some(problem), _) => {
                (Tone::Bad, "Not good.", format!("{}. {judged}", capital(problem)))
            }
            (None, true) => (Tone::Good, "Calibrated.", judged),
            (None, false) => {
                let open =
                    format::plural(self.missing.len() as u64, "parameter is", "parameters are");
                (Tone::Good, "Calibrated.", format!("{judged} {open} not identified."))
            }
        };
        Verdict { tone, headline: headline.to_owned(), sentence }
    }

    fn key_figures(&self) -> Vec<KeyFigure> {
        let identified = self.parameters.iter().filter(|p| p.identified).count() as u64;
        let [fitted, of] = self.runs;
        let overall = self.judged.as_ref();
        let error = |pick: fn(&EndErrors) -> f64| format::optional(overall.map(pick), millimetres);
        let heading = overall.map(|rms| rms.after.yaw);
        vec![
            KeyFigure::plain(
                "End error before",
                error(|rms| distance(&rms.before)),
                "rms, runs left out",
            ),
            KeyFigure::plain(
                "End error after",
                error(|rms| distance(&rms.after)),
                "rms, runs left out",
            ),
            KeyFigure::plain(
                "Heading after",
                format::optional(heading, unsigned_degrees),
                "rms at the end",
            ),
            KeyFigure::plain(
                "Parameters",
                format::count(identified),
                &format!("identified of {}", self.parameters.len()),
            ),
            KeyFigure::plain("Runs", format::count(fitted), &format!("fitted of {of}")),
            KeyFigure {
                tone: if self.rejected.is_empty() { Tone::Plain } else { Tone::Warn },
                ..KeyFigure::plain("Rejected", format::count(self.rejected.len() as u64), "runs")
            },
        ]
    }

    fn parameter_section(&self) -> Section {
        let columns =
            ["parameter", "", "#nominal", "#found", "#95 % interval", "#closed form", "identified"];
        let table = Table::new("Parameters", &columns, "The sensors involve no parameter.")
            .with_rows(self.parameters.iter().map(parameter_row));
        let mut blocks = vec![Block::Table(table)];
        if !self.missing.is_empty() {
            let columns = ["parameter", "what would identify it"];
            blocks.push(Block::Table(notes("Not identified", &columns, &self.missing, "")));
        }
        if !self.derived.is_empty() {
            let row = |d: &super::data::DerivedFigure| {
                let (value, deviation) = (format::fixed(d.value, 6), format::fixed(d.deviation, 6));
                Row::new([d.name.clone(), d.unit.clone(), value, deviation])
            };
            let columns = ["quantity", "", "#value", "#standard deviation"];
            let table = Table::new("Differences and ratios", &columns, "")
                .with_rows(self.derived.iter().map(row));
            blocks.push(Block::Table(table));
        }
        Section::new("parameters", "Parameters", blocks)
            .with_lead("Names are the keys of vehicle.toml; lengths in metres, angles in radians.")
    }

    fn left_out_section(&self) -> Section {
        let columns =
            ["run", "manoeuvre", "by", "#before", "#after", "#heading before", "#heading after"];
        let rejected = |row: &EndErrors| {
            let run = format!("{} (rejected, does not count)", row.run);
            error_row(&EndErrors { run, ..row.clone() }, true).toned(Tone::Warn)
        };
        let rows = self.left_out.iter().map(|row| error_row(row, true));
        let rows = rows.chain(self.outliers.iter().map(rejected));
        let rows = rows.chain(self.rms.iter().map(|row| error_row(row, false)));
        let table = Table::new("End errors", &columns, "No run was left out.").with_rows(rows);
        let mut blocks = Vec::new();
        if !self.left_out.is_empty() {
            blocks.push(self.end_maps());
        }
        blocks.push(Block::Table(table));
        Section::new("left-out", "Runs left out", blocks).with_lead(format!(
            "Dead reckoning from the known start to the known end; {}. A cross is the end of a run, 0 where it should be.",
            self.basis
        ))
    }

    fn path_section(&self) -> Option<Section> {
        let blocks: Vec<Block> =
            self.paths.iter().enumerate().map(|(number, run)| run.figures(number)).collect();
        let section = Section::new("paths", "Paths before and after", blocks).with_lead(
            "Dead reckoning from the known start, by the nominal vehicle and by the calibrated one; \
             a run of each manoeuvre. The cross is the known end.",
        );
        (!self.paths.is_empty()).then_some(section)
    }

    fn run_section(&self) -> Section {
        let columns = ["run", "#travel", "#reference", "#readings", "#axles", "#comparisons"];
        let table =
            Table::new("Residuals, in standard deviations", &columns, "The method has none.")
                .with_rows(self.residuals.iter().map(residual_row));
        let rejected =
            notes("Rejected runs", &["run", "why"], &self.rejected, "No run was rejected.");
        Section::new("runs", "Runs", vec![Block::Table(table), Block::Table(rejected)]).with_lead(
            "Root mean squares; 1 is as believed. Reference: known poses, distances and turns. \
             Axles: what front wheels, rear wheels and steering disagree on.",
        )
    }

    fn note_section(&self) -> Option<Section> {
        let mut blocks = Vec::new();
        if !self.findings.is_empty() {
            blocks.push(Block::Table(notes(
                "Found in the runs",
                &["run", "what"],
                &self.findings,
                "",
            )));
        }
        if !self.notes.is_empty() {
            blocks.push(Block::List(self.notes.clone()));
        }
        (!blocks.is_empty()).then(|| Section::new("notes", "To be known", blocks))
    }
}

fn notes(caption: &str, columns: &[&str], list: &[RunNote], empty: &str) -> Table {
    let row = |note: &RunNote| Row::new([note.name.clone(), note.text.clone()]);
    Table::new(caption, columns, empty).with_rows(list.iter().map(row))
}

fn parameter_row(parameter: &CalibratedParameter) -> Row {
    let show = |value: f64| format::fixed(value, parameter.decimals);
    let [low, high] = parameter.interval.map(show);
    let interval = if low == UNKNOWN { low } else { format!("{low} to {high}") };
    Row::new([
        parameter.name.clone(),
        parameter.unit.clone(),
        show(parameter.nominal),
        show(parameter.value),
        interval,
        show(parameter.closed_form),
        if parameter.identified { "yes" } else { "no, kept as it was" }.to_owned(),
    ])
    .toned(if parameter.identified { Tone::Good } else { Tone::Warn })
}

fn error_row(row: &EndErrors, signed: bool) -> Row {
    let heading = |yaw: f64| match signed {
        true => format::degrees(yaw),
        false => unsigned_degrees(yaw),
    };
    Row::new([
        row.run.clone(),
        row.manoeuvre.clone(),
        row.source.clone(),
        millimetres(distance(&row.before)),
        millimetres(distance(&row.after)),
        heading(row.before.yaw),
        heading(row.after.yaw),
    ])
}

fn unsigned_degrees(radians: f64) -> String {
    let degrees = kerbside_geometry::angle::degrees(radians);
    format::with_unit(&format::fixed(degrees, 2), "deg")
}

fn residual_row(run: &RunResidual) -> Row {
    Row::new([
        run.run.clone(),
        format::metres(run.travel),
        format::fixed(run.reference.0, 2),
        format::count(run.reference.1),
        format::fixed(run.axles.0, 2),
        format::count(run.axles.1),
    ])
}

fn distance(error: &kerbside_geometry::Pose) -> f64 {
    math::hypot(error.x, error.y)
}

fn millimetres(metres: f64) -> String {
    format::with_unit(&format::fixed(1e3 * metres, 1), "mm")
}

fn capital(sentence: &str) -> String {
    let mut letters = sentence.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
