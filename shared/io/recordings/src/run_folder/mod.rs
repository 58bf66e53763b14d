//! Run folders: one uninterrupted drive as text files that a spreadsheet, numpy or a
//! microcontroller can write.
//!
//! `CASE/runs/NAME/` holds `run.toml`, `encoders.csv` or `wheels.csv`, and where there are any
//! `steering.csv`, `imu.csv`, `commands.csv` and `reference.csv`; `CASE/vehicle.toml` describes
//! the vehicle. Reading is strict: what is not as the format says is an error that names file,
//! line, column, what was found and what is allowed. An empty field is a missing value, never 0.

mod error;
mod field;
mod info;
mod rows;
mod stream;
mod table;

use std::path::{Path, PathBuf};

pub use error::RunError;
pub use field::Allowed;
pub use info::RunFile;
pub use rows::{CommandRow, CountRow, GyroRow, Needed, ReferenceRow, Row, SpeedRow, SteeringRow};
pub use stream::{BASE, RawStream, stamp_of};
pub use table::{Further, Table};

/// A run in memory. A file that the folder lacks is none.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// run.toml.
    pub about: RunFile,
    /// encoders.csv.
    pub encoders: Option<Table<CountRow>>,
    /// wheels.csv.
    pub wheels: Option<Table<SpeedRow>>,
    /// steering.csv.
    pub steering: Option<Table<SteeringRow>>,
    /// imu.csv.
    pub gyro: Option<Table<GyroRow>>,
    /// commands.csv.
    pub commands: Option<Table<CommandRow>>,
    /// reference.csv.
    pub reference: Option<Table<ReferenceRow>>,
}

impl Run {
    /// The run in `folder`.
    ///
    /// # Errors
    /// Whatever in the folder is not as the format says.
    pub fn read(folder: &Path) -> Result<Self, RunError> {
        let run = Self {
            about: read_about(folder)?,
            encoders: Table::read(folder)?,
            wheels: Table::read(folder)?,
            steering: Table::read(folder)?,
            gyro: Table::read(folder)?,
            commands: Table::read(folder)?,
            reference: Table::read(folder)?,
        };
        if run.encoders.is_none() && run.wheels.is_none() {
            return Err(RunError::NoWheels { path: folder.into() });
        }
        Ok(run)
    }

    /// Writes the run into `folder`, which is made where it is missing.
    ///
    /// # Errors
    /// [`RunError::Io`] where the operating system refuses.
    pub fn write(&self, folder: &Path) -> Result<(), RunError> {
        let io = |path: &Path| {
            let path = path.to_owned();
            |source| RunError::Io { path, source }
        };
        std::fs::create_dir_all(folder).map_err(io(folder))?;
        let info = folder.join("run.toml");
        std::fs::write(&info, &self.about.text).map_err(io(&info))?;
        write_table(folder, self.encoders.as_ref())?;
        write_table(folder, self.wheels.as_ref())?;
        write_table(folder, self.steering.as_ref())?;
        write_table(folder, self.gyro.as_ref())?;
        write_table(folder, self.commands.as_ref())?;
        write_table(folder, self.reference.as_ref())
    }

    /// Its readings in order of time.
    #[must_use]
    pub fn raws(&self) -> RawStream<'_> {
        RawStream::new(self)
    }

    /// What a person should know: one sentence for each file with columns that are not used, and
    /// one where two files say how the wheels turned.
    #[must_use]
    pub fn notices(&self) -> Vec<String> {
        let mut notices = Vec::new();
        note_further(self.encoders.as_ref(), &mut notices);
        note_further(self.wheels.as_ref(), &mut notices);
        note_further(self.steering.as_ref(), &mut notices);
        note_further(self.gyro.as_ref(), &mut notices);
        note_further(self.commands.as_ref(), &mut notices);
        note_further(self.reference.as_ref(), &mut notices);
        if self.encoders.is_some() && self.wheels.is_some() {
            notices.push("wheels.csv is not used: encoders.csv is there".to_owned());
        }
        notices
    }
}

fn note_further<R: Row>(table: Option<&Table<R>>, notices: &mut Vec<String>) {
    let names: Vec<&str> =
        table.into_iter().flat_map(|table| &table.further).map(|column| &*column.name).collect();
    if !names.is_empty() {
        let plural = if names.len() == 1 { "column" } else { "columns" };
        notices.push(format!("{}: {plural} {} not used", R::FILE, names.join(", ")));
    }
}

fn write_table<R: Row>(folder: &Path, table: Option<&Table<R>>) -> Result<(), RunError> {
    let Some(table) = table else { return Ok(()) };
    let path = folder.join(R::FILE);
    std::fs::write(&path, table.to_text()).map_err(|source| RunError::Io { path, source })
}

/// The folder's own name, also where it is given as `.` or through a link.
fn folder_name(folder: &Path) -> Result<String, RunError> {
    let full =
        folder.canonicalize().map_err(|source| RunError::Io { path: folder.into(), source })?;
    Ok(full.file_name().unwrap_or_default().to_string_lossy().into_owned())
}

fn read_about(folder: &Path) -> Result<RunFile, RunError> {
    let expected = folder_name(folder)?;
    let path = folder.join("run.toml");
    let text = std::fs::read_to_string(&path)
        .map_err(|source| RunError::Io { path: path.clone(), source })?;
    let about = RunFile::parse(&path, text)?;
    if about.info.name != expected {
        return Err(RunError::Name { path, found: about.info.name, expected });
    }
    Ok(about)
}

/// Whether `folder` looks like a run's.
#[must_use]
pub fn is_run(folder: &Path) -> bool {
    ["run.toml", CountRow::FILE, SpeedRow::FILE].iter().any(|file| folder.join(file).is_file())
}

/// The run folders of the case `folder`, by name; none where it is no case.
///
/// # Errors
/// [`RunError::Io`] where the operating system refuses.
pub fn runs_of(folder: &Path) -> Result<Vec<PathBuf>, RunError> {
    runs_in(&folder.join("runs"))
}

/// The run folders in the folder `runs`, by name; none where there is no such folder.
///
/// # Errors
/// [`RunError::Io`] where the operating system refuses.
pub fn runs_in(runs: &Path) -> Result<Vec<PathBuf>, RunError> {
    if !runs.is_dir() {
        return Ok(Vec::new());
    }
    let io = |source| RunError::Io { path: runs.to_owned(), source };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(runs).map_err(io)? {
        let path = entry.map_err(io)?.path();
        if is_run(&path) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// Where the vehicle of the run in `folder` is described: two levels up.
///
/// # Errors
/// [`RunError::Io`] where there is no such folder.
pub fn vehicle_of(folder: &Path) -> Result<PathBuf, RunError> {
    let full =
        folder.canonicalize().map_err(|source| RunError::Io { path: folder.into(), source })?;
    let case = full.ancestors().nth(2).unwrap_or(&full);
    Ok(case.join("vehicle.toml"))
}

#[cfg(test)]
mod tests;
