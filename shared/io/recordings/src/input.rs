//! Recorded readings of either kind, for replay.

use std::path::{Path, PathBuf};

use kerbside_messages::{Message, Raw, Truth};

use crate::drift::ReferencePose;
use crate::recording::{RecordingError, RecordingReader, Records};
use crate::run_folder::{self, RawStream, Run, RunError, stamp_of};

/// Why an input was refused.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// A run folder.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Neither of the two.
    #[error(
        "{}: nothing to replay; allowed: a run folder, a case folder with runs/, or an .mcap \
         recording", path.display()
    )]
    Nothing {
        /// What was given.
        path: PathBuf,
    },
    /// Nothing describes the vehicle.
    #[error(
        "{}: no description of the vehicle: {} is not there; give one",
        input.display(), path.display()
    )]
    NoVehicle {
        /// The run or recording.
        input: PathBuf,
        /// Where it was looked for.
        path: PathBuf,
    },
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
}

/// Something that can be replayed: one drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A run folder.
    Run(PathBuf),
    /// An MCAP recording.
    Recording(PathBuf),
}

/// The drives behind a path: a run folder is one, a case folder one for each of its runs in the
/// order of their names, any other file is a recording.
///
/// # Errors
/// [`InputError::Nothing`] where it is none of these.
pub fn sources(path: &Path) -> Result<Vec<Source>, InputError> {
    if path.is_file() {
        return Ok(vec![Source::Recording(path.into())]);
    }
    if run_folder::is_run(path) {
        return Ok(vec![Source::Run(path.into())]);
    }
    let runs: Vec<_> = run_folder::runs_of(path)?.into_iter().map(Source::Run).collect();
    if runs.is_empty() {
        return Err(InputError::Nothing { path: path.into() });
    }
    Ok(runs)
}

/// The text of a vehicle.toml.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VehicleText {
    /// Where it comes from, for error texts: a file, or a recording.
    pub origin: PathBuf,
    /// The text.
    pub text: String,
}

/// What an estimate is held against.
#[derive(Clone, Debug, PartialEq)]
pub enum Reference {
    /// Nothing is known but the counts.
    None,
    /// What a sensor reported of its marker, whose place vehicle.toml states.
    Marker(Vec<ReferencePose>),
    /// The simulated vehicle's true pose of the body itself.
    Truth(Vec<ReferencePose>),
}

#[derive(Debug)]
enum Content {
    Run(Box<Run>),
    Recording(Box<RecordingReader>),
}

/// A recorded drive, opened.
#[derive(Debug)]
pub struct RawInput {
    name: String,
    path: PathBuf,
    vehicle: VehicleText,
    content: Content,
}

impl RawInput {
    /// Opens `source`. The vehicle is described by the file `vehicle`, if one is given, else by the
    /// vehicle.toml two levels above a run or the one attached to a recording.
    ///
    /// # Errors
    /// Whatever in the files is not as it should be.
    pub fn open(source: &Source, vehicle: Option<&Path>) -> Result<Self, InputError> {
        Self::open_as(source, vehicle.map(read_vehicle).transpose()?)
    }

    /// The same with the text that describes the vehicle, where one is given.
    ///
    /// # Errors
    /// Whatever in the files is not as it should be.
    pub fn open_as(source: &Source, vehicle: Option<VehicleText>) -> Result<Self, InputError> {
        match source {
            Source::Run(path) => Self::open_run(path, vehicle),
            Source::Recording(path) => Self::open_recording(path, vehicle),
        }
    }

    fn open_run(path: &Path, vehicle: Option<VehicleText>) -> Result<Self, InputError> {
        let run = Run::read(path)?;
        let beside = run_folder::vehicle_of(path)?;
        if vehicle.is_none() && !beside.is_file() {
            return Err(InputError::NoVehicle { input: path.into(), path: beside });
        }
        let vehicle = vehicle.map_or_else(|| read_vehicle(&beside), Ok)?;
        let name = run.about.info.name.clone();
        Ok(Self { name, path: path.into(), vehicle, content: Content::Run(Box::new(run)) })
    }

