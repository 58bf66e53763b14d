//! The line to the vehicle: its device, and who may open it.

use std::fs;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::Path;

use kerbside_settings::{InterfaceSettings, Stack};
use rustix::fs::{Access, access};

use super::Check;

const NAME: &str = "line device";

/// The device that the configuration names.
pub(super) fn line(stack: Option<&Stack>) -> Check {
    let device = match stack.map(|stack| &stack.interface) {
        Some(InterfaceSettings::Line { device: Some(device), .. }) => device,
        Some(InterfaceSettings::Line { device: None, .. }) | None => {
            return Check::note(
                NAME,
                "none is configured: kerbside up waits for a simulated vehicle",
                "name it as line.device, or start with --simulate",
            );
        }
        Some(InterfaceSettings::Replay) => return Check::good(NAME, "none is needed in a replay"),
    };
    let Ok(found) = fs::metadata(device) else {
        return Check::lacking(
            NAME,
            format!("{} is not there", device.display()),
            "plug it in; /dev/serial/by-id has names that survive a restart",
        );
    };
    if !found.file_type().is_char_device() {
        return Check::lacking(
            NAME,
            format!("{} is no serial device", device.display()),
            "line.device names a device like /dev/ttyACM0",
        );
    }
    opened(device, &found)
}

fn opened(device: &Path, found: &fs::Metadata) -> Check {
    let groups = fs::read_to_string("/etc/group").unwrap_or_default();
    let group = group_name(&groups, found.gid());
    let place = device.display();
    if access(device, Access::READ_OK | Access::WRITE_OK).is_err() {
        return Check::lacking(
            NAME,
            format!("{place}, mode {:o}, group {group}: not for this user", found.mode() & 0o777),
            format!(
                "usermod -aG {group} USER, then log in again; SupplementaryGroups={group} in the unit"
            ),
        );
    }
    Check::good(NAME, format!("{place}, group {group}"))
}

/// The name of a group; its number where it has none.
fn group_name(groups: &str, id: u32) -> String {
    let named = groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let (name, number) = (fields.next()?, fields.nth(1)?);
        (number.parse() == Ok(id)).then(|| name.to_owned())
    });
    named.unwrap_or_else(|| id.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::Standing::{Good, Lacking, Note};
    use super::*;
    use crate::configuration;

    #[test]
    fn a_device_is_there_and_is_one() {
        let mut stack = configuration::stack(None, None).unwrap();
        assert_eq!(line(Some(&stack)).standing, Note);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let mut with = |device: &Path| {
            stack.interface =
                InterfaceSettings::Line { device: Some(device.to_owned()), baud: 9600 };
            line(Some(&stack))
        };
        assert!(with(&folder.path().join("none")).found.contains("is not there"));
        assert!(with(&file).found.contains("is no serial device"));
        assert_eq!(with(Path::new("/dev/null")).standing, Good);
        assert_eq!(with(&file).standing, Lacking);
        stack.interface = InterfaceSettings::Replay;
        assert_eq!(line(Some(&stack)).standing, Good);
    }

    #[test]
    fn groups_have_names() {
        let groups = "root:x:0:\ndialout:x:20:parker,kerbside\nbroken\n";
        assert_eq!(group_name(groups, 20), "dialout");
        assert_eq!(group_name(groups, 21), "21");
    }
}
