//! The effective configuration, each value with its origin.

use core::fmt;

use super::{Presence, Reading, Value};
use crate::problem::{Problem, SettingsError};

/// Where an effective value comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A file gives it.
    File {
        /// The file, as it was named.
        file: String,
        /// The line, from 1.
        line: usize,
    },
    /// The declared default.
    Default,
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { file, line } => write!(f, "{file}:{line}"),
            Self::Default => f.write_str("default"),
        }
    }
}

/// An effective value.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Dotted key.
    pub key: String,
    /// The value.
    pub value: Value,
    /// Where it comes from.
    pub origin: Origin,
    /// What it would be under other circumstances.
    pub note: Option<String>,
}

/// What a file was read as, with the effective value of every key.
#[derive(Clone, Debug)]
pub struct Loaded<T> {
    /// The typed value.
    pub value: T,
    /// The file, as messages name it.
    pub file: String,
    /// What is suspicious but not refused.
    pub warnings: Vec<Problem>,
    /// Every key that has a value, in the order of their declaration.
    pub settings: Vec<Setting>,
}

impl<T> Loaded<T> {
    /// The effective file in TOML, each line with the origin of its value.
    #[must_use]
    pub fn show(&self) -> String {
        let mut text = format!("# {}\n", self.file);
        let mut tables: Vec<&str> = Vec::new();
        for setting in &self.settings {
            let table = split(&setting.key).0;
            if !tables.contains(&table) {
                tables.push(table);
            }
        }
        // Keys at the top would belong to the table before them, if one came first.
        tables.sort_by_key(|table| !table.is_empty());
        for table in tables {
            self.show_table(table, &mut text);
        }
        text
    }

    fn show_table(&self, table: &str, text: &mut String) {
        if !table.is_empty() {
            text.push_str(&format!("\n[{table}]\n"));
        }
        for setting in self.settings.iter().filter(|setting| split(&setting.key).0 == table) {
            let line = format!("{} = {}", split(&setting.key).1, setting.value);
            text.push_str(&format!("{line:<40} # {}", setting.origin));
            if let Some(note) = &setting.note {
                text.push_str(&format!("; {note}"));
            }
            text.push('\n');
        }
    }
}

fn split(key: &str) -> (&str, &str) {
    key.rsplit_once('.').unwrap_or(("", key))
}

impl<T> Reading<'_, T> {
    /// The effective values of `target`, into which the file was applied.
    pub(crate) fn settings(&self, target: &mut T) -> Vec<Setting> {
        let keys = self.schema().keys.iter().enumerate();
        keys.filter_map(|(index, key)| {
            let line = self.line(index);
            let table = self.schema().optional_table(&key.path);
            let absent = table.is_some_and(|table| !self.has(table));
            if line.is_none() && (absent || key.presence == Presence::Required) {
                return None;
            }
            let file = self.file.name.clone();
            let origin = line.map_or(Origin::Default, |line| Origin::File { file, line });
            let value = key.show(target)?;
            Some(Setting { key: key.path.to_string(), value, origin, note: None })
        })
        .collect()
    }

    /// What was read: `value` if no error was found, else all problems.
    pub(crate) fn finish<V>(
        self,
        value: Option<V>,
        settings: Vec<Setting>,
    ) -> Result<Loaded<V>, SettingsError> {
        let (file, sound) = (self.file.name.clone(), self.is_sound());
        let problems = self.into_problems();
        match value {
            Some(value) if sound => Ok(Loaded { value, file, warnings: problems, settings }),
            _ => Err(SettingsError::Refused(problems)),
        }
    }
}
