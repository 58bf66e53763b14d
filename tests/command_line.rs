//! The command line as a person meets it: help, refusals with their exit codes, and what goes to which stream.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod common_cli;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::Stdio;

use clap::CommandFactory;
use common::Sandbox;
use common_cli::{SHORT, Said, file, finish, reads_like_prose, run};

/// Every verb with its verbs, as words.
fn verbs() -> Vec<(Vec<String>, clap::Command)> {
    fn walk(
        command: &clap::Command,
        path: &[String],
        found: &mut Vec<(Vec<String>, clap::Command)>,
    ) {
        found.push((path.to_vec(), command.clone()));
        for verb in command
            .get_subcommands()
            .filter(|verb| verb.get_name() != "help" && !verb.is_hide_set())
        {
            walk(verb, &[path, &[verb.get_name().to_owned()]].concat(), found);
        }
    }
    let mut found = Vec::new();
    let mut command = kerbside::Cli::command().term_width(80);
    command.build();
    walk(&command, &[], &mut found);
    found
}

#[test]
fn every_verb_has_help_with_an_example_that_fits_a_terminal() {
    let verbs = verbs();
    assert!(verbs.len() > 20, "{verbs:?}");
    for (path, mut verb) in verbs {
        let help = verb.render_long_help().to_string();
        assert!(help.contains("Example"), "{path:?} has no example:\n{help}");
        for line in help.lines() {
            assert!(line.chars().count() <= 80, "{path:?}: {line}");
        }
    }
}

#[test]
fn results_can_be_had_as_json_of_every_verb() {
    let runs_on = |path: &[String]| matches!(path[0].as_str(), "service" | "up");
    for (path, verb) in verbs() {
        let leaf = verb.get_subcommands().next().is_none();
        if leaf && !runs_on(&path) {
            assert!(verb.get_arguments().any(|argument| argument.get_id() == "json"), "{path:?}");
        }
    }
}

#[test]
fn help_and_version_go_to_standard_output_and_usage_errors_do_not() {
    let sandbox = Sandbox::new();
    for arguments in [&["--help"][..], &["help", "park"], &["config", "check", "--help"]] {
        let said = run(&sandbox, arguments);
        assert_eq!((said.code, said.stderr.as_str()), (Some(0), ""), "{arguments:?}");
        assert!(said.stdout.contains("Usage: kerbside"), "{said:?}");
    }
    assert_eq!(run(&sandbox, &["--version"]).stdout, "kerbside 0.1.0\n");
    let usage: [&[&str]; 10] = [
        &[],
        &["parc"],
        &["park"],
        &["park", "garage", "--runs", "0"],
        &["go", "1", "2"],
        &["fix", "1", "2"],
        &["fix", "1", "2", "3", "--yaw-noise", "0"],
        &["status", "--log", "loud"],
        &["up", "--simulate", "--start", "1,2"],
        &["up", "--instance", "Bay 2"],
    ];
    for arguments in usage {
        let said = run(&sandbox, arguments);
        assert_eq!((said.code, said.stdout.as_str()), (Some(2), ""), "{arguments:?}: {said:?}");
        reads_like_prose(&said.stderr);
    }
    run(&sandbox, &["fix", "1e30", "0", "0"]).refuses(2, &["no pose for a vehicle"]);
    run(&sandbox, &["go", "1", "nan", "0"]).refuses(2, &["x and y in metres, yaw in degrees"]);
    sandbox.assert_empty();
}

/// A stack's file with this in it, refused when it is used.
fn refused_stack(sandbox: &Sandbox, content: &str, words: &[&str]) {
    let path = file(sandbox, "conf/stack.toml", content);
    let path = path.to_str().unwrap();
    let said = run(sandbox, &["up", "--config", path]);
    said.refuses(78, &[&[path], words].concat());
    assert_eq!(said.stdout, "");
    let said = run(sandbox, &["park", "garage", "--json", "--config", path]);
    said.refuses(78, words);
    let failure = said.json();
    assert_eq!((&failure["passed"], &failure["exit"]), (&false.into(), &78.into()));
    assert!(!failure["problems"].as_array().unwrap().is_empty(), "{failure}");
}

