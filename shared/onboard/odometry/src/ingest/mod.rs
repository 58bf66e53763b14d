//! From readings to travel.

mod counter;
mod sequence;
mod speedometer;

use kerbside_geometry::{SteeringSensor, Vehicle, WHEELS};
use kerbside_messages::{Header, Nanos, Raw, Travel, WheelStatus};

use crate::clock::{ClockMap, Mapped};
use crate::sensors::{NoModel, Sensors, WheelSignal};
use crate::settings::IngestSettings;
use crate::wheels::{self, WheelScale};
use counter::{Bounds, Counter, Judgement};
use sequence::{Place, Rate, Sequence};
use speedometer::Speedometer;

/// A steering angle may exceed the limit by this factor and this angle \[rad\] before it is out of
/// belief.
const STEERING_BELIEF: (f64, f64) = (1.25, 0.2);

/// Spreads the numbers of successive epochs of one boot id: odd, so that none repeats.
const EPOCH_STEP: u32 = 0x9e37_79b9;

/// The stage that turns readings into travel; one [`Travel`] per [`Raw`].
///
/// # Counter epochs
/// The first epoch of a vehicle's life has its boot id for a number, and travel in it is the
/// counter's own value times metres per count. So it does not matter how often ingest is restarted.
/// A further epoch begins where motion was lost beyond what a counter can tell: after a gap longer
/// than `longest_gap` or long enough for half a turn of the counter at top speed, or when a counter
/// jumped and stayed there. Where wheels report speeds, the motion during ingest's own death and
/// during the interface's is unknown, so each begins a new epoch.
///
/// # Wheels
/// A wheel that turned faster than `speed_margin` times its top speed (that of the outermost place
/// on full lock) is `Implausible`, its increment 0, and its next reading is measured from the last
/// one accepted: a single outlier costs nothing. If three readings in a row agree with one another
/// but not with that one, or eight are refused in a row, the counter jumped, and a new epoch
/// begins. Stamps jitter, so no interval is judged as shorter than the usual one.
///
/// # Gaps
/// A travel has a gap if frames are missing, samples were lost on the way, the interface was
/// restarted, or the wheels were not read for more than 2.5 usual intervals. It stays set until a
/// travel carries wheels again.
#[derive(Clone, Debug)]
pub struct Ingest {
    sensors: Sensors,
    settings: IngestSettings,
    steering: SteeringSensor,
    largest_steering: f64,
    largest_yaw_rate: f64,
    /// What the gyro reads at rest \[rad/s\].
    gyro_bias: f64,
    counters: [Counter; 4],
    speedometers: [Speedometer; 4],
    clock: ClockMap,
    sequence: Sequence,
    rate: Rate,
    boot: Option<u32>,
    epochs: u32,
    salt: u32,
    /// Time of the newest reading on the vehicle's clock, steps of that clock taken out \[s\].
    time: f64,
    vehicle_time: u64,
    arrival: Nanos,
    wheels_read: Option<f64>,
    gap_pending: bool,
    fresh_epoch: bool,
    stamped: bool,
    newest: Travel,
}

impl Ingest {
    /// A stage for `vehicle` with the sensors its file describes, [`Sensors::of`].
    ///
    /// # Errors
    /// [`NoModel`] where no pose could ever be computed from what it measures.
    pub fn new(vehicle: &Vehicle, settings: &IngestSettings) -> Result<Self, NoModel> {
        Self::with_sensors(vehicle, &Sensors::of(vehicle), settings)
    }

    /// A stage for `vehicle` with these sensors, as for recordings that have wheel speeds.
    ///
    /// # Errors
    /// [`NoModel`] where no pose could ever be computed from what it measures.
    pub fn with_sensors(
        vehicle: &Vehicle,
        sensors: &Sensors,
        settings: &IngestSettings,
    ) -> Result<Self, NoModel> {
        sensors.model(vehicle)?;
        let scales = wheels::scales(vehicle, sensors)?;
        let fastest = settings.speed_margin * vehicle.limits.speed;
        let (factor, slack) = STEERING_BELIEF;
        Ok(Self {
            sensors: *sensors,
            settings: settings.clone(),
            steering: vehicle.steering_sensor.unwrap_or(SteeringSensor::new(0.0, 0.0)),
            largest_steering: factor * vehicle.limits.steering + slack,
            gyro_bias: vehicle.gyro.map_or(0.0, |gyro| gyro.bias),
            largest_yaw_rate: fastest * wheels::largest_curvature(vehicle) + 1.0,
            counters: scales.map(Counter::new),
            speedometers: scales
                .map(|scale: WheelScale| Speedometer::new(scale.top_speed, scale.speed_scale)),
            clock: ClockMap::new(settings),
            sequence: Sequence::default(),
            rate: Rate::new(vehicle.encoders.map_or(0.0, |encoders| encoders.rate)),
            boot: None,
            epochs: 0,
            salt: 0,
            time: 0.0,
            vehicle_time: 0,
            arrival: 0,
            wheels_read: None,
            gap_pending: false,
            fresh_epoch: true,
            stamped: false,
            newest: Travel::default(),
        })
    }

