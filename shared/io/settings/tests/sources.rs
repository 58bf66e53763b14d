//! Files are found in their order, and paths in them are relative to them.

// The lint's exception for tests does not reach the helpers of an integration test.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::fs;
use std::path::PathBuf;

use kerbside_messages::Process;
use kerbside_settings::*;

fn compiled_in(path: &str) -> &'static str {
    COMPILED_IN.iter().find(|(name, _)| *name == path).unwrap().1
}

#[test]
fn the_first_place_that_has_a_file_wins_and_the_rest_is_compiled_in() {
    let (given, usual) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let stack = compiled_in("stack.toml");
    fs::write(usual.path().join("stack.toml"), stack.replace("\"info\"", "\"debug\"")).unwrap();
    let usual = [usual.path().to_owned()];
    let level = |sources: &Sources| sources.stack().unwrap().value.log.level;
    let sources = Sources::in_folders(Some(given.path()), &usual).unwrap();
    assert_eq!(level(&sources), LogLevel::Debug);
    fs::write(given.path().join("stack.toml"), stack.replace("\"info\"", "\"trace\"")).unwrap();
    assert_eq!(level(&sources), LogLevel::Trace);
    assert_eq!(level(&Sources::compiled_in()), LogLevel::Info);
    // The scenario is in neither folder.
    assert!(sources.scenario("garage").unwrap().file.starts_with("<compiled in>/"));
    assert_eq!(sources.names(FileKind::Stack), ["stack", "stack-full-size"]);
    assert_eq!(sources.names(FileKind::Vehicle), ["full-size", "paper-1-6"]);
}

#[test]
fn a_given_file_is_the_stack_whatever_its_name_and_its_paths_are_relative_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let stack =
        "vehicle = \"./cars/mine.toml\"\nline.device = \"tty\"\nrecorder.folder = \"/data\"\n";
    fs::write(folder.path().join("mine.toml"), stack).unwrap();
    fs::create_dir(folder.path().join("cars")).unwrap();
    let car =
        compiled_in("vehicles/paper-1-6.toml").replace("name = \"paper-1-6\"", "name = \"mine\"");
    fs::write(folder.path().join("cars/mine.toml"), car).unwrap();
    let sources = Sources::in_folders(Some(&folder.path().join("mine.toml")), &[]).unwrap();
    let stack = sources.stack().unwrap().value;
    assert_eq!(stack.vehicle.name, "mine");
    let device = Some(folder.path().join("tty"));
    assert_eq!(stack.interface, InterfaceSettings::Line { device, baud: 921_600 });
    assert_eq!(stack.recorder.folder, Some(PathBuf::from("/data")));
    // A scenario brings its own vehicle, the stack stays the given one.
    let parking = sources.parking("garage", None).unwrap();
    assert_eq!(parking.stack.value.vehicle.name, "paper-1-6");
    assert!(parking.stack.file.ends_with("mine.toml"));
    let path = folder.path().join("cars/mine.toml");
    let parking = sources.parking("garage", path.to_str()).unwrap();
    assert_eq!(parking.stack.value.vehicle.name, "mine");
}

#[test]
fn a_scenario_by_path_finds_its_vehicle_beside_itself() {
    let folder = tempfile::tempdir().unwrap();
    let car =
        compiled_in("vehicles/paper-1-6.toml").replace("name = \"paper-1-6\"", "name = \"mine\"");
    fs::write(folder.path().join("mine.toml"), car).unwrap();
    let scenario = compiled_in("scenarios/garage.toml").replace("\"paper-1-6\"", "\"mine.toml\"");
    let path = folder.path().join("yard.toml");
    fs::write(&path, scenario).unwrap();
    let parking = Sources::compiled_in().parking(path.to_str().unwrap(), None).unwrap();
    assert_eq!(parking.scenario.value.name, "yard");
    assert_eq!(parking.stack.value.vehicle.name, "mine");
}

