//! The verdict on a run: on truth where there is one, else on the estimate, and it says which.

use kerbside_geometry::{ConvexPolygon, Pose, Vehicle};
use kerbside_messages::{Odometry, Truth, seconds};
use kerbside_reports::JudgedOn;
use kerbside_settings::Scenario;

use super::trace::Trace;
use crate::manoeuvre::End;

/// The vehicle stands below this speed \[m/s\] ...
const REST: f64 = 1e-3;
/// ... for so long \[s\] ...
const REST_TIME: f64 = 0.5;
/// ... with the steering changing less than this \[rad\].
const STEERING_STILL: f64 = 1e-3;
/// A change of direction counts once so much was rolled in the new one \[m\]; scaled with the vehicle.
const GEAR_TRAVEL: f64 = 0.01;

/// What came of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Parked within the tolerance and without a collision.
    pub parked: bool,
    /// The footprint touched an obstacle or left the map.
    pub collision: bool,
    /// How the manoeuvre ended.
    pub end: End,
    /// Why it is not parked, or what there is to say besides; empty where all is well.
    pub cause: String,
    /// What the end pose was judged on.
    pub judged_on: JudgedOn,
    /// End pose seen from the goal, of what it was judged on.
    pub end_error: Option<Pose>,
    /// Estimate seen from the truth at the end.
    pub estimate_error: Option<Pose>,
    /// Changes of the travel direction driven.
    pub gear_changes: u32,
    /// From the first command to the end \[s\].
    pub duration: f64,
    /// Length driven, both directions \[m\].
    pub length: f64,
    /// Least distance to an obstacle driven \[m\].
    pub clearance: Option<f64>,
}

/// A motion that was judged: truth or estimate.
#[derive(Clone, Copy, Debug)]
struct Sample {
    time: f64,
    pose: Pose,
    speed: f64,
    steering: f64,
    distance: f64,
}

/// Judges a run that ended with `end`.
#[must_use]
pub fn judge(trace: &Trace, scenario: &Scenario, vehicle: &Vehicle, end: End) -> Verdict {
    let truth: Vec<Sample> = trace.truth.iter().map(|truth| of_truth(trace, truth)).collect();
    let estimate: Vec<Sample> =
        trace.odometry.iter().map(|odometry| of_odometry(trace, odometry)).collect();
    let (judged_on, samples) =
        if truth.is_empty() { (JudgedOn::Estimate, &estimate) } else { (JudgedOn::Truth, &truth) };
    let last = samples.last();
    let end_error = last.map(|sample| sample.pose.seen_from(&scenario.goal));
    let estimate_error = estimate
        .last()
        .zip(truth.last())
        .map(|(estimate, truth)| estimate.pose.seen_from(&truth.pose));
    let clearance = least_clearance(samples, scenario, vehicle);
    let collision = clearance.is_some_and(|clearance| clearance <= 0.0);
    let within =
        last.is_some_and(|sample| scenario.tolerance.accepts(&scenario.goal, &sample.pose));
    let still = is_still(samples);
    let parked = end == End::Completed && within && still && !collision;
    Verdict {
        parked,
        collision,
        end,
        cause: cause(trace, end, collision, within, still),
        judged_on,
        end_error,
        estimate_error,
        gear_changes: gear_changes(samples, vehicle),
        duration: duration(trace),
        length: last.map_or(0.0, |sample| sample.distance),
        clearance,
    }
}

fn cause(trace: &Trace, end: End, collision: bool, within: bool, still: bool) -> String {
    let mut said = Vec::new();
    if collision {
        said.push("collision".to_owned());
    }
    match end {
        End::Completed if !within => said.push("outside the tolerance".to_owned()),
        End::Completed if !still => said.push("not at rest".to_owned()),
        End::Completed => {}
        End::Stopped(_) => said.push(
            trace.state.map_or_else(|| end.to_string(), |state| crate::manoeuvre::cause_of(&state)),
        ),
        other => said.push(other.to_string()),
    }
    said.extend(trace.recorder_says());
    said.join("; ")
}