    /// Takes the next reading. `missing`: samples lost on the way before it; `new_epoch`: first
    /// sample of a new life of the interface. `out` is overwritten, except for what the sender adds
    /// to its header.
    pub fn step(&mut self, raw: &Raw, missing: u64, new_epoch: bool, out: &mut Travel) {
        if self.boot != Some(raw.boot) {
            self.begin_life(raw);
        }
        let restarted = new_epoch && self.stamped;
        match self.sequence.judge(raw, restarted) {
            Place::Repeated => self.repeat(raw),
            Place::First => self.take(raw, missing, false),
            Place::Next { missing: frames } => {
                self.take(raw, missing.max(u64::from(frames)), restarted);
            }
        }
        let header =
            Header { stamp: self.newest.header.stamp, origin: raw.header.stamp, ..out.header };
        *out = Travel { header, ..self.newest };
    }

    /// Another life of the vehicle: nothing of the old one holds.
    fn begin_life(&mut self, raw: &Raw) {
        self.boot = Some(raw.boot);
        self.clock.reset();
        self.sequence = Sequence::default();
        (self.epochs, self.gap_pending, self.wheels_read) = (0, false, None);
        self.salt = match self.sensors.signal {
            WheelSignal::Counts => 0,
            WheelSignal::Speeds => mix(raw.arrival),
        };
        (self.newest.has_steering, self.newest.has_yaw_rate) = (0, 0);
        self.forget_wheels();
        self.newest.counter_epoch = self.epoch();
    }

    /// Motion was lost: an epoch begins in the same life of the vehicle.
    fn begin_epoch(&mut self) {
        self.epochs = self.epochs.wrapping_add(1);
        self.forget_wheels();
        self.newest.counter_epoch = self.epoch();
    }

    fn forget_wheels(&mut self) {
        self.counters.iter_mut().for_each(Counter::forget);
        self.speedometers.iter_mut().for_each(Speedometer::forget);
        self.fresh_epoch = true;
    }

    fn epoch(&self) -> u32 {
        let boot = self.boot.unwrap_or_default();
        (boot ^ self.salt).wrapping_add(self.epochs.wrapping_mul(EPOCH_STEP))
    }

    /// A reading that was there before moves nothing.
    fn repeat(&mut self, raw: &Raw) {
        let stamp = self.no_earlier(0);
        self.clear(stamp);
        self.newest.transport_delay = kerbside_messages::seconds(raw.arrival.saturating_sub(stamp));
        self.newest.refused = self.newest.refused.saturating_add(1);
    }

    fn take(&mut self, raw: &Raw, missing: u64, restarted: bool) {
        let mapped = self.clock.map(raw.vehicle_time, raw.arrival);
        self.advance_time(raw, &mapped);
        let stamp = self.no_earlier(mapped.stamp);
        self.clear(stamp);
        self.newest.clock_offset = mapped.offset;
        self.newest.clock_drift = mapped.drift;
        self.newest.transport_delay = mapped.delay;
        self.newest.missing = u32::try_from(missing).unwrap_or(u32::MAX);
        self.gap_pending |= missing > 0 || restarted;
        if restarted && self.sensors.signal == WheelSignal::Speeds {
            self.begin_epoch();
        }
        let steering_refused = self.take_steering(raw);
        let yaw_rate_refused = self.take_yaw_rate(raw);
        let wheel_refused = self.take_wheels(raw);
        let refused = steering_refused || yaw_rate_refused || wheel_refused;
        self.newest.refused = self.newest.refused.saturating_add(u32::from(refused));
        if std::mem::take(&mut self.fresh_epoch) {
            self.newest.interval = 0.0;
        }
    }

    /// `stamp`, or a nanosecond after the newest travel's: stamps increase strictly.
    fn no_earlier(&mut self, stamp: Nanos) -> Nanos {
        if std::mem::replace(&mut self.stamped, true) {
            stamp.max(self.newest.header.stamp.saturating_add(1))
        } else {
            stamp
        }
    }

    /// Time goes on by the vehicle's clock, or by arrivals where that clock jumped.
    fn advance_time(&mut self, raw: &Raw, mapped: &Mapped) {
        let nanos = if mapped.stepped || raw.vehicle_time < self.vehicle_time {
            raw.arrival.saturating_sub(self.arrival)
        } else {
            raw.vehicle_time - self.vehicle_time
        };
        self.time += kerbside_messages::seconds(nanos);
        (self.vehicle_time, self.arrival) = (raw.vehicle_time, raw.arrival);
    }

