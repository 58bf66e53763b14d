//! The pages say what the code does: the table of topics, the reference of configuration keys, every command and
//! every link.
//!
//! With `KERBSIDE_WRITE_PAGES=1` in the environment the generated parts are written anew instead of compared.

use std::fs;
use std::path::Path;

use clap::Parser;
use kerbside_messages::topics::{Delivery, PERMIT, Publisher, STATE, TABLE, Topic};

use crate::{assert_none, root};

/// Pages for people.
const PAGES: [&str; 11] = [
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "deploy/README.md",
    "docs/bindings.md",
    "deploy/fleet/README.md",
    "docs/gateway.md",
    "docs/json.md",
    "docs/run-folders.md",
    "deploy/examples/microcontroller/README.md",
    "deploy/examples/python/README.md",
];

const TABLE_BEGIN: &str =
    "<!-- topics: written by `KERBSIDE_WRITE_PAGES=1 cargo test --test house` -->\n";
const TABLE_END: &str = "<!-- end of topics -->";

fn read(page: &str) -> String {
    fs::read_to_string(root().join(page)).unwrap_or_else(|error| panic!("{page}: {error}"))
}

/// Compares a generated page with the one that is there, or writes it.
fn hold(page: &str, is: &str, wanted: &str) {
    if std::env::var_os("KERBSIDE_WRITE_PAGES").is_some() {
        fs::write(root().join(page), wanted).expect("a writable page");
    } else {
        let hint = "KERBSIDE_WRITE_PAGES=1 cargo test -p kerbside --test house writes it anew";
        assert!(is == wanted, "{page} is not what the code says; {hint}");
    }
}

fn publisher(topic: &Topic) -> String {
    match topic.publisher {
        Publisher::One(process) => process.name().to_owned(),
        Publisher::Each => "every process".to_owned(),
        Publisher::Any => "anyone".to_owned(),
    }
}

fn delivery(topic: &Topic) -> String {
    match topic.delivery {
        Delivery::InOrder { depth } => format!("in order, {depth} deep"),
        Delivery::Newest => "newest".to_owned(),
        Delivery::RequestResponse => "request and answer".to_owned(),
    }
}

fn row(topic: &Topic) -> String {
    // Which subscriber is woken is the second thing one asks of a topic: it stands in bold.
    let subscriber = |process: &kerbside_messages::Process| match topic.wakes {
        Some(woken) if woken == *process => format!("**{process}**"),
        _ => process.to_string(),
    };
    let recorder = kerbside_messages::Process::Recorder;
    let readers = topic.subscribers.iter().filter(|process| **process != recorder);
    let readers: Vec<_> = readers.map(subscriber).collect();
    let rate = if topic.rate > 0.0 { format!("{}", topic.rate) } else { String::new() };
    let fresh = topic.freshness.map_or(String::new(), |age| format!("{}", age.as_millis()));
    let cells = [
        format!("`{}`", topic.name),
        publisher(topic),
        readers.join(", "),
        rate,
        fresh,
        delivery(topic),
        topic.doc.to_owned(),
    ];
    format!("| {} |\n", cells.join(" | "))
}

fn table() -> String {
    let head = "\n| topic | from | to | Hz | fresh for, ms | delivery | what it is |\n|---|---|---|---|---|---|---|\n";
    format!("{head}{}\n", TABLE.iter().map(row).collect::<String>())
}

#[test]
fn the_table_of_topics_is_the_codes() {
    let page = read("README.md");
    let begin = page.find(TABLE_BEGIN).expect("the beginning of the table") + TABLE_BEGIN.len();
    let end = page.find(TABLE_END).expect("the end of the table");
    let wanted = format!("{}{}{}", &page[..begin], table(), &page[end..]);
    hold("README.md", &page, &wanted);
}

/// What the supervisor publishes each cycle comes as often as its cycle says.
#[test]
fn the_supervisors_topics_come_once_a_cycle() {
    let cycle = kerbside_safety::SafetySettings::default().cycle.as_secs_f64();
    for topic in [&PERMIT, &STATE] {
        assert!((topic.rate * cycle - 1.0).abs() < 1e-9, "{}: {} Hz", topic.name, topic.rate);
    }
}

#[test]
fn the_reference_of_keys_is_the_codes() {
    let page = "docs/configuration.md";
    let is = fs::read_to_string(root().join(page)).unwrap_or_default();
    hold(page, &is, &kerbside_settings::reference());
}

