//! The recorder: what it leaves when it is killed, and what a full disk costs.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod common_cli;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::stack::{poll, send};
use common::{PATIENCE, Sandbox, Signal};
use common_cli::{Running, SHORT, Said, file, finish, row, run, status, until, until_mode};
use kerbside_messages::schema::schema_name;
use kerbside_messages::topics::TABLE;
use kerbside_recordings::recording::{End, channel_name, check};
use rustix::process::{Pid, Resource, Rlimit, prlimit};
use serde_json::Value;

/// A recorder's pid, once it records.
fn recorder(sandbox: &Sandbox) -> u32 {
    let pid = until(sandbox, "the recorder", |status| {
        let row = row(status, "recorder");
        (row["state"] == "healthy" && status["mode"] != "starting").then(|| row["pid"].as_u64())?
    });
    u32::try_from(pid).unwrap()
}

fn counts(path: &Path) -> BTreeMap<String, u64> {
    let report = check(path).unwrap();
    report.topics.into_iter().map(|topic| (topic.channel, topic.messages)).collect()
}

#[test]
fn a_killed_recorder_leaves_its_closed_chunks_and_its_successor_another_file() {
    let sandbox = Sandbox::new();
    let recording = sandbox.file("run.mcap");
    let path = recording.to_str().unwrap();
    let up = ["up", "--simulate", "--instance", "one", "--start=-1.0,0.65,0", "--recording", path];
    let stack = Running::start(&sandbox, "up", &up);
    until_mode(&sandbox, "ready");
    let first = recorder(&sandbox);
    let grown = || {
        let chunks = check(&recording).ok()?.chunks;
        (chunks >= 3).then_some(chunks)
    };
    assert!(poll(PATIENCE, grown).is_some(), "{}", stack.log());
    send(first, Signal::KILL);
    until(&sandbox, "another recorder", |status| {
        let row = row(status, "recorder");
        (row["state"] == "healthy" && row["pid"] != first).then_some(())
    });
    // Its death is nobody else's matter.
    let seen = status(&sandbox).unwrap();
    assert_eq!((&seen["mode"], &row(&seen, "recorder")["restarts"]), (&"ready".into(), &1.into()));
    let verb = |arguments: &[&str]| run(&sandbox, arguments);
    assert_eq!(verb(&["fix", "-1.0", "0.65", "0"]).code, Some(0));
    // However it ends on a busy machine: what counts here is that there was a plan, and that it was driven.
    let driven = verb(&["go", "-0.9", "0.65", "0", "--json"]);
    assert!(driven.json()["duration_s"].is_number(), "{driven:?}");
    assert_eq!(verb(&["down"]).code, Some(0));
    assert_eq!(stack.end().code, Some(0));
    sandbox.assert_empty();

    // What the first one left ends in a torn place, is told so, and is made whole.
    let torn = verb(&["recording", "check", path, "--json"]);
    assert_eq!(torn.code, Some(1), "{torn:?}");
    assert!(!torn.json()["problems"].as_array().unwrap().is_empty());
    let whole = sandbox.file("whole.mcap");
    let recovered = verb(&["recording", "recover", path, whole.to_str().unwrap(), "--json"]).json();
    let kept: u64 = counts(&recording).values().sum();
    assert!(recovered["messages"].as_u64().unwrap() >= kept && kept > 0, "{recovered}");
    assert_eq!(verb(&["recording", "check", whole.to_str().unwrap()]).code, Some(0));
    verb(&["recording", "recover", path, whole.to_str().unwrap()]).refuses(65, &["whole.mcap"]);

    // The second one's is complete.
    let second = sandbox.file("run-2.mcap");
    let report = check(&second).unwrap();
    assert!(report.is_sound(), "{:?}", report.problems());
    let provenance = report.provenance;
    assert_eq!(provenance.instance.as_deref(), Some("one"));
    assert!(provenance.vehicle.unwrap().contains("wheelbase"));
    assert!(provenance.stack.unwrap().contains("stop_distance"));
    // Everything that happened is in it, and what did not happen has its schema all the same.
    let counts = counts(&second);
    let bytes = std::fs::read(&second).unwrap();
    let names = |text: &str| bytes.windows(text.len()).any(|window| window == text.as_bytes());
    for topic in TABLE.iter().filter(|topic| topic.recorded) {
        let channel = channel_name(topic);
        assert!(names(&channel) && names(&schema_name(topic)), "{channel} has no schema");
        let happened = !["restore", "inhibit"].contains(&topic.name);
        assert_eq!(counts.contains_key(&channel), happened, "{channel}: {counts:?}");
    }
    let known: Vec<_> = TABLE.iter().filter(|topic| topic.recorded).map(channel_name).collect();
    assert!(counts.keys().all(|channel| known.contains(channel)), "{counts:?}");
}

