//! Reading a file against its schema: every problem, each with its place.

use core::ops::Range;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::kind::Fault;
use super::{Key, Presence, Schema, Value, nearest};
use crate::problem::{Cause, Problem, Severity};

/// The text of a file and where it comes from.
#[derive(Clone, Debug)]
pub(crate) struct SourceFile {
    /// The file as messages name it.
    pub(crate) name: String,
    /// Its text.
    pub(crate) text: Arc<str>,
    /// The folder that paths in it are relative to; none for what is compiled in.
    pub(crate) folder: Option<PathBuf>,
}

impl SourceFile {
    /// Line and column, from 1, of a byte.
    pub(crate) fn position(&self, byte: usize) -> (usize, usize) {
        let before = &self.text.as_bytes()[..byte.min(self.text.len())];
        let line_start = before.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        (line, 1 + String::from_utf8_lossy(&before[line_start..]).chars().count())
    }

    /// The text of a span, shortened to a glance.
    pub(crate) fn excerpt(&self, span: &Range<usize>) -> String {
        let text = self.text.get(span.clone()).unwrap_or_default();
        let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
        match words.char_indices().nth(60) {
            Some((end, _)) => format!("{} ...", &words[..end]),
            None => words,
        }
    }
}

/// A value that a file gives.
struct Given {
    value: Value,
    span: Range<usize>,
}

/// A file read against its schema.
pub(crate) struct Reading<'s, T> {
    pub(crate) file: SourceFile,
    schema: &'s Schema<T>,
    given: BTreeMap<usize, Given>,
    tables: BTreeMap<String, Range<usize>>,
    problems: Vec<Problem>,
}

impl<'s, T> Reading<'s, T> {
    /// Reads a file; what is wrong with it is collected, not fatal.
    pub(crate) fn new(schema: &'s Schema<T>, file: &SourceFile) -> Self {
        let (given, tables, problems) = (BTreeMap::new(), BTreeMap::new(), Vec::new());
        let mut reading = Self { file: file.clone(), schema, given, tables, problems };
        let text = Arc::clone(&file.text);
        let (document, errors) = DeTable::parse_recoverable(&text);
        reading.walk("", document.get_ref());
        if errors.is_empty() {
            reading.find_missing();
        } else {
            reading.keep_syntax(errors);
        }
        reading
    }

    fn walk(&mut self, prefix: &str, table: &DeTable<'_>) {
        for (name, value) in table {
            let path = match prefix {
                "" => name.get_ref().to_string(),
                _ => format!("{prefix}.{}", name.get_ref()),
            };
            self.visit(&path, name, value);
        }
    }

    fn visit(&mut self, path: &str, name: &Spanned<Cow<'_, str>>, value: &Spanned<DeValue<'_>>) {
        let schema = self.schema;
        if name.get_ref().contains('.') {
            return self.unknown(path, name.span(), value);
        }
        if let Some((index, key)) = schema.find(path) {
            return self.read_value(index, key, value);
        }
        match value.get_ref() {
            DeValue::Table(table) if schema.is_table(path) => {
                self.tables.insert(path.to_owned(), name.span());
                self.walk(path, table);
            }
            found if schema.is_table(path) => {
                let cause = Cause::WrongType { found: found.type_str() };
                let value = Some(self.file.excerpt(&value.span()));
                self.report(path, name.span(), value, cause, "a table".to_owned());
            }
            _ => self.unknown(path, name.span(), value),
        }
    }

    fn read_value(&mut self, index: usize, key: &Key<T>, found: &Spanned<DeValue<'_>>) {
        let mut faults = Vec::new();
        let value = key.kind.read(found, "", &mut faults);
        for Fault { index, span, cause, allowed } in faults {
            let excerpt = self.file.excerpt(&span);
            self.report(&format!("{}{index}", key.path), span, Some(excerpt), cause, allowed);
        }
        if let Some(value) = value {
            self.given.insert(index, Given { value, span: found.span() });
        }
    }

    fn unknown(&mut self, path: &str, span: Range<usize>, value: &Spanned<DeValue<'_>>) {
        let keys = self.schema.keys.iter().map(|key| key.path.as_ref());
        let tables = self.schema.sections.iter().map(|section| section.path);
        let near = nearest(path, keys.chain(tables).filter(|known| !known.is_empty()));
        let table = path.rsplit_once('.').map_or("", |(table, _)| table);
        let allowed = self.names_in(table);
        let is_table = matches!(value.get_ref(), DeValue::Table(_));
        let value = (!is_table).then(|| self.file.excerpt(&value.span()));
        self.report(path, span, value, Cause::UnknownKey, allowed);
        if let (Some(problem), Some(near)) = (self.problems.last_mut(), near) {
            problem.help = Some(format!("did you mean \"{near}\"?"));
        }
    }

