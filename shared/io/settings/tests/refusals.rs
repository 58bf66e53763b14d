//! What is wrong with a file is said with file, line, key, value and what is allowed.

// The lint's exception for tests does not reach the helpers of an integration test.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::fs;
use std::path::{Path, PathBuf};

use kerbside_settings::*;

/// A configuration folder with the shipped files, to be changed.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        for (path, text) in COMPILED_IN {
            folder.write(path, text);
        }
        folder
    }

    fn path(&self, file: &str) -> PathBuf {
        self.0.path().join(file)
    }

    fn write(&self, file: &str, text: &str) {
        let path = self.path(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    /// Replaces a text that must be there.
    fn change(&self, file: &str, from: &str, to: &str) {
        let text = fs::read_to_string(self.path(file)).unwrap();
        assert!(text.contains(from), "{file} has no {from}");
        self.write(file, &text.replacen(from, to, 1));
    }

    fn sources(&self) -> Sources {
        Sources::in_folders(Some(self.0.path()), &[]).unwrap()
    }
}

fn vehicle_text() -> &'static str {
    COMPILED_IN.iter().find(|(path, _)| *path == "vehicles/paper-1-6.toml").unwrap().1
}

/// The problems of the 1:6 car's file with one text replaced.
fn vehicle_problems(from: &str, to: &str) -> Vec<Problem> {
    assert!(vehicle_text().contains(from), "no {from}");
    let text = vehicle_text().replacen(from, to, 1);
    parse_vehicle("car.toml", &text).err().map_or_else(Vec::new, |error| error.problems().to_vec())
}

fn line_of(text: &str, part: &str) -> usize {
    1 + text.lines().position(|line| line.contains(part)).unwrap()
}

/// The one problem of a result, after checking that its text says all of `parts`.
fn only<T: std::fmt::Debug>(result: Result<T, SettingsError>, parts: &[&str]) -> Problem {
    let error = result.unwrap_err();
    let [problem] = error.problems() else { panic!("one problem, not: {error}") };
    let text = problem.to_string();
    for part in parts {
        assert!(text.contains(part), "\"{part}\" is not in: {text}");
    }
    assert!(text.starts_with(&format!("{}:{}:{}: ", problem.file, problem.line, problem.column)));
    problem.clone()
}

#[test]
fn an_unknown_key_names_the_nearest() {
    let text =
        vehicle_text().replace("rear_overhang = 0.13", "rear_overhang = 0.13\nrear_overhand = 0.1");
    let problem = only(
        parse_vehicle("car.toml", &text),
        &[
            "footprint.rear_overhand = 0.1: ",
            "unknown key",
            "length, width, rear_overhang",
            "did you mean \"footprint.rear_overhang\"?",
        ],
    );
    assert_eq!(problem.cause, Cause::UnknownKey);
    assert_eq!(problem.line, line_of(&text, "rear_overhand ="));
    assert_eq!(&problem.source[problem.span.clone()], "rear_overhand");
}

#[test]
fn a_key_in_the_wrong_table_names_its_table() {
    let text =
        format!("steering_rate = 0.8\n{}", vehicle_text().replace("steering_rate = 0.8", ""));
    let error = parse_vehicle("car.toml", &text).unwrap_err();
    let texts: Vec<_> = error.problems().iter().map(ToString::to_string).collect();
    assert_eq!(texts.len(), 2, "{texts:?}");
    assert!(texts[0].contains("did you mean \"limits.steering_rate\"?"), "{texts:?}");
    assert!(texts[1].contains("limits.steering_rate: missing"), "{texts:?}");
}

#[test]
fn a_wrong_type_names_the_right_one() {
    let text = vehicle_text().replace("wheelbase = 0.50", "wheelbase = \"0.50\"");
    let parts =
        ["wheelbase = \"0.50\"", "wrong type, string", "a number in m, above 0, at most 10000"];
    let problem = only(parse_vehicle("car.toml", &text), &parts);
    assert_eq!(problem.line, line_of(&text, "wheelbase"));
    assert_eq!(&problem.source[problem.span.clone()], "\"0.50\"");
}

