//! What a configuration must satisfy so that the vehicle stops in time and the supervisor can tell.

use core::time::Duration;

use kerbside_geometry::Vehicle;

use crate::recent::MAX_RECENT;
use crate::{SafetySettings, Timeouts};

/// A first-order lag is within 1 % of its end after five time constants.
const LAGS: f64 = 5.0;
/// Room for the scheduler before a vehicle without feedback counts as standing \[s\].
const SETTLE_MARGIN: f64 = 0.1;

/// How long the vehicle takes to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StopTimes {
    /// From full speed to standing, the longest time-out included.
    pub stop: Duration,
    /// From the gate's first output of zero to standing.
    pub settle: Duration,
}

/// Why a configuration is refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum BoundError {
    /// The vehicle has no usable limit.
    #[error("{key} is {value}, it must be positive and finite")]
    Limit {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
    },
    /// Full speed is too fast for the stop distance.
    #[error(
        "at {speed} m/s the vehicle needs {needed:.3} m to stop, {allowed} m are allowed: \
         time-outs and response take {reaction:.3} s, then it brakes at {deceleration} m/s^2; \
         at most {largest_speed:.3} m/s would fit"
    )]
    StopDistance {
        /// `limits.speed` \[m/s\].
        speed: f64,
        /// Distance it needs \[m\].
        needed: f64,
        /// `stop_distance` \[m\].
        allowed: f64,
        /// The longest time-out, an actuation period, delay and lag \[s\].
        reaction: f64,
        /// `limits.deceleration` \[m/s^2\].
        deceleration: f64,
        /// The speed from which the vehicle would stop in time \[m/s\].
        largest_speed: f64,
    },
    /// A period or time-out that is too short for what it is measured with.
    #[error("{key} is {value:?}, it must be at least {least:?} ({why})")]
    TooShort {
        /// The key.
        key: &'static str,
        /// Its value.
        value: Duration,
        /// What it must be at least.
        least: Duration,
        /// What it follows from.
        why: &'static str,
    },
    /// A period or time-out that is too long.
    #[error("{key} is {value:?}, it must be at most {most:?} ({why})")]
    TooLong {
        /// The key.
        key: &'static str,
        /// Its value.
        value: Duration,
        /// What it must be at most.
        most: Duration,
        /// What it follows from.
        why: &'static str,
    },
    /// A count out of range.
    #[error("{key} is {value}, it must be 1 to {most}")]
    Count {
        /// The key.
        key: &'static str,
        /// Its value.
        value: u32,
        /// The largest.
        most: u32,
    },
}

impl BoundError {
    /// The key of the configuration that the error is about.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Limit { key, .. }
            | Self::TooShort { key, .. }
            | Self::TooLong { key, .. }
            | Self::Count { key, .. } => key,
            Self::StopDistance { .. } => "stop_distance",
        }
    }
}

/// The longest single time-out until braking begins, whichever part failed, plus one actuation
/// period \[s\].
#[must_use]
pub fn longest_timeout(settings: &SafetySettings) -> f64 {
    let Timeouts { freshness, permit, vehicle_silence, .. } = settings.timeouts;
    let longest = freshness.max(permit).max(vehicle_silence);
    longest.as_secs_f64() + settings.actuation_period.as_secs_f64()
}

/// From a failure to the beginning of braking at the wheels \[s\].
fn reaction(vehicle: &Vehicle, settings: &SafetySettings) -> f64 {
    let response = vehicle.response();
    longest_timeout(settings) + response.speed_delay + response.speed_lag
}

/// The distance within which the vehicle stops from full speed after any single fault \[m\]:
/// v (T + delay + lag) + v^2 / (2 a), with full speed v, deceleration a and
/// [`longest_timeout`] T.
///
/// With the default time-outs a 1:6 car (0.5 m/s, 0.3 m/s^2, delay 0.02 s, lag 0.10 s) needs
/// 0.629 m; a full-size car at 2 m/s with 1 m/s^2 stays within 3.5 m as long as its delay and lag
/// together are at most 0.445 s.
#[must_use]
pub fn stop_distance(vehicle: &Vehicle, settings: &SafetySettings) -> f64 {
    let (speed, deceleration) = (vehicle.limits.speed, vehicle.limits.deceleration);
    speed * reaction(vehicle, settings) + speed * speed / (2.0 * deceleration)
}