/// Parks along the aisle with the report in `out`; `trouble` is made once the car drives.
fn park(sandbox: &Sandbox, out: &Path, trouble: impl FnOnce(u32)) -> Value {
    let scenario = file(sandbox, "short.toml", SHORT);
    let (scenario, out) = (scenario.to_str().unwrap(), out.to_str().unwrap());
    let park = ["park", scenario, "--json", "--rearm", "--instance", "one", "--out", out];
    let park = Running::start(sandbox, "park", &park);
    trouble(recorder(sandbox));
    let told = until(sandbox, "the recorder's trouble", |status| {
        let said = row(status, "recorder")["waiting_for"].as_str()?.to_owned();
        (said.starts_with("recording ended") || said.starts_with("no recording")).then_some(said)
    });
    let said = park.end();
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.stderr.contains("recorder"), "{said:?}");
    let parked = said.json();
    assert_eq!((&parked["parked"], &parked["cause"]), (&true.into(), &told.into()), "{parked}");
    assert_eq!(parked["restarts"], 0, "{parked}");
    sandbox.assert_empty();
    parked
}

#[test]
fn a_file_that_may_not_grow_costs_the_recording_alone() {
    let sandbox = Sandbox::new();
    let out = sandbox.file("out");
    let recording = out.join("recording.mcap");
    let parked = park(&sandbox, &out, |recorder| {
        let size = std::fs::metadata(&recording).map_or(0, |metadata| metadata.len());
        let limit = Some(size + 100_000);
        let pid = Pid::from_raw(i32::try_from(recorder).unwrap());
        prlimit(pid, Resource::Fsize, Rlimit { current: limit, maximum: limit }).unwrap();
    });
    assert_eq!(parked["cause"], "recording ended: the file may not grow");
    assert_eq!(parked["recording"], recording.to_str().unwrap());
    // What it holds until then is read like that of a killed recorder.
    let report = check(&recording).unwrap();
    assert!(report.end != End::Complete && report.messages() > 0, "{report:?}");
    let whole = sandbox.file("whole.mcap");
    let arguments = ["recording", "recover", recording.to_str().unwrap(), whole.to_str().unwrap()];
    assert_eq!(run(&sandbox, &arguments).code, Some(0));
    assert!(check(&whole).unwrap().is_sound());
}

/// A small file system of its own, unmounted when dropped.
struct SmallDisk(PathBuf);

impl SmallDisk {
    fn mount(path: PathBuf) -> Option<Self> {
        std::fs::create_dir_all(&path).unwrap();
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", "size=256k", "tmpfs"]).arg(&path);
        (finish(mount).code == Some(0)).then_some(Self(path))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let mut unmount = Command::new("umount");
        unmount.arg("-l").arg(&self.0);
        let _ = finish(unmount);
    }
}

#[test]
fn a_full_disk_costs_recording_and_report_and_nothing_else() {
    if !rustix::process::geteuid().is_root() {
        eprintln!("skipped: only root can mount a small disk");
        return;
    }
    let sandbox = Sandbox::new();
    let Some(disk) = SmallDisk::mount(sandbox.file("disk")) else {
        eprintln!("skipped: nothing can be mounted here");
        return;
    };
    let parked = park(&sandbox, &disk.0, |_| ());
    assert_eq!(parked["cause"], "recording ended: the disk is full");
    assert_eq!(parked["report"], Value::Null, "{parked}");
}