#[test]
fn a_value_for_a_table_and_a_table_for_a_value_are_wrong_types() {
    for (from, to, key) in [
        ("[footprint]\nlength = 0.75\nwidth = 0.37\nrear_overhang = 0.13", "[x]", "x"),
        ("drive = \"rear\"", "drive = { front = true }", "drive"),
        (
            "radius = { fl = 0.0725, fr = 0.0725, rl = 0.0725, rr = 0.0725 }",
            "radius = 0.0725",
            "radius",
        ),
    ] {
        let problems = vehicle_problems(from, to);
        assert!(problems.iter().any(|problem| problem.key == key), "{key}: {problems:?}");
    }
}

#[test]
fn out_of_range_names_the_range() {
    for (from, to, parts) in [
        ("wheelbase = 0.50", "wheelbase = 0.0", ["wheelbase = 0.0", "above 0, at most 10000"]),
        ("fl = 0.0725", "fl = -0.0725", ["radius.fl = -0.0725", "above 0, at most 10000"]),
        ("track_rear = 0.310", "track_rear = -1", ["track_rear = -1", "in m, 0 to 10000"]),
        ("steering = 0.5236", "steering = 30", ["limits.steering = 30", "above 0, below 1.57"]),
        (
            "counter_bits = 32",
            "counter_bits = 99",
            ["counter_bits = 99", "integer in bit, 4 to 64"],
        ),
        (
            "drive = \"rear\"",
            "drive = \"both\"",
            ["drive = \"both\"", "\"rear\", \"front\", \"all\""],
        ),
        ("speed = 0.5", "speed = inf", ["limits.speed = inf", "above 0, at most 1000"]),
        ("speed_lag = 0.10", "speed_lag = nan", ["actuators.speed_lag = nan", "0 to 10"]),
    ] {
        let text = vehicle_text().replacen(from, to, 1);
        let problem = only(parse_vehicle("car.toml", &text), &parts);
        assert_eq!(problem.line, line_of(&text, to), "{problem}");
    }
}

#[test]
fn a_missing_key_is_reported_at_its_table() {
    let text = vehicle_text().replace("counter_bits = 32\n", "");
    let parts = ["encoders.counter_bits: missing", "allowed: an integer in bit, 4 to 64"];
    let problem = only(parse_vehicle("car.toml", &text), &parts);
    assert_eq!(problem.line, line_of(&text, "[encoders]"));
    assert_eq!(problem.value, None);
}

#[test]
fn impossible_geometry_is_refused() {
    for (from, to, parts) in [
        (
            "rear_overhang = 0.13",
            "rear_overhang = 0.8",
            [
                "rear_overhang = 0.8",
                "the rear axle lies in front of the footprint",
                "0 to footprint.length = 0.75 m",
            ],
        ),
        (
            "track_front = 0.310",
            "track_front = 0.0",
            [
                "counts_per_revolution.fr = 2048",
                "track_front = 0 leaves one wheel",
                "track_front above 0",
            ],
        ),
    ] {
        let text = vehicle_text().replacen(from, to, 1);
        let problem = only(parse_vehicle("car.toml", &text), &parts);
        assert!(matches!(problem.cause, Cause::ImpossibleGeometry(_)));
    }
}

#[test]
fn suspicious_geometry_is_a_warning() {
    let text = vehicle_text().replacen("width = 0.37", "width = 0.30", 1);
    let loaded = parse_vehicle("car.toml", &text).unwrap();
    let [warning] = &loaded.warnings[..] else { panic!("one warning") };
    assert_eq!(warning.severity, Severity::Warning);
    let text = warning.to_string();
    assert!(text.contains("footprint.width = 0.3: suspicious geometry"), "{text}");
    assert!(text.contains("warning: ") && text.contains("0.31 m"), "{text}");
}

#[test]
fn a_right_wheel_of_an_axle_without_track_needs_no_radius() {
    let text = vehicle_text()
        .replace("track_front = 0.310", "track_front = 0")
        .replace("radius = { fl = 0.0725, fr = 0.0725,", "radius = { fl = 0.08,")
        .replace("= { fl = 2048, fr = 2048,", "= { fl = 2048,");
    assert_eq!(parse_vehicle("car.toml", &text).unwrap().value.vehicle.radius[1], 0.08);
    let text = text.replace("track_front = 0\n", "track_front = 0.3\n");
    only(parse_vehicle("car.toml", &text), &["radius.fr: missing"]);
}