/// The commands in a page's blocks of code: lines that call kerbside, without what a shell would take away.
fn commands(text: &str) -> Vec<String> {
    let mut inside = false;
    let mut found = Vec::new();
    for line in text.lines() {
        if line.starts_with("```") {
            inside = !inside;
            continue;
        }
        let line = line.split(['#', '|', '>', '&']).next().unwrap_or_default().trim();
        let line = line.strip_prefix("$ ").unwrap_or(line);
        let called = line
            .strip_prefix("cargo run --release -- ")
            .or_else(|| line.strip_prefix("kerbside "))
            .or_else(|| line.strip_prefix("target/release/kerbside "));
        if let Some(arguments) = called.filter(|_| inside) {
            found.push(arguments.to_owned());
        }
    }
    found
}

#[test]
fn commands_in_pages_are_understood() {
    let mut complaints = Vec::new();
    let mut count = 0;
    for page in PAGES {
        for command in commands(&read(page)) {
            count += 1;
            let words = core::iter::once("kerbside").chain(command.split_whitespace());
            if let Err(error) = kerbside::Cli::try_parse_from(words)
                && error.use_stderr()
            {
                let said = error.to_string();
                let first = said.lines().next().unwrap_or_default().to_owned();
                complaints.push(format!("{page}: kerbside {command}: {first}"));
            }
        }
    }
    assert!(count > 10, "{count} commands: this test looks at nothing");
    assert_none(&complaints);
}

#[test]
fn links_lead_somewhere() {
    let mut complaints = Vec::new();
    for page in PAGES {
        let text = read(page);
        let folder = Path::new(page).parent().expect("a folder").to_owned();
        for (at, _) in text.match_indices("](") {
            let target = text[at + 2..].split(')').next().unwrap_or_default();
            let file = target.split('#').next().unwrap_or_default();
            let elsewhere = target.contains("://") || file.is_empty();
            if !elsewhere && !root().join(&folder).join(file).exists() {
                complaints.push(format!("{page}: {target} is not there"));
            }
        }
    }
    assert_none(&complaints);
}

#[test]
fn verbs_of_the_command_line_are_told_of() {
    use clap::CommandFactory;
    let readme = read("README.md");
    let untold: Vec<_> = kerbside::Cli::command()
        .get_subcommands()
        .map(|verb| verb.get_name().to_owned())
        .filter(|verb| {
            !readme.contains(&format!("kerbside {verb}")) && !readme.contains(&format!("-- {verb}"))
        })
        .map(|verb| format!("README.md says nothing of kerbside {verb}"))
        .collect();
    assert_none(&untold);
}

/// Verbs below `command` that print an object, each with the words that lead to it.
fn verbs_with_json(command: &clap::Command, words: &str, found: &mut Vec<String>) {
    for verb in command.get_subcommands().filter(|verb| !verb.is_hide_set()) {
        let words = format!("{words} {}", verb.get_name());
        if verb.get_arguments().any(|argument| argument.get_long() == Some("json")) {
            found.push(words.trim().to_owned());
        }
        verbs_with_json(verb, &words, found);
    }
}

#[test]
fn what_verbs_print_as_json_is_told_of() {
    use clap::CommandFactory;
    let page = read("docs/json.md");
    let told: Vec<&str> = page.lines().filter_map(|line| line.strip_prefix("| `")).collect();
    let mut verbs = Vec::new();
    verbs_with_json(&kerbside::Cli::command(), "", &mut verbs);
    assert!(verbs.len() > 20, "{verbs:?}: this test looks at nothing");
    let is_told = |verb: &str| told.iter().any(|line| line.split('`').next() == Some(verb));
    let untold = verbs.iter().filter(|verb| !is_told(verb.as_str()));
    let untold: Vec<_> = untold.map(|verb| format!("docs/json.md has no {verb}")).collect();
    assert_none(&untold);
}

#[test]
fn requests_in_the_gateways_page_are_understood() {
    let page = read("docs/gateway.md");
    let now = page.split("\"now\":").nth(1).and_then(|rest| rest.split('}').next());
    let now = now.and_then(|now| now.parse().ok()).expect("the greeting's clock");
    let settings = kerbside_settings::GatewaySettings::default();
    let requests: Vec<_> = page.lines().filter(|line| line.contains("\"request\":")).collect();
    assert_eq!(requests.len(), 10, "this test looks at nothing");
    let complain = |line: &&str| {
        let (_, request) = kerbside::gateway::request::parse(line.as_bytes(), now, &settings);
        request.err().map(|complaint| format!("docs/gateway.md: {line}: {complaint}"))
    };
    assert_none(&requests.iter().filter_map(complain).collect::<Vec<_>>());
}
