//! The stack by hand: operators' verbs, services started by a person in any order, two stacks side by side, other users.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod common_cli;

use core::time::Duration;
use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};

use common::stack::poll;
use common::{Sandbox, Signal};
use common_cli::{Running, SHORT, Said, file, finish, row, run, status, until, until_mode};
use kerbside_messages::Process;
use kerbside_runtime::{Ticker, now};

const STACK: &str = "vehicle = \"paper-1-6\"\n";

/// A verb on the sandbox's instance.
fn verb(sandbox: &Sandbox, arguments: &[&str]) -> Said {
    let (verb, rest) = arguments.split_first().unwrap();
    let instance = sandbox.instance();
    run(sandbox, &[&[*verb, "--instance", instance.name()], rest].concat())
}

fn must(sandbox: &Sandbox, arguments: &[&str]) -> Said {
    let said = verb(sandbox, arguments);
    assert_eq!((said.code, said.stderr.as_str()), (Some(0), ""), "{arguments:?}: {said:?}");
    said
}

fn up(sandbox: &Sandbox, arguments: &[&str]) -> Running {
    let instance = sandbox.instance();
    let up = ["up", "--simulate", "--instance", instance.name()];
    Running::start(sandbox, "up", &[&up, arguments].concat())
}

/// Where the vehicle stands in the scenario that starts at rest.
const GARAGE: &str = "--start=-1.0,0.65,0";

/// Goes there. On a busy machine samples may come too late: then the car stops, and the operator tries again.
fn go_until_there(sandbox: &Sandbox, arguments: &[&str]) -> Said {
    let late = ["too old", "deadline", "heartbeat missing", "line lost", "is not ready"];
    let arrived = poll(2 * common::PATIENCE, || {
        let said = verb(sandbox, arguments);
        let again = said.code == Some(1) && late.iter().any(|cause| said.stdout.contains(cause));
        (!again).then_some(said)
    });
    arrived.expect("the machine is too busy to drive")
}

#[test]
fn an_operator_fixes_arms_drives_and_stops() {
    let sandbox = Sandbox::new();
    let stack = up(&sandbox, &[GARAGE]);
    until_mode(&sandbox, "ready");
    let refused = verb(&sandbox, &["arm"]);
    assert_eq!(
        (refused.code, refused.stdout.as_str()),
        (Some(1), "one: refused: no pose yet: send a fix\n")
    );
    let refused = verb(&sandbox, &["go", "garage", "--json"]);
    assert_eq!((refused.code, &refused.json()["passed"]), (Some(1), &false.into()));
    assert_eq!(must(&sandbox, &["fix", "-1.0", "0.65", "0"]).stdout, "one: fix accepted\n");

    let driving = Running::start(&sandbox, "go", &["go", "garage", "--json"]);
    until_mode(&sandbox, "driving");
    let second = verb(&sandbox, &["arm"]);
    assert_eq!(second.code, Some(1));
    assert!(second.stdout.contains("the mode is driving"), "{second:?}");
    // The only instance is the one that is meant. A stop is over when the vehicle stands.
    assert_eq!(run(&sandbox, &["stop"]).stdout, "one: ready\n");
    let ended = driving.end();
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert_eq!(ended.json()["cause"], "stopped by an operator");

    // A pose is a goal too; who asked for it and is interrupted stops the vehicle.
    let driving = Running::start(&sandbox, "go", &["go", "1.0", "0.65", "0"]);
    until_mode(&sandbox, "driving");
    driving.signal(Signal::INT);
    let ended = driving.end();
    assert_eq!((ended.code, ended.stdout.as_str()), (Some(1), "one: interrupted\n"));
    until_mode(&sandbox, "ready");

    // A goal that cannot be reached leaves nothing armed.
    let nowhere = verb(&sandbox, &["go", "0", "-0.75", "0", "--among", "garage"]);
    assert_eq!(nowhere.code, Some(1), "{nowhere:?}");
    assert!(nowhere.stdout.contains("no plan: the goal is not free"), "{nowhere:?}");
    assert_eq!(status(&sandbox).unwrap()["mode"], "ready");

    // And at last into the garage, from wherever it stands.
    let arrived = go_until_there(&sandbox, &["go", "garage", "--json"]).json();
    assert_eq!(arrived["cause"], "plan completed");
    assert!(arrived["min_clearance_m"].as_f64().unwrap() >= 0.05, "{arrived}");
    assert_eq!(must(&sandbox, &["down"]).stdout, "one: down\n");
    assert_eq!(stack.end().code, Some(0));
    sandbox.assert_empty();
}

