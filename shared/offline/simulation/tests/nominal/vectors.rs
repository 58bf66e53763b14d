//! Agreement with an independent reading of what the nominal vehicle is.

use crate::support;
use kerbside_geometry::Pose;
use kerbside_simulation::{Noise, Simulator};

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

/// What the simulator shows at an instant, in the order of the vectors' columns.
fn channels(simulator: &Simulator, radius: [f64; 4]) -> [f64; 13] {
    let (rotation, rate) = (simulator.rotation(), simulator.rotation_rate());
    let marker = simulator.marker().expect("both cars have a reference");
    let mut channels = [0.0; 13];
    for wheel in 0..4 {
        channels[wheel] = rotation[wheel];
        channels[4 + wheel] = rate[wheel] * radius[wheel];
    }
    channels[8] = simulator.steering();
    channels[9] = simulator.yaw_rate();
    [channels[10], channels[11], channels[12]] = [marker.x, marker.y, marker.yaw];
    channels
}

/// Largest difference of each channel over the run, as a share of the channel's own size.
fn differences(name: &str) -> [f64; 13] {
    let vectors = support::vectors(name);
    let mut simulator =
        Simulator::new(&vectors.vehicle, Pose::new(0.2, -0.1, 0.4), &Noise::NONE, 0);
    for row in &vectors.commands {
        simulator.command(row[0], row[1], row[2]);
    }
    let (mut difference, mut size) = ([0.0_f64; 13], [0.0_f64; 13]);
    for row in &vectors.rows {
        simulator.advance(row[0]);
        let ours = channels(&simulator, vectors.vehicle.radius);
        for channel in 0..13 {
            let expected = row[channel + 1];
            difference[channel] = difference[channel].max((ours[channel] - expected).abs());
            size[channel] = size[channel].max(expected.abs());
        }
    }
    core::array::from_fn(|channel| difference[channel] / size[channel])
}

/// The files have six digits after the point; what remains besides is their rounding.
fn agrees(name: &str) {
    for (channel, difference) in CHANNELS.iter().zip(differences(name)) {
        assert!(difference < 1e-5, "{name} {channel}: {difference:.2e}");
    }
}

#[test]
fn the_rear_driven_car_of_the_paper_agrees() {
    agrees("paper");
}

#[test]
fn the_front_driven_full_size_car_agrees() {
    agrees("full-size");
}
