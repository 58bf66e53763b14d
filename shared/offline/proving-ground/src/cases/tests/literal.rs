//! Effects whose parameter is what is put in: read off drives that show it by itself.

use super::*;
use crate::library::Asked;

/// Read so often \[Hz\].
const RATE: f64 = 200.0;

/// A car with every sensor that is asked for `rows` of (time, share of the largest speed, angle), read evenly.
fn asked(rows: &[(f64, f64, f64)], duration: f64) -> Case {
    let mut case = equipped(81, Kind::Null, "", 0.0);
    let specification = &mut case.specification;
    // Neither limit is to come in where it is not put in.
    specification.truth.limits.acceleration = 50.0;
    specification.truth.limits.steering_rate = 50.0;
    let top = specification.vehicle.limits.speed;
    let plan = &mut specification.runs[0];
    plan.commands = rows
        .iter()
        .map(|(time, share, steering)| Asked {
            time: *time,
            speed: share * top,
            steering: *steering,
        })
        .collect();
    plan.duration = duration;
    let even: Vec<_> =
        (0_u32..).map(|k| f64::from(k) / RATE).take_while(|time| *time < duration).collect();
    let stamps = &mut plan.stamps;
    for stamps in
        [&mut stamps.encoders, &mut stamps.steering, &mut stamps.gyro, &mut stamps.reference]
    {
        stamps.clone_from(&even);
    }
    case
}

/// What is driven without and with one effect.
fn both(case: &Case, id: &'static str, values: &[(&'static str, f64)]) -> [Signals; 2] {
    [signals(case, &[], 0), signals(case, &[Effect::new(id, values)], 0)]
}

fn top(case: &Case) -> f64 {
    case.specification.vehicle.limits.speed
}

/// Place of the rear axle at the end, seen from the start: forward and left \[m\].
fn end(case: &Case, signals: &Signals) -> (f64, f64) {
    let marker = case.specification.vehicle.reference.expect("a reference").marker;
    let body = signals.reference.last().expect("rows").compose(&marker.inverse());
    let seen = case.specification.runs[0].start.inverse().compose(&body);
    (seen.x, seen.y)
}

fn assert_close(value: f64, expected: f64, share: f64, what: &str) {
    assert!((value - expected).abs() < share * expected.abs(), "{what}: {value}, not {expected}");
}

#[test]
fn delays_and_lags_cost_their_time_at_the_speed_and_angle() {
    let straight = asked(&[(0.5, 0.5, 0.0)], 5.0);
    for (id, name) in [("speed_delay", "delay"), ("speed_lag", "lag")] {
        let [plain, late] = both(&straight, id, &[(name, 0.2)]);
        let lost = (plain.distance - late.distance) / (0.5 * top(&straight));
        assert_close(lost, 0.2, 2e-3, id);
    }
    let turning = asked(&[(0.5, 0.0, 0.3)], 4.0);
    for (id, name) in [("steering_delay", "delay"), ("steering_lag", "lag")] {
        let [plain, late] = both(&turning, id, &[(name, 0.15)]);
        let missing: f64 = plain.steering.iter().zip(&late.steering).map(|(a, b)| a - b).sum();
        assert_close(missing / RATE / 0.3, 0.15, 5e-3, id);
    }
}

#[test]
fn limits_are_the_fastest_change() {
    let turning = asked(&[(0.5, 0.0, 0.3)], 4.0);
    let [_, limited] = both(&turning, "steering_rate_limit", &[("limit", 0.2)]);
    let steps = limited.steering.windows(2).map(|pair| (pair[1] - pair[0]) * RATE);
    assert_close(steps.fold(0.0, f64::max), 0.2, 1e-3, "rate");
    let straight = asked(&[(0.5, 0.8, 0.0)], 8.0);
    let [_, limited] = both(&straight, "acceleration_limit", &[("limit", 0.1 * top(&straight))]);
    let radius = straight.specification.vehicle.driven_radius();
    let driven =
        usize::from(straight.specification.vehicle.drive != kerbside_geometry::Drive::Front) * 2;
    let ways: Vec<_> = limited.wheels.iter().map(|wheels| wheels[driven] * radius).collect();
    let fastest = ways.windows(3).map(|w| (w[2] - 2.0 * w[1] + w[0]) * RATE * RATE);
    assert_close(fastest.fold(0.0, f64::max), 0.1 * top(&straight), 0.02, "acceleration");
}

