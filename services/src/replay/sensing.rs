//! What the readings of a drive carry, and so which odometry model they allow: a sensor counts where the vehicle's
//! file describes it and the drive has it. Nothing is guessed.

use kerbside_geometry::{Vehicle, WHEELS, Wheel};
use kerbside_messages::{FilterKind, OdometryModel, Raw};
use kerbside_odometry::{Sensors, WheelSignal};

/// What some readings carry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Carried {
    counts: u8,
    speeds: u8,
    steering: bool,
    yaw_rate: bool,
}

impl Carried {
    /// What these readings carry, all together.
    pub fn by(raws: &[Raw]) -> Self {
        raws.iter().fold(Self::default(), |so_far, raw| Self {
            counts: so_far.counts | raw.counts_mask,
            speeds: so_far.speeds | raw.speeds_mask,
            steering: so_far.steering || raw.has_steering == 1,
            yaw_rate: so_far.yaw_rate || raw.has_yaw_rate == 1,
        })
    }

    /// What of it the file of `vehicle` describes. Counts go before speeds.
    pub fn sensors(&self, vehicle: &Vehicle) -> Sensors {
        let described = Sensors::of(vehicle);
        let wheels = if self.counts != 0 {
            let counted = vehicle.encoders.is_some();
            let read = wheels_of(self.counts);
            let both =
                core::array::from_fn(|index| counted && described.wheels[index] && read[index]);
            Sensors { wheels: both, signal: WheelSignal::Counts, ..described }
        } else {
            described.with_speeds(wheels_of(self.speeds))
        };
        Sensors {
            steering: described.steering && self.steering,
            gyro: described.gyro && self.yaw_rate,
            ..wheels
        }
    }

    /// Where file and drive do not agree, a sentence each.
    pub fn disagreements(&self, vehicle: &Vehicle) -> Vec<String> {
        let described = Sensors::of(vehicle);
        let mut said = Vec::new();
        if self.counts != 0 {
            let read = wheels_of(self.counts);
            let only = |has: &[bool; 4], lacks: &[bool; 4]| {
                names(core::array::from_fn(|index| has[index] && !lacks[index]))
            };
            if let Some(wheels) = only(&described.wheels, &read) {
                said.push(format!("{wheels}: an encoder is described, but was never read"));
            }
            if let Some(wheels) = only(&read, &described.wheels) {
                said.push(format!(
                    "{wheels}: counts are not used, vehicle.toml has no counts_per_revolution"
                ));
            }
        }
        for (name, key, described, carried) in [
            ("steering sensor", "steering_sensor", described.steering, self.steering),
            ("gyro", "gyro", described.gyro, self.yaw_rate),
        ] {
            match (described, carried) {
                (true, false) => said.push(format!("the {name} is described, but was never read")),
                (false, true) => {
                    said.push(format!("the {name} is not used, vehicle.toml has no [{key}]"));
                }
                _ => {}
            }
        }
        said
    }
}

fn wheels_of(mask: u8) -> [bool; 4] {
    WHEELS.map(|wheel| mask & (1 << wheel.index()) != 0)
}

