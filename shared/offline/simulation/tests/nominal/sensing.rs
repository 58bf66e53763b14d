//! What the sensors show of the motion.

use core::f64::consts::TAU;

use crate::support;
use kerbside_geometry::{Encoders, Pose, SteeringSensor, Vehicle};
use kerbside_simulation::{Noise, SensorReading, Simulator};

fn car() -> Vehicle {
    Vehicle { radius: [0.0725; 4], ..support::vectors("paper").vehicle }
}

/// Drives forward, then in reverse, reading every 5 ms.
fn drive(simulator: &mut Simulator, mut each: impl FnMut(&Simulator, SensorReading)) {
    simulator.command(0.0, 0.3, 0.3);
    simulator.command(4.0, -0.4, -0.2);
    for step in 1..=2000 {
        simulator.advance(f64::from(step) * 0.005);
        let reading = simulator.reading();
        each(simulator, reading);
    }
}

#[test]
#[allow(clippy::cast_possible_truncation)]
fn counts_are_the_whole_counts_of_the_rotation_in_both_directions() {
    let mut simulator = Simulator::new(&car(), Pose::default(), &Noise::NONE, 1)
        .with_first_counts([1000, -1000, 0, 5]);
    let mut least = 0;
    drive(&mut simulator, |simulator, reading| {
        let whole = simulator.rotation().map(|turn| (turn / TAU * 2048.0).floor() as i64);
        let [fl, fr, rl, rr] = whole;
        assert_eq!(reading.counts, [fl + 1000, fr - 1000, rl, rr + 5]);
        assert_eq!((reading.counts_mask, reading.speeds_mask), (0xf, 0));
        least = least.min(rl);
    });
    assert!(least < -100, "the drive ends behind its start: {least}");
}

#[test]
fn a_narrow_counter_wraps_and_a_missing_encoder_is_masked() {
    let mut vehicle = car();
    vehicle.encoders = vehicle.encoders.map(|encoders| Encoders {
        counts_per_revolution: [None, None, Some(2048.0), Some(2048.0)],
        counter_bits: 8,
        ..encoders
    });
    let mut wide = Simulator::new(&car(), Pose::default(), &Noise::NONE, 1);
    let mut truth = Vec::new();
    drive(&mut wide, |_, reading| truth.push(reading.counts));
    let mut narrow = Simulator::new(&vehicle, Pose::default(), &Noise::NONE, 1);
    let mut index = 0;
    drive(&mut narrow, |_, reading| {
        assert_eq!((reading.counts_mask, &reading.counts[..2]), (0b1100, &[0, 0][..]));
        assert!((-128..128).contains(&reading.counts[2]));
        assert_eq!((reading.counts[2] - truth[index][2]) % 256, 0);
        index += 1;
    });
}

#[test]
fn a_vehicle_without_encoders_reports_speeds_of_the_wheels_it_has() {
    let vehicle =
        Vehicle { encoders: None, gyro: None, steering_sensor: None, track_front: 0.0, ..car() };
    let mut simulator = Simulator::new(&vehicle, Pose::default(), &Noise::NONE, 1);
    drive(&mut simulator, |simulator, reading| {
        assert_eq!((reading.counts_mask, reading.speeds_mask), (0, 0b1101));
        let rate = simulator.rotation_rate();
        let expected = [rate[0] * 0.0725, 0.0, rate[2] * 0.0725, rate[3] * 0.0725];
        assert_eq!(reading.speeds, expected);
        assert_eq!((reading.steering, reading.yaw_rate), (None, None));
    });
}

#[test]
fn noise_free_sensors_show_the_rack_and_the_yaw_rate() {
    let mut simulator = Simulator::new(&car(), Pose::default(), &Noise::NONE, 1);
    drive(&mut simulator, |simulator, reading| {
        assert_eq!(reading.steering, Some(simulator.steering()));
        assert_eq!(reading.yaw_rate, Some(simulator.yaw_rate()));
    });
}

#[test]
fn a_seed_repeats_its_readings_and_another_one_does_not() {
    let readings = |seed| {
        let mut simulator = Simulator::new(&car(), Pose::default(), &Noise::default(), seed);
        let mut all = Vec::new();
        drive(&mut simulator, |_, reading| all.push(reading));
        all
    };
    assert_eq!(readings(7), readings(7));
    assert_ne!(readings(7), readings(8));
}