    /// A travel at `stamp` in which nothing was read.
    fn clear(&mut self, stamp: Nanos) {
        let travel = &mut self.newest;
        travel.interval = wheels::elapsed(stamp, travel.header.stamp);
        travel.header.stamp = stamp;
        travel.increment = [0.0; 4];
        (travel.missing, travel.gap) = (0, 0);
        (travel.steering_is_new, travel.yaw_rate_is_new) = (0, 0);
        let unread = |present| if present { WheelStatus::NotRead } else { WheelStatus::Absent };
        travel.status = self.sensors.wheels.map(|present| unread(present).code());
    }

    /// Takes the steering angle, the sensor's offset and gain taken out; true if it is out of belief.
    fn take_steering(&mut self, raw: &Raw) -> bool {
        if raw.has_steering != 1 || !self.sensors.steering {
            return false;
        }
        let angle = self.steering.angle(raw.steering);
        let believed = angle.abs() <= self.largest_steering;
        if believed {
            self.newest.steering = angle;
            (self.newest.has_steering, self.newest.steering_is_new) = (1, 1);
        }
        !believed
    }

    /// Takes the yaw rate, the gyro's bias taken out; true if it is out of belief.
    fn take_yaw_rate(&mut self, raw: &Raw) -> bool {
        if raw.has_yaw_rate != 1 || !self.sensors.gyro {
            return false;
        }
        let rate = raw.yaw_rate - self.gyro_bias;
        let believed = rate.abs() <= self.largest_yaw_rate;
        if believed {
            self.newest.yaw_rate = rate;
            (self.newest.has_yaw_rate, self.newest.yaw_rate_is_new) = (1, 1);
        }
        !believed
    }

    /// Takes the wheels that were read; true if one is implausible.
    fn take_wheels(&mut self, raw: &Raw) -> bool {
        let read = self.wheels_of(raw);
        if read == [false; 4] {
            self.newest.gap = u8::from(self.gap_pending);
            return false;
        }
        self.judge_interval();
        let bounds = self.bounds();
        let mut judged = self.judge_wheels(raw, read, &bounds);
        if judged.contains(&Some(Judgement::Lost)) {
            self.begin_epoch();
            judged = self.judge_wheels(raw, read, &bounds);
        }
        self.newest.gap = u8::from(std::mem::take(&mut self.gap_pending));
        for (index, judgement) in judged.into_iter().enumerate() {
            self.write_wheel(index, judgement);
        }
        judged.contains(&Some(Judgement::Implausible))
    }

    fn judge_interval(&mut self) {
        if let Some(before) = self.wheels_read.replace(self.time) {
            self.gap_pending |= self.rate.has_hole(self.time - before);
        }
    }

    fn bounds(&self) -> Bounds {
        Bounds {
            speed_margin: self.settings.speed_margin,
            longest_gap: self.settings.longest_gap,
            shortest: self.rate.usual(),
        }
    }

    /// Which of the vehicle's wheels this reading carries.
    fn wheels_of(&self, raw: &Raw) -> [bool; 4] {
        let mask = match self.sensors.signal {
            WheelSignal::Counts => raw.counts_mask,
            WheelSignal::Speeds => raw.speeds_mask,
        };
        let carried = |wheel: kerbside_geometry::Wheel| {
            self.sensors.wheels[wheel.index()] && mask & (1 << wheel.index()) != 0
        };
        WHEELS.map(carried)
    }

    fn judge_wheels(
        &mut self,
        raw: &Raw,
        read: [bool; 4],
        bounds: &Bounds,
    ) -> [Option<Judgement>; 4] {
        let mut judged = [None; 4];
        for index in (0..4).filter(|index| read[*index]) {
            judged[index] = Some(match self.sensors.signal {
                WheelSignal::Counts => {
                    self.counters[index].read(raw.counts[index], self.time, bounds)
                }
                WheelSignal::Speeds => {
                    self.speedometers[index].read(raw.speeds[index], self.time, bounds)
                }
            });
        }
        judged
    }

    fn write_wheel(&mut self, index: usize, judgement: Option<Judgement>) {
        let travel = &mut self.newest;
        travel.travel[index] = match self.sensors.signal {
            WheelSignal::Counts => self.counters[index].travel(),
            WheelSignal::Speeds => self.speedometers[index].travel(),
        };
        let status = match judgement {
            None => return,
            Some(Judgement::First) => WheelStatus::Zeroed,
            Some(Judgement::Turned(increment)) => {
                travel.increment[index] = increment;
                WheelStatus::Valid
            }
            Some(Judgement::Implausible | Judgement::Lost) => WheelStatus::Implausible,
        };
        travel.status[index] = status.code();
    }
}

/// A number that another `value` is unlikely to give.
fn mix(value: u64) -> u32 {
    let spread = value.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (spread >> 32) as u32
}