#[test]
fn all_problems_of_a_file_are_listed_in_its_order() {
    let text = vehicle_text()
        .replace("wheelbase = 0.50", "wheelbase = -1")
        .replace("track_rear", "trackrear")
        .replace("speed_lag = 0.10", "speed_lag = true");
    let error = parse_vehicle("car.toml", &text).unwrap_err();
    let keys: Vec<_> = error.problems().iter().map(|problem| problem.key.as_str()).collect();
    assert_eq!(keys, ["track_rear", "wheelbase", "trackrear", "actuators.speed_lag"]);
}

#[test]
fn a_file_that_is_no_toml_is_refused_with_every_syntax_error() {
    let text =
        vehicle_text().replace("wheelbase = 0.50", "wheelbase = ").replace("[limits]", "[limits");
    let error = parse_vehicle("car.toml", &text).unwrap_err();
    for part in ["wheelbase =", "[limits"] {
        let line = line_of(&text, part);
        let syntax = |problem: &&Problem| matches!(problem.cause, Cause::Syntax(_));
        assert!(error.problems().iter().filter(syntax).any(|p| p.line == line), "{error}");
    }
}

#[test]
fn the_stop_distance_is_held_against_the_vehicle() {
    let folder = Folder::new();
    folder.change("stack.toml", "stop_distance = 0.65", "stop_distance = 0.6");
    let parts = [
        "stack.toml:6:17",
        "safety.stop_distance = 0.6",
        "at least 0.629 m",
        "limits.speed at most 0.48",
    ];
    let problem = only(folder.sources().stack(), &parts);
    assert!(
        matches!(problem.cause, Cause::StopDistance { needed } if (needed - 0.6292).abs() < 1e-4)
    );
    // The full-size car under the small car's promise.
    let folder = Folder::new();
    folder.change("scenarios/garage-full-size.toml", "stack = \"stack-full-size\"", "");
    let parts =
        ["stack.toml:6", "safety.stop_distance = 0.65", "for full-size", "at least 3.110 m"];
    only(folder.sources().parking("garage-full-size", None), &parts);
}

#[test]
fn periods_that_the_supervisor_cannot_resolve_are_refused() {
    let folder = Folder::new();
    folder.change("stack.toml", "[interface]", "[timeouts]\nheartbeat = 0.15\n\n[interface]");
    let parts =
        ["timeouts.heartbeat_window = 0.2", "out of range", "at least 0.3 s", "not in the file"];
    only(folder.sources().stack(), &parts);
    // Switched off, the tighter defaults with real-time rights do not count.
    let folder = Folder::new();
    folder.change("stack.toml", "[interface]", "[timeouts]\nheartbeat = 0.04\n\n[interface]");
    assert!(folder.sources().stack().is_ok());
    folder.change("stack.toml", "enabled = \"off\"", "enabled = \"auto\"");
    only(folder.sources().stack(), &["timeouts.heartbeat_window = 0.05", "at least 0.08 s"]);
}

#[test]
fn what_is_kept_of_recordings_has_room_for_two() {
    let folder = Folder::new();
    let kept = "enabled = true\nfile_bytes = 1000000\nkeep_bytes = 1999999";
    folder.change("stack.toml", "[recorder]\nenabled = true", &format!("[recorder]\n{kept}"));
    let error = folder.sources().stack().unwrap_err();
    let said = error.problems()[0].to_string();
    for part in ["stack.toml:", "recorder.keep_bytes = 1999999", "out of range", "at least 2000000"]
    {
        assert!(said.contains(part), "no {part} in {said}");
    }
    folder.change("stack.toml", "keep_bytes = 1999999", "keep_bytes = 2000000");
    assert_eq!(folder.sources().stack().unwrap().value.recorder.keep_bytes, Some(2_000_000));
}