fn of_truth(trace: &Trace, truth: &Truth) -> Sample {
    Sample {
        time: trace.time(truth.header.stamp),
        pose: Pose::new(truth.x, truth.y, truth.yaw),
        speed: truth.speed,
        steering: truth.steering,
        distance: truth.distance,
    }
}

fn of_odometry(trace: &Trace, odometry: &Odometry) -> Sample {
    Sample {
        time: trace.time(odometry.header.stamp),
        pose: Pose::new(odometry.x, odometry.y, odometry.yaw),
        speed: odometry.speed,
        steering: odometry.steering,
        distance: odometry.distance,
    }
}

fn least_clearance(samples: &[Sample], scenario: &Scenario, vehicle: &Vehicle) -> Option<f64> {
    let obstacles: Vec<&ConvexPolygon> =
        scenario.obstacles.iter().map(|obstacle| &obstacle.outline).collect();
    let at = |sample: &Sample| {
        let footprint = vehicle.footprint.polygon_at(&sample.pose);
        let inside = scenario.bounds.depth(footprint.corners());
        obstacles.iter().map(|obstacle| footprint.distance(obstacle)).fold(inside, f64::min)
    };
    samples.iter().map(at).reduce(f64::min)
}

fn is_still(samples: &[Sample]) -> bool {
    let Some(last) = samples.last() else { return false };
    let recent: Vec<&Sample> =
        samples.iter().rev().take_while(|sample| last.time - sample.time <= REST_TIME).collect();
    let spans = recent.last().is_some_and(|first| last.time - first.time > 0.8 * REST_TIME);
    let slow = recent.iter().all(|sample| sample.speed.abs() < REST);
    let steady =
        recent.iter().all(|sample| (sample.steering - last.steering).abs() < STEERING_STILL);
    spans && slow && steady
}

fn gear_changes(samples: &[Sample], vehicle: &Vehicle) -> u32 {
    let enough = GEAR_TRAVEL * vehicle.wheelbase / 0.5;
    let (mut changes, mut direction, mut candidate, mut since) = (0, 0.0, 0.0, 0.0);
    for pair in samples.windows(2) {
        let sign = if pair[1].speed.abs() < REST { candidate } else { pair[1].speed.signum() };
        if sign != candidate {
            (candidate, since) = (sign, pair[0].distance);
        }
        if candidate != direction && pair[1].distance - since >= enough {
            changes += u32::from(direction != 0.0);
            direction = candidate;
        }
    }
    changes
}

fn duration(trace: &Trace) -> f64 {
    let first = trace.commands.first().map(|command| command.header.sent);
    let last = trace.truth.last().map(|truth| truth.header.stamp);
    let last = last.or_else(|| trace.odometry.last().map(|odometry| odometry.header.stamp));
    first.zip(last).map_or(0.0, |(first, last)| seconds(last.saturating_sub(first)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(time: f64, speed: f64, distance: f64) -> Sample {
        Sample { time, pose: Pose::default(), speed, steering: 0.0, distance }
    }

    #[test]
    fn a_short_twitch_is_no_gear_change() {
        let vehicle = crate::configuration::stack(None, Some("paper-1-6")).unwrap().vehicle;
        let mut samples = Vec::new();
        let mut distance = 0.0;
        for (speed, steps) in
            [(0.1, 100), (-0.1, 2), (0.1, 100), (-0.1, 100), (0.0, 100), (-0.1, 50)]
        {
            for _ in 0..steps {
                distance += f64::abs(speed) * 0.005;
                samples.push(sample(0.005 * samples.len() as f64, speed, distance));
            }
        }
        assert_eq!(gear_changes(&samples, &vehicle), 1);
    }

    #[test]
    fn rest_is_half_a_second_without_motion() {
        let moving: Vec<_> = (0..200).map(|k| sample(0.005 * f64::from(k), 0.1, 0.0)).collect();
        assert!(!is_still(&moving));
        let rest: Vec<_> = (0..200).map(|k| sample(0.005 * f64::from(k), 0.0, 0.0)).collect();
        assert!(is_still(&rest));
        assert!(!is_still(&rest[..50]), "a quarter of a second is too short");
    }
}
