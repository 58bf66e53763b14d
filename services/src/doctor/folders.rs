//! Shared memory, the run-time folder, and where recordings go.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use kerbside_runtime::Instance;
use kerbside_settings::Stack;
use rustix::fs::{Access, access, statvfs};

use super::Check;
use crate::commands::DEFAULT_INSTANCE;
use crate::output::state_folder;

/// Where the middleware keeps samples.
const SHARED_MEMORY: &str = "/dev/shm";
/// What a stack needs of it \[byte\]: twice what the shipped one was seen to take.
const STACK_BYTES: u64 = 64 << 20;

/// All of them.
pub(super) fn all(stack: Option<&Stack>) -> Vec<Check> {
    let mut found = vec![shared_memory(Path::new(SHARED_MEMORY)), run_time()];
    found.extend(stack.filter(|stack| stack.recorder.enabled).map(recordings));
    found
}

/// Bytes as people write them.
pub(super) fn size(bytes: u64) -> String {
    const UNITS: [&str; 4] = ["kB", "MB", "GB", "TB"];
    let mut value = bytes as f64 / 1e3;
    let mut units = UNITS.into_iter();
    let mut unit = units.next().unwrap_or_default();
    for next in units {
        if value < 1000.0 {
            break;
        }
        (value, unit) = (value / 1e3, next);
    }
    if value < 10.0 { format!("{value:.1} {unit}") } else { format!("{value:.0} {unit}") }
}

/// Bytes that a user without privileges may still write where `path` lies.
fn free(path: &Path) -> Option<u64> {
    let space = statvfs(path).ok()?;
    Some(space.f_bavail.saturating_mul(space.f_frsize))
}

fn shared_memory(path: &Path) -> Check {
    const NAME: &str = "shared memory";
    let (place, mount) =
        (path.display(), format!("mount -t tmpfs -o mode=1777 tmpfs {}", path.display()));
    let Some(free) = free(path) else {
        return Check::lacking(NAME, format!("{place} is not there"), mount);
    };
    let mode = fs::metadata(path).map_or(0, |folder| folder.mode() & 0o7777);
    if access(path, Access::WRITE_OK | Access::EXEC_OK).is_err() {
        let found = format!("{place} has mode {mode:o}: this user may not write there");
        return Check::lacking(NAME, found, format!("chmod 1777 {place}"));
    }
    if free < STACK_BYTES {
        let found = format!("{place} has {} left, a stack needs {}", size(free), size(STACK_BYTES));
        let advice =
            format!("remove what others left there, or mount -o remount,size=256M {place}");
        return Check::lacking(NAME, found, advice);
    }
    Check::good(NAME, format!("{place}, {} left", size(free)))
}

fn run_time() -> Check {
    const NAME: &str = "run-time folder";
    let set = std::env::var_os("XDG_RUNTIME_DIR").filter(|folder| !folder.is_empty());
    let instance = match Instance::named(DEFAULT_INSTANCE) {
        Ok(instance) => instance,
        Err(error) => return Check::lacking(NAME, error.to_string(), "a shorter XDG_RUNTIME_DIR"),
    };
    let folder = instance.folder().parent().unwrap_or(instance.folder());
    let place = folder.display();
    // Instances lie in a folder of their own, which is made where it is missing.
    let exists = folder.exists();
    let there = if exists { Some(folder) } else { folder.parent() };
    let owner = there.and_then(|there| fs::metadata(there).ok()).map(|there| there.uid());
    let user = rustix::process::geteuid().as_raw();
    let writable = there.is_some_and(|there| access(there, Access::WRITE_OK).is_ok());
    match (owner, set) {
        (None, _) => Check::lacking(
            NAME,
            format!("{place}: the folder above it is not there"),
            "set XDG_RUNTIME_DIR to a folder of this user's on a tmpfs",
        ),
        (Some(_), _) if !writable => Check::lacking(
            NAME,
            format!("{place}: this user may not write there"),
            "set XDG_RUNTIME_DIR to a folder of this user's",
        ),
        (Some(owner), _) if exists && owner != user => Check::lacking(
            NAME,
            format!("{place} belongs to user {owner}, this is user {user}"),
            "an instance is for one user: set XDG_RUNTIME_DIR to a folder of this user's",
        ),
        (Some(_), Some(_)) => Check::good(NAME, place.to_string()),
        (Some(_), None) => Check::note(
            NAME,
            format!("{place}: XDG_RUNTIME_DIR is not set"),
            "set it alike for kerbside up and for whoever talks to it, or leave it unset for all",
        ),
    }
}

/// Where they go, with room for one of the largest size.
fn recordings(stack: &Stack) -> Check {
    const NAME: &str = "recordings";
    let settings = &stack.recorder;
    let folder = settings.folder.clone().unwrap_or_else(|| state_folder().join("recordings"));
    let place = folder.display();
    let there = existing(&folder);
    if access(&there, Access::WRITE_OK).is_err() {
        return Check::lacking(
            NAME,
            format!("{place}: this user may not write to {}", there.display()),
            "recorder.folder names another folder, and recorder.enabled = false records nothing",
        );
    }
    let left = free(&there).unwrap_or(0);
    let wanted = settings.keep_bytes.unwrap_or(settings.file_bytes);
    if left < wanted {
        return Check::note(
            NAME,
            format!("{place}: {} left, recordings may take {}", size(left), size(wanted)),
            "a smaller recorder.keep_bytes and recorder.file_bytes; a full disk ends a recording, \
             nothing else",
        );
    }
    if settings.keep_bytes.is_none() && settings.keep_days.is_none() {
        return Check::note(
            NAME,
            format!("{place}, {} left; none is ever removed", size(left)),
            "recorder.keep_bytes or recorder.keep_days on a machine that runs for months",
        );
    }
    Check::good(NAME, format!("{place}, {} left", size(left)))
}

/// The nearest folder of a path that exists.
fn existing(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    absolute.ancestors().find(|folder| folder.is_dir()).unwrap_or(Path::new("/")).to_owned()
}

#[cfg(test)]
mod tests {
    use super::super::Standing::{Good, Lacking};
    use super::*;

    #[test]
    fn sizes_are_read_at_a_glance() {
        let sizes = [999, 65_536, 1_000_000, 2_500_000_000, 3_000_000_000_000_000];
        assert_eq!(sizes.map(size), ["1.0 kB", "66 kB", "1.0 MB", "2.5 GB", "3000 TB"]);
    }

    #[test]
    fn shared_memory_that_is_not_there_is_lacking() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(shared_memory(&folder.path().join("none")).standing, Lacking);
        let free = free(folder.path()).unwrap();
        assert_eq!(shared_memory(folder.path()).standing == Good, free >= STACK_BYTES);
    }

    #[test]
    fn a_folder_that_is_made_later_is_judged_by_the_one_above() {
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("a/b/c");
        assert_eq!(existing(&deep), folder.path());
    }
}
