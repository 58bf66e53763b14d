//! The vehicle's clock seen from the host's.
//!
//! A reading taken at vehicle time v arrives at host time a = v + offset(v) + delay, and only the
//! delay's sign is known: it is positive. So the offset is a straight line that touches the cloud
//! of points (v, a - v) from below: an edge of its lower convex hull (Moon, Skelly, Towsley:
//! "Estimation and removal of clock skew from network delay measurements", 1999). The window is
//! kept as the lowest point of each of [`BUCKETS`] stretches, so memory and time are bounded; the
//! edge below the window's middle gives the drift. Between two fits the line only sinks, and does
//! so at once, as soon as a reading comes faster than all before: a stamp is never later than the
//! arrival.

use kerbside_messages::{NANOS_PER_SECOND, Nanos};

use crate::settings::IngestSettings;

/// Stretches of the window whose fastest reading is kept.
const BUCKETS: usize = 64;

/// A change of the offset beyond this is a step of a clock, not drift \[ns\].
const STEP: f64 = 50e6;

/// Readings that came late by more than [`STEP`] for so long were not delayed: the vehicle's time
/// stood still \[ns\].
const STEP_HOLD: u64 = 500_000_000;

/// Shortest span that tells anything about drift \[ns\].
const SHORTEST_SPAN: f64 = 1e9;

/// A reading on the host's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapped {
    /// When it was taken \[ns of the host's clock\]; never later than its arrival.
    pub stamp: Nanos,
    /// Host's clock minus vehicle's at the stamp \[ns\].
    pub offset: i64,
    /// Rate of the vehicle's clock against the host's, minus 1.
    pub drift: f64,
    /// How late it came beyond the fastest readings \[s\].
    pub delay: f64,
    /// The vehicle's clock jumped: differences across this reading are to be taken from arrivals.
    pub stepped: bool,
}

/// A point under which the line must pass: vehicle time and offset, both from the base \[ns\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Point {
    x: f64,
    y: f64,
}

/// offset = height + slope x.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    height: f64,
    slope: f64,
}

impl Line {
    fn at(&self, x: f64) -> f64 {
        self.height + self.slope * x
    }
}

/// Maps the vehicle's time to the host's from pairs of (vehicle time, arrival) alone.
///
/// Where both are one clock, as in a recorded run, the mapping is the identity to the last bit.
#[derive(Clone, Debug)]
pub struct ClockMap {
    window: f64,
    largest_slope: f64,
    base: Option<Base>,
    line: Line,
    newest: f64,
    open: Point,
    open_since: f64,
    closed: [Point; BUCKETS],
    count: usize,
    late_since: Option<Nanos>,
}

/// Origin of the points.
#[derive(Clone, Copy, Debug)]
struct Base {
    vehicle: u64,
    offset: i64,
}

impl ClockMap {
    /// A mapping that has seen nothing.
    #[must_use]
    pub fn new(settings: &IngestSettings) -> Self {
        Self {
            window: settings.clock_window * NANOS_PER_SECOND,
            largest_slope: settings.clock_drift,
            base: None,
            line: Line::default(),
            newest: 0.0,
            open: Point::default(),
            open_since: 0.0,
            closed: [Point::default(); BUCKETS],
            count: 0,
            late_since: None,
        }
    }

    /// Forgets all it has seen: another clock follows.
    pub fn reset(&mut self) {
        self.base = None;
    }

    /// The reading of vehicle time `vehicle` that arrived at `arrival`, both \[ns\].
    pub fn map(&mut self, vehicle: u64, arrival: Nanos) -> Mapped {
        let base = match self.base {
            Some(base) => base,
            None => self.start(vehicle, arrival),
        };
        let point = base.point(vehicle, arrival);
        let residual = point.y - self.line.at(point.x);
        if point.x < self.newest || residual < -STEP || self.stood_still(residual, arrival) {
            let stepped = !(residual > STEP && point.x >= self.newest);
            self.start(vehicle, arrival);
            return self.mapped(vehicle, arrival, Point::default(), stepped);
        }
        self.newest = point.x;
        self.line.height += residual.min(0.0);
        self.collect(point);
        self.mapped(vehicle, arrival, point, false)
    }

    fn start(&mut self, vehicle: u64, arrival: Nanos) -> Base {
        let base = Base { vehicle, offset: arrival.wrapping_sub(vehicle).cast_signed() };
        self.base = Some(base);
        self.line = Line::default();
        (self.newest, self.count, self.late_since) = (0.0, 0, None);
        (self.open, self.open_since) = (Point::default(), 0.0);
        base
    }

    /// Whether everything has come late for so long that it is not the transport.
    fn stood_still(&mut self, residual: f64, arrival: Nanos) -> bool {
        if residual <= STEP {
            self.late_since = None;
            return false;
        }
        let since = *self.late_since.get_or_insert(arrival);
        arrival.saturating_sub(since) > STEP_HOLD
    }