#[test]
fn a_refused_stack_is_shown_where_it_is_wrong() {
    let sandbox = Sandbox::new();
    let base = "vehicle = \"paper-1-6\"\n";
    let with = |more: &str| format!("{base}{more}");
    refused_stack(
        &sandbox,
        &with("[tracker]\ngain_acros = 2.0\n"),
        &["stack.toml:3", "tracker.gain_acros", "unknown key", "gain_across"],
    );
    refused_stack(
        &sandbox,
        &with("[recorder]\nenabled = \"yes\"\n"),
        &["stack.toml:3", "recorder.enabled = \"yes\"", "wrong type", "true or false"],
    );
    refused_stack(
        &sandbox,
        &with("[log]\nlevel = \"loud\"\n"),
        &["stack.toml:3", "log.level = \"loud\"", "not allowed", "\"trace\""],
    );
    refused_stack(
        &sandbox,
        &with("[safety]\nstop_distance = 0.1\n"),
        &["stack.toml:3", "safety.stop_distance = 0.1", "to stop from full speed", "at least"],
    );
    let several = "[log]\nlevel = \"loud\"\nformat = 3\n";
    let words = ["2 problems", "stack.toml:3", "stack.toml:4", "log.format = 3", "wrong type"];
    refused_stack(&sandbox, &with(several), &words);
    refused_stack(&sandbox, &with("[log\n"), &["stack.toml:2", "not valid TOML"]);
    // The scenario of `park` brings a vehicle of its own.
    let path = file(&sandbox, "conf/stack.toml", "vehicle = \"paper-1-7\"\n");
    run(&sandbox, &["up", "--config", path.to_str().unwrap()])
        .refuses(78, &["stack.toml:1", "vehicle = \"paper-1-7\"", "paper-1-6", "full-size"]);
    sandbox.assert_empty();
}

#[test]
fn a_refused_scenario_or_vehicle_is_shown_where_it_is_wrong() {
    let sandbox = Sandbox::new();
    let refused = |name: &str, content: String, words: &[&str]| {
        let path = file(&sandbox, name, &content);
        let path = path.to_str().unwrap();
        let said = match name.split('-').next() {
            Some("vehicle") => run(&sandbox, &["park", "garage", "--vehicle", path]),
            _ => run(&sandbox, &["park", path]),
        };
        said.refuses(78, &[&[path], words].concat());
    };
    let scenario = |from: &str, to: &str| {
        assert!(SHORT.contains(from), "{from}");
        SHORT.replacen(from, to, 1)
    };
    refused(
        "outside.toml",
        scenario("[goal]\nx = -0.5", "[goal]\nx = 9.5"),
        &["goal", "the footprint leaves the map"],
    );
    refused(
        "inside.toml",
        scenario("[goal]\nx = -0.5\ny = 0.65", "[goal]\nx = -0.5\ny = -0.2"),
        &["goal", "obstacle"],
    );
    refused(
        "key.toml",
        scenario("gear = \"forward\"", "gear = \"sideways\""),
        &["key.toml:19", "goal.gear = \"sideways\"", "\"reverse\""],
    );
    let compiled_in = kerbside_settings::COMPILED_IN;
    let (_, car) = compiled_in.iter().find(|(name, _)| *name == "vehicles/paper-1-6.toml").unwrap();
    let line = car.lines().find(|line| line.starts_with("rear_overhang")).unwrap();
    refused(
        "vehicle-odd.toml",
        car.replacen(line, "rear_overhang = 0.8", 1),
        &["footprint.rear_overhang = 0.8", "impossible geometry", "in front of the footprint"],
    );
    run(&sandbox, &["park", "gerage"]).refuses(
        78,
        &["no scenario named \"gerage\"", "there are: garage, ", "parallel-full-size"],
    );
    run(&sandbox, &["park", "nowhere/x.toml"]).refuses(78, &["nowhere/x.toml", "No such file"]);
    run(&sandbox, &["up", "--config", "nowhere"]).refuses(78, &["nowhere", "No such file"]);
    sandbox.assert_empty();
}