#[test]
fn play_dead_zone_and_stiction_have_their_width() {
    let swing = asked(&[(0.5, 0.0, 0.3), (2.0, 0.0, -0.3), (3.5, 0.0, -0.2)], 5.0);
    let [_, loose] = both(&swing, "steering_backlash", &[("width", 0.06)]);
    let at = |signals: &Signals, time: usize| signals.steering[time * 100];
    assert!((at(&loose, 3) - 0.27).abs() < 1e-6 && (at(&loose, 6) + 0.27).abs() < 1e-6);
    assert!((loose.steering[999] + 0.23).abs() < 1e-6, "{}", loose.steering[999]);
    let narrow = asked(&[(0.5, 0.0, 0.05), (2.0, 0.0, 0.2)], 4.0);
    let [_, sticking] = both(&narrow, "steering_stick", &[("width", 0.08)]);
    assert_eq!(at(&sticking, 3), 0.0);
    assert!((sticking.steering[799] - 0.2).abs() < 0.1 * 0.08, "{}", sticking.steering[799]);
    let steps = asked(&[(0.5, 0.1, 0.0), (3.0, -0.3, 0.0)], 6.0);
    let [plain, dead] = both(&steps, "speed_dead_zone", &[("width", 0.2 * top(&steps))]);
    assert_eq!(dead.wheels[550], [0.0; 4]);
    let ways = [&plain, &dead].map(|signals| signals.wheels[1199][2] - signals.wheels[800][2]);
    assert_close(ways[1], ways[0], 1e-3, "beyond it");
}

#[test]
fn the_floor_and_the_side_carry_the_body_as_they_say() {
    let straight = asked(&[(0.5, 0.6, 0.0)], 6.0);
    let [plain, drifting] = both(&straight, "lateral_drift", &[("rate", 0.03)]);
    let (way, side) = end(&straight, &drifting);
    let across = side - end(&straight, &plain).1;
    assert_close(across / way, 0.03, 1e-2, "drift");
    let direction = 1.1;
    let [plain, sloping] =
        both(&straight, "floor_slope", &[("direction", direction), ("rate", 0.02)]);
    let (a, b) = (plain.reference.last().expect("rows"), sloping.reference.last().expect("rows"));
    assert!((math::atan2(b.y - a.y, b.x - a.x) - direction).abs() < 1e-2);
    assert_close(a.distance(b) / plain.distance, 0.02, 1e-2, "slope");
    // On a circle the course turns outwards by rate * yaw rate.
    let circle = asked(&[(0.5, 0.6, 0.3)], 8.0);
    let course = |signals: &Signals| {
        let marker = circle.specification.vehicle.reference.expect("a reference").marker;
        let [a, b, c] = [1300, 1301, 1302].map(|k| signals.reference[k].compose(&marker.inverse()));
        math::atan2(c.y - a.y, c.x - a.x) - b.yaw
    };
    let [plain, slipping] = both(&circle, "lateral_slip", &[("rate", 0.15)]);
    let turned = kerbside_geometry::angle::wrap(course(&slipping) - course(&plain));
    assert_close(turned, -0.15 * plain.yaw_rate[1300], 2e-2, "side slip");
}

#[test]
fn slip_costs_its_share_of_the_way() {
    let straight = asked(&[(0.5, 0.6, 0.0)], 6.0);
    // Whatever the profile, the integral of speed and acceleration is half the square of the speed.
    let speed = 0.6 * top(&straight);
    let [plain, creeping] = both(&straight, "acceleration_slip", &[("rate", 0.05)]);
    let lost = plain.distance - creeping.distance;
    assert_close(lost, 0.05 * 0.5 * speed * speed, 1e-2, "acceleration slip");
    let start = straight.specification.runs[0].start;
    let patch = [("x", start.x), ("y", start.y), ("radius", 0.2 * speed), ("ratio", 0.2)];
    let [plain, held] = both(&straight, "floor_patch", &patch);
    // Inside it covers the radius on wheels that turn for a fifth less.
    let lost = plain.distance - held.distance;
    assert_close(lost, 0.2 * speed * 0.2 / 0.8, 2e-2, "patch");
    let [_, growing] = both(&straight, "radius_growth", &[("rate", 0.01)]);
    assert!(growing.distance > 1.02 * plain.distance && growing.distance < 1.05 * plain.distance);
}
