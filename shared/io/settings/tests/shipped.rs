//! Every file that is shipped, and every vehicle of recorded drives, loads.

// The lint's exception for tests does not reach the helpers of an integration test.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use kerbside_geometry::Drive;
use kerbside_settings::*;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..")
}

fn toml_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            toml_files(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "toml") {
            found.push(path);
        }
    }
}

#[test]
fn what_is_compiled_in_is_the_config_folder() {
    let folder = repository().join("config");
    let mut files = Vec::new();
    toml_files(&folder, &mut files);
    let relative =
        |path: &PathBuf| path.strip_prefix(&folder).unwrap().to_str().unwrap().to_owned();
    let shipped: BTreeSet<_> = files.iter().map(relative).collect();
    let compiled_in: BTreeSet<_> = COMPILED_IN.iter().map(|(path, _)| (*path).to_owned()).collect();
    assert_eq!(shipped, compiled_in);
}

#[test]
fn nothing_shipped_has_a_problem() {
    assert_eq!(check(&Sources::compiled_in()), []);
    let folder = Sources::in_folders(Some(&repository().join("config")), &[]).unwrap();
    assert_eq!(check(&folder), []);
}

#[test]
fn the_1_6_car_is_the_papers() {
    let vehicle = Sources::compiled_in().vehicle("paper-1-6").unwrap().value.vehicle;
    assert_eq!(vehicle, kerbside_geometry::Vehicle::paper_car());
}

#[test]
fn parking_brings_the_stack_that_suits_the_scenario() {
    let sources = Sources::compiled_in();
    for (scenario, vehicle, stop_distance) in [
        ("garage", "paper-1-6", 0.65),
        ("parallel", "paper-1-6", 0.65),
        ("garage-full-size", "full-size", 3.5),
        ("parallel-full-size", "full-size", 3.5),
    ] {
        let parking = sources.parking(scenario, None).unwrap();
        assert_eq!(parking.scenario.value.name, scenario);
        assert_eq!(parking.stack.value.vehicle.name, vehicle);
        assert_eq!(parking.stack.value.safety(false).stop_distance, stop_distance);
    }
}

#[test]
fn the_full_size_scenes_are_six_times_the_small_ones() {
    let sources = Sources::compiled_in();
    for name in ["garage", "parallel"] {
        let small = sources.scenario(name).unwrap().value;
        let large = sources.scenario(&format!("{name}-full-size")).unwrap().value;
        let close = |a: f64, b: f64| assert!((6.0 * a - b).abs() < 1e-9, "{name}: {a} and {b}");
        for axis in 0..2 {
            close(small.bounds.min[axis], large.bounds.min[axis]);
            close(small.bounds.max[axis], large.bounds.max[axis]);
        }
        for (a, b) in [(small.start, large.start), (small.goal, large.goal)] {
            close(a.x, b.x);
            close(a.y, b.y);
            assert_eq!(a.yaw, b.yaw);
        }
        close(small.plan.clearance, large.plan.clearance);
        close(small.tolerance.position, large.tolerance.position);
        close(small.disturbance.position, large.disturbance.position);
        close(small.disturbance.known_position, large.disturbance.known_position);
        assert_eq!(small.obstacles.len(), large.obstacles.len());
        for (a, b) in small.obstacles.iter().zip(&large.obstacles) {
            for (a, b) in a.outline.corners().iter().zip(b.outline.corners()) {
                close(a[0], b[0]);
                close(a[1], b[1]);
            }
        }
    }
}

#[test]
fn a_plan_request_carries_the_whole_scene() {
    let parking = Sources::compiled_in().parking("garage", None).unwrap();
    let request = parking.scenario.value.plan_request(&parking.stack.value.vehicle);
    assert_eq!((request.x, request.y), (0.0, -0.72));
    assert!((request.yaw - core::f64::consts::FRAC_PI_2).abs() < 1e-15);
    assert_eq!(request.bounds, [-2.0, -0.95, 2.5, 1.3]);
    assert_eq!((request.gear, request.gear_changes), (-1, 1));
    assert_eq!((request.clearance, request.speed), (0.05, 0.2));
    assert!((request.steering - 28.0_f64.to_radians()).abs() < 1e-15);
    let obstacles: Vec<_> = request.obstacles().map(<[_]>::to_vec).collect();
    assert_eq!(obstacles[0], [[-2.0, -0.95], [-0.26, -0.95], [-0.26, 0.0], [-2.0, 0.0]]);
    assert_eq!(obstacles[1], [[0.26, -0.95], [2.5, -0.95], [2.5, 0.0], [0.26, 0.0]]);
    assert_eq!(obstacles.len(), 2);
}

#[test]
fn vehicles_of_recorded_drives_load() {
    let folder = repository().join("tests/data/vehicles");
    let tricycle = load_vehicle(&folder.join("optiodom-tricycle.toml")).unwrap().value;
    assert_eq!(tricycle.vehicle.track_front, 0.0);
    assert_eq!(tricycle.vehicle.actuators, None);
    let counts = tricycle.vehicle.encoders.unwrap().counts_per_revolution;
    assert_eq!(counts, [Some(1600.0), None, None, None]);
    assert_eq!(tricycle.uncertainty.field("wheelbase"), 0.005);
    assert_eq!(tricycle.uncertainty.effect("speed_gain", "gain"), 0.0);
    let small = load_vehicle(&folder.join("f1tenth-levine.toml")).unwrap().value.vehicle;
    assert_eq!((small.drive, small.encoders), (Drive::All, None));
    assert_eq!(small.reference.unwrap().marker.x, 0.19);
}

/// The large collection lies beside the repository on machines that have it.
#[test]
fn every_vehicle_and_run_of_the_large_collection_loads() {
    let collection = repository().join("../shared/data");
    if !collection.is_dir() {
        eprintln!("skipped: there is no {}", collection.display());
        return;
    }
    let mut files = Vec::new();
    toml_files(&collection, &mut files);
    let (mut vehicles, mut runs) = (0, 0);
    for path in files {
        match path.file_name().and_then(|name| name.to_str()) {
            Some("vehicle.toml") => {
                load_vehicle(&path).unwrap_or_else(|error| panic!("{error}"));
                vehicles += 1;
            }
            Some("run.toml") => {
                let run = load_run(&path).unwrap_or_else(|error| panic!("{error}")).value;
                let folder = path.parent().unwrap().file_name().unwrap();
                assert_eq!(run.name, folder.to_str().unwrap());
                runs += 1;
            }
            _ => {}
        }
    }
    assert!(vehicles > 0 && runs > 0);
    println!("{vehicles} vehicles, {runs} runs");
}