/// The speed whose [`stop_distance`] is the allowed one \[m/s\].
#[must_use]
pub fn largest_speed(vehicle: &Vehicle, settings: &SafetySettings) -> f64 {
    let (reaction, a) = (reaction(vehicle, settings), vehicle.limits.deceleration);
    a * ((reaction * reaction + 2.0 * settings.stop_distance / a).sqrt() - reaction)
}

/// How long the vehicle takes to stop, for a supervisor that cannot see it.
#[must_use]
pub fn stop_times(vehicle: &Vehicle, settings: &SafetySettings) -> StopTimes {
    let response = vehicle.response();
    let settle = response.speed_delay + LAGS * response.speed_lag + SETTLE_MARGIN;
    let ramp = vehicle.limits.speed / vehicle.limits.deceleration;
    StopTimes {
        stop: duration(longest_timeout(settings) + settle + ramp),
        settle: duration(settle),
    }
}

/// Seconds as a duration; what is none becomes the longest, so that nothing ends too early.
fn duration(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}

/// Everything at once: limits, stop distance and periods. All that is wrong, in that order.
#[must_use]
pub fn check(vehicle: &Vehicle, settings: &SafetySettings) -> Vec<BoundError> {
    let mut errors = check_limits(vehicle, settings);
    if errors.is_empty() {
        errors.extend(check_stop_distance(vehicle, settings).err());
    }
    errors.extend(check_periods(settings));
    errors
}

/// Whether the numbers that gate and bounds divide by or compare with are any.
fn check_limits(vehicle: &Vehicle, settings: &SafetySettings) -> Vec<BoundError> {
    let limits = &vehicle.limits;
    let values = [
        ("limits.speed", limits.speed),
        ("limits.acceleration", limits.acceleration),
        ("limits.deceleration", limits.deceleration),
        ("limits.steering", limits.steering),
        ("limits.steering_rate", limits.steering_rate),
        ("stop_distance", settings.stop_distance),
    ];
    let wrong = values.into_iter().filter(|(_, value)| !(value.is_finite() && *value > 0.0));
    wrong.map(|(key, value)| BoundError::Limit { key, value }).collect()
}

/// Whether the vehicle stops within the configured distance.
///
/// # Errors
/// [`BoundError::StopDistance`] with all its terms.
pub fn check_stop_distance(vehicle: &Vehicle, settings: &SafetySettings) -> Result<(), BoundError> {
    let needed = stop_distance(vehicle, settings);
    if needed <= settings.stop_distance {
        return Ok(());
    }
    Err(BoundError::StopDistance {
        speed: vehicle.limits.speed,
        needed,
        allowed: settings.stop_distance,
        reaction: reaction(vehicle, settings),
        deceleration: vehicle.limits.deceleration,
        largest_speed: largest_speed(vehicle, settings),
    })
}

/// Whether the periods fit each other: what is judged must be longer than what judges it. All that
/// do not.
#[must_use]
pub fn check_periods(settings: &SafetySettings) -> Vec<BoundError> {
    let errors = shortest(settings).into_iter().filter_map(Shortest::check);
    errors.chain(longest(settings)).chain(counts(settings)).collect()
}

struct Shortest {
    key: &'static str,
    value: Duration,
    least: Duration,
    why: &'static str,
}

impl Shortest {
    fn check(self) -> Option<BoundError> {
        let Self { key, value, least, why } = self;
        (value < least).then_some(BoundError::TooShort { key, value, least, why })
    }
}

