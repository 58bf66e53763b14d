//! What `deploy/` promises: the service manager is told, the units are sound, the package is installed, upgraded and
//! removed, and a fleet is diagnosed. What a machine has no tool for is skipped, and said.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod common_cli;

use std::fs;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::{PATIENCE, Sandbox, Signal};
use common_cli::{Running, Said, file, finish, is_documented, run};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

fn executable() -> &'static str {
    env!("CARGO_BIN_EXE_kerbside")
}

/// Whether a program is there; its absence is said.
fn has(program: &str) -> bool {
    let found = Command::new("sh").args(["-c", &format!("command -v {program}")]).output().unwrap();
    if !found.status.success() {
        eprintln!("skipped: {program} is not installed");
    }
    found.status.success()
}

/// Runs a program that must succeed.
fn well(command: &mut Command) -> Said {
    let said = ends(command);
    assert_eq!(said.code, Some(0), "{command:?}: {said:?}");
    said
}

fn ends(command: &mut Command) -> Said {
    let output = command.output().unwrap();
    Said {
        code: output.status.code(),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

/// A service manager, as far as a service sees it.
struct Manager {
    socket: UnixDatagram,
    path: PathBuf,
}

impl Manager {
    fn new(sandbox: &Sandbox) -> Self {
        let path = sandbox.file("notify");
        let socket = UnixDatagram::bind(&path).unwrap();
        socket.set_read_timeout(Some(PATIENCE)).unwrap();
        Self { socket, path }
    }

    /// The lines that come, up to the one that `last` is of.
    fn hears(&self, last: impl Fn(&str) -> bool) -> Vec<String> {
        let mut lines = Vec::new();
        let mut buffer = [0; 4096];
        loop {
            let length = self.socket.recv(&mut buffer).expect("a notification");
            let text = std::str::from_utf8(&buffer[..length]).unwrap();
            lines.extend(text.lines().map(str::to_owned));
            if text.lines().any(&last) {
                return lines;
            }
        }
    }

    /// `up` as a unit of type `notify` with a watchdog would start it.
    fn start(&self, sandbox: &Sandbox, arguments: &[&str]) -> Running {
        let mut command = sandbox.kerbside();
        command.args(["up", "--instance", sandbox.instance().name()]).args(arguments);
        command.env("NOTIFY_SOCKET", &self.path).env("WATCHDOG_USEC", "900000");
        Running::spawn(sandbox, "up", command)
    }
}

#[test]
fn the_service_manager_hears_of_readiness_mode_and_life() {
    let sandbox = Sandbox::new();
    let manager = Manager::new(&sandbox);
    let stack = manager.start(&sandbox, &["--simulate"]);
    let heard = manager.hears(|line| line == "STATUS=ready");
    assert_eq!(heard[0], "READY=1", "{heard:?}");
    assert_eq!(heard.iter().filter(|line| *line == "READY=1").count(), 1, "{heard:?}");
    for _ in 0..3 {
        manager.hears(|line| line == "WATCHDOG=1");
    }
    assert_eq!(run(&sandbox, &["down"]).code, Some(0));
    let heard = manager.hears(|line| line == "STOPPING=1");
    let known = ["WATCHDOG=1", "STOPPING=1"];
    let strange = |line: &&String| !line.starts_with("STATUS=") && !known.contains(&line.as_str());
    assert_eq!(heard.iter().find(strange), None);
    assert_eq!(stack.end().code, Some(0));
    sandbox.assert_empty();
}

#[test]
fn a_vehicle_that_is_switched_off_is_no_failure_of_the_service() {
    let sandbox = Sandbox::new();
    let manager = Manager::new(&sandbox);
    let stack = manager.start(&sandbox, &[]);
    let heard = manager.hears(|line| line == "STATUS=starting: waiting for the vehicle's line");
    assert_eq!(heard[0], "READY=1", "{heard:?}");
    stack.signal(Signal::TERM);
    manager.hears(|line| line == "STOPPING=1");
    assert_eq!(stack.end().code, Some(0));
    sandbox.assert_empty();
}

/// The units in `folder`, with the executable of this build.
fn units(folder: &Path) -> [PathBuf; 2] {
    ["kerbside.service", "kerbside.target"].map(|name| {
        let text = fs::read_to_string(root().join("deploy/systemd").join(name)).unwrap();
        let path = folder.join(name);
        fs::write(&path, text.replace("/usr/bin/kerbside", executable())).unwrap();
        path
    })
}

#[test]
fn systemd_takes_the_units_and_finds_them_tight() {
    if !has("systemd-analyze") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let units = units(folder.path());
    let said = well(Command::new("systemd-analyze").args(["verify", "--man=no"]).args(&units));
    assert_eq!((said.stdout.as_str(), said.stderr.as_str()), ("", ""));
    // The threshold is in tenths: the exposure stays below 3.0.
    let mut security = Command::new("systemd-analyze");
    security.args(["security", "--offline=true", "--no-pager", "--threshold=29"]).arg(&units[0]);
    let said = well(&mut security);
    assert!(said.stdout.contains("Overall exposure level"), "{said:?}");
    eprintln!("skipped: whether they run; no systemd is process 1 of a test");
}

/// What a unit says under a key, all values.
fn values<'a>(text: &'a str, key: &str) -> Vec<&'a str> {
    text.lines().filter_map(|line| line.strip_prefix(key)?.strip_prefix('=')).collect()
}

