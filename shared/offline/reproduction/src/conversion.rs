//! Row 4: from the front wheels to the rear axle, without noise.

use kerbside_calibration::{rear_distance_centre_form, rear_from_front, rear_from_front_travel};
use kerbside_geometry::{Pose, angle, math};
use kerbside_proving_ground::{Chassis, Manoeuvre, Pace, Physics, Sensors, State};

use crate::figure::{Accept, Figure};
use crate::scatter::drive;

/// Travel of the rear axle per sample \[m\].
const TRAVEL: f64 = 0.01;

/// A sample at a constant steering angle.
struct Sample {
    steering: f64,
    distance: f64,
    turn: f64,
    left: f64,
    right: f64,
}

/// What the front wheels of the proving ground roll at `degrees`, forward or in reverse.
fn sample(chassis: &Chassis, degrees: f64, direction: f64) -> Sample {
    let steering = angle::radians(degrees);
    let curvature = math::tan(steering) / chassis.wheelbase;
    let [left, right, ..] = chassis.travel_per_metre(curvature);
    let distance = direction * TRAVEL;
    Sample {
        steering,
        distance,
        turn: distance * curvature,
        left: distance * left,
        right: distance * right,
    }
}

/// Samples from -`limit` to `limit` degrees in steps of half a degree, in both directions.
fn samples(chassis: &Chassis, from: f64, to: f64) -> Vec<Sample> {
    #[allow(clippy::cast_possible_truncation)] // few
    let count = ((to - from) / 0.5) as i32;
    let angles = (0..=count).map(move |step| from + 0.5 * f64::from(step));
    let both = angles.flat_map(|degrees| [(degrees, 1.0), (degrees, -1.0)]);
    both.map(|(degrees, direction)| sample(chassis, degrees, direction)).collect()
}

fn greatest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}

/// The figures of row 4.
pub(crate) fn figures() -> Vec<Figure> {
    let chassis = Chassis::paper();
    let (track, wheelbase) = (chassis.track_front, chassis.wheelbase);
    let range = samples(&chassis, -35.0, 35.0);
    let form = greatest(range.iter().map(|sample| {
        let (distance, turn) =
            rear_from_front(sample.left, sample.right, sample.steering, track, wheelbase);
        let scale = sample.turn.abs().max(TRAVEL);
        ((distance - sample.distance) / sample.distance)
            .abs()
            .max((turn - sample.turn).abs() / scale)
    }));
    let bends = range.iter().filter(|sample| sample.steering.abs() > angle::radians(4.9));
    let centre = greatest(bends.map(|sample| {
        let distance = rear_distance_centre_form(sample.left, sample.right, sample.steering);
        let error = distance / sample.distance - 1.0;
        let sin = math::sin(sample.steering);
        let predicted = track * track / (8.0 * wheelbase * wheelbase) * sin.powi(4);
        (error / predicted - 1.0).abs()
    }));
    let free = greatest(range.iter().map(|sample| {
        let found = rear_from_front_travel(sample.left, sample.right, track, wheelbase);
        found.map_or(f64::INFINITY, |(distance, _)| (distance / sample.distance - 1.0).abs())
    }));
    // At 43.9 degrees two angles give the same travel: beyond it the wheels alone cannot tell that they are beyond.
    let beyond = [samples(&chassis, 40.5, 43.5), samples(&chassis, -43.5, -40.5)];
    let answered = beyond.iter().flatten().filter(|sample| {
        rear_from_front_travel(sample.left, sample.right, track, wheelbase).is_some()
    });
    let refused = answered.count() == 0;
    let [right, squared] = s_path_ends(&chassis);
    vec![
        Figure::new(4, "form (b), relative error to 35 deg", "", form, Accept::AtMost(1e-9)),
        Figure::new(4, "centre form against its formula", "", centre, Accept::AtMost(0.02)),
        Figure::new(4, "form (d), relative error to 35 deg", "", free, Accept::AtMost(1e-6)),
        Figure::new(
            4,
            "form (d) refuses 40 deg to its limit, 43.9",
            "",
            f64::from(u8::from(refused)),
            Accept::AtLeast(1.0),
        ),
        Figure::new(
            4,
            "S path's end by form (b), no noise",
            "mm",
            1e3 * right,
            Accept::AtMost(2.0),
        ),
        // Beside 26 mm of noise: a yaw that is too small by cosine squared is no small matter.
        Figure::new(
            4,
            "S path's end by cos^2 yaw, no noise",
            "mm",
            1e3 * squared,
            Accept::AtLeast(400.0),
        ),
    ]
}

/// End errors of the S path by the front axle: by form (b), and with both wheels turned by the centre's angle, so that
/// the yaw is low by its cosine squared \[m\].
fn s_path_ends(chassis: &Chassis) -> [f64; 2] {
    let sensors = Sensors::paper(1.0).without_errors();
    let test = drive(Physics::NEUTRAL, &sensors, Manoeuvre::s_path(Pace::paper(0.09)));
    let truth = test.record(1).truth;
    let rolled = |from: &State, to: &State, wheel: usize| {
        chassis.radius[wheel] * (to.rotation[wheel] - from.rotation[wheel])
    };
    let mut poses = [Pose::default(); 2];
    for pair in truth.windows(2) {
        let (left, right) = (rolled(&pair[0], &pair[1], 0), rolled(&pair[0], &pair[1], 1));
        let steering = 0.5 * (pair[0].steering + pair[1].steering);
        let (distance, turn) =
            rear_from_front(left, right, steering, chassis.track_front, chassis.wheelbase);
        poses[0] = poses[0].advance(distance, turn);
        let cos = math::cos(steering);
        let turn = (right - left) * cos / chassis.track_front;
        poses[1] = poses[1].advance(0.5 * (left + right) * cos, turn);
    }
    let end = truth.last().map_or(Pose::default(), |state| state.pose);
    poses.map(|pose| pose.distance(&end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn row_4_is_reached() {
        for figure in figures() {
            assert!(figure.passed(), "{figure:?}");
        }
    }
}