#[test]
fn status_shows_each_process_and_the_mode() {
    let sandbox = Sandbox::new();
    let stack = up(&sandbox, &[]);
    until_mode(&sandbox, "ready");
    let seen = status(&sandbox).unwrap();
    assert_eq!((&seen["instance"], &seen["passed"]), (&"one".into(), &true.into()));
    let by_default = |process: &Process| *process != Process::Gateway;
    let names = Process::SUPERVISED.into_iter().filter(by_default).map(Process::name);
    let names: Vec<_> = names.collect();
    let rows = seen["processes"].as_array().unwrap();
    assert_eq!(rows.iter().map(|row| row["name"].as_str().unwrap()).collect::<Vec<_>>(), names);
    for process in rows {
        assert_eq!(process["state"], "healthy", "{seen}");
        assert!(process["age_ms"].as_u64().unwrap() < 1000, "{seen}");
        let pid = process["pid"].as_u64().unwrap();
        let line = fs::read_to_string(format!("/proc/{pid}/cmdline")).unwrap().replace('\0', " ");
        let name = process["name"].as_str().unwrap();
        assert!(line.starts_with(&format!("kerbside service {name} ")), "{line}");
    }
    let table = must(&sandbox, &["status"]).stdout;
    for name in names {
        assert!(table.contains(name), "{table}");
    }
    assert!(table.contains("mode ready"), "{table}");
    // A second supervisor is refused, and does no harm.
    let instance = sandbox.instance();
    let pid = stack.pid().to_string();
    run(&sandbox, &["up", "--simulate", "--instance", instance.name()])
        .refuses(75, &["instance one is already supervised by process", &pid]);
    assert_eq!(status(&sandbox).unwrap()["mode"], "ready");
    stack.signal(Signal::TERM);
    assert_eq!(stack.end().code, Some(0));
    sandbox.assert_empty();
}

#[test]
fn ctrl_c_ends_a_stack_in_order_even_when_nobody_reads_what_it_says() {
    let sandbox = Sandbox::new();
    let instance = sandbox.instance();
    let mut command = sandbox.kerbside();
    command.args(["up", "--simulate", "--instance", instance.name()]);
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stderr.take());
    until_mode(&sandbox, "ready");
    common::stack::send(child.id(), Signal::INT);
    let ended = poll(common::PATIENCE, || child.try_wait().unwrap());
    assert_eq!(ended.and_then(|status| status.code()), Some(0));
    sandbox.assert_empty();
}

#[test]
fn log_lines_of_all_processes_read_together() {
    let sandbox = Sandbox::new();
    let config = file(&sandbox, "json.toml", &format!("{STACK}[log]\nformat = \"json\"\n"));
    let stack = up(&sandbox, &["--config", config.to_str().unwrap()]);
    until_mode(&sandbox, "ready");
    must(&sandbox, &["down"]);
    let log = stack.end().stderr;
    let mut times = Vec::new();
    let mut processes = std::collections::BTreeSet::new();
    // What it says to the person who started it is no event.
    for line in log.lines().filter(|line| !line.starts_with("instance one is ready")) {
        let event: serde_json::Value =
            serde_json::from_str(line).unwrap_or_else(|_| panic!("{log}"));
        assert!(event["message"].is_string() && event["fields"].is_object(), "{event}");
        assert_eq!(event["level"], "info", "{event}");
        processes.insert(event["process"].as_str().unwrap().to_owned());
        times.push(event["time"].as_f64().unwrap());
    }
    for process in ["supervisor", "interface", "recorder", "vehicle"] {
        assert!(processes.contains(process), "{process} is missing:\n{log}");
    }
    // One clock: the lines are in order but for those of the same instant.
    assert!(times.windows(2).all(|pair| pair[1] > pair[0] - 0.1), "{times:?}");
    sandbox.assert_empty();

    // RUST_LOG goes before the configuration, and reaches the children.
    let sandbox = Sandbox::new();
    let mut command = sandbox.kerbside();
    command.args(["up", "--simulate", "--instance", "one"]).env("RUST_LOG", "error");
    let stack = Running::spawn(&sandbox, "quiet", command);
    until_mode(&sandbox, "ready");
    must(&sandbox, &["down"]);
    assert_eq!(stack.end().stderr, "instance one is ready; Ctrl-C ends it\n");
    sandbox.assert_empty();
}