/// The system calls of a set of systemd's, those of the sets in it among them; a call alone is its own set.
fn calls(set: &str) -> Vec<String> {
    let (mut open, mut calls) = (vec![set.to_owned()], Vec::new());
    while let Some(name) = open.pop() {
        if !name.starts_with('@') {
            calls.push(name);
            continue;
        }
        let mut filter = Command::new("systemd-analyze");
        let said = well(filter.args(["syscall-filter", "--no-pager", &name])).stdout;
        let lines = said.lines().map(str::trim);
        let members = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
        // The first line is the set's own name.
        open.extend(members.skip(1).map(str::to_owned));
    }
    calls
}

/// What the unit allows.
fn allowed_calls() -> Vec<String> {
    let text = fs::read_to_string(root().join("deploy/systemd/kerbside.service")).unwrap();
    let mut allowed: Vec<String> = Vec::new();
    for filter in values(&text, "SystemCallFilter") {
        let refused = filter.strip_prefix('~');
        let named = refused.unwrap_or(filter).split_whitespace().flat_map(calls);
        if refused.is_some() {
            let named: Vec<String> = named.collect();
            allowed.retain(|call| !named.contains(call));
        } else {
            allowed.extend(named);
        }
    }
    allowed
}

/// The call in a line of strace: `PID name(...` or `PID <... name resumed>...`.
fn called(line: &str) -> Option<String> {
    let call = line.split_once(' ')?.1.trim_start();
    let call = call.strip_prefix("<... ").unwrap_or(call);
    let end = call.find(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_')?;
    let (name, rest) = call.split_at(end);
    let is_call = rest.starts_with('(') || rest.starts_with(" resumed");
    (is_call && !name.is_empty()).then(|| name.to_owned())
}

#[test]
fn a_parking_stack_needs_no_system_call_that_the_unit_refuses() {
    if !has("systemd-analyze") || !has("strace") {
        return;
    }
    let allowed = allowed_calls();
    // Under strace nothing is in time: real-time scheduling is left out of what is driven.
    for call in ["sched_setscheduler", "sched_setaffinity", "mlockall"] {
        assert!(allowed.iter().any(|known| known == call), "{call} is refused");
    }
    let sandbox = Sandbox::new();
    let trace = sandbox.file("trace");
    let manager = Manager::new(&sandbox);
    let mut command = sandbox.at_home(Command::new("strace"));
    command.args(["-f", "-qq", "-o"]).arg(&trace).arg(executable());
    command.args(["up", "--simulate", "--instance", "one"]).env("NOTIFY_SOCKET", &manager.path);
    let stack = Running::spawn(&sandbox, "up", command);
    manager.hears(|line| line == "STATUS=ready");
    assert_eq!(run(&sandbox, &["fix", "0", "0", "0"]).code, Some(0));
    // However it ends under strace: what counts is what was called.
    run(&sandbox, &["go", "0.2", "0", "0"]);
    run(&sandbox, &["down"]);
    stack.end();
    let mut refused: Vec<String> =
        fs::read_to_string(&trace).unwrap().lines().filter_map(called).collect();
    refused.sort();
    refused.dedup();
    assert!(refused.len() > 30 && refused.contains(&"sendto".to_owned()), "{refused:?}");
    refused.retain(|call| !allowed.contains(call));
    assert_eq!(refused, Vec::<String>::new());
    sandbox.assert_empty();
}

/// A copy of what the package is made of, that a test may change.
fn sources(folder: &Path) {
    let copied = ["config", "deploy", "docs", "README.md", "CHANGELOG.md", "LICENSE-MIT"];
    let mut copy = Command::new("cp");
    copy.arg("-R").args(copied.map(|name| root().join(name))).arg(folder);
    well(&mut copy);
}

/// Builds the package of `sources` in a folder of its own.
fn package(sources: &Path, out: &str) -> PathBuf {
    let out = sources.join(out);
    fs::create_dir(&out).unwrap();
    let mut build = Command::new(sources.join("deploy/debian/build"));
    build.args(["--binary", executable(), "--out"]).arg(&out).env("DEB_COMPRESSION", "none");
    PathBuf::from(well(&mut build).stdout.trim())
}

/// A Debian of its own in a folder, as far as dpkg needs it.
struct Debian(tempfile::TempDir);

impl Debian {
    fn new() -> Self {
        let root = tempfile::tempdir().unwrap();
        for folder in ["var/lib/dpkg/info", "var/lib/dpkg/updates", "etc"] {
            fs::create_dir_all(root.path().join(folder)).unwrap();
        }
        fs::write(root.path().join("var/lib/dpkg/status"), "").unwrap();
        Self(root)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_default()
    }

    fn dpkg(&self, arguments: &[&str]) -> Said {
        let mut dpkg = Command::new("dpkg");
        dpkg.arg(format!("--root={}", self.0.path().display()));
        // The C library and systemd are the machine's, and so are the programs that the scripts call.
        dpkg.args(["--force-script-chrootless", "--force-depends", "--force-confold"]);
        well(dpkg.args(arguments))
    }
}

#[test]
fn the_package_is_installed_upgraded_and_removed() {
    let tools = ["dpkg-deb", "dpkg", "systemd-sysusers", "systemd-tmpfiles", "systemctl"];
    if !tools.into_iter().all(has) {
        return;
    }
    if !rustix::process::geteuid().is_root() {
        eprintln!("skipped: only root may give files to the user of a package");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    sources(folder.path());
    let first = package(folder.path(), "first");
    let debian = Debian::new();
    debian.dpkg(&["--install", first.to_str().unwrap()]);
    holds_everything(&debian);

    // The administrator names the vehicle's device; then a version comes that ships other files.
    let mine = debian.read("etc/kerbside/stack.toml").replace("# device =", "device =");
    fs::write(debian.path("etc/kerbside/stack.toml"), &mine).unwrap();
    fs::write(debian.path("var/lib/kerbside/recordings/one.mcap"), "recorded").unwrap();
    for shipped in ["deploy/debian/stack.toml", "config/vehicles/full-size.toml"] {
        let path = folder.path().join(shipped);
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, format!("{text}# newer\n")).unwrap();
    }
    let second = package(folder.path(), "second");
    debian.dpkg(&["--install", second.to_str().unwrap()]);
    assert_eq!(debian.read("etc/kerbside/stack.toml"), mine, "what was changed is kept");
    assert!(debian.read("etc/kerbside/stack.toml.dpkg-dist").ends_with("# newer\n"));
    assert!(debian.read("etc/kerbside/vehicles/full-size.toml").ends_with("# newer\n"));

    // Removed, it leaves what is the administrator's; purged, what was recorded.
    well(Command::new("systemctl").arg(format!("--root={}", debian.0.path().display())).args([
        "--quiet",
        "enable",
        "kerbside.target",
    ]));
    let wanted = "etc/systemd/system/multi-user.target.wants/kerbside.target";
    assert!(debian.path(wanted).is_symlink());
    debian.dpkg(&["--remove", "kerbside"]);
    assert!(!debian.path("usr/bin/kerbside").exists() && !debian.path(wanted).is_symlink());
    assert_eq!(debian.read("etc/kerbside/stack.toml"), mine);
    debian.dpkg(&["--purge", "kerbside"]);
    assert!(!debian.path("etc/kerbside").exists());
    assert_eq!(debian.read("var/lib/kerbside/recordings/one.mcap"), "recorded");
    eprintln!("skipped: whether the service starts; no systemd is process 1 of a test");
}

fn holds_everything(debian: &Debian) {
    let owner = |name: &str| {
        use std::os::unix::fs::MetadataExt;
        let found = fs::metadata(debian.path(name)).unwrap();
        (found.uid(), found.mode() & 0o777)
    };
    let passwd = debian.read("etc/passwd");
    let user = passwd.lines().find(|line| line.starts_with("kerbside:")).expect("a user");
    let id: u32 = user.split(':').nth(2).unwrap().parse().unwrap();
    assert!(debian.read("etc/group").lines().any(|line| line.starts_with("kerbside:")));
    assert_eq!(owner("var/lib/kerbside/recordings"), (id, 0o750));
    assert_eq!(owner("usr/bin/kerbside"), (0, 0o755));
    let unit = debian.read("usr/lib/systemd/system/kerbside.service");
    for page in values(&unit, "Documentation")[0].split_whitespace() {
        let name = page.trim_start_matches("man:").trim_end_matches("(1)");
        assert!(debian.path(&format!("usr/share/man/man1/{name}.1.gz")).exists(), "{page}");
    }
    for name in [
        "usr/lib/systemd/system/kerbside.target",
        "usr/share/bash-completion/completions/kerbside",
        "usr/share/zsh/vendor-completions/_kerbside",
        "usr/share/fish/vendor_completions.d/kerbside.fish",
        "usr/share/doc/kerbside/copyright",
        "etc/kerbside/scenarios/garage.toml",
    ] {
        assert!(debian.path(name).exists(), "{name}");
    }
    let conffiles = debian.read("var/lib/dpkg/info/kerbside.conffiles");
    assert_eq!(conffiles.lines().count(), 8, "{conffiles}");
    // What is shipped to a vehicle computer is a configuration without a problem.
    let config = debian.path("etc/kerbside");
    let said = ends(Command::new(executable()).args(["config", "check", "--config"]).arg(config));
    assert_eq!((said.code, said.stdout.as_str()), (Some(0), "no problem found\n"), "{said:?}");
}

#[test]
fn a_package_is_not_built_from_what_is_not_there() {
    let build = root().join("deploy/debian/build");
    let said = ends(Command::new(&build).args(["--binary", "/nonexistent/kerbside"]));
    assert_eq!(said.code, Some(65), "{said:?}");
    assert!(said.stderr.contains("/nonexistent/kerbside is not there"), "{said:?}");
    let said = ends(Command::new(&build).args(["--version", "2"]));
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.stderr.contains("--binary FILE and --out DIR"), "{said:?}");
}

