//! Reads the small files beside the tests.
// Not every test needs all of it.
#![allow(dead_code)]

use std::path::{Path, PathBuf};

use kerbside_geometry::{
    Actuators, Drive, Encoders, Footprint, Gyro, Limits, Pose, Reference, SteeringSensor, Vehicle,
    WHEELS,
};
use kerbside_simulation::{Effect, Overlay};
use toml::{Table, Value};

/// A folder of vectors.
pub(crate) struct Vectors {
    pub(crate) vehicle: Vehicle,
    pub(crate) commands: Vec<Vec<f64>>,
    pub(crate) rows: Vec<Vec<f64>>,
}

/// The folder of one car.
pub(crate) fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/vectors").join(name)
}

/// What a car did with one overlay: the overlay and the rows.
pub(crate) fn altered(name: &str, overlay: &str) -> (Overlay, Vec<Vec<f64>>) {
    let read = |ending: &str| {
        std::fs::read_to_string(folder(name).join(format!("{overlay}.{ending}"))).expect("readable")
    };
    (overlay_of(&read("toml").parse().expect("TOML")), rows(&read("csv")))
}

fn overlay_of(root: &Table) -> Overlay {
    let mut overlay = Overlay::new();
    let tables = root.get("effect").and_then(Value::as_array);
    for table in tables.into_iter().flatten().filter_map(Value::as_table) {
        let wheel = table.get("wheel").and_then(Value::as_str);
        let wheel = wheel.map(|name| WHEELS.into_iter().find(|wheel| wheel.name() == name));
        let names = table.keys().filter(|key| !["id", "wheel"].contains(&key.as_str()));
        let values: Vec<(&str, f64)> =
            names.map(|name| (name.as_str(), number(table, name))).collect();
        let id = table["id"].as_str().expect("text");
        let effect = Effect::new(id, wheel.flatten(), &values).expect("an effect");
        overlay.add(effect).expect("each once");
    }
    overlay
}

/// Reads the vectors of one car.
pub(crate) fn vectors(name: &str) -> Vectors {
    let read = |file: &str| std::fs::read_to_string(folder(name).join(file)).expect("readable");
    Vectors {
        vehicle: vehicle(&read("vehicle.toml").parse().expect("TOML")),
        commands: rows(&read("commands.csv")),
        rows: rows(&read("neutral.csv")),
    }
}

fn rows(text: &str) -> Vec<Vec<f64>> {
    let row = |line: &str| line.split(',').map(|field| field.parse().expect("number")).collect();
    text.lines().skip(1).map(row).collect()
}

fn number(table: &Table, key: &str) -> f64 {
    match &table[key] {
        Value::Float(value) => *value,
        Value::Integer(value) => f64::from(i32::try_from(*value).expect("small")),
        other => panic!("{key} is {other}"),
    }
}

fn wheels(table: &Table) -> [Option<f64>; 4] {
    ["fl", "fr", "rl", "rr"].map(|wheel| table.contains_key(wheel).then(|| number(table, wheel)))
}

fn vehicle(root: &Table) -> Vehicle {
    let table = |key: &str| root[key].as_table().expect("table");
    let optional = |key: &str| root.get(key).and_then(Value::as_table);
    let (footprint, limits, actuators) = (table("footprint"), table("limits"), table("actuators"));
    Vehicle {
        name: root["name"].as_str().expect("text").to_owned(),
        wheelbase: number(root, "wheelbase"),
        track_front: number(root, "track_front"),
        track_rear: number(root, "track_rear"),
        radius: wheels(table("radius")).map(Option::unwrap),
        speed_radius: [None; 4],
        drive: match root["drive"].as_str() {
            Some("rear") => Drive::Rear,
            Some("front") => Drive::Front,
            Some("all") => Drive::All,
            other => panic!("drive {other:?}"),
        },
        footprint: Footprint {
            length: number(footprint, "length"),
            width: number(footprint, "width"),
            rear_overhang: number(footprint, "rear_overhang"),
        },
        limits: Limits {
            speed: number(limits, "speed"),
            acceleration: number(limits, "acceleration"),
            deceleration: number(limits, "acceleration"),
            steering: number(limits, "steering"),
            steering_rate: number(limits, "steering_rate"),
        },
        actuators: Some(Actuators {
            speed_delay: number(actuators, "speed_delay"),
            speed_lag: number(actuators, "speed_lag"),
            steering_delay: number(actuators, "steering_delay"),
            steering_lag: number(actuators, "steering_lag"),
            ..Actuators::default()
        }),
        encoders: optional("encoders").map(|encoders| Encoders {
            counts_per_revolution: wheels(
                encoders["counts_per_revolution"].as_table().expect("table"),
            ),
            counter_bits: 32,
            noise_per_distance: None,
            rate: number(encoders, "rate"),
        }),
        steering_sensor: optional("steering_sensor")
            .map(|sensor| SteeringSensor::new(number(sensor, "noise"), number(sensor, "rate"))),
        gyro: optional("gyro").map(|gyro| Gyro {
            noise: number(gyro, "noise"),
            rate: number(gyro, "rate"),
            bias: 0.0,
        }),
        reference: optional("reference").map(reference),
    }
}

fn reference(table: &Table) -> Reference {
    let noise = table["noise"].as_table().expect("table");
    let marker = table["marker"].as_table().expect("table");
    Reference {
        position_noise: number(noise, "position"),
        yaw_noise: number(noise, "yaw"),
        rate: number(table, "rate"),
        marker: Pose::new(number(marker, "x"), number(marker, "y"), number(marker, "yaw")),
    }
}
