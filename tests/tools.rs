//! The tools on a running stack: what they show is there, and nothing is left of them.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod common_cli;

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read};
use std::os::fd::AsFd;
use std::process::Stdio;

use common::stack::{poll, send};
use common::{PATIENCE, Sandbox, Signal};
use common_cli::{Running, Said, is_documented, run, until_mode};
use kerbside::vehicle::pty::Pty;
use kerbside_messages::topics::RAW;
use kerbside_messages::{Process, Raw};
use kerbside_runtime::{GUESTS, Session};
use serde_json::Value;

fn up(sandbox: &Sandbox) -> Running {
    let instance = sandbox.instance();
    let stack = Running::start(
        sandbox,
        "up",
        &["up", "--simulate", "--start=-1.0,0.65,0", "--instance", instance.name()],
    );
    until_mode(sandbox, "ready");
    stack
}

fn down(sandbox: &Sandbox, stack: Running) {
    assert_eq!(run(sandbox, &["down"]).code, Some(0));
    assert_eq!(stack.end().code, Some(0));
    sandbox.assert_empty();
}

fn good(sandbox: &Sandbox, arguments: &[&str]) -> Said {
    let said = run(sandbox, arguments);
    assert_eq!((said.code, said.stderr.as_str()), (Some(0), ""), "{arguments:?}: {said:?}");
    said
}