#[test]
fn every_key_of_the_stack_arrives() {
    let folder = tempfile::tempdir().unwrap();
    let text = "vehicle = \"paper-1-6\"\ninterface.kind = \"replay\"\n\
        [timeouts]\nfreshness = 0.08\n[tracker]\ncorridor = 0.2\n[planner]\nsearch_nodes = 1234\n\
        [realtime]\nenabled = \"on\"\npriority = 80\nlock_memory = false\ncores = [2, 3]\n\
        [recorder]\nenabled = false\nchunk_size = 65536\ncompression = \"none\"\n\
        file_bytes = 5000000000\nkeep_bytes = 20000000000\nkeep_days = 30\n\
        [log]\nlevel = \"warn\"\nformat = \"json\"\n[process.recorder]\nstart = \"external\"\n\
        [initial_pose]\nx = 1\ny = -2.5\nyaw_degrees = 180\n";
    let path = folder.path().join("all.toml");
    fs::write(&path, text).unwrap();
    let stack = Sources::in_folders(Some(&path), &[]).unwrap().stack().unwrap().value;
    assert_eq!(stack.interface, InterfaceSettings::Replay);
    // What the file states holds with and without rights; what it does not has two defaults.
    for rights in [false, true] {
        assert_eq!(stack.safety(rights).timeouts.freshness.as_millis(), 80);
    }
    assert_eq!(stack.safety(false).timeouts.permit.as_millis(), 150);
    assert_eq!(stack.safety(true).timeouts.permit.as_millis(), 40);
    assert_eq!((stack.tracker.corridor, stack.planner.search_nodes), (0.2, 1234));
    let cores = Some(vec![2, 3]);
    let realtime =
        RealtimeSettings { enabled: RealtimeMode::On, priority: 80, lock_memory: false, cores };
    assert_eq!(stack.realtime, realtime);
    let recorder = RecorderSettings {
        enabled: false,
        folder: None,
        chunk_size: 65_536,
        compression: Compression::None,
        file_bytes: 5_000_000_000,
        keep_bytes: Some(20_000_000_000),
        keep_days: Some(30),
    };
    assert_eq!(stack.recorder, recorder);
    assert_eq!(stack.log, LogSettings { level: LogLevel::Warn, format: LogFormat::Json });
    assert_eq!(stack.start_of(Process::Recorder), Start::External);
    assert_eq!(stack.start_of(Process::Planner), Start::Supervisor);
    assert_eq!(stack.start_of(Process::Vehicle), Start::External);
    let initial = stack.estimator.initial_pose.unwrap();
    assert_eq!((initial.pose.x, initial.pose.y), (1.0, -2.5));
    assert!((initial.pose.yaw - core::f64::consts::PI).abs() < 1e-15);
    assert_eq!(initial.position_noise, 0.002);
}

#[test]
fn a_run_file_says_what_it_says() {
    let text = "name = \"a\"\nmanoeuvre = \"circle\"\nrepeat_of = \"b\"\ndistance = 6\n\
        end_pose = [6.0, 0, 0.1]\n\
        start = { x = 1, y = 2, yaw = 3 }\n[conditions]\nfloor = \"concrete\"\nload = 12.5\nday \
                                                                   = 2024-07-11\n";
    let run = parse_run("run.toml", text).unwrap().value;
    assert_eq!((run.name.as_str(), run.manoeuvre.as_str()), ("a", "circle"));
    assert_eq!((run.repeat_of.as_deref(), run.distance), (Some("b"), Some(6.0)));
    assert_eq!(run.end_pose.map(|pose| (pose.x, pose.yaw)), Some((6.0, 0.1)));
    assert_eq!(run.start.map(|pose| (pose.y, pose.yaw)), Some((2.0, 3.0)));
    assert_eq!(run.conditions["floor"], Value::Text("concrete".into()));
    assert_eq!(run.conditions["load"], Value::Number(12.5));
    assert_eq!(run.conditions["day"], Value::Text("2024-07-11".into()));
    let error = parse_run("run.toml", "start.x = 1\nspeed = 2\n").unwrap_err().to_string();
    for part in
        ["name: missing", "start.y: missing", "start.yaw: missing", "speed = 2: unknown key"]
    {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn a_vehicle_is_found_again_by_the_file_it_came_from() {
    let sources = Sources::compiled_in();
    let stack = sources.stack().unwrap().value;
    let again = sources.vehicle(&stack.vehicle_file).unwrap();
    assert_eq!(again.value.vehicle, stack.vehicle);
    assert!(sources.vehicle("<compiled in>/vehicles/none.toml").is_err());
}
