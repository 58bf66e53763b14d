//! Agreement with an independent reading of what each effect is.

use std::collections::BTreeSet;

use crate::support::{self, Vectors};
use kerbside_geometry::Pose;
use kerbside_simulation::effects::library;
use kerbside_simulation::{Command, Drive, Effects, Overlay, STEP, Trajectory};

const CHANNELS: [&str; 13] = [
    "rotation fl",
    "rotation fr",
    "rotation rl",
    "rotation rr",
    "speed fl",
    "speed fr",
    "speed rl",
    "speed rr",
    "steering",
    "yaw rate",
    "x",
    "y",
    "yaw",
];

/// Every overlay that a car has vectors for.
fn names(car: &str) -> BTreeSet<String> {
    std::fs::read_dir(support::folder(car))
        .unwrap()
        .filter_map(|entry| {
            let name = entry.unwrap().file_name().into_string().unwrap();
            name.strip_suffix(".toml").map(str::to_owned)
        })
        .filter(|name| name != "vehicle" && name != "neutral")
        .collect()
}

/// What the sensors show at `t`, in the order of the vectors' columns.
fn shown(trajectory: &Trajectory, t: f64) -> [f64; 13] {
    let mut row = [0.0; 13];
    row[..4].copy_from_slice(&trajectory.rotation(t));
    row[4..8].copy_from_slice(&trajectory.wheel_speed(t));
    row[8] = trajectory.steering(t);
    row[9] = trajectory.yaw_rate(t);
    let reference = trajectory.reference(t);
    [row[10], row[11], row[12]] = [reference.x, reference.y, reference.yaw];
    row
}

fn simulate(vectors: &Vectors, overlay: &Overlay) -> Trajectory {
    let commands: Vec<Command> = vectors
        .commands
        .iter()
        .map(|row| Command { t: row[0], speed: row[1], steering: row[2] })
        .collect();
    let drive = Drive {
        vehicle: &vectors.vehicle,
        effects: Effects::from(overlay),
        commands: &commands,
        start: Pose::new(0.2, -0.1, 0.4),
        step: STEP,
    };
    let mut trajectory = Trajectory::new();
    drive.trajectory(16.0, &mut trajectory);
    trajectory
}

/// Compares root mean squares over the run: our deviation against what the effect does. Returns the
/// channels in which ours is above a hundredth.
fn compare(vectors: &Vectors, car: &str, name: &str) -> Vec<String> {
    let (overlay, rows) = support::altered(car, name);
    assert!(rows.len() >= 79, "{car} {name}: {} rows", rows.len());
    let trajectory = simulate(vectors, &overlay);
    let mut wrong = Vec::new();
    for (channel, of) in CHANNELS.iter().enumerate() {
        let (mut ours, mut total) = (0.0, 0.0);
        for row in &rows {
            let neutral = vectors.rows.iter().find(|neutral| neutral[0] == row[0]).unwrap();
            total += (row[channel + 1] - neutral[channel + 1]).powi(2);
            ours += (shown(&trajectory, row[0])[channel] - row[channel + 1]).powi(2);
        }
        let root = |sum: f64| (sum / rows.len() as f64).sqrt();
        let (ours, total) = (root(ours), root(total));
        // Where nothing happens: rounding of the files, straight lines between our steps.
        if ours > 0.01 * total + 1e-5 {
            wrong.push(format!("{car} {name}, {of}: {ours:.2e} of {total:.2e}"));
        }
    }
    wrong
}

fn agrees(car: &str) {
    let vectors = support::vectors(car);
    let wrong: Vec<String> =
        names(car).iter().flat_map(|name| compare(&vectors, car, name)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_effect_does_what_it_says_to_the_rear_driven_car_of_the_paper() {
    agrees("paper");
}

#[test]
fn every_effect_does_what_it_says_to_the_front_driven_full_size_car() {
    agrees("full-size");
}

#[test]
fn every_effect_has_vectors() {
    for car in ["paper", "full-size"] {
        let names = names(car);
        assert!(names.len() >= library().len() + 8, "{}", names.len());
        for definition in library() {
            assert!(names.contains(definition.id), "{}", definition.id);
        }
    }
}