#[test]
fn shells_and_manuals_take_what_they_are_given() {
    let sandbox = Sandbox::new();
    for shell in ["bash", "zsh", "fish"] {
        let said = run(&sandbox, &["completions", shell]);
        assert_eq!(said.code, Some(0));
        assert!(said.stdout.contains("lockstep"), "{shell}");
        let script = file(&sandbox, &format!("completions.{shell}"), &said.stdout);
        if has(shell) {
            well(Command::new(shell).arg("-n").arg(script));
        }
    }
    let said = run(&sandbox, &["completions", "bash", "--json"]).json();
    assert_eq!(said["shell"], "bash");
    run(&sandbox, &["completions", "csh"]).refuses(2, &["csh", "bash", "zsh", "fish"]);
    let folder = sandbox.file("man");
    let said = run(&sandbox, &["man", "--out", folder.to_str().unwrap(), "--json"]).json();
    let pages = said["pages"].as_array().unwrap();
    assert!(
        pages.len() > 20 && pages.iter().all(|page| Path::new(page.as_str().unwrap()).exists())
    );
    if has("groff") {
        let page = folder.join("kerbside-park.1");
        let said = well(Command::new("groff").args(["-man", "-ww", "-Tutf8"]).arg(page));
        assert_eq!(said.stderr, "");
    }
    assert!(run(&sandbox, &["man"]).stdout.contains(".TH kerbside 1"));
    run(&sandbox, &["man", "--out", "/proc/nowhere"]).refuses(75, &["cannot write to /proc"]);
}