/// A stack none of whose processes the supervisor starts.
fn by_hand(sandbox: &Sandbox) -> String {
    let external = |process: Process| format!("[process.{process}]\nstart = \"external\"\n");
    let external: String = Process::SUPERVISED.map(external).concat();
    let path = file(sandbox, "hand.toml", &format!("{STACK}{external}"));
    path.to_str().unwrap().to_owned()
}

fn service(sandbox: &Sandbox, process: Process, config: &str) -> Running {
    let arguments = ["service", process.name(), "--instance", "one", "--config", config];
    Running::start(sandbox, process.name(), &arguments)
}

#[test]
fn services_start_by_hand_in_any_order() {
    let sandbox = Sandbox::new();
    let config = by_hand(&sandbox);
    // Against the way of the samples, the supervisor in the midst.
    let before = [Process::Recorder, Process::Actuation, Process::Tracker, Process::Planner];
    let mut services: Vec<_> =
        before.map(|process| (process, service(&sandbox, process, &config))).into();
    for (_, service) in &services {
        service.until_says("waiting: the supervisor of instance one is not there yet");
    }
    let up = ["up", "--instance", "one", "--config", &config];
    let stack = Running::start(&sandbox, "up", &up);
    until(&sandbox, "the tracker", |status| {
        (row(status, "tracker")["state"] == "healthy").then_some(())
    });
    let seen = status(&sandbox).unwrap();
    assert_eq!(
        (&seen["mode"], &row(&seen, "ingest")["state"]),
        (&"starting".into(), &"external".into())
    );
    for process in [Process::Estimator, Process::Ingest, Process::Interface] {
        services.push((process, service(&sandbox, process, &config)));
    }
    until(&sandbox, "what the interface waits for", |status| {
        (row(status, "interface")["waiting_for"] == "the vehicle's line").then_some(())
    });
    let vehicle = ["service", "vehicle", "--instance", "one", "--start=0.2,0.65,0"];
    let vehicle = Running::start(&sandbox, "vehicle", &vehicle);
    until_mode(&sandbox, "ready");

    for (process, service) in &services {
        let second = ["service", process.name(), "--instance", "one", "--config", &config];
        let pid = service.pid().to_string();
        run(&sandbox, &second).refuses(75, &["already runs as process", &pid]);
    }
    run(&sandbox, &["service", "vehicle", "--instance", "one"])
        .refuses(75, &["already has a simulated vehicle", &vehicle.pid().to_string()]);
    must(&sandbox, &["fix", "0.2", "0.65", "0"]);
    must(&sandbox, &["arm"]);

    // A supervisor that ends leaves them alone; they end by themselves, some time after its last word.
    must(&sandbox, &["down"]);
    assert_eq!(stack.end().code, Some(0));
    let silent = now();
    for (process, service) in services {
        let ended = service.end();
        assert_eq!(ended.code, Some(75), "{process}: {ended:?}");
        assert!(ended.stderr.contains("the supervisor is silent: ending"), "{ended:?}");
    }
    let lasted = kerbside_messages::seconds(now() - silent);
    assert!((1.0..4.0).contains(&lasted), "ended after {lasted} s");
    vehicle.signal(Signal::TERM);
    assert_eq!(vehicle.end().code, Some(0));
    sandbox.assert_empty();
}