fn shortest(settings: &SafetySettings) -> [Shortest; 13] {
    let at_least = |key, value, least, why| Shortest { key, value, least, why };
    let (t, restart) = (&settings.timeouts, &settings.restart);
    let (cycle, actuation) = (settings.cycle, settings.actuation_period);
    let tick = Duration::from_millis(1);
    [
        at_least("cycle", cycle, tick, "timers resolve no less"),
        at_least("actuation_period", actuation, tick, "timers resolve no less"),
        at_least("heartbeat", t.heartbeat, cycle, "one supervisor cycle"),
        at_least(
            "heartbeat_window",
            t.heartbeat_window,
            (2 * t.heartbeat).max(t.heartbeat + 2 * cycle),
            "two heartbeats, and a heartbeat with two supervisor cycles",
        ),
        at_least("slow_window", t.slow_window, t.heartbeat_window, "heartbeat_window"),
        at_least("permit", t.permit, 2 * cycle + actuation, "two supervisor cycles and a gate's"),
        at_least("freshness", t.freshness, 2 * actuation, "two actuation periods"),
        at_least("vehicle_silence", t.vehicle_silence, 2 * actuation, "two actuation periods"),
        at_least("deadline", t.deadline, tick, "timers resolve no less"),
        at_least("supervisor_silence", t.supervisor_silence, t.permit + cycle, "a permit's life"),
        at_least("arm", t.arm, t.heartbeat_window, "heartbeat_window"),
        at_least("restart.backoff", restart.backoff, cycle, "one supervisor cycle"),
        at_least("restart.deaths_window", restart.deaths_window, cycle, "one supervisor cycle"),
    ]
}

fn longest(settings: &SafetySettings) -> impl Iterator<Item = BoundError> {
    let second = Duration::from_secs(1);
    let restart = &settings.restart;
    let limits = [
        ("deadline", settings.timeouts.deadline, second, "misses are counted over a second"),
        ("restart.backoff", restart.backoff, restart.backoff_limit, "restart.backoff_limit"),
    ];
    limits.into_iter().filter_map(|(key, value, most, why)| {
        (value > most).then_some(BoundError::TooLong { key, value, most, why })
    })
}