#[test]
fn without_a_stack_operators_are_told_how_to_get_one() {
    let sandbox = Sandbox::new();
    let verbs: [&[&str]; 6] =
        [&["status"], &["arm"], &["stop"], &["down"], &["fix", "0", "0", "0"], &["go", "garage"]];
    for verb in verbs {
        run(&sandbox, verb).refuses(75, &["no instance is running", "kerbside up"]);
        let said = run(&sandbox, &[verb, &["--json", "--instance", "bay2"]].concat());
        said.refuses(75, &["instance bay2 is not running"]);
        assert_eq!(said.json()["exit"], 75);
    }
    sandbox.assert_empty();
}

#[test]
fn folders_that_cannot_be_used_are_named() {
    let sandbox = Sandbox::new();
    let deep = format!("/tmp/{}", "d".repeat(80));
    let mut command = sandbox.kerbside();
    command.args(["up", "--simulate"]).env("XDG_RUNTIME_DIR", &deep);
    finish(command).refuses(75, &[&deep, "room for the sockets", "XDG_RUNTIME_DIR"]);
    run(&sandbox, &["park", "garage", "--out", "/proc/nothing"])
        .refuses(75, &["cannot write to /proc/nothing"]);
    // Root writes wherever it likes.
    if !rustix::process::geteuid().is_root() {
        let closed = sandbox.file("closed");
        fs::create_dir(&closed).unwrap();
        fs::set_permissions(&closed, fs::Permissions::from_mode(0o500)).unwrap();
        let closed = closed.to_str().unwrap();
        run(&sandbox, &["park", "garage", "--out", closed])
            .refuses(75, &[closed, "Permission denied"]);
    }
    sandbox.assert_empty();
}

#[test]
fn what_is_compiled_in_parks_from_any_folder_and_tells_one_object() {
    let sandbox = Sandbox::new();
    let said = run(&sandbox, &["park", "garage", "--lockstep", "--json"]);
    assert_eq!((said.code, said.stderr.as_str()), (Some(0), ""), "{said:?}");
    let parked = said.json();
    assert_eq!((&parked["schema"], &parked["parked"]), (&"kerbside.park.v1".into(), &true.into()));
    let report = parked["report"].as_str().unwrap();
    assert!(report.starts_with('/') && fs::metadata(report).unwrap().len() > 10_000, "{report}");
    sandbox.assert_empty();
}

#[test]
fn configuration_is_checked_shown_and_explained() {
    let sandbox = Sandbox::new();
    let good = |arguments: &[&str]| {
        let said = run(&sandbox, arguments);
        assert_eq!((said.code, said.stderr.as_str()), (Some(0), ""), "{arguments:?}: {said:?}");
        said
    };
    assert_eq!(good(&["config", "check"]).stdout, "no problem found\n");
    assert_eq!(good(&["config", "check", "--json"]).json()["problems"], serde_json::json!([]));
    let shown = good(&["config", "show", "--scenario", "garage"]).stdout;
    assert!(shown.contains("stop_distance = 0.65") && shown.contains("scenarios/garage.toml:"));
    let settings = good(&["config", "show", "--json"]).json();
    let settings = settings["settings"].as_array().unwrap();
    assert!(settings.iter().any(|one| one["key"] == "log.level" && one["value"] == "\"info\""));
    // What is shown can be used.
    let whole = file(&sandbox, "whole.toml", &good(&["config", "show"]).stdout);
    good(&["config", "check", "--config", whole.to_str().unwrap()]);
    assert!(good(&["config", "explain", "tracker.gain_across"]).stdout.contains("allowed:"));
    let keys = good(&["config", "explain", "--all", "--json"]).json();
    assert!(keys["keys"].as_array().unwrap().len() > 50);
    assert!(good(&["config", "explain", "--reference"]).stdout.starts_with("# Configuration keys"));
    run(&sandbox, &["config", "explain", "tracker.gain_acros"])
        .refuses(2, &["no key \"tracker.gain_acros\"", "did you mean", "gain_across"]);
    let broken = file(&sandbox, "broken.toml", "vehicle = 3\n");
    let broken = broken.to_str().unwrap();
    run(&sandbox, &["config", "check", "--config", broken])
        .refuses(78, &[broken, "vehicle = 3", "wrong type"]);
    let said = run(&sandbox, &["config", "check", "--json", "--config", broken]);
    assert_eq!(said.code, Some(78));
    assert!(said.json()["problems"][0].as_str().unwrap().contains("broken.toml:1:"));
}