#[test]
fn a_folder_that_cannot_be_written_costs_the_recording_alone() {
    let sandbox = Sandbox::new();
    let instance = sandbox.instance();
    let up = ["up", "--simulate", "--recording", "/proc/nothing/run.mcap", "--instance"];
    let stack = Running::start(&sandbox, "up", &[&up[..], &[instance.name()]].concat());
    until_mode(&sandbox, "ready");
    until(&sandbox, "what the recorder says", |status| {
        (row(status, "recorder")["waiting_for"].as_str()?.starts_with("no recording: "))
            .then_some(())
    });
    let down = run(&sandbox, &["down"]);
    assert_eq!(down.code, Some(0), "{down:?}");
    let Said { code, stderr, .. } = stack.end();
    assert_eq!(code, Some(0));
    assert!(stderr.contains("no recording; everything else goes on"), "{stderr}");
    sandbox.assert_empty();
}

#[test]
fn chunks_are_as_the_configuration_says() {
    let sandbox = Sandbox::new();
    let folder = sandbox.file("recordings");
    let (kept, quiet) =
        (folder.to_str().unwrap(), "[recorder]\nchunk_size = 8192\ncompression = \"none\"");
    let content = format!("vehicle = \"paper-1-6\"\n{quiet}\nfolder = \"{kept}\"\n");
    let config = file(&sandbox, "stack.toml", &content);
    let up = ["up", "--simulate", "--instance", "one", "--config", config.to_str().unwrap()];
    let stack = Running::start(&sandbox, "up", &up);
    until_mode(&sandbox, "ready");
    let found = || std::fs::read_dir(&folder).ok()?.next()?.ok().map(|entry| entry.path());
    let path = poll(PATIENCE, found).unwrap();
    // A second of it has some 150 kB: as few of the usual chunks as seconds pass, many of these.
    let many = || (check(&path).ok()?.chunks > 30).then_some(());
    assert!(poll(PATIENCE, many).is_some());
    assert_eq!(run(&sandbox, &["down"]).code, Some(0));
    assert_eq!(stack.end().code, Some(0));
    let report = check(&path).unwrap();
    assert!(report.is_sound(), "{:?}", report.problems());
    let seconds =
        report.time.map(|(first, last)| kerbside_messages::seconds(last - first)).unwrap();
    assert!(report.chunks as f64 > 5.0 * seconds, "{} chunks in {seconds} s", report.chunks);
    sandbox.assert_empty();
}

#[test]
fn recordings_are_cut_and_the_oldest_give_way() {
    let sandbox = Sandbox::new();
    let folder = sandbox.file("recordings");
    std::fs::create_dir(&folder).unwrap();
    let others = folder.join("other-1700000000-1.mcap");
    std::fs::write(&others, vec![0; 400_000]).unwrap();
    let content = format!(
        "vehicle = \"paper-1-6\"\n[recorder]\nchunk_size = 8192\ncompression = \"none\"\n\
         file_bytes = 1000000\nkeep_bytes = 3000000\nfolder = \"{}\"\n",
        folder.display()
    );
    let config = file(&sandbox, "stack.toml", &content);
    let up = ["up", "--simulate", "--instance", "one", "--config", config.to_str().unwrap()];
    let stack = Running::start(&sandbox, "up", &up);
    until_mode(&sandbox, "ready");
    let ours = || {
        let entries = std::fs::read_dir(&folder).unwrap().flatten();
        let named = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with("one-"));
        named.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    // A second of it has about a megabyte: the first file has to go after three.
    let first = poll(PATIENCE, || ours().first().cloned()).unwrap();
    assert!(poll(PATIENCE, || (!first.exists()).then_some(())).is_some(), "{:?}", ours());
    assert_eq!(run(&sandbox, &["down"]).code, Some(0));
    assert_eq!(stack.end().code, Some(0));
    let left = ours();
    let bytes: u64 = left.iter().map(|path| path.metadata().unwrap().len()).sum();
    assert!(bytes < 6_000_000 && left.len() >= 2, "{bytes} bytes in {left:?}");
    for path in &left {
        let report = check(path).unwrap();
        assert!(report.is_sound(), "{}: {:?}", path.display(), report.problems());
        assert!(report.messages() > 0);
    }
    assert!(others.exists(), "another instance's is nobody's business");
    sandbox.assert_empty();
}