#[test]
fn problems_of_the_vehicle_come_with_the_stack() {
    let folder = Folder::new();
    folder.change("vehicles/paper-1-6.toml", "wheelbase = 0.50", "wheelbase = 0");
    folder.change("stack.toml", "baud = 921600", "baud = 1");
    let error = folder.sources().stack().unwrap_err();
    let files: Vec<_> = error
        .problems()
        .iter()
        .map(|p| (Path::new(&p.file).file_name().unwrap().to_str().unwrap(), p.key.as_str()))
        .collect();
    assert_eq!(files, [("stack.toml", "line.baud"), ("paper-1-6.toml", "wheelbase")]);
    // `config check` lists each once, though the vehicle is named by three files.
    assert_eq!(check(&folder.sources()).len(), 2);
}

#[test]
fn a_goal_that_is_not_free_is_refused() {
    for (from, to, parts) in [
        (
            "y = -0.72",
            "y = -1.3",
            ["goal = (0, -1.3, 90 degrees)", "the footprint leaves the map by 0.480 m"],
        ),
        (
            "x = 0.0",
            "x = 0.2",
            ["goal = (0.2, -0.72", "inside or against the slot's neighbour towards +x"],
        ),
        (
            "x = 0.0",
            "x = 0.04",
            ["goal = (0.04, -0.72", "0.035 m from the slot's neighbour towards +x"],
        ),
        ("y = -0.72", "y = -0.80", ["goal = (0, -0.8", "0.020 m from the map's edge"]),
        ("y = 0.65", "y = 1.3", ["start = (-1, 1.3", "the footprint leaves the map by 0.185 m"]),
        ("x = -1.0", "x = -1.9", ["start = (-1.9, 0.65", "leaves the map by 0.030 m"]),
        ("x = -1.0\ny = 0.65", "x = -1.0\ny = -0.5", ["start = (-1, -0.5", "inside or against"]),
    ] {
        let folder = Folder::new();
        folder.change("scenarios/garage.toml", from, to);
        let text = fs::read_to_string(folder.path("scenarios/garage.toml")).unwrap();
        let problem = only(folder.sources().scenario("garage"), &parts);
        let allowed = "footprint of paper-1-6 (0.75 x 0.37 m) at least plan.clearance = 0.05 m";
        assert!(problem.allowed.contains(allowed), "{problem}");
        assert!(problem.file.ends_with("scenarios/garage.toml"));
        assert_eq!(problem.line, line_of(&text, &format!("[{}]", problem.key)));
    }
}

#[test]
fn a_goal_on_a_stated_obstacle_names_the_obstacle() {
    for (obstacle, name) in [
        ("boxes = [[-1.9, 1.0, -1.8, 1.1], [-0.1, -0.6, 0.1, -0.5]]", "boxes[1]"),
        ("polygons = [[[-0.1, -0.6], [0.0, -0.4], [0.1, -0.6]]]", "polygons[0]"),
    ] {
        let folder = Folder::new();
        folder.change("scenarios/garage.toml", "[slot]", &format!("{obstacle}\n[slot]"));
        let problem = only(folder.sources().scenario("garage"), &["goal = ", name]);
        assert!(matches!(problem.cause, Cause::Blocked(_)));
    }
}