/// Deviation of the four wheels' travel from the truth at the end \[m\].
fn travel_errors(seed: u64, reads: u32) -> [f64; 4] {
    let noise = Noise { wheel: 0.0005, phase: 0.0, ..Noise::NONE };
    // Fine counts, so that their width does not hide the noise.
    let mut vehicle = car();
    vehicle.encoders = vehicle
        .encoders
        .map(|encoders| Encoders { counts_per_revolution: [Some(1e6); 4], ..encoders });
    let mut simulator = Simulator::new(&vehicle, Pose::default(), &noise, seed);
    simulator.command(0.0, 0.4, 0.0);
    let mut counts = [0; 4];
    for read in 1..=reads {
        simulator.advance(10.0 * f64::from(read) / f64::from(reads));
        counts = simulator.reading().counts;
    }
    #[allow(clippy::cast_precision_loss)]
    core::array::from_fn(|wheel| {
        (counts[wheel] as f64 / 1e6 * TAU - simulator.rotation()[wheel]) * 0.0725
    })
}

#[test]
fn the_wheels_err_independently_with_a_variance_that_grows_with_travel_alone() {
    for reads in [1, 40] {
        let errors: Vec<[f64; 4]> = (0..400).map(|seed| travel_errors(seed, reads)).collect();
        let product = |a: usize, b: usize| {
            errors.iter().map(|error| error[a] * error[b]).sum::<f64>() / 400.0
        };
        // 10 s at 0.4 m/s less the ramp and the delay: about 3.7 m.
        let distance = 0.4 * (10.0 - 0.02) - 0.5 * 0.4 * 0.4 / 0.3;
        let expected = 0.0005_f64.powi(2) * distance;
        for wheel in 0..4 {
            let ratio = product(wheel, wheel) / expected;
            // Four standard errors of a variance from 400 samples.
            assert!((ratio - 1.0).abs() < 4.0 * (2.0_f64 / 400.0).sqrt(), "{reads}: {ratio}");
            let correlation = product(wheel, (wheel + 1) % 4) / expected;
            assert!(correlation.abs() < 4.0 * (1.0_f64 / 400.0).sqrt(), "{correlation}");
        }
    }
}

#[test]
fn noisy_speeds_add_up_to_a_noisy_travel_and_standing_wheels_are_silent() {
    let noise = Noise { wheel: 0.0005, ..Noise::NONE };
    let vehicle = Vehicle { encoders: None, ..car() };
    let mut simulator = Simulator::new(&vehicle, Pose::default(), &noise, 4);
    let (mut sum, mut before) = (0.0, [0.0; 4]);
    simulator.command(1.0, 0.3, 0.0);
    for step in 1..=400 {
        simulator.advance(f64::from(step) * 0.02);
        let speeds = simulator.reading().speeds;
        if simulator.time() < 1.0 {
            assert_eq!(speeds, [0.0; 4]);
        }
        sum += 0.01 * (speeds[2] + before[2]);
        before = speeds;
    }
    // 1.9 m: a standard deviation of 0.7 mm.
    let error = sum - simulator.distance();
    assert!(error != 0.0 && error.abs() < 0.003, "{error}");
}

#[test]
fn white_noise_has_the_size_it_was_given() {
    let noise = Noise { steering: 0.01, gyro: 0.02, ..Noise::NONE };
    let mut simulator = Simulator::new(&car(), Pose::default(), &noise, 5);
    let (mut steering, mut gyro) = (0.0, 0.0);
    for _ in 0..4000 {
        let reading = simulator.reading();
        steering += reading.steering.unwrap().powi(2) / 4000.0;
        gyro += reading.yaw_rate.unwrap().powi(2) / 4000.0;
    }
    // Four standard errors: 9 %.
    assert!((steering / 1e-4 - 1.0).abs() < 0.09 && (gyro / 4e-4 - 1.0).abs() < 0.09);
}

#[test]
fn a_steering_sensor_reads_with_its_own_offset_and_gain() {
    let mut vehicle = car();
    let sensor = vehicle.steering_sensor.unwrap();
    vehicle.steering_sensor = Some(SteeringSensor { offset: 0.02, gain: 1.1, ..sensor });
    let mut simulator = Simulator::new(&vehicle, Pose::default(), &Noise::NONE, 6);
    assert_eq!(simulator.reading().steering, Some(0.02));
    simulator.command(0.0, 0.0, 0.2);
    simulator.advance(5.0);
    let expected = 1.1 * simulator.steering() + 0.02;
    assert!((simulator.reading().steering.unwrap() - expected).abs() < 1e-12);
    assert!(simulator.steering() > 0.19);
}
