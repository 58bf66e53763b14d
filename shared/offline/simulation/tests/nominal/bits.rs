//! The same calls give the same bits, on every machine.

use kerbside_geometry::Pose;
use kerbside_simulation::{Noise, Simulator};

use crate::support;

#[test]
fn a_noisy_drive_ends_with_the_bits_it_always_had() {
    let vectors = support::vectors("paper");
    let start = Pose::new(0.2, -0.1, 0.4);
    let mut simulator = Simulator::new(&vectors.vehicle, start, &Noise::default(), 20);
    vectors.commands.iter().for_each(|row| simulator.command(row[0], row[1], row[2]));
    let mut reading = simulator.reading();
    for step in 1..=3200 {
        simulator.advance(f64::from(step) * 0.005);
        reading = simulator.reading();
    }
    let pose = simulator.pose();
    let bits = [pose.x, pose.y, pose.yaw, reading.steering.unwrap()].map(f64::to_bits);
    assert_eq!(
        bits,
        [
            0x3ffa_4c38_0a12_23b5,
            0x3fec_bd49_0cc5_6f4c,
            0x3fd8_e81a_2106_a55e,
            0xbfd0_db26_c0f5_4790
        ]
    );
    assert_eq!(reading.counts, [8084, 8159, 7815, 7985]);
}
