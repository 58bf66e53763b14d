//! run.toml.

use std::path::Path;

use kerbside_settings::{RunInfo, SettingsError, parse_run};

/// A run.toml: what it says, and its text, so that it can be written again as it was.
#[derive(Clone, Debug, PartialEq)]
pub struct RunFile {
    /// What it says.
    pub info: RunInfo,
    /// The whole file.
    pub text: String,
}

impl RunFile {
    /// Of a run called `name` of which nothing else is known.
    #[must_use]
    pub fn new(name: &str) -> Self {
        let text = format!("name = {}\n", toml::Value::String(name.to_owned()));
        Self { info: RunInfo { name: name.to_owned(), ..RunInfo::default() }, text }
    }

    /// From the text of the file `path`.
    ///
    /// # Errors
    /// [`SettingsError`] with every problem of the file.
    pub fn parse(path: &Path, text: String) -> Result<Self, SettingsError> {
        let info = parse_run(&path.display().to_string(), &text)?.value;
        Ok(Self { info, text })
    }
}
