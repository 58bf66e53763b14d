//! What one wheel's counts are worth, and how far it can turn: shared by both stages.

use core::f64::consts::TAU;

use kerbside_geometry::{Vehicle, WHEELS, Wheel, math};
use kerbside_messages::Nanos;

use crate::sensors::{NoModel, Sensors, WheelSignal};

/// Travel of a counter epoch stays within this, so that its last digit stays below a nanometre or
/// two \[m\].
const FARTHEST: f64 = 1e7;

/// Curvature is bounded by this angle even where a vehicle's file allows a quarter turn or more
/// \[rad\].
const SHARPEST: f64 = 1.4;

/// One wheel's numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WheelScale {
    /// Travel per count \[m\]; 0 for a wheel that reports speeds.
    pub(crate) metres_per_count: f64,
    /// Width of the counter \[bit\].
    pub(crate) counter_bits: u32,
    /// Width of the ring on which absolute counts become travel \[bit\]: the counter's, or less
    /// where the counter reaches farther than [`FARTHEST`].
    pub(crate) ring_bits: u32,
    /// What a reported speed has to be multiplied by.
    pub(crate) speed_scale: f64,
    /// Fastest that the wheel rolls when the rear-axle centre moves at `limits.speed` \[m/s\].
    pub(crate) top_speed: f64,
}

impl WheelScale {
    /// Travel after which absolute counts repeat \[m\]; infinite for speeds, which do not wrap.
    pub(crate) fn ring(&self) -> f64 {
        if self.metres_per_count > 0.0 {
            power_of_two(self.ring_bits) * self.metres_per_count
        } else {
            f64::INFINITY
        }
    }

    /// Travel after which the counter itself repeats \[m\].
    pub(crate) fn range(&self) -> f64 {
        power_of_two(self.counter_bits) * self.metres_per_count
    }

    /// The difference of two travels of one epoch that may stem from different lives of ingest
    /// \[m\].
    pub(crate) fn difference(&self, now: f64, before: f64) -> f64 {
        let (difference, ring) = (now - before, self.ring());
        if difference.abs() <= 0.5 * ring {
            return difference;
        }
        difference - ring * (difference / ring).round()
    }
}

/// The numbers of all four wheels.
///
/// # Errors
/// [`NoModel::Field`] for counters that are none.
pub(crate) fn scales(vehicle: &Vehicle, sensors: &Sensors) -> Result<[WheelScale; 4], NoModel> {
    let none = WheelScale {
        metres_per_count: 0.0,
        counter_bits: 64,
        ring_bits: 64,
        speed_scale: 1.0,
        top_speed: 0.0,
    };
    let mut all = [none; 4];
    for wheel in WHEELS {
        let scale = &mut all[wheel.index()];
        scale.speed_scale = vehicle.speed_scale(wheel);
        scale.top_speed = vehicle.limits.speed * speed_factor(vehicle, wheel);
        if sensors.signal == WheelSignal::Counts && sensors.wheels[wheel.index()] {
            (scale.metres_per_count, scale.counter_bits) = counting(vehicle, wheel)?;
            scale.ring_bits = ring_bits(scale.counter_bits, scale.metres_per_count);
        }
    }
    Ok(all)
}

/// Largest curvature of the rear-axle centre's path \[1/m\].
pub(crate) fn largest_curvature(vehicle: &Vehicle) -> f64 {
    math::tan(vehicle.limits.steering.min(SHARPEST)) / vehicle.wheelbase
}

/// Nanoseconds from `earlier` to `later`, 0 if they are the other way round, in seconds.
pub(crate) fn elapsed(later: Nanos, earlier: Nanos) -> f64 {
    kerbside_messages::seconds(later.saturating_sub(earlier))
}

fn counting(vehicle: &Vehicle, wheel: Wheel) -> Result<(f64, u32), NoModel> {
    let encoders = vehicle.encoders.ok_or(NoModel::NoWheel)?;
    let counts = encoders.counts_per_revolution[wheel.index()].ok_or(NoModel::NoWheel)?;
    if !(counts.is_finite() && counts > 0.0) {
        return Err(NoModel::Field {
            field: "encoders.counts_per_revolution",
            value: counts,
            allowed: "a number above 0",
        });
    }
    if !(1..=64).contains(&encoders.counter_bits) {
        return Err(NoModel::Field {
            field: "encoders.counter_bits",
            value: f64::from(encoders.counter_bits),
            allowed: "1 to 64",
        });
    }
    Ok((vehicle.radius[wheel.index()] * TAU / counts, encoders.counter_bits))
}

/// How much faster than the rear-axle centre the wheel's contact point can move.
fn speed_factor(vehicle: &Vehicle, wheel: Wheel) -> f64 {
    let (x, y) = vehicle.wheel_position(wheel);
    let curvature = largest_curvature(vehicle);
    math::hypot(1.0 + y.abs() * curvature, x * curvature)
}

fn ring_bits(counter_bits: u32, metres_per_count: f64) -> u32 {
    let mut bits = counter_bits;
    while bits > 1 && power_of_two(bits) * metres_per_count > FARTHEST {
        bits -= 1;
    }
    bits
}

/// 2^bits, exactly.
fn power_of_two(bits: u32) -> f64 {
    f64::from_bits(u64::from(1023 + bits) << 52)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use kerbside_geometry::Limits;

    /// The 1:6 car of the paper with its own wheels and tracks (Tables 1 and 2).
    pub(crate) fn car() -> Vehicle {
        Vehicle {
            track_front: 0.285,
            track_rear: 0.292,
            radius: [0.07097, 0.07114, 0.069515, 0.069605],
            limits: Limits { steering: 0.6109, ..Vehicle::paper_car().limits },
            ..Vehicle::paper_car()
        }
    }

    #[test]
    fn powers_are_exact() {
        for bits in 0..=64 {
            assert_eq!(power_of_two(bits), (0..bits).fold(1.0, |power, _| power * 2.0));
        }
    }

    #[test]
    fn differences_ignore_whole_rings() {
        let scale = scales(&car(), &Sensors::of(&car())).expect("a car")[2];
        let ring = scale.ring();
        for turns in -3..=3 {
            let now = 1.25 + f64::from(turns) * ring;
            assert!((scale.difference(now, 1.0) - 0.25).abs() < 1e-9);
        }
    }

    #[test]
    fn a_wide_counter_keeps_its_last_digits() {
        let mut vehicle = car();
        if let Some(encoders) = &mut vehicle.encoders {
            encoders.counter_bits = 64;
        }
        let scale = scales(&vehicle, &Sensors::of(&vehicle)).expect("a car")[0];
        assert!(scale.ring() <= FARTHEST && scale.ring() > 0.4 * FARTHEST);
        assert_eq!(scale.range(), power_of_two(64) * scale.metres_per_count);
    }

    #[test]
    fn counters_that_are_none_are_refused() {
        for bits in [0, 65] {
            let mut vehicle = car();
            if let Some(encoders) = &mut vehicle.encoders {
                encoders.counter_bits = bits;
            }
            assert!(matches!(
                scales(&vehicle, &Sensors::of(&vehicle)),
                Err(NoModel::Field { field: "encoders.counter_bits", .. })
            ));
        }
    }

    #[test]
    fn the_outer_front_wheel_is_the_fastest() {
        let all = scales(&car(), &Sensors::of(&car())).expect("a car");
        assert!(all[0].top_speed > all[2].top_speed && all[2].top_speed > 0.5);
    }
}