    /// The names that may stand in a table, for people.
    fn names_in(&self, table: &str) -> String {
        let below = |path: &'s str| match table {
            "" => Some(path),
            _ => path.strip_prefix(table)?.strip_prefix('.'),
        };
        let schema = self.schema;
        let mut names: Vec<&str> = schema
            .keys
            .iter()
            .filter_map(|key| below(&key.path))
            .map(|rest| rest.split('.').next().unwrap_or(rest))
            .collect();
        names.dedup();
        if names.is_empty() { "nothing here".to_owned() } else { names.join(", ") }
    }

    fn find_missing(&mut self) {
        let schema = self.schema;
        for (index, key) in schema.keys.iter().enumerate() {
            let table_absent =
                schema.optional_table(&key.path).is_some_and(|table| !self.has(table));
            if key.presence == Presence::Required
                && !table_absent
                && !self.given.contains_key(&index)
                && !self.is_reported(&key.path)
            {
                self.missing(&key.path);
            }
        }
    }

    /// Reports a key as missing from its table.
    pub(crate) fn missing(&mut self, path: &str) {
        let allowed = self.schema.find(path).map_or(String::new(), |(_, key)| key.kind.to_string());
        let doc = self.schema.find(path).map(|(_, key)| key.doc.to_string());
        let span = self.table_span(path);
        self.report(path, span, None, Cause::Missing, allowed);
        if let Some(problem) = self.problems.last_mut() {
            problem.help = doc;
        }
    }

    fn is_reported(&self, path: &str) -> bool {
        self.problems.iter().any(|problem| {
            problem
                .key
                .strip_prefix(path)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('['))
                || path.strip_prefix(problem.key.as_str()).is_some_and(|rest| rest.starts_with('.'))
        })
    }

    /// The nearest table around a path that the file has; the file's beginning for keys at the top.
    fn table_span(&self, path: &str) -> Range<usize> {
        let mut table = path;
        while let Some((outer, _)) = table.rsplit_once('.') {
            if let Some(span) = self.tables.get(outer) {
                return span.clone();
            }
            table = outer;
        }
        0..0
    }

    /// Where the text is no TOML, what follows from it in the same line or as a gap is noise.
    fn keep_syntax(&mut self, errors: Vec<toml::de::Error>) {
        let consequences = std::mem::take(&mut self.problems);
        for error in errors {
            let end = self.file.text.len();
            let span = error.span().unwrap_or(end..end);
            let cause = Cause::Syntax(error.message().to_owned());
            self.report("", span, None, cause, String::new());
        }
        let lines: Vec<_> = self.problems.iter().map(|problem| problem.line).collect();
        let own = |problem: &Problem| !lines.contains(&problem.line);
        self.problems.extend(consequences.into_iter().filter(own));
    }

    fn report(
        &mut self,
        key: &str,
        span: Range<usize>,
        value: Option<String>,
        cause: Cause,
        allowed: String,
    ) {
        let (line, column) = self.file.position(span.start);
        self.problems.push(Problem {
            severity: Severity::Error,
            file: self.file.name.clone(),
            source: Arc::clone(&self.file.text),
            span,
            line,
            column,
            key: key.to_owned(),
            value,
            cause,
            allowed,
            help: None,
        });
    }

    /// Reports a problem with a key whose value is of the declared kind: at its value, or at its
    /// table where the value is the default.
    pub(crate) fn refuse(&mut self, path: &str, value: &str, cause: Cause, allowed: String) {
        let given = self.span(path);
        let is_default = given.is_none();
        let span = given.unwrap_or_else(|| self.table_span(path));
        self.report(path, span, Some(value.to_owned()), cause, allowed);
        if let (Some(problem), true) = (self.problems.last_mut(), is_default) {
            problem.help = Some("not in the file: this is what holds without it".to_owned());
        }
    }

    /// The same as a warning.
    pub(crate) fn warn(&mut self, path: &str, value: &str, cause: Cause, allowed: String) {
        self.refuse(path, value, cause, allowed);
        if let Some(problem) = self.problems.last_mut() {
            problem.severity = Severity::Warning;
        }
    }

    /// Adds problems of another file that this one names.
    pub(crate) fn adopt(&mut self, problems: &[Problem]) {
        self.problems.extend_from_slice(problems);
    }

    fn span(&self, path: &str) -> Option<Range<usize>> {
        let given = self.schema.find(path).and_then(|(index, _)| self.given.get(&index));
        given.map(|given| given.span.clone()).or_else(|| self.tables.get(path).cloned())
    }

    /// Whether the file gives that key, or has that table.
    pub(crate) fn has(&self, path: &str) -> bool {
        self.span(path).is_some()
    }

    /// The line a key is given in.
    pub(crate) fn line(&self, index: usize) -> Option<usize> {
        self.given.get(&index).map(|given| self.file.position(given.span.start).0)
    }

    /// Puts what the file gives into `target`.
    pub(crate) fn apply(&self, target: &mut T) {
        for (index, given) in &self.given {
            let taken = self.schema.keys[*index].take(target, &given.value);
            debug_assert!(taken, "{} does not fit its field", self.schema.keys[*index].path);
        }
    }

    /// Whether no error was found so far.
    pub(crate) fn is_sound(&self) -> bool {
        self.problems.iter().all(|problem| problem.severity < Severity::Error)
    }

    /// The schema the file was read against.
    pub(crate) fn schema(&self) -> &'s Schema<T> {
        self.schema
    }

    /// The problems, in the order of the text, those of other files last.
    pub(crate) fn into_problems(self) -> Vec<Problem> {
        let mut problems = self.problems;
        let own = self.file.name;
        problems
            .sort_by_key(|problem| (problem.file != own, problem.file.clone(), problem.span.start));
        problems
    }
}