    /// Keeps the lowest point of a stretch; a stretch that ends gives a new line.
    fn collect(&mut self, point: Point) {
        if point.x - self.open_since >= self.window / BUCKETS as f64 {
            self.close(point.x);
            (self.open, self.open_since) = (point, point.x);
            self.fit();
        } else if point.y - self.open.y < self.line.slope * (point.x - self.open.x) {
            self.open = point;
        }
    }

    /// Files the open stretch and drops what has left the window.
    fn close(&mut self, x: f64) {
        let oldest = x - self.window;
        let kept = self.closed[..self.count].iter().position(|point| point.x >= oldest);
        let mut first = kept.unwrap_or(self.count);
        if self.count - first == BUCKETS {
            first += 1;
        }
        self.closed.copy_within(first..self.count, 0);
        self.count -= first;
        self.closed[self.count] = self.open;
        self.count += 1;
    }

    /// The line below all closed points and the newest, drift within what is believed.
    fn fit(&mut self) {
        let points = &self.closed[..self.count];
        let slope = hull_slope(points).clamp(-self.largest_slope, self.largest_slope);
        let below = |height: f64, point: &Point| height.min(point.y - slope * point.x);
        let height = points.iter().fold(self.open.y - slope * self.open.x, below);
        self.line = Line { height, slope };
    }

    #[allow(clippy::cast_possible_truncation)] // Offsets from the base are far below 2^53 ns.
    fn mapped(&self, vehicle: u64, arrival: Nanos, point: Point, stepped: bool) -> Mapped {
        let base = self.base.map_or(0, |base| base.offset);
        let offset = base.wrapping_add(self.line.at(point.x).min(point.y).floor() as i64);
        let stamp = vehicle.wrapping_add_signed(offset).min(arrival);
        Mapped {
            stamp,
            offset: stamp.wrapping_sub(vehicle).cast_signed(),
            drift: -self.line.slope / (1.0 + self.line.slope),
            delay: kerbside_messages::seconds(arrival.wrapping_sub(stamp)),
            stepped,
        }
    }
}

impl Base {
    #[allow(clippy::cast_precision_loss)] // 2^53 ns are 104 days.
    fn point(&self, vehicle: u64, arrival: Nanos) -> Point {
        let offset = arrival.wrapping_sub(vehicle).cast_signed();
        Point {
            x: vehicle.wrapping_sub(self.vehicle).cast_signed() as f64,
            y: offset.wrapping_sub(self.offset) as f64,
        }
    }
}

/// Slope of the lower convex hull's edge below the middle of the points, which are ordered in x; 0
/// for too short a span. The hull is found by Andrew's monotone chain.
fn hull_slope(points: &[Point]) -> f64 {
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return 0.0 };
    if last.x - first.x < SHORTEST_SPAN {
        return 0.0;
    }
    let mut hull = [Point::default(); BUCKETS];
    let mut size = 0;
    for point in points {
        while size >= 2 && !turns_left(&hull[size - 2], &hull[size - 1], point) {
            size -= 1;
        }
        hull[size] = *point;
        size += 1;
    }
    let middle = 0.5 * (first.x + last.x);
    let edge = hull[..size].windows(2).find(|edge| edge[1].x >= middle);
    edge.map_or(0.0, |edge| (edge[1].y - edge[0].y) / (edge[1].x - edge[0].x))
}

