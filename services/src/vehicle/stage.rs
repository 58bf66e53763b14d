//! The simulated vehicle's stage: commands in, readings out, and its own stop on silence. Pure, driven live and in
//! lockstep.

use core::time::Duration;

use kerbside_geometry::{Pose, Vehicle};
use kerbside_line::{Frame, Hello, Sensors, VehicleEnd, VehicleEvent};
use kerbside_messages::{Header, Nanos, Truth, nanos, seconds};
use kerbside_simulation::{Effects, Noise, Simulator};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// What a simulated vehicle is made of.
#[derive(Clone, Debug)]
pub struct Making {
    /// The vehicle.
    pub vehicle: Vehicle,
    /// What it differs by from that description.
    pub effects: Effects,
    /// Where it stands at first.
    pub start: Pose,
    /// Seed of its sensors' noise.
    pub seed: u64,
    /// Its boot id.
    pub boot: u32,
    /// Silence after which it stops by itself.
    pub silence: Duration,
}

/// The simulated vehicle. Times are its own \[ns since its start\].
#[derive(Clone, Debug)]
pub struct VehicleStage {
    end: VehicleEnd,
    simulator: Simulator,
    period: Nanos,
    time: Nanos,
    silent: bool,
    hello: Hello,
    /// Counts at which the counters were set to zero.
    zero: [i64; 4],
    /// What the board's clock shows besides the time since the start \[ns\].
    clock: i64,
}

impl VehicleStage {
    /// A vehicle that stands and waits for a host.
    #[must_use]
    pub fn new(making: &Making) -> Self {
        let (vehicle, effects) = (&making.vehicle, &making.effects);
        let noise = Noise::default();
        let mut simulator =
            Simulator::with_effects(vehicle, effects, making.start, &noise, making.seed);
        let period = period_of(&making.vehicle);
        let hello = hello_of(making, &simulator.reading(), period);
        Self {
            end: VehicleEnd::new(hello),
            simulator,
            period,
            time: 0,
            silent: true,
            hello,
            zero: driven_before(making).map(|count| -count),
            clock: 0,
        }
    }

    /// The board starts anew as `boot`: counters and clock begin at zero, and nothing moves until a host commands it.
    pub fn reboot(&mut self, boot: u32) {
        self.hello = Hello { boot, ..self.hello };
        self.end = VehicleEnd::new(self.hello);
        self.reset_counters();
        self.clock = -self.time.cast_signed();
    }

    /// The counters are set to zero, and nothing says so.
    pub fn reset_counters(&mut self) {
        self.zero = self.simulator.reading().counts;
    }

    /// The clock that readings are stamped by jumps by `by` \[ns\], not below zero, and goes on from there.
    pub fn step_clock(&mut self, by: i64) {
        self.clock = (self.clock + by).max(-self.time.cast_signed());
    }

    /// Another silence time-out \[ms\].
    #[cfg(test)]
    pub(crate) fn set_silence(&mut self, silence: u16) {
        self.hello.silence_ms = silence;
        self.end = VehicleEnd::new(self.hello);
    }

    /// Time between readings \[ns\].
    #[must_use]
    pub fn period(&self) -> Nanos {
        self.period
    }

    /// Takes bytes from the line at `time`.
    pub fn receive(&mut self, time: Nanos, bytes: &[u8]) {
        let simulator = &mut self.simulator;
        self.end.receive(time, bytes, &mut |event| {
            if let VehicleEvent::Command { speed, steering, .. } = event {
                simulator.command(seconds(time), f64::from(speed), f64::from(steering));
            }
        });
    }

    /// Drives until `time` and writes what is due then: handshake and one reading.
    pub fn tick(&mut self, time: Nanos, mut write: impl FnMut(&Frame)) {
        self.simulator.advance(seconds(time));
        self.time = time;
        // The vehicle's own layer of safety: commands that stay away are a command to stop.
        let silent = self.end.is_silent(time);
        if silent && !self.silent {
            self.simulator.halt(seconds(time));
        }
        self.silent = silent;
        while let Some(frame) = self.end.pending(time) {
            write(&frame);
        }
        let mut reading = self.simulator.reading();
        for (count, zero) in reading.counts.iter_mut().zip(self.zero) {
            *count = count.wrapping_sub(zero);
        }
        let shown = time.saturating_add_signed(self.clock);
        write(&self.end.reading_at(time, &sensors_of(shown, &reading)));
    }

    /// The true state, at the host's time `now`.
    pub fn truth(&self, now: Nanos, out: &mut Truth) {
        let pose = self.simulator.pose();
        *out = Truth {
            header: Header::stamped(now, 0),
            x: pose.x,
            y: pose.y,
            yaw: pose.yaw,
            speed: self.simulator.speed(),
            steering: self.simulator.steering(),
            distance: self.simulator.distance(),
            vehicle_time: self.time,
            silent: u8::from(self.silent),
            ..Truth::default()
        };
    }
}

/// Where the counters stand when the board has long been up: each somewhere, none near its zero.
fn driven_before(making: &Making) -> [i64; 4] {
    let bits = making.vehicle.encoders.map_or(32, |encoders| encoders.counter_bits);
    let least = 1_i64 << bits.clamp(4, 28).saturating_sub(3);
    let mut random = Pcg64::seed_from_u64(making.seed ^ 0x0d0_5e7e5);
    [0; 4].map(|_: i64| {
        let count = random.random_range(least..2 * least);
        if random.random_bool(0.5) { count } else { -count }
    })
}

/// Time between readings \[ns\]: that of the fastest sensor.
fn period_of(vehicle: &Vehicle) -> Nanos {
    let rates = [
        vehicle.encoders.map(|sensor| sensor.rate),
        vehicle.steering_sensor.map(|sensor| sensor.rate),
        vehicle.gyro.map(|sensor| sensor.rate),
    ];
    let fastest = rates.into_iter().flatten().fold(1.0, f64::max);
    nanos(1.0 / fastest)
}

fn hello_of(making: &Making, reading: &kerbside_simulation::SensorReading, period: Nanos) -> Hello {
    let bits = making.vehicle.encoders.map_or(32, |encoders| encoders.counter_bits);
    Hello {
        boot: making.boot,
        counter_bits: u8::try_from(bits).unwrap_or(64),
        counts_mask: reading.counts_mask,
        speeds_mask: reading.speeds_mask,
        has_steering: reading.steering.is_some(),
        has_yaw_rate: reading.yaw_rate.is_some(),
        reading_period_us: u32::try_from(period / 1000).unwrap_or(u32::MAX),
        silence_ms: u16::try_from(making.silence.as_millis()).unwrap_or(u16::MAX),
    }
}

#[allow(clippy::cast_possible_truncation)] // the line carries single precision
fn sensors_of(time: Nanos, reading: &kerbside_simulation::SensorReading) -> Sensors {
    Sensors {
        time,
        counts_mask: reading.counts_mask,
        counts: reading.counts,
        speeds_mask: reading.speeds_mask,
        speeds: reading.speeds.map(|speed| speed as f32),
        steering: reading.steering.map(|angle| angle as f32),
        yaw_rate: reading.yaw_rate.map(|rate| rate as f32),
    }
}
