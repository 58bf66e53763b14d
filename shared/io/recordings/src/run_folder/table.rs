//! One CSV file of a run: a header line, then rows in order of time.

use std::path::Path;

use csv::ByteRecord;

use super::error::RunError;
use super::field::{self, Allowed};
use super::rows::{Needed, Row};

/// Stamps that can be turned into nanoseconds after [`super::BASE`].
const STAMP: Allowed = Allowed::Number { low: -0.999, high: 1e8, unit: "s" };

/// The rows of a file, and what else its columns hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Table<R> {
    /// Rows, stamps increasing; at least one.
    pub rows: Vec<R>,
    /// Bit i: the header names column i of [`Row::COLUMNS`].
    pub columns: u8,
    /// Columns that the format does not know, as they were.
    pub further: Vec<Further>,
}

/// A column that the format does not know: kept as text and used by nobody.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Further {
    /// Its name in the header.
    pub name: String,
    text: String,
    ends: Vec<usize>,
}

impl Further {
    /// An empty column.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned(), ..Self::default() }
    }

    /// Appends the field of the next row.
    pub fn push(&mut self, field: &str) {
        self.text.push_str(field);
        self.ends.push(self.text.len());
    }

    /// The field of row `row`; empty beyond the last.
    #[must_use]
    pub fn field(&self, row: usize) -> &str {
        let start = row.checked_sub(1).map_or(0, |before| self.ends[before]);
        self.ends.get(row).map_or("", |end| &self.text[start..*end])
    }
}

impl<R: Row> Table<R> {
    /// A table of `rows` with the columns of the mask `columns`.
    #[must_use]
    pub fn new(rows: Vec<R>, columns: u8) -> Self {
        Self { rows, columns, further: Vec::new() }
    }

    /// The file in `folder`; none where there is no such file.
    ///
    /// # Errors
    /// Whatever in it is not as the format says.
    pub fn read(folder: &Path) -> Result<Option<Self>, RunError> {
        let path = folder.join(R::FILE);
        match std::fs::read(&path) {
            Ok(bytes) => Self::parse(&path, &bytes).map(Some),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(RunError::Io { path, source }),
        }
    }

    /// The text `bytes` of a file called `path`.
    ///
    /// # Errors
    /// Whatever in it is not as the format says.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, RunError> {
        check_text(path, bytes)?;
        let mut reader =
            csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(bytes);
        let mut record = ByteRecord::new();
        if !next(path, &mut reader, &mut record)? {
            return Err(RunError::NoHeader { path: path.into(), columns: R::COLUMNS.join(", ") });
        }
        let mut parser = Parser::new(path, bytes, Header::parse::<R>(path, &record)?);
        while next(path, &mut reader, &mut record)? {
            parser.take(&record)?;
        }
        parser.finish()
    }

    /// The file's text: what [`Table::parse`] reads as the same table.
    #[must_use]
    pub fn to_text(&self) -> String {
        let known = (0..R::COLUMNS.len()).filter(|column| self.columns & (1 << column) != 0);
        let mut text = String::from("t");
        for name in known.clone().map(|column| R::COLUMNS[column]) {
            text.push(',');
            text.push_str(name);
        }
        for further in &self.further {
            text.push(',');
            push_quoted(&further.name, &mut text);
        }
        text.push('\n');
        for (index, row) in self.rows.iter().enumerate() {
            text.push_str(&row.t().to_string());
            for column in known.clone() {
                text.push(',');
                row.append(column, &mut text);
            }
            for further in &self.further {
                text.push(',');
                push_quoted(further.field(index), &mut text);
            }
            text.push('\n');
        }
        text
    }
}

fn push_quoted(field: &str, text: &mut String) {
    if !field.contains([',', '"', '\n', '\r']) {
        return text.push_str(field);
    }
    text.push('"');
    text.push_str(&field.replace('"', "\"\""));
    text.push('"');
}

fn check_text(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    let Err(error) = core::str::from_utf8(bytes) else { return Ok(()) };
    let before = &bytes[..error.valid_up_to()];
    let line = 1 + before.iter().filter(|byte| **byte == b'\n').count() as u64;
    Err(RunError::NotUtf8 { path: path.into(), line })
}

fn next(
    path: &Path,
    reader: &mut csv::Reader<&[u8]>,
    record: &mut ByteRecord,
) -> Result<bool, RunError> {
    reader
        .read_byte_record(record)
        .map_err(|error| RunError::Io { path: path.into(), source: error.into() })
}

/// A field as text. The whole file was found to be UTF-8, and fields end at ASCII characters.
fn text(field: &[u8]) -> &str {
    core::str::from_utf8(field).unwrap_or_default()
}

