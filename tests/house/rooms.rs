//! Which crate may depend on which: read from what cargo itself knows of the workspace.

use std::process::Command;

use serde_json::Value;

use crate::{assert_none, root};

/// The only crate that knows the middleware.
const MIDDLEWARE_CRATE: &str = "kerbside-runtime";

/// Other people's crates that a pure crate may use: arithmetic, layouts, encodings and error texts. What opens files,
/// sockets or clocks is not here, and neither is what logs. `rayon` spreads arithmetic over the cores and gives its
/// results in their order: the same bits whatever the threads do.
const PURE: [&str; 9] =
    ["bytemuck", "cobs", "crc32fast", "libm", "nalgebra", "rand", "rand_pcg", "rayon", "thiserror"];

/// Where a crate lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Room {
    Services,
    Messages,
    Line,
    Runtime,
    Onboard,
    Offline,
    Io,
}

impl Room {
    fn of(path: &str) -> Option<Self> {
        let parts: Vec<_> = path.split('/').collect();
        match parts[..] {
            ["services"] => Some(Self::Services),
            ["shared", "middleware", "messages"] => Some(Self::Messages),
            ["shared", "middleware", "line"] => Some(Self::Line),
            ["shared", "middleware", "runtime"] => Some(Self::Runtime),
            ["shared", "onboard", _] => Some(Self::Onboard),
            ["shared", "offline", _] => Some(Self::Offline),
            ["shared", "io", _] => Some(Self::Io),
            _ => None,
        }
    }

    /// The rooms that a crate of this one may look into.
    fn knows(self) -> &'static [Self] {
        match self {
            Self::Services => {
                &[Self::Messages, Self::Line, Self::Runtime, Self::Onboard, Self::Offline, Self::Io]
            }
            Self::Io => &[Self::Messages, Self::Line, Self::Onboard, Self::Offline, Self::Io],
            Self::Offline => &[Self::Messages, Self::Onboard, Self::Offline],
            Self::Onboard => &[Self::Messages, Self::Onboard],
            Self::Runtime => &[Self::Messages],
            Self::Messages | Self::Line => &[],
        }
    }

    fn is_pure(self) -> bool {
        matches!(self, Self::Messages | Self::Line | Self::Onboard | Self::Offline)
    }
}

/// A dependency as a manifest states it; `kind` is empty for a normal one.
struct Arrow {
    from: String,
    room: Room,
    to: String,
    to_room: Option<Room>,
    kind: String,
}

impl Arrow {
    fn is_normal(&self) -> bool {
        self.kind.is_empty()
    }
}

impl core::fmt::Display for Arrow {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let kind = if self.is_normal() { "normal" } else { self.kind.as_str() };
        write!(f, "{} -> {} ({kind} dependency)", self.from, self.to)
    }
}

fn metadata() -> Value {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--format-version", "1", "--offline"])
        .current_dir(root())
        .output()
        .expect("cargo starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("cargo writes JSON")
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

/// Path of a package below the root, from the path of its manifest.
fn place(package: &Value) -> String {
    let manifest = text(&package["manifest_path"]).trim_end_matches("/Cargo.toml");
    let root = root();
    let root = root.to_str().expect("a path in UTF-8");
    manifest.strip_prefix(root).unwrap_or(manifest).trim_start_matches('/').to_owned()
}

fn packages(metadata: &Value) -> Vec<(String, Room)> {
    let list = metadata["packages"].as_array().expect("packages");
    list.iter()
        .map(|package| {
            let (name, place) = (text(&package["name"]).to_owned(), place(package));
            let room = Room::of(&place);
            (name, room.unwrap_or_else(|| panic!("{place} is in no room of the house")))
        })
        .collect()
}

fn arrows() -> Vec<Arrow> {
    let metadata = metadata();
    let rooms = packages(&metadata);
    let room = |name: &str| rooms.iter().find(|(known, _)| known == name).map(|(_, room)| *room);
    let list = metadata["packages"].as_array().expect("packages");
    let of_package = |package: &Value| {
        let from = text(&package["name"]).to_owned();
        let dependencies = package["dependencies"].as_array().expect("dependencies");
        let arrow = |dependency: &Value| {
            let to = text(&dependency["name"]).to_owned();
            Arrow {
                from: from.clone(),
                room: room(&from).expect("a room"),
                to_room: room(&to),
                to,
                kind: text(&dependency["kind"]).to_owned(),
            }
        };
        dependencies.iter().map(arrow).collect::<Vec<_>>()
    };
    list.iter().flat_map(of_package).collect()
}

#[test]
fn arrows_between_rooms_point_one_way() {
    let astray = |arrow: &&Arrow| arrow.to_room.is_some_and(|to| !arrow.room.knows().contains(&to));
    let arrows = arrows();
    let ours = arrows.iter().filter(|arrow| arrow.to_room.is_some()).count();
    assert!(ours > 20, "{ours} arrows between our own crates: this test looks at nothing");
    let complaints: Vec<_> = arrows.iter().filter(astray).map(ToString::to_string).collect();
    assert_none(&complaints);
}

#[test]
fn one_crate_knows_the_middleware() {
    let arrows = arrows();
    let knows = |arrow: &&Arrow| arrow.to.starts_with("iceoryx2");
    let who: Vec<_> = arrows.iter().filter(knows).map(|arrow| arrow.from.as_str()).collect();
    assert_eq!(who, [MIDDLEWARE_CRATE]);
}

#[test]
fn pure_crates_use_nothing_that_touches_the_world() {
    let impure = |arrow: &&Arrow| {
        let known = arrow.to_room.is_some() || PURE.contains(&arrow.to.as_str());
        arrow.room.is_pure() && arrow.is_normal() && !known
    };
    let complaints: Vec<_> = arrows().iter().filter(impure).map(ToString::to_string).collect();
    assert_none(&complaints);
}

#[test]
fn what_is_tested_with_simulation_does_not_import_it() {
    let imports = |arrow: &&Arrow| {
        arrow.from == "kerbside-proving-ground" && arrow.to == "kerbside-simulation"
    };
    let complaints: Vec<_> = arrows().iter().filter(imports).map(ToString::to_string).collect();
    assert_none(&complaints);
}