#[test]
fn an_external_process_is_watched_and_never_killed() {
    let sandbox = Sandbox::new();
    let external = "[process.planner]\nstart = \"external\"\n";
    let config = file(&sandbox, "stack.toml", &format!("{STACK}{external}"));
    let config = config.to_str().unwrap();
    let stack = up(&sandbox, &["--config", config]);
    let planner = service(&sandbox, Process::Planner, config);
    until_mode(&sandbox, "ready");
    planner.signal(Signal::STOP);
    until(&sandbox, "silence", |status| {
        (row(status, "planner")["state"] == "silent").then_some(())
    });
    // A child would have been killed by now.
    let patience = now() + 3_000_000_000;
    let mut look = Ticker::new(Duration::from_millis(100));
    while now() < patience {
        let seen = status(&sandbox).unwrap();
        assert_eq!(row(&seen, "planner")["pid"], planner.pid(), "{seen}");
        look.wait();
    }
    // Back again, it is what it was before.
    planner.signal(Signal::CONT);
    let seen = until(&sandbox, "health", |status| {
        (row(status, "planner")["state"] == "healthy").then(|| status.clone())
    });
    assert_eq!(row(&seen, "planner")["pid"], planner.pid(), "{seen}");
    must(&sandbox, &["down"]);
    assert_eq!(stack.end().code, Some(0));
    assert_eq!(planner.end().code, Some(75));
    sandbox.assert_empty();
}

#[test]
fn a_service_does_not_join_what_a_killed_supervisor_left() {
    let sandbox = Sandbox::new();
    let config = by_hand(&sandbox);
    let up = ["up", "--instance", "one", "--config", &config];
    let stack = Running::start(&sandbox, "up", &up);
    until_mode(&sandbox, "starting");
    stack.signal(Signal::KILL);
    stack.end();
    let tracker = service(&sandbox, Process::Tracker, &config);
    tracker.until_says("waiting: the supervisor of instance one is not there yet");
    run(&sandbox, &["status"]).refuses(75, &["no instance is running"]);
    let stack = Running::start(&sandbox, "up", &up);
    until(&sandbox, "the tracker", |status| {
        (row(status, "tracker")["state"] == "healthy").then_some(())
    });
    must(&sandbox, &["down"]);
    assert_eq!(stack.end().code, Some(0));
    assert_eq!(tracker.end().code, Some(75));
    sandbox.assert_empty();
}

#[test]
fn a_service_whose_supervisor_died_before_they_met_waits_for_no_other() {
    let sandbox = Sandbox::new();
    // Process 1 started nobody here.
    let orphan = ["service", "planner", "--instance", "one", "--supervisor", "1"];
    run(&sandbox, &orphan).refuses(75, &["the supervisor ended before this process met it"]);
    sandbox.assert_empty();
}

#[test]
fn two_stacks_drive_side_by_side() {
    let one = Sandbox::new();
    let two = one.beside();
    let start = "[initial_pose]\nx = -1.0\ny = 0.65\nyaw_degrees = 0.0\n";
    let config = file(&one, "posed.toml", &format!("{STACK}{start}"));
    let config = config.to_str().unwrap();
    let arguments = ["--config", config, GARAGE];
    let stacks = [up(&one, &arguments), up(&two, &arguments)];
    until_mode(&one, "ready");
    until_mode(&two, "ready");
    // Which one is meant has to be said.
    let pids = stacks.each_ref().map(|stack| format!("(process {})", stack.pid()));
    for verb in [&["status"][..], &["arm"], &["down"], &["fix", "0", "0", "0"], &["go", "garage"]] {
        run(&one, verb).refuses(75, &["several instances", "one", "two", &pids[0], &pids[1]]);
    }
    // The stack's file says where the vehicle stands: no fix is needed.
    let drive = |sandbox: &Sandbox| go_until_there(sandbox, &["go", "-0.5", "0.65", "0"]).stdout;
    let (of_one, of_two) = std::thread::scope(|scope| {
        let (one, two) = (scope.spawn(|| drive(&one)), scope.spawn(|| drive(&two)));
        (one.join().unwrap(), two.join().unwrap())
    });
    assert_eq!(
        (of_one.as_str(), of_two.as_str()),
        ("one: plan completed\n", "two: plan completed\n")
    );
    // One ends, the other stays.
    let [first, second] = stacks;
    must(&one, &["down"]);
    assert_eq!(first.end().code, Some(0));
    one.assert_empty();
    assert_eq!(status(&two).unwrap()["mode"], "ready");
    second.signal(Signal::INT);
    assert_eq!(second.end().code, Some(0));
    two.assert_empty();
}