#[test]
fn files_that_are_no_recordings_are_refused() {
    let sandbox = Sandbox::new();
    let text = file(&sandbox, "text", "not a recording");
    let (text, out) = (text.to_str().unwrap().to_owned(), sandbox.file("out.mcap"));
    run(&sandbox, &["recording", "check", &text]).refuses(65, &[&text, "not an MCAP file"]);
    run(&sandbox, &["recording", "recover", &text, out.to_str().unwrap()]).refuses(65, &[&text]);
    assert!(!out.exists());
    run(&sandbox, &["recording", "check", "/nowhere.mcap"]).refuses(65, &["/nowhere.mcap"]);
}

#[test]
fn a_reader_that_leaves_early_is_no_failure() {
    let sandbox = Sandbox::new();
    for arguments in [&["config", "explain", "--all"][..], &["config", "show"]] {
        let mut command = sandbox.kerbside();
        command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(String::from_utf8_lossy(&output.stderr), "", "{arguments:?}");
        assert_ne!(output.status.code(), Some(101), "{arguments:?}: {:?}", output.status);
    }
}

/// The helper that the tests above lean on has to be able to fail.
#[test]
#[should_panic(expected = "panicked")]
fn debug_output_does_not_pass_for_prose() {
    let stderr = "thread 'main' panicked at src/x.rs".to_owned();
    Said { code: Some(75), stdout: String::new(), stderr }.refuses(75, &[]);
}

#[test]
fn a_simulated_vehicle_differs_from_its_description_where_up_is_told_so() {
    let sandbox = Sandbox::new();
    let overlay = file(&sandbox, "e.toml", "[[effect]]\nid = \"radius_scale\"\nscale = 1.02\n");
    let overlay = overlay.to_str().unwrap();
    let up = |more: &[&str]| run(&sandbox, &[&["up", "--instance", "one"], more].concat());
    up(&["--effects", overlay]).refuses(2, &["--effects and --plant are for --simulate"]);
    let wrong = file(&sandbox, "w.toml", "[[effect]]\nid = \"radius_scal\"\nscale = 1.02\n");
    let wrong = wrong.to_str().unwrap();
    up(&["--simulate", "--effects", wrong]).refuses(78, &["w.toml", "radius_scal"]);
    up(&["--simulate", "--plant", "paper-1-7"]).refuses(78, &["paper-1-7", "paper-1-6"]);
    let arguments = ["up", "--simulate", "--instance", "one", "--effects", overlay];
    let stack = common_cli::Running::start(&sandbox, "up", &arguments);
    common_cli::until_mode(&sandbox, "ready");
    let vehicle = sandbox.processes().into_iter().find(|(_, line)| line.contains(" vehicle "));
    let (_, line) = vehicle.expect("a simulated vehicle");
    assert!(line.contains(&format!("--effects {overlay}")), "{line}");
    assert_eq!(run(&sandbox, &["down"]).code, Some(0));
    assert_eq!(stack.end().code, Some(0));
    sandbox.assert_empty();
}
