//! The page of a report on the paper's experiments.

use kerbside_reproduction::{FULL, Figure as Reached, ROWS, Verdict as Became};

use super::data::ReproductionReport;
use super::{figures, remarks, tables};
use crate::ReportError;
use crate::format;
use crate::page::{Block, KeyFigure, Page, Section, Verdict};
use crate::svg::{Figure, Tone};

/// What each row is about, and what the paper has in its place.
const TITLES: [(&str, &str); ROWS as usize] = [
    ("Straights: Table 1, Figure 6 (a, b)", "Four diameters; end points before and after."),
    ("Arcs: Table 2, Figure 6 (c, d)", "Two effective tracks; end points before and after."),
    ("The paper's own reference", "5 cm and 5 deg: what such a reference can tell."),
    (
        "Front to rear: equations (3) to (6)",
        "The centre form; the exact form by each wheel's angle.",
    ),
    (
        "Along the path: Figures 7 and 8",
        "Paths nearly alike, the filter's error below the rear wheels'.",
    ),
    ("Ends: Figure 9", "Variance 0.429 and 0.283: a ratio of 0.66 over 60 runs."),
    ("Is the covariance true?", "The paper has nothing on it."),
    ("Slip", "The paper has nothing on it."),
    ("Parking: Figure 10, Table 3", "Signed means of an unknown number of runs."),
];

impl ReproductionReport {
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
        let asked = |row: &u8| self.reproduction.asked.wants(*row);
        let mut sections: Vec<Section> =
            (1..=ROWS).filter(asked).map(|row| self.row_section(row)).collect();
        sections.push(open_section());
        sections.push(self.provenance.section());
        Page {
            title: "The paper's experiments".to_owned(),
            kind: "Reproduction".to_owned(),
            subtitle:
                "Lee, Chung, Chang: Improvement of odometry accuracy and Parking Control for a \
                       Car-Like Mobile Robot"
                    .to_owned(),
            verdict: self.verdict(),
            key_figures: self.key_figures(),
            sections,
            footer: self.provenance.footer(),
        }
    }

    fn count(&self, became: Became) -> u64 {
        let figures = self.reproduction.figures.iter().filter(|figure| figure.is_held());
        figures.filter(|figure| self.reproduction.verdict(figure) == became).count() as u64
    }

    fn verdict(&self) -> Verdict {
        let (missed, open) = (self.count(Became::Missed), self.count(Became::Open));
        let (tone, headline) = match (missed, open) {
            (0, 0) => (Tone::Good, "Reached."),
            (0, _) => (Tone::Warn, "Not decided."),
            _ => (Tone::Bad, "Missed."),
        };
        let reached = self.count(Became::Reached);
        let sentence = format!(
            "{} reached, {missed} missed, {open} left open by so few trials.",
            format::plural(reached, "figure", "figures")
        );
        Verdict { tone, headline: headline.to_owned(), sentence }
    }

    fn key_figures(&self) -> Vec<KeyFigure> {
        let asked = &self.reproduction.asked;
        let row = |row: u8| {
            let held = |figure: &&Reached| figure.row == row && figure.is_held();
            let figures: Vec<_> = self.reproduction.figures.iter().filter(held).collect();
            let reached = figures.iter().filter(|figure| figure.passed()).count();
            let value = format!("{reached} of {}", figures.len());
            let bad = figures.iter().any(|f| self.reproduction.verdict(f) == Became::Missed);
            let tone = Tone::of(!bad);
            let title = TITLES[usize::from(row) - 1].0;
            let short = title.split(':').next().unwrap_or(title);
            KeyFigure { tone, ..KeyFigure::plain(&format!("Row {row}"), value, short) }
        };
        let trials = format::count(asked.trials as u64);
        let note = format!("{FULL} are asked for");
        let mut cards = vec![KeyFigure::plain("Trials per case", trials, &note)];
        cards.extend((1..=ROWS).filter(|number| asked.wants(*number)).map(row));
        cards
    }

    fn row_section(&self, row: u8) -> Section {
        let (title, paper) = TITLES[usize::from(row) - 1];
        let mut blocks = self.pictures(row);
        blocks.push(Block::Table(tables::figures(&self.reproduction, row, true)));
        blocks.extend(self.table(row));
        if self.reproduction.figures.iter().any(|figure| figure.row == row && !figure.is_held()) {
            blocks.push(Block::Table(tables::figures(&self.reproduction, row, false)));
        }
        Section::new(&format!("row-{row}"), &format!("{row}. {title}"), blocks)
            .with_lead(format!("In the paper: {paper}"))
    }

    fn pictures(&self, row: u8) -> Vec<Block> {
        let out = &self.reproduction;
        let fine = out.calibrations.first();
        let of_kind = |kind: usize| {
            let all = fine.map_or(Vec::new(), figures::figure_6);
            beside(all.into_iter().skip(2 * kind).take(2).collect())
        };
        match row {
            1 => vec![of_kind(0)],
            2 => vec![of_kind(1)],
            5 => vec![beside(figures::figure_7(&out.ends)), beside(figures::figure_8(&out.ends))],
            6 => vec![beside(figures::figure_9(&out.ends))],
            7 => vec![beside(figures::growth(&out.growth))],
            9 => vec![beside(figures::figure_10(&out.parkings))],
            _ => Vec::new(),
        }
    }

    fn table(&self, row: u8) -> Option<Block> {
        let out = &self.reproduction;
        let table = match row {
            6 => tables::ends(&out.ends),
            8 => tables::slips(&out.slips),
            9 => tables::parking(&out.parkings, &self.stack),
            _ => return None,
        };
        Some(Block::Table(table))
    }
}

fn beside(figures: Vec<Figure>) -> Block {
    Block::Beside(figures.into_iter().map(Block::Figure).collect())
}

fn open_section() -> Section {
    let list = |remarks: &[&str]| Block::List(remarks.iter().map(|r| (*r).to_owned()).collect());
    let blocks = vec![
        list(&remarks::OPEN),
        Block::Text("What does not fit together in it:".to_owned()),
        list(&remarks::CONTRADICTIONS),
    ];
    Section::new("open", "What the paper leaves open", blocks)
}
