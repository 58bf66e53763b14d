//! What a page is made of. Every text is escaped when the page is rendered.

use askama::Template;

use crate::ReportError;
use crate::svg::{Figure, STYLE, Tone};

/// A page: one file that needs nothing else.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// The browser's title and the heading.
    pub title: String,
    /// What kind of report it is.
    pub kind: String,
    /// One line below the heading.
    pub subtitle: String,
    /// What it comes to.
    pub verdict: Verdict,
    /// The most important figures.
    pub key_figures: Vec<KeyFigure>,
    /// The rest.
    pub sections: Vec<Section>,
    /// Last line of the page.
    pub footer: String,
}

/// What it comes to.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Good or bad.
    pub tone: Tone,
    /// A word or two.
    pub headline: String,
    /// The sentence behind them.
    pub sentence: String,
}

impl Verdict {
    fn sign(&self) -> &'static str {
        match self.tone {
            Tone::Good => "M7 17.5l6 6L26 10",
            Tone::Bad => "M9 9l14 14M23 9L9 23",
            Tone::Plain | Tone::Warn => "M16 7v12M16 24.5v.1",
        }
    }
}

/// A figure worth a card.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeyFigure {
    /// What it is.
    pub label: String,
    /// The figure with its unit.
    pub value: String,
    /// A few words below it; may be empty.
    pub note: String,
    /// How it is judged.
    pub tone: Tone,
    /// How much of what is allowed it uses, 1 for all of it; none: no such thing.
    pub used: Option<f64>,
}

impl KeyFigure {
    /// A figure that is not judged.
    #[must_use]
    pub fn plain(label: &str, value: String, note: &str) -> Self {
        Self { label: label.to_owned(), value, note: note.to_owned(), ..Self::default() }
    }

    /// A figure held against the greatest size that is allowed; what is not finite is bad.
    #[must_use]
    pub fn limited(label: &str, value: String, size: f64, limit: f64, note: &str) -> Self {
        let used = size.abs() / limit;
        let tone = Tone::of(used <= 1.0);
        Self { tone, used: used.is_finite().then_some(used), ..Self::plain(label, value, note) }
    }

    fn meter(&self) -> Option<String> {
        self.used.map(|used| crate::format::fixed(100.0 * used.clamp(0.0, 1.0), 1))
    }
}

/// A part of a page.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// Unique on the page; letters, digits and hyphens.
    pub id: String,
    /// Heading.
    pub title: String,
    /// A sentence below it; may be empty.
    pub lead: String,
    /// Content.
    pub blocks: Vec<Block>,
}

impl Section {
    /// A section without a lead.
    #[must_use]
    pub fn new(id: &str, title: &str, blocks: Vec<Block>) -> Self {
        Self { id: id.to_owned(), title: title.to_owned(), lead: String::new(), blocks }
    }

    /// The section with a lead.
    #[must_use]
    pub fn with_lead(self, lead: impl Into<String>) -> Self {
        Self { lead: lead.into(), ..self }
    }
}

/// A piece of content.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// A paragraph.
    Text(String),
    /// A list.
    List(Vec<String>),
    /// A table.
    Table(Table),
    /// Names and values; values in the letters of a terminal.
    Facts(Vec<(String, String)>),
    /// A figure as wide as the page.
    Figure(Figure),
    /// Blocks side by side where there is room.
    Beside(Vec<Block>),
    /// Blocks below one another, as one of those side by side.
    Stack(Vec<Block>),
}

/// A table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// What it shows.
    pub caption: String,
    /// Heads of the columns.
    pub columns: Vec<Column>,
    /// Rows, a cell per column.
    pub rows: Vec<Row>,
    /// Said instead of a table without rows.
    pub empty: String,
}

impl Table {
    /// A table without rows; `columns` are names, one that starts with `#` is a column of numbers.
    #[must_use]
    pub fn new(caption: &str, columns: &[&str], empty: &str) -> Self {
        let column = |name: &&str| match name.strip_prefix('#') {
            Some(name) => Column { name: name.to_owned(), is_number: true },
            None => Column { name: (*name).to_owned(), is_number: false },
        };
        Self {
            caption: caption.to_owned(),
            columns: columns.iter().map(column).collect(),
            rows: Vec::new(),
            empty: empty.to_owned(),
        }
    }

    fn has_heads(&self) -> bool {
        self.columns.iter().any(|column| !column.name.is_empty())
    }

    /// The table with rows.
    #[must_use]
    pub fn with_rows(self, rows: impl IntoIterator<Item = Row>) -> Self {
        Self { rows: rows.into_iter().collect(), ..self }
    }
}

/// Head of a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name.
    pub name: String,
    /// Set flush right.
    pub is_number: bool,
}

/// A row of a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// A cell per column; the first is the row's head.
    pub cells: Vec<String>,
    /// How it is judged.
    pub tone: Tone,
}

impl Row {
    /// A row that is not judged.
    #[must_use]
    pub fn new<C: Into<String>>(cells: impl IntoIterator<Item = C>) -> Self {
        Self { cells: cells.into_iter().map(Into::into).collect(), tone: Tone::Plain }
    }

    /// The row with a tone.
    #[must_use]
    pub fn toned(self, tone: Tone) -> Self {
        Self { tone, ..self }
    }
}

#[derive(Template)]
#[template(path = "page.html", whitespace = "minimize")]
struct PageTemplate<'a> {
    page: &'a Page,
    figure_style: &'a str,
    page_style: &'a str,
}

#[derive(Template)]
#[template(path = "block.html", whitespace = "minimize")]
struct BlockTemplate<'a> {
    block: &'a Block,
}

impl Block {
    fn render(&self) -> askama::Result<String> {
        BlockTemplate { block: self }.render()
    }
}

impl Page {
    /// The page as a file; well-formed XML as well as HTML.
    ///
    /// # Errors
    /// Where the template cannot be filled.
    pub fn render(&self) -> Result<String, ReportError> {
        let page_style = include_str!("../templates/page.css");
        let text = PageTemplate { page: self, figure_style: STYLE, page_style }.render()?;
        Ok(without_controls(text))
    }
}

/// Control characters have no place in XML, escaped or not.
fn without_controls(text: String) -> String {
    let is_foreign = |letter: char| {
        let is_control = letter.is_control() && !matches!(letter, '\n' | '\t');
        is_control || matches!(letter, '\u{fffe}' | '\u{ffff}')
    };
    if text.chars().any(is_foreign) { text.replace(is_foreign, "\u{fffd}") } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_over_its_limit_is_bad_and_one_unknown_too() {
        let figure = |size| KeyFigure::limited("a", String::new(), size, 2.0, "");
        assert_eq!(figure(-2.0).tone, Tone::Good);
        assert_eq!(figure(2.1).tone, Tone::Bad);
        assert_eq!(figure(f64::NAN).tone, Tone::Bad);
        assert_eq!(figure(f64::NAN).meter(), None);
        assert_eq!(figure(9.0).meter().as_deref(), Some("100.0"));
    }

    #[test]
    fn controls_do_not_reach_the_file() {
        assert_eq!(without_controls("a\u{0}b\u{1b}c\nd".to_owned()), "a\u{fffd}b\u{fffd}c\nd");
    }
}
