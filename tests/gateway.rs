//! The gateway: requests and rights, clients that do harm, and what other users reach.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod common_cli;

use core::time::Duration;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};

use common::stack::{poll, send};
use common::{PATIENCE, Sandbox, Signal};
use common_cli::{Running, file, finish, row, run, status, until, until_mode};
use kerbside_runtime::now;
use serde_json::{Value, json};

/// A stack whose pose is known, with a gateway.
const STACK: &str = "vehicle = \"paper-1-6\"\n[safety]\nstop_distance = 0.65\n[recorder]\nenabled = false\n\
    [initial_pose]\nx = -1.0\ny = 0.65\nyaw_degrees = 0.0\n[gateway]\nenabled = true\n";

fn up(sandbox: &Sandbox, more: &str) -> Running {
    let config = file(sandbox, "stack.toml", &format!("{STACK}{more}"));
    let config = config.to_str().unwrap();
    let arguments =
        ["up", "--simulate", "--start=-1.0,0.65,0", "--instance", "one", "--config", config];
    let stack = Running::start(sandbox, "up", &arguments);
    until_mode(sandbox, "ready");
    stack
}

fn down(sandbox: &Sandbox, stack: Running) {
    let said = run(sandbox, &["down", "--instance", "one"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(stack.end().code, Some(0));
    assert!(!door(sandbox).exists(), "the socket is left");
    sandbox.assert_empty();
}

fn door(sandbox: &Sandbox) -> PathBuf {
    sandbox.gateways().join("one.gateway")
}

fn gateway_pid(sandbox: &Sandbox) -> u64 {
    until(sandbox, "the gateway", |status| {
        let row = row(status, "gateway");
        (row["state"] == "healthy").then(|| row["pid"].as_u64().unwrap())
    })
}

/// A client that speaks lines.
struct Client {
    lines: BufReader<UnixStream>,
    asked: u64,
}

impl Client {
    fn connect(path: &Path) -> Self {
        let stream = poll(PATIENCE, || UnixStream::connect(path).ok()).expect("a gateway");
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_write_timeout(Some(PATIENCE)).unwrap();
        Self { lines: BufReader::new(stream), asked: 0 }
    }

    /// A client that has been greeted.
    fn enter(path: &Path) -> Self {
        let mut client = Self::connect(path);
        let greeting = client.hear().expect("a greeting");
        assert_eq!(greeting["schema"], "kerbside.gateway.v1", "{greeting}");
        client
    }

    fn say(&mut self, line: &str) {
        self.lines.get_mut().write_all(format!("{line}\n").as_bytes()).unwrap();
    }

    /// The next line; none where the gateway has closed.
    fn hear(&mut self) -> Option<Value> {
        let mut line = String::new();
        match self.lines.read_line(&mut line) {
            Ok(0) | Err(_) => None,
            Ok(_) => Some(serde_json::from_str(&line).unwrap_or_else(|_| panic!("{line:?}"))),
        }
    }

    /// The reply to a request; samples on the way are passed over.
    fn ask(&mut self, mut request: Value) -> Value {
        self.asked += 1;
        request["id"] = json!(self.asked);
        self.say(&request.to_string());
        loop {
            let line = self.hear().expect("a reply");
            if line["id"] == self.asked {
                return line;
            }
        }
    }

    fn sample(&mut self, topic: &str) -> Value {
        loop {
            let line = self.hear().expect("a sample");
            if line["topic"] == topic {
                return line["sample"].clone();
            }
        }
    }
}

#[test]
fn what_is_asked_is_done_and_what_is_wrong_is_named() {
    let sandbox = Sandbox::new();
    let stack = up(&sandbox, "");
    gateway_pid(&sandbox);
    let mut client = Client::connect(&door(&sandbox));
    let greeting = client.hear().unwrap();
    assert_eq!(greeting["instance"], "one");
    assert_eq!(greeting["rights"], json!(["watch", "fix", "inhibit", "plan", "arm", "stop"]));

    let said = client.ask(json!({"request": "status"}));
    assert_eq!((&said["ok"], &said["status"]["mode"]), (&json!(true), &json!("ready")));
    assert_eq!(said["state"]["mode"], 1);
    let topics = client.ask(json!({"request": "topics"}));
    let topics = topics["topics"].as_array().unwrap().clone();
    assert!(topics.iter().any(|topic| topic["topic"] == "odometry"));
    assert!(topics.iter().all(|topic| topic["topic"] != "truth"));

    client.ask(json!({"request": "subscribe", "topic": "odometry", "rate": 50}));
    let (first, second) = (client.sample("odometry"), client.sample("odometry"));
    let sequence = |sample: &Value| sample["header"]["sequence"].as_u64().unwrap();
    assert!(sequence(&second) > sequence(&first));
    assert!((first["x"].as_f64().unwrap() + 1.0).abs() < 0.01, "{first}");
    let beat = json!({"request": "subscribe", "topic": "heartbeat", "process": "tracker"});
    assert_eq!(client.ask(beat)["ok"], true);
    assert_eq!(client.sample("heartbeat")["process"], 4);
    client.ask(json!({"request": "unsubscribe", "topic": "odometry"}));

    client.say("nonsense");
    let said = client.hear_failure();
    assert_eq!(said["error"]["what"], "line", "{said}");
    let said = client.ask(json!({"request": "subscribe", "topic": "truth"}));
    assert!(said["error"]["allowed"].as_str().unwrap().contains("odometry"), "{said}");

    let small = [1e-6, 0.0, 0.0, 0.0, 1e-6, 0.0, 0.0, 0.0, 1e-6];
    let fix = json!({"x": -1.0, "y": 0.65, "yaw": 0.0, "covariance": small});
    let said = client.ask(json!({"request": "fix", "fix": fix}));
    assert_eq!(said["verdict"], "accepted", "{said}");
    let said = client.ask(json!({"request": "arm"}));
    assert_eq!((&said["mode"], &said["arms"]), (&json!("armed"), &json!(1)), "{said}");
    let inhibit = json!({"expiry": now() + 100_000_000, "why": "a test"});
    let said = client.ask(json!({"request": "inhibit", "inhibit": inhibit}));
    assert_eq!(said["ok"], true, "{said}");
    let said = client.ask(json!({"request": "stop"}));
    assert_eq!(said["ok"], true, "{said}");
    down(&sandbox, stack);
}

impl Client {
    fn hear_failure(&mut self) -> Value {
        loop {
            let line = self.hear().expect("a failure");
            if line["ok"] == false {
                return line;
            }
        }
    }
}

/// Reads until the other end closes; what came last.
fn until_closed(stream: &mut UnixStream) -> Vec<u8> {
    let mut all = Vec::new();
    let mut piece = [0; 4096];
    loop {
        match stream.read(&mut piece) {
            Ok(0) | Err(_) => return all,
            Ok(count) => all.extend_from_slice(&piece[..count]),
        }
    }
}

/// Writes until the other end closes or the test's patience ends; whether it was closed.
fn flood(stream: &mut UnixStream, line: &[u8]) -> bool {
    let deadline = now() + 20_000_000_000;
    stream.set_write_timeout(Some(Duration::from_millis(200))).unwrap();
    while now() < deadline {
        match stream.write(line) {
            Ok(_) => {}
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
            Err(_) => return true,
        }
    }
    false
}

#[test]
fn clients_that_do_harm_cost_themselves() {
    let sandbox = Sandbox::new();
    let limits = "clients = 8\nclients_per_user = 7\nrequest_rate = 200\npatience = 0.5\n";
    let stack = up(&sandbox, limits);
    let pid = gateway_pid(&sandbox);
    let path = door(&sandbox);
    // All of them come in before the door is stormed.
    let [mut good, mut greedy, endless, mut babbling] =
        core::array::from_fn(|_| Client::enter(&path));
    std::thread::scope(|scope| {
        // One that subscribes to everything and takes nothing is disconnected.
        let stalled = scope.spawn(move || {
            for topic in ["raw", "travel", "odometry", "state", "permit", "actuator"] {
                greedy.ask(json!({"request": "subscribe", "topic": topic}));
            }
            let mut stream = greedy.lines.into_inner();
            flood(&mut stream, b"{\"request\": \"status\"}\n")
        });
        // One whose line never ends is told why, and disconnected.
        let endless = scope.spawn(move || {
            let mut stream = endless.lines.into_inner();
            let closed = flood(&mut stream, &[b'a'; 4096]);
            (closed, String::from_utf8(until_closed(&mut stream)).unwrap())
        });
        // Rubbish is answered with what is wrong, line by line.
        let rubbish = scope.spawn(move || {
            for line in ["\u{1}\u{2}", "{", "[[[[", "{\"request\": 1}", "null"] {
                babbling.say(line);
                assert_eq!(babbling.hear_failure()["ok"], false);
            }
        });
        // Some come and vanish at once, in the midst of a line.
        let vanishing = scope.spawn(|| {
            for _ in 0..100 {
                if let Ok(mut stream) = UnixStream::connect(&path) {
                    let _ = stream.write_all(b"{\"request\": \"subscr");
                }
            }
        });
        // Meanwhile the car drives, and a good client is served.
        let going = scope.spawn(|| go(|arguments| run(&sandbox, arguments)));
        while !(stalled.is_finished() && endless.is_finished() && going.is_finished()) {
            assert_eq!(good.ask(json!({"request": "status"}))["ok"], true);
        }
        assert!(stalled.join().unwrap(), "a client that takes nothing stays");
        let (closed, words) = endless.join().unwrap();
        assert!(closed && words.contains("gateway.line_length"), "{words}");
        rubbish.join().unwrap();
        vanishing.join().unwrap();
        going.join().unwrap();
        let seen = status(&sandbox).unwrap();
        let gateway = row(&seen, "gateway");
        assert_eq!((&gateway["pid"], &gateway["restarts"]), (&json!(pid), &json!(0)), "{seen}");
        for process in ["interface", "ingest", "estimator", "tracker", "actuation"] {
            assert_eq!(row(&seen, process)["restarts"], 0, "{seen}");
        }
    });
    down(&sandbox, stack);
}

/// Half a metre along the aisle, on whatever way there is from where the car came to stand.
const THERE: [&str; 4] = ["go", "-0.5", "0.65", "0"];

/// Drives there, as `verb` runs it; a busy machine may stop the car, then it is tried again.
fn go(verb: impl Fn(&[&str]) -> common_cli::Said) {
    let mut said = Vec::new();
    let arrived = poll(2 * PATIENCE, || {
        let newest = verb(&[&THERE[..1], &["--instance", "one", "--"], &THERE[1..]].concat());
        let there = newest.code == Some(0) && newest.stdout == "one: plan completed\n";
        said.push(newest);
        there.then_some(())
    });
    assert!(arrived.is_some(), "the car does not get there: {said:?}");
}

#[test]
fn there_are_only_so_many_clients() {
    let sandbox = Sandbox::new();
    let stack = up(&sandbox, "clients = 3\nclients_per_user = 2\n");
    gateway_pid(&sandbox);
    let path = door(&sandbox);
    let (one, _two) = (Client::enter(&path), Client::enter(&path));
    let said = Client::connect(&path).hear().unwrap();
    let words = said["error"]["found"].as_str().unwrap();
    assert!(words.contains("gateway.clients_per_user = 2"), "{said}");
    // Who goes makes room.
    drop(one);
    let again = poll(PATIENCE, || {
        Client::connect(&path).hear().filter(|said| said["schema"] == "kerbside.gateway.v1")
    });
    assert!(again.is_some());
    down(&sandbox, stack);
}

#[test]
fn a_gateway_that_dies_costs_its_clients_alone() {
    let sandbox = Sandbox::new();
    let stack = up(&sandbox, "");
    let pid = gateway_pid(&sandbox);
    let path = door(&sandbox);
    let mut client = Client::enter(&path);
    let armed = client.ask(json!({"request": "arm"}));
    assert_eq!(armed["mode"], "armed", "{armed}");
    send(u32::try_from(pid).unwrap(), Signal::KILL);
    assert_eq!(client.hear(), None);
    let again = until(&sandbox, "another gateway", |status| {
        // What the mode was, it stays.
        assert_eq!(status["mode"], "armed", "{status}");
        let row = row(status, "gateway");
        (row["state"] == "healthy" && row["restarts"] == 1).then(|| row["pid"].clone())
    });
    assert_ne!(again, pid);
    // What was left of the socket has been replaced.
    let mut client = Client::enter(&path);
    assert_eq!(client.ask(json!({"request": "stop"}))["ok"], true);
    down(&sandbox, stack);
}

#[test]
fn users_that_are_not_there_are_refused_with_the_key() {
    let sandbox = Sandbox::new();
    let text = format!("{STACK}[gateway.rights]\nstop = [\"no-such-user\"]\n");
    let config = file(&sandbox, "stack.toml", &text);
    let said = run(
        &sandbox,
        &["up", "--simulate", "--instance", "one", "--config", config.to_str().unwrap()],
    );
    said.refuses(78, &["gateway.rights.stop", "\"no-such-user\"", "no user of that name"]);
    sandbox.assert_empty();
}

#[test]
fn a_place_for_the_socket_that_others_could_take_is_not_used() {
    let sandbox = Sandbox::new();
    let open = sandbox.gateways().join("open");
    fs::create_dir(&open).unwrap();
    fs::set_permissions(&open, fs::Permissions::from_mode(0o777)).unwrap();
    let socket = open.join("one.gateway");
    let stack = up(&sandbox, &format!("socket = \"{}\"\n", socket.display()));
    until(&sandbox, "the reason", |status| {
        let said = row(status, "gateway")["waiting_for"].as_str().unwrap().to_owned();
        said.starts_with("no gateway: ").then_some(())
    });
    assert!(!socket.exists());
    stack.until_says("mode 777");
    down(&sandbox, stack);
}

/// Three ordinary users who are nobody on this machine: the stack's, one with some rights, one without any.
const USER: u32 = 21_001;
const PEER: u32 = 21_002;
const NOBODY: u32 = 21_003;
/// A group that has rights.
const GROUP: u32 = 21_077;

#[test]
fn another_user_reaches_the_gateway_alone_and_only_with_rights() {
    if !rustix::process::geteuid().is_root() {
        eprintln!("skipped: only root can become other users");
        return;
    }
    let sandbox = Sandbox::new();
    let instance = sandbox.instance();
    let home = instance.folder().ancestors().nth(3).unwrap().to_owned();
    fs::set_permissions(&home, fs::Permissions::from_mode(0o755)).unwrap();
    for part in ["run", "state", "work", "doors"] {
        chown(home.join(part), Some(USER), Some(USER)).unwrap();
    }
    let rights = format!("[gateway.rights]\nwatch = [\"@{GROUP}\"]\nstop = [\"{PEER}\"]\n");
    let config = file(&sandbox, "stack.toml", &format!("{STACK}{rights}"));
    let mut up = sandbox.kerbside();
    up.uid(USER).gid(USER).args(["up", "--simulate", "--start=-1.0,0.65,0", "--instance", "one"]);
    up.arg("--config").arg(&config);
    let stack = Running::spawn(&sandbox, "up", up);
    let as_user = |user: u32, group: u32, arguments: &[&str]| {
        let mut command = sandbox.kerbside();
        finish({
            command.uid(user).gid(group).args(arguments);
            command
        })
    };
    let own = |arguments: &[&str]| as_user(USER, USER, arguments);
    let ready = poll(PATIENCE, || {
        let said = own(&["status", "--json"]);
        let json = (said.code == Some(0)).then(|| said.json())?;
        (json["mode"] == "ready" && row(&json, "gateway")["state"] == "healthy").then_some(())
    });
    assert!(ready.is_some(), "{}", stack.log());

    // Nothing of the instance is open to anybody else but the socket.
    let segments: Vec<_> =
        sandbox.segments().into_iter().map(|name| format!("/dev/shm/{name}")).collect();
    assert!(segments.len() > 50, "{segments:?}");
    let mut look = std::process::Command::new("sh");
    look.arg("-c").arg("for f; do cat \"$f\" || ls \"$f\"; done >/dev/null 2>&1 && echo reached");
    look.arg("sh").args(&segments).arg(instance.folder()).arg(instance.configuration());
    look.uid(PEER).gid(GROUP);
    assert_eq!(finish(look).stdout, "", "another user reads what is not theirs");

    // By the group: it may watch. By its number: it may stop. No more.
    let said = as_user(PEER, GROUP, &["status", "--json"]);
    assert_eq!((said.code, said.stderr.as_str()), (Some(0), ""), "{said:?}");
    assert_eq!((&said.json()["mode"], &said.json()["instance"]), (&json!("ready"), &json!("one")));
    let said = as_user(PEER, GROUP, &["status", "--instance", "one"]);
    assert!(said.stdout.contains("mode ready"), "{said:?}");
    let said = as_user(PEER, GROUP, &["stop", "--instance", door(&sandbox).to_str().unwrap()]);
    assert_eq!((said.code, said.stdout.as_str()), (Some(0), "one: ready\n"), "{said:?}");
    as_user(PEER, GROUP, &["arm"])
        .refuses(1, &["user 21002 without the right arm", "gateway.rights.arm"]);
    as_user(PEER, GROUP, &["fix", "0", "0", "0"]).refuses(1, &["without the right fix"]);
    as_user(PEER, GROUP, &["go", "garage"]).refuses(1, &["without the right arm"]);
    as_user(PEER, GROUP, &["down"]).refuses(75, &["another user's"]);
    as_user(PEER, PEER, &["status"]).refuses(1, &["without the right watch"]);
    as_user(NOBODY, NOBODY, &["status"]).refuses(1, &["user 21003 without any right"]);
    as_user(NOBODY, NOBODY, &["stop"]).refuses(1, &["user 21003 without any right"]);

    let said = own(&["down"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(stack.end().code, Some(0));
    sandbox.assert_empty();
    as_user(PEER, GROUP, &["status"]).refuses(75, &["no instance is running"]);
}

#[test]
fn another_user_with_all_rights_parks_the_car() {
    if !rustix::process::geteuid().is_root() {
        eprintln!("skipped: only root can become other users");
        return;
    }
    let sandbox = Sandbox::new();
    let home = sandbox.instance().folder().ancestors().nth(3).unwrap().to_owned();
    fs::set_permissions(&home, fs::Permissions::from_mode(0o755)).unwrap();
    let names = ["watch", "fix", "plan", "arm", "stop"].map(|right| format!("{right} = [\"*\"]\n"));
    let stack = up(&sandbox, &format!("[gateway.rights]\n{}", names.concat()));
    gateway_pid(&sandbox);
    let peer = |arguments: &[&str]| {
        let mut command = sandbox.kerbside();
        // A folder of its own for what is its own: the stack's is closed to it.
        command.uid(PEER).gid(PEER).env("XDG_RUNTIME_DIR", "/nonexistent").args(arguments);
        finish(command)
    };
    go(peer);
    let said = peer(&["fix", "--instance", "one", "--", "-0.5", "0.65", "0"]);
    assert_eq!((said.code, said.stdout.as_str()), (Some(0), "one: fix accepted\n"), "{said:?}");
    down(&sandbox, stack);
}