/// Lines of JSON.
fn objects(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn tools_show_what_a_stack_does() {
    let sandbox = Sandbox::new();
    let stack = up(&sandbox);
    topics_are_listed_with_who_takes_part(&sandbox);
    samples_are_printed(&sandbox);
    rates_are_measured(&sandbox);
    one_table_goes_to_a_pipe(&sandbox);
    wrong_names_are_refused(&sandbox);
    a_reader_that_leaves_early_ends_them(&sandbox);
    places_that_are_taken_are_told(&sandbox);
    an_interrupt_ends_an_echo_and_so_does_the_end_of_the_stack(&sandbox, stack);
}

fn topics_are_listed_with_who_takes_part(sandbox: &Sandbox) {
    let listed = good(sandbox, &["topics", "--json"]).json();
    is_documented("topics", &listed);
    let topics = listed["topics"].as_array().unwrap();
    let of = |name: &str| topics.iter().find(|topic| topic["name"] == name).unwrap();
    let names = |list: &Value| -> Vec<String> {
        let list = list.as_array().unwrap().iter();
        list.map(|one| one["process"].as_str().unwrap_or("guest").to_owned()).collect()
    };
    assert_eq!(names(&of("odometry")["publishers"]), ["estimator"]);
    let readers = names(&of("odometry")["subscribers"]);
    for reader in ["planner", "recorder", "supervisor", "tracker"] {
        assert!(readers.iter().any(|name| name == reader), "{reader}: {readers:?}");
    }
    assert!(!readers.iter().any(|name| name == "guest"), "{readers:?}");
    assert_eq!(names(&of("plan_request")["subscribers"]), ["planner"]);
    assert_eq!(names(&of("heartbeat")["publishers"]).len(), supervised().count());
    assert!(of("odometry")["rate_hz"].as_f64().unwrap() > 50.0, "{}", of("odometry"));
    assert!(of("heartbeat")["rate_hz"].as_f64().unwrap() > 150.0, "{}", of("heartbeat"));
    let shown = good(sandbox, &["topics"]).stdout;
    assert!(shown.contains("odometry") && shown.contains("estimator"), "{shown}");
}

fn samples_are_printed(sandbox: &Sandbox) {
    let samples = objects(&good(sandbox, &["echo", "odometry", "--count", "5", "--json"]).stdout);
    let sequences: Vec<_> =
        samples.iter().map(|sample| sample["header"]["sequence"].as_u64().unwrap()).collect();
    assert_eq!(sequences.len(), 5);
    assert!(sequences.windows(2).all(|pair| pair[1] == pair[0] + 1), "{sequences:?}");
    assert!(samples[0]["x"].is_f64() && samples[0]["state"] == "no initial pose", "{}", samples[0]);
    let fields =
        ["echo", "state", "--count", "2", "--fields", "mode,processes.1.process,header.topic"];
    let lines = good(sandbox, &fields).stdout;
    let line = "mode=ready (1)  processes.1.process=ingest (1)  header.topic=11\n";
    assert_eq!(lines, format!("{line}{line}"));
    let whole = good(sandbox, &["echo", "heartbeat/tracker", "--count", "1"]).stdout;
    assert!(whole.contains("process: tracker (4)\n") && whole.ends_with("---\n"), "{whole}");
    assert!(whole.lines().all(|line| line.chars().count() <= 80), "{whole}");
    // Nobody has planned anything yet.
    let silent = run(sandbox, &["echo", "plan", "--timeout", "0.2"]);
    silent.refuses(1, &["no sample of plan came for 0.2 s"]);
}

fn rates_are_measured(sandbox: &Sandbox) {
    let measured =
        good(sandbox, &["hz", "raw", "heartbeat/planner", "--window", "1", "--json"]).json();
    is_documented("hz", &measured);
    let [raw, beat] = &measured["topics"].as_array().unwrap()[..] else { panic!("{measured}") };
    assert_eq!((&raw["name"], &raw["nominal_hz"]), (&"raw".into(), &200.0.into()));
    assert!(
        raw["rate_hz"].as_f64().unwrap() > 50.0 && raw["samples"].as_u64().unwrap() > 20,
        "{raw}"
    );
    assert!(raw["jitter_ms"]["max"].as_f64() >= raw["jitter_ms"]["p50"].as_f64(), "{raw}");
    assert!(raw["period_ms"]["p50"].as_f64().unwrap() > 0.0 && raw["refused"] == 0, "{raw}");
    let rate = beat["rate_hz"].as_f64().unwrap();
    assert!(rate > 20.0 && rate < 75.0, "{beat}");
    let table = good(sandbox, &["hz", "--window", "0.3"]).stdout;
    assert!(
        table.contains("odometry") && table.lines().all(|line| line.chars().count() <= 80),
        "{table}"
    );
    let silent = run(sandbox, &["hz", "plan", "--window", "0.1", "--json"]);
    assert_eq!((silent.code, &silent.json()["passed"]), (Some(1), &false.into()));
}

/// The processes of a stack that has no gateway.
fn supervised() -> impl Iterator<Item = Process> {
    Process::SUPERVISED.into_iter().filter(|process| *process != Process::Gateway)
}

fn one_table_goes_to_a_pipe(sandbox: &Sandbox) {
    let seen = good(sandbox, &["top", "--interval", "0.5", "--json"]).json();
    let processes = seen["processes"].as_array().unwrap();
    let of = |name: &str| processes.iter().find(|process| process["name"] == name).unwrap();
    for process in supervised() {
        let line = of(process.name());
        assert!(line["memory_mib"].as_f64().unwrap() > 1.0 && line["state"] == "healthy", "{line}");
    }
    assert!(of("estimator")["work_max_ms"].as_f64().unwrap() > 0.0);
    assert!(
        of("supervisor")["pid"].as_u64().unwrap() > 0 && of("vehicle")["pid"].as_u64().unwrap() > 0
    );
    is_documented("top", &seen);
    let topics = seen["topics"].as_array().unwrap();
    let raw = topics.iter().find(|topic| topic["name"] == "raw").unwrap();
    assert!(
        raw["rate_hz"].as_f64().unwrap() > 50.0 && raw["age_ms"].as_f64().unwrap() < 5e3,
        "{raw}"
    );
    let two = good(sandbox, &["top", "--interval", "0.1", "--count", "2"]).stdout;
    assert_eq!(two.matches("instance one, ready").count(), 2, "{two}");
    assert!(two.lines().all(|line| line.chars().count() <= 80), "{two}");
}

fn wrong_names_are_refused(sandbox: &Sandbox) {
    run(sandbox, &["echo", "odometri"]).refuses(2, &["no such topic", "odometry"]);
    run(sandbox, &["echo", "plan_request"]).refuses(2, &["between two processes"]);
    run(sandbox, &["hz", "raw/tracker"]).refuses(2, &["leave /tracker out"]);
    run(sandbox, &["echo", "odometry", "--fields", "x,z"]).refuses(2, &["odometry has no \"z\""]);
    run(sandbox, &["top", "--instance", "two"]).refuses(75, &["instance two is not running"]);
}

fn a_reader_that_leaves_early_ends_them(sandbox: &Sandbox) {
    let verbs: [&[&str]; 3] = [
        &["echo", "raw"],
        &["hz", "raw", "--window", "0.1", "--watch"],
        &["top", "--count", "9999"],
    ];
    for verb in verbs {
        let mut command = sandbox.kerbside();
        command.args(verb).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        assert!(!line.is_empty(), "{verb:?}");
        let ended = poll(PATIENCE, || child.try_wait().unwrap());
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        assert_eq!((ended.unwrap().code(), said.as_str()), (Some(0), ""), "{verb:?}");
    }
}

fn places_that_are_taken_are_told(sandbox: &Sandbox) {
    let session = Session::join(&sandbox.instance(), Process::Operator).unwrap();
    let guests: Vec<_> = (0..GUESTS).map(|_| session.subscriber::<Raw>(None, 1).unwrap()).collect();
    let full = run(sandbox, &["echo", "raw", "--count", "1"]);
    full.refuses(
        75,
        &["topic raw: all 6 places for tools and other guests are taken", "by process"],
    );
    run(sandbox, &["hz", "raw"]).refuses(75, &["all 6 places"]);
    // Who shows everything shows what it can.
    assert!(good(sandbox, &["top", "--interval", "0.1"]).stdout.contains("full"));
    assert!(session.admit_guest(&RAW, None).is_err());
    drop((guests, session));
    good(sandbox, &["echo", "raw", "--count", "1"]);
}

fn an_interrupt_ends_an_echo_and_so_does_the_end_of_the_stack(sandbox: &Sandbox, stack: Running) {
    let started = |name: &str, arguments: &[&str]| {
        let echo = Running::start(sandbox, name, arguments);
        let file = sandbox.file(&format!("{name}.out"));
        let printed = poll(PATIENCE, || fs::read(&file).ok().filter(|text| !text.is_empty()));
        assert!(printed.is_some(), "{arguments:?} prints nothing");
        echo
    };
    let echo = started("echo", &["echo", "raw"]);
    echo.signal(Signal::INT);
    let ended = echo.end();
    assert_eq!((ended.code, ended.stderr.as_str()), (Some(0), ""), "{ended:?}");
    // A tool that dies in the middle is swept like any other process.
    let killed = started("killed", &["echo", "raw"]);
    killed.signal(Signal::KILL);
    killed.end();
    let endless = started("endless", &["echo", "raw", "--fields", "header.sequence"]);
    let counted = started("counted", &["echo", "raw", "--count", "1000000", "--json"]);
    let top = started("top", &["top", "--interval", "0.1", "--count", "1000000"]);
    down_with_tools(sandbox, stack);
    assert_eq!(endless.end().code, Some(0));
    for tool in [counted, top] {
        let ended = tool.end();
        assert_eq!(ended.code, Some(75), "{}", ended.stderr);
        assert!(ended.stderr.contains("instance one ended"), "{}", ended.stderr);
    }
    sandbox.assert_empty();
}

fn down_with_tools(sandbox: &Sandbox, stack: Running) {
    assert_eq!(run(sandbox, &["down"]).code, Some(0));
    assert_eq!(stack.end().code, Some(0));
}

#[test]
fn top_fills_a_terminal_and_gives_it_back() {
    let sandbox = Sandbox::new();
    let stack = up(&sandbox);
    let link = sandbox.file("terminal");
    let mut terminal = Pty::create(&link).unwrap();
    let size = rustix::termios::Winsize { ws_row: 40, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 };
    let open = || File::options().read(true).write(true).open(&link).unwrap();
    let end = open();
    rustix::termios::tcsetwinsize(end.as_fd(), size).unwrap();
    let before = rustix::termios::tcgetattr(&end).unwrap();
    let mut command = sandbox.kerbside();
    command.args(["top", "--interval", "0.2"]);
    command.stdin(open()).stdout(open()).stderr(open()).env("TERM", "xterm");
    let mut child = command.spawn().unwrap();
    let mut shown = Vec::new();
    let mut buffer = [0; 4096];
    let drawn = poll(PATIENCE, || {
        let length = terminal.read(&mut buffer).unwrap();
        shown.extend_from_slice(&buffer[..length]);
        String::from_utf8_lossy(&shown).contains("quits;").then_some(())
    });
    let text = String::from_utf8_lossy(&shown).into_owned();
    assert!(drawn.is_some(), "{} bytes were drawn", shown.len());
    assert!(text.contains("estimator") && text.contains("odometry"), "{text}");
    assert!(terminal.write(b"q").unwrap());
    let ended = poll(PATIENCE, || {
        let length = terminal.read(&mut buffer).unwrap();
        shown.extend_from_slice(&buffer[..length]);
        child.try_wait().unwrap()
    });
    if ended.is_none() {
        send(child.id(), Signal::KILL);
    }
    assert_eq!(ended.unwrap().code(), Some(0));
    let length = terminal.read(&mut buffer).unwrap();
    shown.extend_from_slice(&buffer[..length]);
    let text = String::from_utf8_lossy(&shown);
    assert!(text.contains("\u{1b}[?1049h") && text.contains("\u{1b}[?1049l"), "the other screen");
    let after = rustix::termios::tcgetattr(&end).unwrap();
    assert_eq!(format!("{:?}", after.local_modes), format!("{:?}", before.local_modes));
    drop((end, terminal));
    down(&sandbox, stack);
}

#[test]
fn without_a_stack_the_table_is_there_and_the_others_say_how_to_get_one() {
    let sandbox = Sandbox::new();
    let said = run(&sandbox, &["topics", "--json"]);
    assert_eq!((said.code, &said.json()["instance"]), (Some(0), &Value::Null));
    assert!(said.stderr.contains("no instance is running"), "{said:?}");
    for verb in [&["echo", "raw"][..], &["hz"], &["top"], &["topics", "--instance", "bay2"]] {
        assert_eq!(run(&sandbox, verb).code, Some(75), "{verb:?}");
    }
    run(&sandbox, &["top"]).refuses(75, &["no instance is running", "kerbside up"]);
    sandbox.assert_empty();
}
