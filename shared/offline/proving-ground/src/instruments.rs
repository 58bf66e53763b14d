//! What the sensors make of the truth.

use core::f64::consts::TAU;

use kerbside_geometry::{Pose, WHEELS};

use crate::chassis::Chassis;
use crate::colour::{Process, TravelNoise};
use crate::normal::Normal;
use crate::plant::State;
use crate::sensors::{Coloured, Encoders, Failure, Sensors, Slip};

/// Streams of the seed: one for each wheel, then these.
const STEERING: u64 = 4;
const GYRO: u64 = 5;
const REFERENCE: u64 = 6;
const PHASE: u64 = 7;

/// The sensors of a vehicle, each drawing its errors from a stream of its own. They are read at times that never fall;
/// each reading draws anew.
#[derive(Clone, Debug)]
pub struct Instruments {
    sensors: Sensors,
    wheels: [WheelReader; 4],
    rack: Reader,
    gyro: Reader,
    bias: f64,
    reference: ReferenceReader,
    slips: Vec<Slip>,
}

#[derive(Clone, Debug)]
struct WheelReader {
    normal: Normal,
    noise: TravelNoise,
    radius: f64,
    phase: f64,
    /// Random part of the rotation so far \[rad\].
    error: f64,
    /// Turned in both directions at the previous reading \[rad\].
    turned: f64,
    /// Counts that a stuck encoder shows, and what it has missed.
    stuck_at: Option<f64>,
    missed: f64,
}

#[derive(Clone, Debug)]
struct Reader {
    normal: Normal,
    process: Process,
    read_at: f64,
}

#[derive(Clone, Debug)]
struct ReferenceReader {
    normal: Normal,
    position: [Process; 2],
    yaw: Process,
}

impl Instruments {
    /// The sensors of a vehicle of these measures, whose wheels slip as `slips` say.
    #[must_use]
    pub fn new(chassis: &Chassis, sensors: &Sensors, slips: &[Slip], seed: u64) -> Self {
        let mut phase = Normal::new(seed, PHASE);
        let noise = sensors.encoders.as_ref().map(|encoders| (encoders.noise, encoders));
        let wheels = WHEELS.map(|wheel| {
            let i = wheel.index();
            let (density, length, share) = noise.map_or((0.0, 0.0, 0.0), |(noise, encoders)| {
                (noise[i], encoders.correlation_length, encoders.phase)
            });
            WheelReader {
                normal: Normal::new(seed, i as u64),
                noise: TravelNoise::new(density, length),
                radius: chassis.radius[i],
                phase: share * phase.uniform(),
                error: 0.0,
                turned: 0.0,
                stuck_at: None,
                missed: 0.0,
            }
        });
        let steering = sensors.steering.map_or(Coloured::NONE, |sensor| sensor.coloured);
        let reference = sensors.reference.map_or([Coloured::NONE; 2], |reference| {
            [reference.position_coloured, reference.yaw_coloured]
        });
        Self {
            sensors: sensors.clone(),
            wheels,
            rack: Reader::new(seed, STEERING, steering),
            gyro: Reader::new(seed, GYRO, Coloured::NONE),
            bias: sensors.gyro.map_or(0.0, |gyro| gyro.bias),
            reference: ReferenceReader {
                normal: Normal::new(seed, REFERENCE),
                position: [Process::new(reference[0]); 2],
                yaw: Process::new(reference[1]),
            },
            slips: slips.to_vec(),
        }
    }