/// The line on which a record begins, from 1. The reader's own count is of no use: it is taken
/// before the line ends and empty lines that it skips ahead of the record.
fn line_of(bytes: &[u8], record: &ByteRecord) -> u64 {
    let place = record.position().map_or(0, csv::Position::byte);
    let place = usize::try_from(place).map_or(bytes.len(), |place| place.min(bytes.len()));
    let skipped = bytes[place..].iter().take_while(|byte| matches!(byte, b'\r' | b'\n')).count();
    1 + bytes[..place + skipped].iter().filter(|byte| **byte == b'\n').count() as u64
}

/// Where in a row each column is.
struct Header {
    width: usize,
    stamp: usize,
    /// Place in the row, and index in [`Row::COLUMNS`].
    known: Vec<(usize, usize)>,
    /// Place in the row, and name.
    further: Vec<(usize, String)>,
}

impl Header {
    fn parse<R: Row>(path: &Path, record: &ByteRecord) -> Result<Self, RunError> {
        let names: Vec<&str> = record.iter().map(text).collect();
        let mut stamp = None;
        let mut header =
            Self { width: names.len(), stamp: 0, known: Vec::new(), further: Vec::new() };
        for (place, name) in names.iter().enumerate() {
            if names[..place].contains(name) {
                return Err(RunError::Twice { path: path.into(), column: (*name).to_owned() });
            }
            match R::COLUMNS.iter().position(|column| column == name) {
                Some(column) => header.known.push((place, column)),
                None if *name == "t" => stamp = Some(place),
                None => header.further.push((place, (*name).to_owned())),
            }
        }
        header.stamp = stamp.filter(|_| header.suffices::<R>()).ok_or_else(|| {
            RunError::NoColumn { path: path.into(), found: names.join(", "), needed: needs::<R>() }
        })?;
        Ok(header)
    }

    fn suffices<R: Row>(&self) -> bool {
        match R::NEEDED {
            Needed::Any => !self.known.is_empty(),
            Needed::First(count) => {
                self.known.iter().filter(|known| known.1 < count).count() == count
            }
        }
    }
}

fn needs<R: Row>() -> String {
    match R::NEEDED {
        Needed::Any => format!("needed: t and at least one of {}", R::COLUMNS.join(", ")),
        Needed::First(count) => format!("needed: t, {}", R::COLUMNS[..count].join(", ")),
    }
}

struct Parser<'a, R> {
    path: &'a Path,
    bytes: &'a [u8],
    header: Header,
    rows: Vec<R>,
    further: Vec<Further>,
}

impl<'a, R: Row> Parser<'a, R> {
    fn new(path: &'a Path, bytes: &'a [u8], header: Header) -> Self {
        let further = header.further.iter().map(|(_, name)| Further::new(name)).collect();
        Self { path, bytes, header, rows: Vec::new(), further }
    }

    fn take(&mut self, record: &ByteRecord) -> Result<(), RunError> {
        if record.len() != self.header.width {
            return Err(RunError::Fields {
                path: self.path.into(),
                line: line_of(self.bytes, record),
                found: record.len(),
                expected: self.header.width,
            });
        }
        let mut row = R::default();
        row.set_t(self.stamp(record)?);
        for (place, column) in &self.header.known {
            let field = text(&record[*place]);
            if !field.is_empty() && row.set(*column, field).is_none() {
                let allowed = format!("{}, or nothing", R::allowed(*column));
                return Err(self.value(record, R::COLUMNS[*column], field, allowed));
            }
        }
        for ((place, _), further) in self.header.further.iter().zip(&mut self.further) {
            further.push(text(&record[*place]));
        }
        self.rows.push(row);
        Ok(())
    }

    fn stamp(&self, record: &ByteRecord) -> Result<f64, RunError> {
        let field = text(&record[self.header.stamp]);
        let t = field::number(field, STAMP)
            .ok_or_else(|| self.value(record, "t", field, STAMP.to_string()))?;
        match self.rows.last().map(Row::t) {
            Some(previous) if t <= previous => Err(RunError::Order {
                path: self.path.into(),
                line: line_of(self.bytes, record),
                t,
                previous,
            }),
            _ => Ok(t),
        }
    }

    fn value(&self, record: &ByteRecord, column: &str, found: &str, allowed: String) -> RunError {
        RunError::Value {
            path: self.path.into(),
            line: line_of(self.bytes, record),
            column: column.to_owned(),
            found: found.to_owned(),
            allowed,
        }
    }

    fn finish(self) -> Result<Table<R>, RunError> {
        if self.rows.is_empty() {
            return Err(RunError::NoRows { path: self.path.into() });
        }
        let columns = self.header.known.iter().fold(0, |mask, known| mask | 1 << known.1);
        Ok(Table { rows: self.rows, columns, further: self.further })
    }
}