    fn open_recording(path: &Path, vehicle: Option<VehicleText>) -> Result<Self, InputError> {
        let reader = RecordingReader::open(path)?;
        let attached = reader.provenance().vehicle.clone();
        let vehicle = match (vehicle, attached) {
            (Some(given), _) => given,
            (None, Some(text)) => VehicleText { origin: path.into(), text },
            (None, None) => {
                let missing = PathBuf::from("attachment vehicle.toml");
                return Err(InputError::NoVehicle { input: path.into(), path: missing });
            }
        };
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { name, path: path.into(), vehicle, content: Content::Recording(Box::new(reader)) })
    }

    /// Its name: the run's, or the recording's file without extension.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What describes the vehicle.
    #[must_use]
    pub fn vehicle(&self) -> &VehicleText {
        &self.vehicle
    }

    /// The run, where it is one.
    #[must_use]
    pub fn run(&self) -> Option<&Run> {
        match &self.content {
            Content::Run(run) => Some(run),
            Content::Recording(_) => None,
        }
    }

    /// What a person should know about the input, a sentence each.
    #[must_use]
    pub fn notices(&self) -> Vec<String> {
        self.run().map(Run::notices).unwrap_or_default()
    }

    /// Its readings from the beginning, in the order in which they arrived. They carry the stamps
    /// of the source: a run's begin at [`run_folder::BASE`], a recording's are the host's of then.
    ///
    /// # Errors
    /// [`InputError`] where the file cannot be opened again.
    pub fn raws(&self) -> Result<Raws<'_>, InputError> {
        Ok(match &self.content {
            Content::Run(run) => Raws::Run(run.raws()),
            Content::Recording(reader) => Raws::Recording(Box::new(reader.records(&[Raw::TOPIC])?)),
        })
    }

    /// What an estimate can be held against, with stamps as the readings have them.
    ///
    /// # Errors
    /// [`InputError`] where a recording is damaged.
    pub fn reference(&self) -> Result<Reference, InputError> {
        let (poses, kind): (Vec<_>, fn(_) -> _) = match &self.content {
            Content::Run(run) => (marker_poses(run), Reference::Marker),
            Content::Recording(reader) => (true_poses(reader)?, Reference::Truth),
        };
        Ok(if poses.is_empty() { Reference::None } else { kind(poses) })
    }
}

fn read_vehicle(path: &Path) -> Result<VehicleText, InputError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| InputError::Io { path: path.into(), source })?;
    Ok(VehicleText { origin: path.into(), text })
}

/// The rows of a run's reference that state a position.
fn marker_poses(run: &Run) -> Vec<ReferencePose> {
    let rows = run.reference.iter().flat_map(|table| &table.rows);
    rows.filter_map(|row| {
        Some(ReferencePose { stamp: stamp_of(row.t), x: row.x?, y: row.y?, yaw: row.yaw })
    })
    .collect()
}

fn true_poses(reader: &RecordingReader) -> Result<Vec<ReferencePose>, RecordingError> {
    let mut poses: Vec<ReferencePose> = Vec::new();
    reader.for_each(|truth: &Truth| {
        let stamp = truth.header.stamp;
        // A restarted vehicle may state the same instant again.
        if poses.last().is_none_or(|last| last.stamp < stamp) {
            poses.push(ReferencePose { stamp, x: truth.x, y: truth.y, yaw: Some(truth.yaw) });
        }
    })?;
    Ok(poses)
}

/// The readings of a [`RawInput`].
pub enum Raws<'a> {
    /// Of a run.
    Run(RawStream<'a>),
    /// Of a recording.
    Recording(Box<Records<'a>>),
}

impl Iterator for Raws<'_> {
    type Item = Result<Raw, InputError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self {
            Self::Run(stream) => stream.next().map(Ok),
            Self::Recording(records) => match records.next() {
                Ok(record) => record.and_then(|record| record.decode()).map(Ok),
                Err(error) => Some(Err(error.into())),
            },
        }
    }
}