#[test]
fn the_doctor_says_what_is_lacking_and_what_to_do() {
    let sandbox = Sandbox::new();
    let stack = "vehicle = \"paper-1-6\"\n[line]\ndevice = \"/dev/kerbside-none\"\n";
    let config = file(&sandbox, "stack.toml", stack);
    let config = config.to_str().unwrap();
    let said = run(&sandbox, &["doctor", "--config", config]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.stdout.lines().all(|line| line.chars().count() <= 80), "{}", said.stdout);
    assert!(said.stdout.contains("/dev/kerbside-none is not there"), "{}", said.stdout);
    let told = run(&sandbox, &["doctor", "--json", "--config", config]).json();
    is_documented("doctor", &told);
    assert_eq!(told["passed"], false);
    let checks = told["checks"].as_array().unwrap();
    let named = |name: &str| checks.iter().find(|check| check["name"] == name).unwrap();
    assert_eq!(named("line device")["state"], "lacking");
    assert!(named("line device")["advice"].as_str().unwrap().contains("/dev/serial/by-id"));
    for name in ["kernel", "cores", "real-time scheduling", "locked memory", "shared memory"] {
        assert!(!named(name)["found"].as_str().unwrap().is_empty(), "{name}");
    }
    assert!(checks.iter().all(|check| (check["state"] == "ok") == check["advice"].is_null()));
    // A refused configuration is one more thing that is lacking, with its place.
    let refused = file(&sandbox, "bad/stack.toml", "vehicle = \"paper-1-6\"\nspeed = 3\n");
    let told = run(&sandbox, &["doctor", "--json", "--config", refused.to_str().unwrap()]).json();
    let first = &told["checks"][0];
    assert!(first["found"].as_str().unwrap().contains("stack.toml:2"), "{first}");
    run(&sandbox, &["doctor", "--config", "/nonexistent"]).refuses(78, &["/nonexistent"]);
}