/// Two ordinary users who are nobody on this machine.
const USER: u32 = 21_001;
const PEER: u32 = 21_002;

#[test]
fn an_ordinary_user_parks_and_another_one_cannot_reach_it() {
    if !rustix::process::geteuid().is_root() {
        eprintln!(
            "skipped: only root can become two other users; as this user the other tests park"
        );
        return;
    }
    let sandbox = Sandbox::new();
    let instance = sandbox.instance();
    let home = instance.folder().ancestors().nth(3).unwrap().to_owned();
    fs::set_permissions(&home, fs::Permissions::from_mode(0o755)).unwrap();
    for part in ["run", "state", "work"] {
        chown(home.join(part), Some(USER), Some(USER)).unwrap();
    }
    let scenario = file(&sandbox, "short.toml", SHORT);
    let mut park = sandbox.kerbside();
    park.uid(USER).gid(USER);
    park.args(["park", scenario.to_str().unwrap(), "--json", "--rearm", "--instance", "one"]);
    let park = Running::spawn(&sandbox, "park", park);
    let as_user = |user: u32, mut command: Command| {
        finish({
            command.uid(user).gid(user);
            command
        })
    };
    let verb = |arguments: &[&str]| {
        let mut command = sandbox.kerbside();
        command.args(arguments);
        command
    };
    let driving = poll(common::PATIENCE, || {
        let said = as_user(USER, verb(&["status", "--json"]));
        (said.code == Some(0) && said.json()["mode"] == "driving").then_some(())
    });
    assert!(driving.is_some(), "{}", park.log());

    let folder = fs::metadata(instance.folder()).unwrap();
    assert_eq!((folder.uid(), folder.mode() & 0o777), (USER, 0o700));
    let segments: Vec<_> =
        sandbox.segments().into_iter().map(|name| format!("/dev/shm/{name}")).collect();
    assert!(segments.len() > 50, "{segments:?}");
    let open = |path: &&String| fs::metadata(path).is_ok_and(|found| found.mode() & 0o077 != 0);
    assert_eq!(segments.iter().filter(open).collect::<Vec<_>>(), Vec::<&String>::new());
    let mut look = Command::new("sh");
    look.arg("-c").arg("for f; do cat \"$f\" || ls \"$f\"; done >/dev/null 2>&1 && echo reached");
    look.arg("sh").args(&segments).arg(instance.folder()).arg(instance.configuration());
    assert_eq!(as_user(PEER, look).stdout, "", "another user reads what is not theirs");
    as_user(PEER, verb(&["status", "--instance", "one"])).refuses(75, &["one is not running"]);
    as_user(PEER, verb(&["stop"])).refuses(75, &["no instance is running"]);
    as_user(PEER, verb(&["up", "--simulate", "--instance", "one"])).refuses(75, &["kerbside"]);

    let said = park.end();
    // Those who look make a small machine late now and then; it is armed again, and says so.
    let other = |line: &&str| !line.ends_with("cause=deadline missed");
    let others: Vec<_> = said.stderr.lines().filter(other).collect();
    assert_eq!((said.code, others), (Some(0), Vec::new()), "{said:?}");
    assert_eq!(said.json()["parked"], true);
    sandbox.assert_empty();
}
