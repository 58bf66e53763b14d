//! The list of a file's keys.

use std::borrow::Cow;

use super::{Field, Kind, Value};

/// Whether a key must be there, and what holds where it is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Must be there, as soon as its table is.
    Required,
    /// Has a default.
    Default,
    /// May be absent; the text says what that means.
    Optional(&'static str),
}

/// What is declared of a key, for people.
#[derive(Clone, Debug, PartialEq)]
pub struct Declaration {
    /// The kind of file it belongs to, like `stack.toml`.
    pub file: &'static str,
    /// Dotted path.
    pub path: String,
    /// Type, unit and range.
    pub kind: Kind,
    /// Whether it must be there.
    pub presence: Presence,
    /// What holds where it is absent, in words; the default as TOML, where there is one.
    pub default: Option<String>,
    /// What it is.
    pub doc: String,
}

/// What is declared of a table, for people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SectionDeclaration {
    /// Dotted path; empty for the file itself.
    pub path: &'static str,
    /// Whether it may be absent.
    pub optional: bool,
    /// What it is.
    pub doc: &'static str,
}

/// Fills the field; false where the field cannot hold the value.
type Take<T> = Box<dyn Fn(&mut T, &Value) -> bool + Send + Sync>;
/// The field's value.
type Show<T> = Box<dyn Fn(&mut T) -> Option<Value> + Send + Sync>;

/// A key and the field of `T` it fills.
pub(crate) struct Key<T> {
    pub(crate) path: Cow<'static, str>,
    pub(crate) kind: Kind,
    pub(crate) presence: Presence,
    pub(crate) doc: Cow<'static, str>,
    take: Take<T>,
    show: Show<T>,
}

impl<T> Key<T> {
    /// Fills the field; false where the field cannot hold the value.
    pub(crate) fn take(&self, target: &mut T, value: &Value) -> bool {
        (self.take)(target, value)
    }

    /// The field's value.
    pub(crate) fn show(&self, target: &mut T) -> Option<Value> {
        (self.show)(target)
    }
}

/// Defaults that hold under a circumstance.
struct Variant<T> {
    circumstance: &'static str,
    default: fn() -> T,
}

/// The keys of one kind of file, filling a `T`.
pub(crate) struct Schema<T> {
    pub(crate) file: &'static str,
    pub(crate) sections: Vec<SectionDeclaration>,
    pub(crate) keys: Vec<Key<T>>,
    default: fn() -> T,
    variants: Vec<Variant<T>>,
}

impl<T> Schema<T> {
    /// An empty list for files called `file`, whose absent keys are as in `default()`.
    pub(crate) fn new(file: &'static str, doc: &'static str, default: fn() -> T) -> Self {
        let root = SectionDeclaration { path: "", optional: false, doc };
        Self { file, sections: vec![root], keys: Vec::new(), default, variants: Vec::new() }
    }

    /// Defaults that hold instead under a circumstance; shown where they differ.
    pub(crate) fn variant(mut self, circumstance: &'static str, default: fn() -> T) -> Self {
        self.variants.push(Variant { circumstance, default });
        self
    }

    /// A table.
    pub(crate) fn section(mut self, path: &'static str, doc: &'static str) -> Self {
        self.sections.push(SectionDeclaration { path, optional: false, doc });
        self
    }

    /// A table whose required keys are required only if the table is there.
    pub(crate) fn optional_section(mut self, path: &'static str, doc: &'static str) -> Self {
        self.sections.push(SectionDeclaration { path, optional: true, doc });
        self
    }

    /// A key with the default that `default()` holds.
    pub(crate) fn key<F: Field>(
        self,
        path: impl Into<Cow<'static, str>>,
        kind: Kind,
        doc: impl Into<Cow<'static, str>>,
        field: impl Fn(&mut T) -> &mut F + Copy + Send + Sync + 'static,
    ) -> Self {
        self.add(path.into(), kind, Presence::Default, doc.into(), field)
    }

    /// A key that must be there.
    pub(crate) fn required<F: Field>(
        self,
        path: impl Into<Cow<'static, str>>,
        kind: Kind,
        doc: impl Into<Cow<'static, str>>,
        field: impl Fn(&mut T) -> &mut F + Copy + Send + Sync + 'static,
    ) -> Self {
        self.add(path.into(), kind, Presence::Required, doc.into(), field)
    }

    /// A key that may be absent, and what that means.
    pub(crate) fn optional<F: Field>(
        self,
        path: impl Into<Cow<'static, str>>,
        kind: Kind,
        absent: &'static str,
        doc: impl Into<Cow<'static, str>>,
        field: impl Fn(&mut T) -> &mut F + Copy + Send + Sync + 'static,
    ) -> Self {
        self.add(path.into(), kind, Presence::Optional(absent), doc.into(), field)
    }

    fn add<F: Field>(
        mut self,
        path: Cow<'static, str>,
        kind: Kind,
        presence: Presence,
        doc: Cow<'static, str>,
        field: impl Fn(&mut T) -> &mut F + Copy + Send + Sync + 'static,
    ) -> Self {
        let take = move |target: &mut T, value: &Value| {
            F::take(value).map(|taken| *field(target) = taken).is_some()
        };
        let show = move |target: &mut T| field(target).show();
        let (take, show) = (Box::new(take), Box::new(show));
        self.keys.push(Key { path, kind, presence, doc, take, show });
        self
    }

    /// The defaults.
    pub(crate) fn default(&self) -> T {
        (self.default)()
    }

    /// The key of that path.
    pub(crate) fn find(&self, path: &str) -> Option<(usize, &Key<T>)> {
        self.keys.iter().enumerate().find(|(_, key)| key.path == path)
    }

    /// The optional table a path is in, if any.
    pub(crate) fn optional_table(&self, path: &str) -> Option<&'static str> {
        let inside = |section: &&SectionDeclaration| section.optional && within(path, section.path);
        self.sections.iter().find(inside).map(|section| section.path)
    }

    /// Whether keys or tables are declared below that path.
    pub(crate) fn is_table(&self, path: &str) -> bool {
        self.sections.iter().any(|section| section.path == path)
            || self.keys.iter().any(|key| within(&key.path, path))
    }

    /// What is declared, for people.
    pub(crate) fn declarations(&self) -> Vec<Declaration> {
        let mut base = self.default();
        self.keys.iter().map(|key| self.declaration(key, &mut base)).collect()
    }

    fn declaration(&self, key: &Key<T>, base: &mut T) -> Declaration {
        Declaration {
            file: self.file,
            path: key.path.to_string(),
            kind: key.kind,
            presence: key.presence,
            default: self.default_text(key, base),
            doc: key.doc.to_string(),
        }
    }

    fn default_text(&self, key: &Key<T>, base: &mut T) -> Option<String> {
        match key.presence {
            Presence::Required => None,
            Presence::Optional(absent) => Some(absent.to_owned()),
            Presence::Default => {
                let value = key.show(base)?;
                let mut text = value.to_string();
                for Variant { circumstance, default } in &self.variants {
                    let other = key.show(&mut default()).filter(|other| *other != value);
                    if let Some(other) = other {
                        text.push_str(&format!("; {circumstance}: {other}"));
                    }
                }
                Some(text)
            }
        }
    }
}

/// Whether a dotted path lies below a table.
fn within(path: &str, table: &str) -> bool {
    path.strip_prefix(table).is_some_and(|rest| rest.starts_with('.'))
}