fn turns_left(a: &Point, b: &Point, c: &Point) -> bool {
    (b.x - a.x) * (c.y - a.y) > (b.y - a.y) * (c.x - a.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::Exp1;
    use rand_pcg::Pcg64;

    const PERIOD: u64 = 5_000_000;
    const START: u64 = 7_000_000_000_000;

    /// Host time at which a vehicle of that drift (rate - 1) shows `vehicle`.
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    fn host(vehicle: u64, drift: f64) -> u64 {
        START + (vehicle as f64 / (1.0 + drift)).round() as u64
    }

    /// Exponential jitter of 2 ms at most 20 ms, and a burst of 40 readings held back for up to 20
    /// ms each second.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    fn jitter(random: &mut Pcg64, sample: u64) -> u64 {
        let exponential: f64 = random.sample::<f64, _>(Exp1) * 2e6;
        let burst = if sample % 200 < 40 { random.random_range(10e6..20e6) } else { 0.0 };
        (exponential + burst).min(20e6) as u64
    }

    #[test]
    fn one_clock_is_mapped_to_itself() {
        let mut map = ClockMap::new(&IngestSettings::default());
        for sample in 0..20_000_u64 {
            let time = 32_500_000 + sample * 9_876_543;
            let mapped = map.map(time, time);
            assert_eq!((mapped.stamp, mapped.offset), (time, 0));
            assert_eq!((mapped.drift, mapped.delay, mapped.stepped), (0.0, 0.0, false));
        }
    }

    #[test]
    fn drift_and_offset_are_found_below_the_jitter() {
        for (seed, drift) in [(1, 200e-6), (2, -200e-6), (3, 0.0), (4, 450e-6)] {
            let mut random = Pcg64::seed_from_u64(seed);
            let mut map = ClockMap::new(&IngestSettings::default());
            let (mut worst, mut worst_drift) = (0.0_f64, 0.0_f64);
            let mut arrival = 0;
            for sample in 0..12_000_u64 {
                let vehicle = sample * PERIOD;
                arrival = (host(vehicle, drift) + jitter(&mut random, sample)).max(arrival);
                let mapped = map.map(vehicle, arrival);
                assert!(mapped.stamp <= arrival);
                if vehicle >= 10_000_000_000 {
                    let error = mapped.stamp as i64 - host(vehicle, drift) as i64;
                    worst = worst.max((error as f64).abs());
                    worst_drift = worst_drift.max((mapped.drift - drift).abs());
                }
            }
            println!("drift {drift}: stamp within {worst} ns, drift within {worst_drift}");
            assert!(worst < 150e3, "{worst} ns at drift {drift}");
            assert!(worst_drift < 15e-6, "{worst_drift} at drift {drift}");
        }
    }

    #[test]
    fn disbelieved_drift_is_held_at_the_bound() {
        let mut map = ClockMap::new(&IngestSettings::default());
        let mut drift = 0.0;
        for sample in 0..8_000 {
            let vehicle = sample * PERIOD;
            drift = map.map(vehicle, host(vehicle, 5e-3)).drift;
        }
        assert!((drift - 5e-4).abs() < 1e-6, "{drift}");
    }

    #[test]
    fn steps_of_the_vehicles_clock_are_found() {
        for step in [-3_000_000_000_i64, -10_000_000, 3_000_000_000] {
            let mut map = ClockMap::new(&IngestSettings::default());
            let begin = 100_000_000_000_u64;
            for sample in 0..1000 {
                map.map(begin + sample * PERIOD, START + sample * PERIOD);
            }
            let vehicle = (begin + 1000 * PERIOD).wrapping_add_signed(step);
            let first = map.map(vehicle, START + 1000 * PERIOD);
            assert!(first.stepped, "step {step}");
            assert_eq!(first.stamp, START + 1000 * PERIOD);
            let next = map.map(vehicle + PERIOD, START + 1001 * PERIOD);
            assert_eq!((next.stamp, next.stepped), (START + 1001 * PERIOD, false));
        }
    }

    #[test]
    fn a_vehicle_whose_time_stood_still_is_current_again_soon() {
        let mut map = ClockMap::new(&IngestSettings::default());
        let pause = 2_000_000_000;
        let mut delays = [0.0; 300];
        for sample in 0..1000 {
            map.map(sample * PERIOD, START + sample * PERIOD);
        }
        for (index, delay) in delays.iter_mut().enumerate() {
            let vehicle = (1000 + index as u64) * PERIOD;
            let mapped = map.map(vehicle, START + pause + vehicle);
            (*delay, _) = (mapped.delay, assert!(!mapped.stepped));
        }
        assert_eq!(delays[0], 2.0);
        assert!(delays[110..].iter().all(|delay| *delay == 0.0));
    }

    #[test]
    fn a_backlog_is_delay_and_no_step() {
        let mut map = ClockMap::new(&IngestSettings::default());
        for sample in 0..1000_u64 {
            let vehicle = sample * PERIOD;
            // The host slept through readings 500 to 700 and reads them all at once.
            let arrival = if (500..700).contains(&sample) { 700 * PERIOD } else { vehicle };
            let mapped = map.map(vehicle, START + arrival);
            assert_eq!((mapped.stamp, mapped.stepped), (START + vehicle, false));
        }
    }

    proptest! {
        #[test]
        fn no_stamp_is_later_than_its_arrival(
            pairs in prop::collection::vec((any::<u64>(), any::<u64>()), 1..200)
        ) {
            let mut map = ClockMap::new(&IngestSettings::default());
            for (vehicle, arrival) in pairs {
                let mapped = map.map(vehicle, arrival);
                prop_assert!(mapped.drift.is_finite() && mapped.delay.is_finite());
                prop_assert_eq!(vehicle.wrapping_add_signed(mapped.offset), mapped.stamp);
            }
        }

        #[test]
        fn hostile_jitter_never_lifts_a_stamp_over_its_arrival(
            delays in prop::collection::vec(0_u64..40_000_000, 1..400)
        ) {
            let mut map = ClockMap::new(&IngestSettings::default());
            for (sample, delay) in delays.iter().enumerate() {
                let vehicle = sample as u64 * 50_000_000;
                let arrival = START + vehicle + delay;
                prop_assert!(map.map(vehicle, arrival).stamp <= arrival);
            }
        }
    }
}