fn counts(settings: &SafetySettings) -> impl Iterator<Item = BoundError> {
    let most = u32::try_from(MAX_RECENT).unwrap_or(u32::MAX);
    let counts = [
        ("deadline_misses", settings.timeouts.deadline_misses),
        ("restart.deaths", settings.restart.deaths),
    ];
    let wrong = counts.into_iter().filter(move |(_, value)| !(1..=most).contains(value));
    wrong.map(move |(key, value)| BoundError::Count { key, value, most })
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerbside_geometry::{Actuators, Limits};

    fn vehicle(limits: Limits, speed_delay: f64, speed_lag: f64) -> Vehicle {
        let actuators = Some(Actuators { speed_delay, speed_lag, ..Actuators::default() });
        Vehicle { limits, actuators, ..Vehicle::paper_car() }
    }

    fn small_car() -> Vehicle {
        Vehicle::paper_car()
    }

    fn full_size(speed: f64, lag: f64) -> Vehicle {
        let limits = Limits { speed, acceleration: 1.0, deceleration: 1.0, ..small_car().limits };
        vehicle(limits, 0.1, lag)
    }

    #[test]
    fn the_small_car_stops_within_65_centimetres_but_not_62() {
        let settings = SafetySettings::default();
        let needed = stop_distance(&small_car(), &settings);
        // 0.5 (0.305 + 0.02 + 0.10) + 0.25 / 0.6
        assert!((needed - 0.629_166_666_666_666_7).abs() < 1e-12, "{needed}");
        assert_eq!(check(&small_car(), &settings), []);
        let tight = SafetySettings { stop_distance: 0.62, ..settings };
        let [error] = check(&small_car(), &tight)[..] else { panic!("one error") };
        assert_eq!(error.key(), "stop_distance");
        let said = error.to_string();
        assert!(
            said.contains("0.629") && said.contains("0.62 m") && said.contains("0.496"),
            "{said}"
        );
    }

    #[test]
    fn a_full_size_car_at_2_metres_per_second_has_445_milliseconds_of_response() {
        let settings = SafetySettings { stop_distance: 3.5, ..SafetySettings::default() };
        assert!(check_stop_distance(&full_size(2.0, 0.344), &settings).is_ok());
        assert!(check_stop_distance(&full_size(2.0, 0.346), &settings).is_err());
    }

    #[test]
    fn the_largest_speed_needs_just_the_allowed_distance() {
        let settings = SafetySettings { stop_distance: 3.5, ..SafetySettings::default() };
        let speed = largest_speed(&full_size(9.0, 0.3), &settings);
        let needed = stop_distance(&full_size(speed, 0.3), &settings);
        assert!((needed - 3.5).abs() < 1e-12, "{speed} m/s needs {needed}");
    }

    #[test]
    fn every_time_out_counts_in_the_stop_distance() {
        let long = Duration::from_millis(900);
        let base = stop_distance(&small_car(), &SafetySettings::default());
        for change in [
            (|t, long| t.freshness = long) as fn(&mut Timeouts, Duration),
            |t, long| t.permit = long,
            |t, long| t.vehicle_silence = long,
        ] {
            let mut settings = SafetySettings::default();
            change(&mut settings.timeouts, long);
            let more = stop_distance(&small_car(), &settings) - base;
            assert!((more - 0.5 * 0.6).abs() < 1e-12, "{more}");
        }
    }

    #[test]
    fn the_shipped_periods_fit_with_and_without_real_time_rights() {
        let mut settings = SafetySettings::default();
        assert_eq!(check_periods(&settings), []);
        settings.timeouts.freshness = Duration::from_millis(20);
        settings.timeouts.permit = Duration::from_millis(40);
        settings.timeouts.vehicle_silence = Duration::from_millis(100);
        settings.timeouts.heartbeat_window = Duration::from_millis(50);
        settings.timeouts.deadline = Duration::from_millis(5);
        assert_eq!(check_periods(&settings), []);
    }

    #[test]
    fn every_period_has_a_limit_that_names_it() {
        type Change = fn(&mut SafetySettings);
        let changes: [(&str, Change); 17] = [
            ("cycle", |s| s.cycle = Duration::ZERO),
            ("actuation_period", |s| s.actuation_period = Duration::ZERO),
            ("heartbeat", |s| s.timeouts.heartbeat = Duration::from_millis(9)),
            ("heartbeat_window", |s| s.timeouts.heartbeat_window = Duration::from_millis(39)),
            ("slow_window", |s| s.timeouts.slow_window = Duration::from_millis(199)),
            ("permit", |s| s.timeouts.permit = Duration::from_millis(24)),
            ("freshness", |s| s.timeouts.freshness = Duration::from_millis(9)),
            ("vehicle_silence", |s| s.timeouts.vehicle_silence = Duration::from_millis(9)),
            ("deadline", |s| s.timeouts.deadline = Duration::ZERO),
            ("deadline", |s| s.timeouts.deadline = Duration::from_millis(1001)),
            ("supervisor_silence", |s| s.timeouts.supervisor_silence = Duration::from_millis(159)),
            ("arm", |s| s.timeouts.arm = Duration::from_millis(199)),
            ("restart.backoff", |s| s.restart.backoff = Duration::from_millis(9)),
            ("restart.backoff", |s| s.restart.backoff_limit = Duration::from_millis(99)),
            ("restart.deaths_window", |s| s.restart.deaths_window = Duration::from_millis(9)),
            ("deadline_misses", |s| s.timeouts.deadline_misses = 33),
            ("restart.deaths", |s| s.restart.deaths = 0),
        ];
        for (key, change) in changes {
            let mut settings = SafetySettings::default();
            change(&mut settings);
            let keys: Vec<_> = check_periods(&settings).iter().map(BoundError::key).collect();
            assert_eq!(keys, [key]);
        }
    }

    #[test]
    fn limits_that_are_none_are_refused_before_they_are_divided_by() {
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut car = small_car();
            car.limits.deceleration = wrong;
            let errors = check(&car, &SafetySettings::default());
            assert_eq!(
                errors.iter().map(BoundError::key).collect::<Vec<_>>(),
                ["limits.deceleration"]
            );
        }
    }
}