    /// Counts of the wheels: the counter's bits, sign-extended; none of a wheel without an encoder or one that is not
    /// read, and none at all without encoders. Quantised by floor of the cumulative rotation.
    pub fn counts(&mut self, state: &State) -> Option<[Option<i64>; 4]> {
        let encoders = self.sensors.encoders.as_ref()?;
        let mut counts = [None; 4];
        for (wheel, reader) in WHEELS.into_iter().zip(&mut self.wheels) {
            let i = wheel.index();
            let slip: f64 = self.slips.iter().map(|slip| slip.travel_at(wheel, state.time)).sum();
            let rotation =
                reader.rotation(state.rotation[i] + slip / reader.radius, state.turned[i]);
            let Some(resolution) = encoders.counts_per_revolution[i] else {
                continue;
            };
            let steps = rotation * (resolution / TAU) + reader.phase;
            counts[i] = reader
                .shown(steps, failure(encoders, i, state.time))
                .map(|steps| wrapped(encoders, i, steps));
        }
        Some(counts)
    }

    /// The steering sensor's angle \[rad\]; none without a sensor.
    pub fn steering(&mut self, state: &State) -> Option<f64> {
        let sensor = self.sensors.steering?;
        let Reader { normal, process, .. } = &mut self.rack;
        let error = process.at(state.time, normal) + normal.scaled(sensor.white);
        Some(sensor.gain * state.steering + sensor.offset + error)
    }

    /// The gyro's yaw rate \[rad/s\]; none without a gyro.
    pub fn yaw_rate(&mut self, state: &State) -> Option<f64> {
        let gyro = self.sensors.gyro?;
        let elapsed = (state.time - self.gyro.read_at).max(0.0);
        self.gyro.read_at = state.time;
        self.bias += self.gyro.normal.scaled(gyro.drift * elapsed.sqrt());
        Some(gyro.gain * state.yaw_rate + self.bias + self.gyro.normal.scaled(gyro.white))
    }

    /// Stamp by the reference's own clock \[s\] and pose of the marker, yaw not wrapped; none without a reference.
    pub fn reference(&mut self, state: &State) -> Option<(f64, Pose)> {
        let sensor = self.sensors.reference?;
        let ReferenceReader { normal, position, yaw } = &mut self.reference;
        let marker = state.pose.compose(&sensor.marker);
        let [x, y] = position
            .each_mut()
            .map(|process| process.at(state.time, normal) + normal.scaled(sensor.position_white));
        let turn = yaw.at(state.time, normal) + normal.scaled(sensor.yaw_white);
        let pose = Pose::new(marker.x + x, marker.y + y, marker.yaw + turn);
        Some((state.time + sensor.clock_offset, pose))
    }
}

impl Reader {
    fn new(seed: u64, stream: u64, coloured: Coloured) -> Self {
        Self { normal: Normal::new(seed, stream), process: Process::new(coloured), read_at: 0.0 }
    }
}

impl WheelReader {
    /// Rotation with its random part \[rad\].
    fn rotation(&mut self, rotation: f64, turned: f64) -> f64 {
        let travel = (turned - self.turned) * self.radius;
        self.turned = turned;
        self.error += self.noise.over(travel, &mut self.normal) / self.radius;
        rotation + self.error
    }

    /// What the encoder shows of `steps`.
    fn shown(&mut self, steps: f64, failure: Option<Failure>) -> Option<f64> {
        if failure == Some(Failure::Stuck) {
            let shown = *self.stuck_at.get_or_insert(steps - self.missed);
            return Some(shown);
        }
        if let Some(shown) = self.stuck_at.take() {
            self.missed = steps - shown;
        }
        failure.is_none().then_some(steps - self.missed)
    }
}

fn failure(encoders: &Encoders, wheel: usize, time: f64) -> Option<Failure> {
    let active = encoders
        .faults
        .iter()
        .find(|fault| fault.wheel.index() == wheel && (fault.begin..fault.end).contains(&time));
    active.map(|fault| fault.failure)
}

/// The counter's bits, sign-extended.
#[allow(clippy::cast_possible_truncation)] // 63 bits of counts reach to the next star.
fn wrapped(encoders: &Encoders, wheel: usize, steps: f64) -> i64 {
    let count = encoders.first_counts[wheel].wrapping_add(steps.floor() as i64);
    let unused = 64 - encoders.counter_bits.clamp(1, 64);
    count << unused >> unused
}
