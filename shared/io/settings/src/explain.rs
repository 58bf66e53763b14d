//! What every key is, from its declaration.

use crate::declare::{Declaration, Presence, Schema, SectionDeclaration, nearest};
use crate::{SettingsError, run, scenario, stack, vehicle};

/// The keys of one kind of file.
struct File {
    name: &'static str,
    sections: Vec<SectionDeclaration>,
    keys: Vec<Declaration>,
}

impl File {
    fn of<T>(schema: &Schema<T>) -> Self {
        let (name, sections) = (schema.file, schema.sections.clone());
        Self { name, sections, keys: schema.declarations() }
    }
}

fn files() -> [File; 4] {
    [
        File::of(stack::schema()),
        File::of(vehicle::schema()),
        File::of(scenario::schema()),
        File::of(run::schema()),
    ]
}

/// Every declared key, in the order of the reference page.
#[must_use]
pub fn declarations() -> Vec<Declaration> {
    files().into_iter().flat_map(|file| file.keys).collect()
}

/// What a key is. `key` is a dotted path, or a table for all keys below it.
///
/// # Errors
/// [`SettingsError::UnknownKey`] with the nearest declared key.
pub fn explain(key: &str) -> Result<String, SettingsError> {
    let all = declarations();
    let below = format!("{key}.");
    let wanted =
        |declared: &&Declaration| declared.path == key || declared.path.starts_with(&below);
    let texts: Vec<_> = all.iter().filter(wanted).map(explain_one).collect();
    if texts.is_empty() {
        let near = nearest(key, all.iter().map(|declared| declared.path.as_str()));
        let (key, nearest) = (key.to_owned(), near.map(str::to_owned));
        return Err(SettingsError::UnknownKey { key, nearest });
    }
    Ok(texts.join("\n"))
}

/// What every key is.
#[must_use]
pub fn explain_all() -> String {
    declarations().iter().map(explain_one).collect::<Vec<_>>().join("\n")
}

fn explain_one(key: &Declaration) -> String {
    format!(
        "{} ({})\n    {}\n    allowed: {}\n    {}\n",
        key.path,
        key.file,
        key.doc,
        key.kind,
        absence(key)
    )
}

fn absence(key: &Declaration) -> String {
    match (&key.presence, &key.default) {
        (Presence::Default, Some(default)) => format!("default: {default}"),
        (Presence::Optional(absent), _) => format!("absent: {absent}"),
        _ => "required".to_owned(),
    }
}

/// The reference page of all keys, in Markdown.
#[must_use]
pub fn reference() -> String {
    let mut page = String::from(
        "# Configuration keys\n\nGenerated from the declarations that also check the files: \
         `kerbside config explain --all` says the same.\n",
    );
    for file in files() {
        page.push_str(&format!("\n## {}\n", file.name));
        for section in &file.sections {
            add_section(&mut page, &file, section);
        }
    }
    page
}

fn add_section(page: &mut String, file: &File, section: &SectionDeclaration) {
    if !section.path.is_empty() {
        page.push_str(&format!("\n### [{}]\n", section.path));
    }
    page.push_str(&format!("\n{}\n", section.doc));
    let mut keys = file.keys.iter().filter(|key| home(file, key) == section.path).peekable();
    if keys.peek().is_some() {
        page.push_str("\n| key | allowed | without it | meaning |\n|---|---|---|---|\n");
    }
    for key in keys {
        let cells = [key.kind.to_string(), absence(key), key.doc.clone()];
        let cells = cells.map(|cell| cell.replace('|', "\\|"));
        page.push_str(&format!("| `{}` | {} |\n", key.path, cells.join(" | ")));
    }
}

/// The innermost declared table that a key is in.
fn home(file: &File, key: &Declaration) -> &'static str {
    let inside = |section: &&SectionDeclaration| {
        key.path.strip_prefix(section.path).is_some_and(|rest| rest.starts_with('.'))
    };
    let innermost = file.sections.iter().filter(inside).max_by_key(|section| section.path.len());
    innermost.map_or("", |section| section.path)
}