#[test]
fn space_and_obstacles_must_make_sense() {
    for (from, to, parts) in [
        ("[slot]", "[map]\nx = [0, 1]\ny = [0, 1]\n[slot]", ["map = ", "either [map] or [slot]"]),
        (
            "x = [-0.26, 0.26]",
            "x = [0.26, -0.26]",
            ["slot.x = [0.26, -0.26]", "the lesser number first"],
        ),
        (
            "x = [-0.26, 0.26]",
            "x = [2.4, 2.8]",
            ["slot.x = [2.4, 2.8]", "within slot.aisle_x, -2 to 2.5 m"],
        ),
        ("x = [-0.26, 0.26]", "x = [-0.26]", ["slot.x = [-0.26]: a list of 1", "an array of 2"]),
        (
            "[slot]",
            "boxes = [[0, 0, 0, 1]]\n[slot]",
            ["boxes = ", "boxes[0] is [0.0, 0.0, 0.0, 1.0]"],
        ),
        (
            "[slot]",
            "boxes = [[0, 0, \"a\", 1]]\n[slot]",
            ["boxes[0][2] = \"a\"", "wrong type, string"],
        ),
        (
            "[slot]",
            "polygons = [[[0, 0], [1, 0], [0.1, 0.1], [0, 1]]]\n[slot]",
            ["polygons = ", "not convex"],
        ),
        (
            "steering_degrees = 28.0",
            "steering_degrees = 31",
            ["plan.steering_degrees = 31", "30.00 degrees"],
        ),
        (
            "speed = 0.2",
            "speed = 0.6",
            ["plan.speed = 0.6", "at most limits.speed of paper-1-6, 0.5 m/s"],
        ),
        (
            "vehicle = \"paper-1-6\"",
            "vehicle = \"paper-1-5\"",
            ["vehicle = \"paper-1-5\"", "full-size, paper-1-6"],
        ),
    ] {
        let folder = Folder::new();
        folder.change("scenarios/garage.toml", from, to);
        only(folder.sources().scenario("garage"), &parts);
    }
    let folder = Folder::new();
    let boxes: Vec<_> = (0..31).map(|i| format!("[{i}, 1.2, {i}.1, 1.25]")).collect();
    let boxes = format!("boxes = [{}]\n[slot]", boxes.join(", "));
    folder.change("scenarios/garage.toml", "[slot]", &boxes);
    only(folder.sources().scenario("garage"), &["boxes = 33 obstacles", "at most 32 obstacles"]);
    let folder = Folder::new();
    let text = fs::read_to_string(folder.path("scenarios/garage.toml")).unwrap();
    let text: Vec<_> = text.split("\n\n").filter(|part| !part.starts_with("[slot]")).collect();
    folder.write("scenarios/garage.toml", &text.join("\n\n"));
    only(folder.sources().scenario("garage"), &["map = absent", "either [map] or [slot]"]);
}

#[test]
fn corners_may_run_either_way_round() {
    let request = |polygon: &str| {
        let folder = Folder::new();
        folder.change(
            "scenarios/garage.toml",
            "[slot]",
            &format!("polygons = [{polygon}]\n[slot]"),
        );
        let parking = folder.sources().parking("garage", None).unwrap();
        parking.scenario.value.obstacles.last().unwrap().outline.clone()
    };
    let left = request("[[2.0, 1.0], [2.1, 1.0], [2.0, 1.1]]");
    let right = request("[[2.0, 1.1], [2.1, 1.0], [2.0, 1.0]]");
    assert!(left.contains([2.02, 1.02]) && right.contains([2.02, 1.02]));
}

#[test]
fn what_is_not_there_is_named_with_what_is() {
    let folder = Folder::new();
    let error = folder.sources().scenario("garge").unwrap_err().to_string();
    for part in
        ["no scenario named \"garge\"", "what is compiled in", "there are: garage,", "parallel"]
    {
        assert!(error.contains(part), "{part}: {error}");
    }
    assert!(error.contains(&folder.path("scenarios").display().to_string()), "{error}");
    let missing = Sources::new(Some(Path::new("/nowhere/stack.toml"))).unwrap_err();
    assert!(missing.to_string().contains("/nowhere/stack.toml"), "{missing}");
    assert!(
        explain("limits.sped").unwrap_err().to_string().contains("did you mean \"limits.speed\"?")
    );
}