fn names(wheels: [bool; 4]) -> Option<String> {
    let names: Vec<_> =
        WHEELS.iter().filter(|wheel| wheels[wheel.index()]).map(|wheel| wheel.name()).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

/// Sensors as one word of a command line.
#[must_use]
pub fn format(sensors: &Sensors) -> String {
    let signal = match sensors.signal {
        WheelSignal::Counts => "counts",
        WheelSignal::Speeds => "speeds",
    };
    let wheels = WHEELS.iter().filter(|wheel| sensors.wheels[wheel.index()]);
    let mut words: Vec<&str> = core::iter::once(signal).chain(wheels.map(|w| w.name())).collect();
    words.extend(sensors.steering.then_some("steering"));
    words.extend(sensors.gyro.then_some("gyro"));
    words.join(",")
}

/// What [`format()`] wrote.
///
/// # Errors
/// The word that is none.
pub fn parse(text: &str) -> Result<Sensors, String> {
    let mut sensors =
        Sensors { wheels: [false; 4], signal: WheelSignal::Counts, steering: false, gyro: false };
    for word in text.split(',') {
        match word {
            "counts" => sensors.signal = WheelSignal::Counts,
            "speeds" => sensors.signal = WheelSignal::Speeds,
            "steering" => sensors.steering = true,
            "gyro" => sensors.gyro = true,
            name => {
                let wheel = WHEELS.into_iter().find(|wheel| wheel.name() == name);
                sensors.wheels[wheel.map(Wheel::index).ok_or_else(|| name.to_owned())?] = true;
            }
        }
    }
    Ok(sensors)
}

/// What a filter of a model uses, by name: the fused one takes every sensor that is there.
pub fn uses(model: OdometryModel, filter: FilterKind, sensors: &Sensors) -> Vec<String> {
    let signal = match sensors.signal {
        WheelSignal::Counts => "counts of",
        WheelSignal::Speeds => "speed of",
    };
    let one = || WHEELS.iter().find(|wheel| sensors.wheels[wheel.index()]).map_or("", |w| w.name());
    // A single wheel: a rear one goes before a front one.
    let single = || {
        let rear = [Wheel::RearLeft, Wheel::RearRight];
        let rear = rear.into_iter().find(|wheel| sensors.wheels[wheel.index()]);
        rear.map_or_else(one, Wheel::name)
    };
    let fused = filter == FilterKind::Fused && model != OdometryModel::None;
    if fused {
        let mut used = vec![format!("{signal} {}", names(sensors.wheels).unwrap_or_default())];
        used.extend(sensors.steering.then(|| "steering sensor".to_owned()));
        used.extend(sensors.gyro.then(|| "gyro".to_owned()));
        return used;
    }
    let wheels = match model {
        OdometryModel::RearFront => "rl, rr, fl, fr",
        OdometryModel::Rear => "rl, rr",
        OdometryModel::Front => "fl, fr",
        OdometryModel::WheelSteering | OdometryModel::WheelGyro => single(),
        OdometryModel::None => "no wheel",
    };
    let mut used = vec![format!("{signal} {wheels}")];
    match model {
        OdometryModel::RearFront | OdometryModel::Front | OdometryModel::WheelSteering => {
            used.push("steering sensor".to_owned());
        }
        OdometryModel::WheelGyro => used.push("gyro".to_owned()),
        OdometryModel::Rear | OdometryModel::None => {}
    }
    used
}

/// What the vehicle or the drive lacks, and what follows from that for a filter of the model.
pub fn lacks(model: OdometryModel, filter: FilterKind, sensors: &Sensors) -> Vec<String> {
    let [fl, fr, rl, rr] = sensors.wheels;
    let beside = fl || fr || sensors.steering || sensors.gyro;
    if filter == FilterKind::Fused && model == OdometryModel::Rear && beside {
        // The front wheels that are there, or the gyro, see the heading too.
        return Vec::new();
    }
    let rear = match (rl, rr) {
        (true, true) => "the rear wheels are on one place",
        (false, false) => "no rear wheel is read",
        _ => "only one rear wheel is read",
    };
    let front = match (fl && fr, sensors.steering) {
        (true, _) => "no steering sensor",
        (false, true) => "not both front wheels are read",
        (false, false) => "not both front wheels are read, and no steering sensor",
    };
    match model {
        OdometryModel::RearFront | OdometryModel::None => Vec::new(),
        OdometryModel::Rear => {
            vec![format!("{front}: nothing corrects the heading that the rear wheels give")]
        }
        OdometryModel::Front => {
            vec![format!("{rear}: the front wheels and the steering angle alone give the motion")]
        }
        OdometryModel::WheelSteering => vec![format!(
            "{rear}: the steering angle gives the heading, and its offset turns it for good"
        )],
        OdometryModel::WheelGyro => vec![format!(
            "{rear}, no usable steering angle: the gyro gives the heading, and its offset turns it for good"
        )],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(counts_mask: u8, speeds_mask: u8) -> Raw {
        Raw { counts_mask, speeds_mask, ..Raw::default() }
    }

    fn car() -> Vehicle {
        crate::configuration::stack(None, Some("paper-1-6")).unwrap().vehicle
    }

    #[test]
    fn what_is_described_but_not_recorded_is_lacking() {
        let carried = Carried::by(&[raw(0b0100, 0), raw(0b1000, 0)]);
        let sensors = carried.sensors(&car());
        assert_eq!(sensors.wheels, [false, false, true, true]);
        assert!(!sensors.steering && !sensors.gyro);
        assert_eq!(sensors.model(&car()), Ok(OdometryModel::Rear));
        let said = carried.disagreements(&car());
        assert!(said[0].starts_with("fl, fr: an encoder is described"), "{said:?}");
        assert_eq!(said.len(), 2, "{said:?}");
    }

    #[test]
    fn what_is_recorded_but_not_described_is_not_used() {
        let mut vehicle = car();
        (vehicle.encoders, vehicle.gyro) = (None, None);
        let with_gyro = Raw { has_yaw_rate: 1, ..raw(0b1100, 0) };
        let carried = Carried::by(&[with_gyro]);
        let sensors = carried.sensors(&vehicle);
        assert_eq!((sensors.wheels, sensors.gyro), ([false; 4], false));
        let speeds = Carried::by(&[raw(0, 0b1100)]).sensors(&vehicle);
        assert_eq!(speeds.model(&vehicle), Ok(OdometryModel::Rear));
        assert_eq!(speeds.signal, WheelSignal::Speeds);
    }

    #[test]
    fn the_fused_filter_uses_whatever_is_there() {
        let sensors = Carried::by(&[raw(0b1111, 0)]).sensors(&car());
        let of = |filter| {
            let model = OdometryModel::Rear;
            (uses(model, filter, &sensors), lacks(model, filter, &sensors).len())
        };
        assert_eq!(of(FilterKind::Fused), (vec!["counts of fl, fr, rl, rr".to_owned()], 0));
        assert_eq!(of(FilterKind::Rear), (vec!["counts of rl, rr".to_owned()], 1));
    }

    #[test]
    fn sensors_come_back_from_a_command_line() {
        let carried = Carried { counts: 0, speeds: 0b0101, steering: true, yaw_rate: true };
        let sensors = carried.sensors(&car());
        assert_eq!(parse(&format(&sensors)), Ok(sensors));
        assert_eq!(parse("counts,xl"), Err("xl".to_owned()));
    }
}
