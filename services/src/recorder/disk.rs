//! The files that a recorder writes, one after the other.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use kerbside_recordings::recording::{Chunks, Provenance, RecordingWriter, WriteError};
use kerbside_runtime::now;
use kerbside_settings::{Compression, RecorderSettings};

use super::kept;
use crate::service::Service;

/// A recording in a file.
pub(super) type Writer = RecordingWriter<File>;

/// The recording on disk, while it can be written.
pub(super) struct Disk {
    place: Place,
    provenance: Provenance,
    settings: RecorderSettings,
    file: Open,
}

/// Where to record.
enum Place {
    /// In this one file, however large it grows: somebody waits for it under that name.
    File(PathBuf),
    /// In files of this instance's, the old ones giving way to the new.
    Folder { folder: PathBuf, instance: String },
}

enum Open {
    Yes { writer: Box<Writer>, path: PathBuf },
    No { why: String },
}

impl Disk {
    /// Begins a recording; where that fails, says so and records nothing.
    pub(super) fn create(service: &Service) -> Self {
        let settings = service.stack.recorder.clone();
        let (place, provenance) = (place(service), provenance(service));
        let mut disk = Self { place, provenance, settings, file: Open::No { why: String::new() } };
        disk.begin();
        disk
    }

    /// Whether anything is being recorded.
    pub(super) fn is_open(&self) -> bool {
        matches!(self.file, Open::Yes { .. })
    }

    /// What to write to.
    pub(super) fn writer(&mut self) -> Option<&mut Writer> {
        match &mut self.file {
            Open::Yes { writer, .. } => Some(writer),
            Open::No { .. } => None,
        }
    }

    /// Why nothing is recorded.
    pub(super) fn why(&self) -> &str {
        match &self.file {
            Open::Yes { .. } => "",
            Open::No { why } => why,
        }
    }

    /// Nothing more is recorded, because of `error`.
    pub(super) fn fail(&mut self, error: &WriteError) {
        let Open::Yes { path, .. } = &self.file else { return };
        tracing::error!(path = %path.display(), %error, "recording ends here; everything else goes on");
        self.file = Open::No { why: format!("recording ended: {}", short(error)) };
    }

    /// Closes a file that has grown as large as one may be, and begins the next; whether it did.
    pub(super) fn begin_next_if_full(&mut self) -> bool {
        let (Open::Yes { path, .. }, Place::Folder { .. }) = (&self.file, &self.place) else {
            return false;
        };
        let size = fs::metadata(path).map_or(0, |file| file.len());
        let full = size >= self.settings.file_bytes;
        if full {
            self.close(0);
            self.begin();
        }
        full
    }

    /// Completes the file; `lost` samples are missing in the recording.
    pub(super) fn close(&mut self, lost: u64) {
        let Open::Yes { writer, path } = &mut self.file else { return };
        match writer.finish() {
            Ok(closed) => {
                let (messages, chunks) = (closed.messages, closed.chunks);
                tracing::info!(path = %path.display(), messages, chunks, lost, "recording closed");
            }
            Err(error) => {
                tracing::error!(path = %path.display(), %error, "recording not closed; recording recover reads it");
            }
        }
    }

    /// Makes room, and begins a file.
    fn begin(&mut self) {
        let path = free_path(&self.path());
        if let Place::Folder { folder, instance } = &self.place {
            kept::make_room(folder, instance, &self.settings);
        }
        let chunks = Chunks {
            bytes: self.settings.chunk_size as usize,
            compressed: self.settings.compression == Compression::Lz4,
        };
        let opened = path.parent().map_or(Ok(()), fs::create_dir_all).map_err(WriteError::from);
        let opened = opened.and_then(|()| {
            RecordingWriter::create_in_chunks(&path, &self.provenance, now(), chunks)
        });
        self.file = match opened {
            Ok(writer) => {
                tracing::info!(path = %path.display(), "recording");
                Open::Yes { writer: Box::new(writer), path }
            }
            Err(error) => {
                tracing::error!(path = %path.display(), %error, "no recording; everything else goes on");
                Open::No { why: format!("no recording: {}", short(&error)) }
            }
        };
    }

    fn path(&self) -> PathBuf {
        match &self.place {
            Place::File(path) => path.clone(),
            Place::Folder { folder, instance } => {
                folder.join(format!("{instance}-{}.mcap", crate::output::stamp()))
            }
        }
    }
}

/// Where to record: as asked for, else in the configured folder, else in the user's state folder.
fn place(service: &Service) -> Place {
    if let Some(path) = &service.args.recording {
        return Place::File(path.clone());
    }
    let configured = service.stack.recorder.folder.clone();
    let folder = configured.unwrap_or_else(|| crate::output::state_folder().join("recordings"));
    Place::Folder { folder, instance: service.instance.name().to_owned() }
}

/// A restarted recorder must not overwrite what its predecessor saved.
fn free_path(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let numbered = |number: u32| path.with_file_name(format!("{stem}-{number}.mcap"));
    core::iter::once(path.to_owned())
        .chain((2..).map(numbered))
        .find(|path| !path.exists())
        .unwrap_or_default()
}

fn provenance(service: &Service) -> Provenance {
    Provenance {
        version: Some(env!("CARGO_PKG_VERSION").to_owned()),
        instance: Some(service.instance.name().to_owned()),
        scenario: service.args.scenario.clone(),
        vehicle: Some(service.stack.vehicle_text.clone()),
        stack: Some(service.stack_text.clone()),
        ..Provenance::default()
    }
}

/// The error in the few words that a heartbeat has room for.
fn short(error: &WriteError) -> String {
    match error {
        WriteError::DiskFull(_) => "the disk is full".to_owned(),
        WriteError::FileTooLarge(_) => "the file may not grow".to_owned(),
        WriteError::Io(error) => error.kind().to_string(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use kerbside_messages::Heartbeat;

    use super::*;

    #[test]
    fn what_ends_a_recording_fits_a_heartbeat() {
        let errors = [
            std::io::ErrorKind::StorageFull,
            std::io::ErrorKind::FileTooLarge,
            std::io::ErrorKind::PermissionDenied,
        ];
        for kind in errors {
            let words = format!("recording ended: {}", short(&std::io::Error::from(kind).into()));
            assert!(words.len() <= Heartbeat::default().text.len(), "{words}");
        }
    }

    #[test]
    fn a_successor_takes_another_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        assert_eq!(free_path(&path), path);
        fs::write(&path, "").unwrap();
        fs::write(folder.path().join("run-2.mcap"), "").unwrap();
        assert_eq!(free_path(&path), folder.path().join("run-3.mcap"));
    }
}
