//! Which recordings are kept: the newest that the configuration has room for, and none that are too old.

use core::cmp::Reverse;
use core::time::Duration;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use kerbside_settings::RecorderSettings;

/// Seconds of a day.
const DAY: u64 = 86_400;
/// Digits that seconds of the epoch have at least, in names of files.
const SECONDS_DIGITS: usize = 9;

/// A recording that nobody writes to any more.
#[derive(Clone, Debug, PartialEq)]
struct Recording {
    path: PathBuf,
    bytes: u64,
    written: SystemTime,
}

/// Removes the oldest recordings of `instance` in `folder`, whole ones, until one of the largest size has room within
/// `keep_bytes`, and those that were last written longer than `keep_days` ago. Called while no file is open.
pub(super) fn make_room(folder: &Path, instance: &str, settings: &RecorderSettings) {
    if settings.keep_bytes.is_none() && settings.keep_days.is_none() {
        return;
    }
    let doomed = doomed(recordings(folder, instance), settings, SystemTime::now());
    for Recording { path, bytes, .. } in doomed {
        match fs::remove_file(&path) {
            Ok(()) => tracing::info!(path = %path.display(), bytes, "old recording removed"),
            Err(error) => {
                tracing::warn!(path = %path.display(), %error, "an old recording cannot be removed");
            }
        }
    }
}

/// The recordings that have to go.
fn doomed(
    mut recordings: Vec<Recording>,
    settings: &RecorderSettings,
    now: SystemTime,
) -> Vec<Recording> {
    recordings.sort_by_key(|recording| Reverse((recording.written, recording.path.clone())));
    let room = settings.keep_bytes.map(|keep| keep.saturating_sub(settings.file_bytes));
    let age = settings.keep_days.map(|days| Duration::from_secs(u64::from(days) * DAY));
    let mut kept = 0_u64;
    let has_to_go = |recording: &Recording| {
        kept = kept.saturating_add(recording.bytes);
        // A clock that was set back makes no recording old.
        let passed = now.duration_since(recording.written).unwrap_or_default();
        room.is_some_and(|room| kept > room) || age.is_some_and(|age| passed > age)
    };
    recordings.into_iter().filter(has_to_go).collect()
}

/// The recordings of `instance` in `folder`; other files, and what links lead to, are nobody's business here.
fn recordings(folder: &Path, instance: &str) -> Vec<Recording> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let recording = |entry: fs::DirEntry| {
        let metadata = entry.metadata().ok().filter(fs::Metadata::is_file)?;
        is_named(entry.file_name().to_str()?, instance).then_some(())?;
        let written = metadata.modified().ok()?;
        Some(Recording { path: entry.path(), bytes: metadata.len(), written })
    };
    entries.flatten().filter_map(recording).collect()
}

/// Whether a recorder of `instance` gave a file this name: INSTANCE-SECONDS-PID.mcap, perhaps with a number behind.
fn is_named(name: &str, instance: &str) -> bool {
    let stamp = name.strip_prefix(instance).and_then(|rest| rest.strip_prefix('-'));
    let Some(stamp) = stamp.and_then(|rest| rest.strip_suffix(".mcap")) else { return false };
    let parts: Vec<&str> = stamp.split('-').collect();
    let numbers = parts
        .iter()
        .all(|part| !part.is_empty() && part.bytes().all(|letter| letter.is_ascii_digit()));
    numbers && matches!(parts.len(), 2 | 3) && parts[0].len() >= SECONDS_DIGITS
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(file: u64, keep: Option<u64>, days: Option<u32>) -> RecorderSettings {
        RecorderSettings {
            file_bytes: file,
            keep_bytes: keep,
            keep_days: days,
            ..RecorderSettings::default()
        }
    }

    fn recording(number: u64, bytes: u64, days: u64) -> Recording {
        let written = SystemTime::UNIX_EPOCH + Duration::from_secs((1000 - days) * DAY + number);
        Recording { path: format!("car-1700000000-{number}.mcap").into(), bytes, written }
    }

    fn gone(recordings: &[Recording], settings: &RecorderSettings) -> Vec<String> {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(1000 * DAY + 60);
        let doomed = doomed(recordings.to_vec(), settings, now);
        doomed.iter().map(|gone| gone.path.display().to_string()).collect()
    }

    #[test]
    fn the_oldest_give_way_until_the_next_one_has_room() {
        let all = [recording(1, 40, 3), recording(3, 30, 1), recording(2, 50, 2)];
        assert!(gone(&all, &settings(10, None, None)).is_empty());
        assert!(gone(&all, &settings(10, Some(130), None)).is_empty());
        let oldest = "car-1700000000-1.mcap";
        assert_eq!(gone(&all, &settings(10, Some(129), None)), [oldest]);
        assert_eq!(gone(&all, &settings(40, Some(80), None)).len(), 2);
        assert_eq!(gone(&all, &settings(100, Some(100), None)).len(), 3);
    }

    #[test]
    fn what_is_older_than_so_many_days_goes() {
        let all = [recording(1, 1, 31), recording(2, 1, 29), recording(3, 1, 30)];
        assert_eq!(gone(&all, &settings(1, None, Some(30))).len(), 2);
        assert_eq!(gone(&all, &settings(1, None, Some(31))), ["car-1700000000-1.mcap"]);
        assert!(gone(&all, &settings(1, None, Some(32))).is_empty());
        // The clock was set back.
        let ahead = Recording { written: SystemTime::now(), ..recording(4, 1, 0) };
        assert!(gone(&[ahead], &settings(1, None, Some(1))).is_empty());
    }

    #[test]
    fn only_files_of_this_instance_are_looked_at() {
        let ours = ["bay-1700000000-7.mcap", "bay-1700000000-7-2.mcap"];
        assert!(ours.iter().all(|name| is_named(name, "bay")));
        for other in [
            "bay-2-1700000000-7.mcap",
            "bay-1700000000.mcap",
            "bay-1700000000-7.mcap.part",
            "bay-1700000000-x.mcap",
            "bay-1700000000-7-2-3.mcap",
            "bay-1700000000-.mcap",
            "other-1700000000-7.mcap",
            "bay.mcap",
        ] {
            assert!(!is_named(other, "bay"), "{other}");
        }
    }

    #[test]
    fn nothing_but_recordings_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["car-1700000000-1.mcap", "car-1700000000-2.mcap", "notes.txt", "tour.mcap"] {
            fs::write(at(name), [0; 100]).unwrap();
        }
        fs::create_dir(at("car-1700000000-3.mcap")).unwrap();
        std::os::unix::fs::symlink(at("tour.mcap"), at("car-1700000000-4.mcap")).unwrap();
        make_room(folder.path(), "car", &settings(50, Some(160), None));
        assert!(!at("car-1700000000-1.mcap").exists());
        for name in ["car-1700000000-2.mcap", "notes.txt", "tour.mcap", "car-1700000000-3.mcap"] {
            assert!(at(name).exists(), "{name}");
        }
        assert!(at("car-1700000000-4.mcap").is_symlink());
        // A folder that is not there yet has nothing old in it.
        make_room(&at("none"), "car", &settings(50, Some(160), None));
    }
}