#[test]
fn checking_everything_lists_each_problem_of_each_file() {
    let folder = Folder::new();
    folder.change("stack.toml", "level = \"info\"", "level = \"loud\"");
    folder.change("vehicles/full-size.toml", "width = 1.85", "width = 1.2");
    folder.change("scenarios/garage.toml", "yaw_degrees = 90.0", "yaw_degree = 90.0");
    folder.change("scenarios/parallel.toml", "[slot]", "stack = \"stak\"\n[slot]");
    folder.change("scenarios/parallel-full-size.toml", "\"stack-full-size\"", "\"stack-short\"");
    folder.write("stack-short.toml", "vehicle = \"paper-1-6\"\nsafety.stop_distance = 1.0\n");
    fs::write(folder.path("scenarios/binary.toml"), [0xff, 0xfe]).unwrap();
    let problems = check(&folder.sources());
    let found: Vec<_> = problems
        .iter()
        .map(|p| format!("{} {}", p.file.rsplit('/').next().unwrap(), p.key))
        .collect();
    for expected in [
        "stack.toml log.level",
        "full-size.toml footprint.width",
        "garage.toml goal.yaw_degree",
        "garage.toml goal.yaw_degrees",
        "parallel.toml stack",
        // Right for the vehicle it names, wrong for the scenario that uses it.
        "stack-short.toml safety.stop_distance",
        "binary.toml ",
    ] {
        let count = found.iter().filter(|found| *found == expected).count();
        assert_eq!(count, 1, "{expected}: {found:?}");
    }
    assert_eq!(found.len(), 7, "{found:?}");
}

const CALIBRATED_TEXT: &str = r#"
[calibration]
method = "joint"
version = "0.1.0"
date = "2026-11-28"
runs = ["straight-1", "circle-1"]
parameters = ["track_rear", "steering_sensor.offset"]
covariance = [[4e-6, 1e-9], [1e-9, 1e-8]]
[calibration.residuals]
inflation = 1.2
[calibration.rejected]
circle-2 = "slip"
"#;

fn calibrated_text(from: &str, to: &str) -> String {
    assert!(CALIBRATED_TEXT.contains(from), "no {from}");
    format!("{}{}", vehicle_text(), CALIBRATED_TEXT.replacen(from, to, 1))
}

#[test]
fn a_calibration_is_read_and_shown_as_it_was() {
    let loaded = parse_vehicle("car.toml", &calibrated_text("", "")).unwrap();
    let again = parse_vehicle("car.toml", &loaded.show()).unwrap();
    let calibration = loaded.value.calibration.unwrap();
    assert_eq!(calibration.covariance_of("track_rear", "steering_sensor.offset"), Some(1e-9));
    assert_eq!(calibration.covariance_of("track_rear", "wheelbase"), None);
    assert_eq!(again.value.calibration, Some(calibration));
    assert_eq!(parse_vehicle("car.toml", vehicle_text()).unwrap().value.calibration, None);
}

#[test]
fn a_calibration_that_cannot_be_is_refused() {
    for (from, to, words) in [
        ("1e-9], [1e-9", "1e-9], [2e-9", "calibration.covariance"),
        ("[4e-6", "[-4e-6", "calibration.covariance"),
        ("1e-9], [1e-9", "1e-3], [1e-3", "calibration.covariance"),
        (", [1e-9, 1e-8]]", "]", "2 rows of 2 entries"),
        ("\"track_rear\"", "\"track_raer\"", "calibration.parameters[0]"),
        ("\"joint\"", "\"guess\"", "closed-form"),
        ("date = ", "day = ", "calibration.day"),
    ] {
        let error = parse_vehicle("car.toml", &calibrated_text(from, to)).unwrap_err();
        assert!(error.to_string().contains(words), "{to}: {error}");
    }
}

#[test]
fn a_steering_sensor_has_offset_and_gain() {
    let noise = vehicle_text().lines().skip_while(|line| *line != "[steering_sensor]").nth(1);
    let noise = noise.unwrap();
    let with = |more: &str| vehicle_text().replacen(noise, &format!("{noise}\n{more}"), 1);
    let sensor =
        |text: &str| parse_vehicle("car.toml", text).unwrap().value.vehicle.steering_sensor;
    assert_eq!(sensor(vehicle_text()).map(|s| (s.offset, s.gain)), Some((0.0, 1.0)));
    let text = with("offset = -0.01\ngain = 1.05");
    assert_eq!(sensor(&text).map(|s| (s.offset, s.gain)), Some((-0.01, 1.05)));
    let error = parse_vehicle("car.toml", &with("gain = 0.0")).unwrap_err();
    assert!(error.to_string().contains("steering_sensor.gain = 0.0: out of range"), "{error}");
}