/// A Python that has Dask: `KERBSIDE_PYTHON`, else `python3`.
fn python() -> Option<String> {
    let python = std::env::var("KERBSIDE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let asked = Command::new(&python).args(["-c", "import dask.distributed"]).output();
    if asked.is_ok_and(|asked| asked.status.success()) {
        return Some(python);
    }
    eprintln!("skipped: {python} has no dask.distributed");
    None
}

#[test]
fn a_fleet_is_diagnosed_on_two_workers() {
    let Some(python) = python() else { return };
    let sandbox = Sandbox::new();
    let cases = sandbox.file("cases");
    for name in ["good", "broken"] {
        fs::create_dir_all(cases.join(name)).unwrap();
        let from = root().join("tests/data/cases/paper-1-6/.");
        well(Command::new("cp").arg("-R").arg(from).arg(cases.join(name)));
    }
    fs::write(cases.join("broken/vehicle.toml"), "name = 3\n").unwrap();
    let out = sandbox.file("out");
    let fleet = |wanted: Option<i32>| {
        let mut command = Command::new(&python);
        command.arg(root().join("deploy/fleet/diagnose_fleet.py")).arg(&cases).arg("--out");
        command.arg(&out).args(["--workers", "2", "--kerbside", executable()]);
        let said = finish(sandbox.at_home(command));
        assert_eq!(said.code, wanted, "{said:?}");
        let table = fs::read_to_string(out.join("fleet.csv")).unwrap();
        table.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let table = fleet(Some(1));
    assert_eq!(table.len(), 3, "{table:?}");
    assert!(table[1].starts_with("broken,") && table[1].contains("vehicle.toml:1"), "{table:?}");
    assert!(table[2].starts_with("good,,") && table[2].contains("False"), "{table:?}");
    assert!(
        out.join("good/diagnosis.json").exists() && !out.join("broken/diagnosis.json").exists()
    );
    // Begun again, it goes on: what is diagnosed is kept.
    fs::remove_dir_all(cases.join("broken")).unwrap();
    let table = fleet(Some(0));
    assert!(table.len() == 2 && table[1].contains("True"), "{table:?}");
}
