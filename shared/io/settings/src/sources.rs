//! Where configuration is looked for: a given path, `./config`, `/etc/kerbside`, then what is
//! compiled in.

use std::fs;
use std::path::{Path, PathBuf};

use crate::declare::SourceFile;
use crate::{SettingsError, nearest};

/// The three kinds of files that have names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// `NAME.toml`.
    Stack,
    /// `vehicles/NAME.toml`.
    Vehicle,
    /// `scenarios/NAME.toml`.
    Scenario,
}

impl FileKind {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::Stack, Self::Vehicle, Self::Scenario];

    /// The word for it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stack => "stack",
            Self::Vehicle => "vehicle",
            Self::Scenario => "scenario",
        }
    }

    const fn folder(self) -> &'static str {
        match self {
            Self::Stack => "",
            Self::Vehicle => "vehicles",
            Self::Scenario => "scenarios",
        }
    }
}

/// Path under `config/` and text of each file that is compiled in.
macro_rules! compiled_in {
    ($($path:literal),+ $(,)?) => {
        &[$((
            $path,
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../config/", $path)),
        )),+]
    };
}

/// What is compiled in, so that an installed executable runs without any file.
pub const COMPILED_IN: &[(&str, &str)] = compiled_in![
    "stack.toml",
    "stack-full-size.toml",
    "vehicles/full-size.toml",
    "vehicles/paper-1-6.toml",
    "scenarios/garage.toml",
    "scenarios/garage-full-size.toml",
    "scenarios/parallel.toml",
    "scenarios/parallel-full-size.toml",
];

/// How messages name a file that is compiled in.
const COMPILED_IN_PREFIX: &str = "<compiled in>/";

/// The places where configuration is looked for, the first one first.
#[derive(Clone, Debug)]
pub struct Sources {
    folders: Vec<PathBuf>,
    stack: Option<PathBuf>,
}

impl Sources {
    /// The usual places; before them `given`, a folder like `config/` or a stack's file, where
    /// there is one.
    ///
    /// # Errors
    /// [`SettingsError::Unreadable`] where `given` is not there.
    pub fn new(given: Option<&Path>) -> Result<Self, SettingsError> {
        let usual = [PathBuf::from("config"), PathBuf::from("/etc/kerbside")];
        Self::in_folders(given, &usual)
    }

    /// The same with other usual places.
    ///
    /// # Errors
    /// [`SettingsError::Unreadable`] where `given` is not there.
    pub fn in_folders(given: Option<&Path>, usual: &[PathBuf]) -> Result<Self, SettingsError> {
        let mut sources = Self { folders: Vec::new(), stack: None };
        if let Some(given) = given {
            let metadata = fs::metadata(given).map_err(|error| unreadable(given, &error))?;
            if metadata.is_dir() {
                sources.folders.push(given.to_owned());
            } else {
                let folder = given.parent().filter(|folder| !folder.as_os_str().is_empty());
                sources.folders.push(folder.unwrap_or(Path::new(".")).to_owned());
                sources.stack = Some(given.to_owned());
            }
        }
        sources.folders.extend_from_slice(usual);
        Ok(sources)
    }

    /// What is compiled in, and nothing else.
    #[must_use]
    pub const fn compiled_in() -> Self {
        Self { folders: Vec::new(), stack: None }
    }

    /// The names that can be found, each kind's in order.
    #[must_use]
    pub fn names(&self, kind: FileKind) -> Vec<String> {
        let mut names: Vec<_> =
            self.folders.iter().flat_map(|place| names_in(place, kind)).collect();
        let compiled_in = COMPILED_IN.iter().filter_map(|(path, _)| name_of(path, kind));
        names.extend(compiled_in.map(str::to_owned));
        names.sort();
        names.dedup();
        names
    }

    /// The stack's file that was given, if one was.
    pub(crate) fn given_stack(&self) -> Option<Result<SourceFile, SettingsError>> {
        self.stack.as_deref().map(read)
    }

    /// The file that `reference` names: a path, relative to the file `from` it stands in, or a name
    /// to look for. Also takes what messages call a file, [`SourceFile::name`].
    pub(crate) fn find(
        &self,
        kind: FileKind,
        reference: &str,
        from: Option<&SourceFile>,
    ) -> Result<SourceFile, SettingsError> {
        if let Some(path) = reference.strip_prefix(COMPILED_IN_PREFIX) {
            let file = COMPILED_IN.iter().find(|(known, _)| *known == path);
            let missing = || unreadable(Path::new(reference), &"not compiled in");
            return file.map(|(path, text)| compiled_in_file(path, text)).ok_or_else(missing);
        }
        if reference.contains('/') || reference.ends_with(".toml") {
            let folder = from.and_then(|file| file.folder.as_deref()).unwrap_or(Path::new(""));
            return read(&folder.join(reference));
        }
        let path = |place: &PathBuf| place.join(kind.folder()).join(format!("{reference}.toml"));
        if let Some(path) = self.folders.iter().map(path).find(|path| path.is_file()) {
            return read(&path);
        }
        let compiled_in =
            COMPILED_IN.iter().find(|(path, _)| name_of(path, kind) == Some(reference));
        compiled_in.map(|(path, text)| compiled_in_file(path, text)).ok_or_else(|| {
            let mut known = self.names(kind);
            // The one that was meant comes first.
            if let Some(near) = nearest(reference, known.iter().map(String::as_str)) {
                let near = near.to_owned();
                known.sort_by_key(|name| (*name != near, name.clone()));
            }
            let (name, searched) = (reference.to_owned(), self.searched(kind));
            SettingsError::NotFound { kind: kind.name(), name, searched, known }
        })
    }

    fn searched(&self, kind: FileKind) -> Vec<String> {
        let folders =
            self.folders.iter().map(|place| place.join(kind.folder()).display().to_string());
        folders.chain(["what is compiled in".to_owned()]).collect()
    }
}

fn compiled_in_file(path: &str, text: &str) -> SourceFile {
    SourceFile { name: format!("{COMPILED_IN_PREFIX}{path}"), text: text.into(), folder: None }
}

/// The name of a file of that kind from its path under a configuration folder.
fn name_of(path: &str, kind: FileKind) -> Option<&str> {
    let (folder, name) = path.rsplit_once('/').unwrap_or(("", path));
    let name = name.strip_suffix(".toml").filter(|_| folder == kind.folder())?;
    (kind != FileKind::Stack || name.starts_with("stack")).then_some(name)
}

fn names_in(place: &Path, kind: FileKind) -> Vec<String> {
    let Ok(entries) = fs::read_dir(place.join(kind.folder())) else { return Vec::new() };
    let path = |file: &str| match kind.folder() {
        "" => file.to_owned(),
        folder => format!("{folder}/{file}"),
    };
    entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter_map(|file| name_of(&path(&file), kind).map(str::to_owned))
        .collect()
}

/// Reads a file of configuration.
pub(crate) fn read(path: &Path) -> Result<SourceFile, SettingsError> {
    let bytes = fs::read(path).map_err(|error| unreadable(path, &error))?;
    let text = String::from_utf8(bytes).map_err(|error| unreadable(path, &error))?;
    let folder = path.parent().map(Path::to_owned);
    Ok(SourceFile { name: path.display().to_string(), text: text.into(), folder })
}

fn unreadable(path: &Path, error: &impl ToString) -> SettingsError {
    SettingsError::Unreadable { path: path.to_owned(), reason: error.to_string() }
}
