//! What is known of a run's motion besides wheels and steering, and when it was known.

use kerbside_geometry::Pose;

use crate::gyro::{Gyro, Turned};
use crate::noise::Settings;
use crate::run::{ReferencePose, Run};
use crate::travel::Base;

/// Poses of the start that are known by agreement are as good as exact \[m\], \[rad\].
const AGREED: f64 = 1e-6;

/// Something known of the motion besides wheels and steering.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Known {
    /// The marker's pose and its standard deviations \[m\], \[rad\].
    Pose { x: f64, y: f64, yaw: Option<f64>, position_deviation: f64, yaw_deviation: f64 },
    /// Travelled distance and its standard deviation \[m\].
    Distance(f64, f64),
    /// Net turn and its standard deviation \[rad\].
    Turn(f64, f64),
    /// The turn since the gyro was last looked at, its bias in it.
    Gyro(Turned),
}

/// Whether it is known by agreement alone: the start of what was measured by hand.
pub(crate) fn is_agreed(known: &Known) -> bool {
    matches!(known, Known::Pose { position_deviation, .. } if *position_deviation <= AGREED)
}

/// Everything known of the run besides wheels and steering, with the time it was known.
pub(crate) fn known_of(
    run: &Run,
    settings: &Settings,
    (from, to): (f64, f64),
) -> Vec<(f64, Known)> {
    let noise = &settings.noise;
    let mut known = Vec::new();
    let pose = |pose: &Pose, deviation: f64, yaw_deviation: f64| Known::Pose {
        x: pose.x,
        y: pose.y,
        yaw: Some(pose.yaw),
        position_deviation: deviation,
        yaw_deviation,
    };
    for reading in thinned(&run.reference, noise.reference_interval, (from, to)) {
        let pose = Known::Pose {
            x: reading.x,
            y: reading.y,
            yaw: reading.yaw,
            position_deviation: noise.position,
            yaw_deviation: noise.yaw,
        };
        known.push((reading.t.clamp(from, to), pose));
    }
    // What was measured by hand is relative to the start, wherever that is; a reference of its own makes it
    // superfluous.
    if run.reference.is_empty() {
        let start = run.start.unwrap_or_default();
        known.push((from, pose(&start, AGREED, AGREED)));
        if let Some(end) = run.end_pose {
            let end = start.compose(&end);
            known.push((to, pose(&end, noise.hand_position, noise.hand_yaw)));
        }
    }
    known.extend(run.distance.map(|distance| (to, Known::Distance(distance, noise.distance))));
    known.extend(run.net_turn.map(|turn| (to, Known::Turn(turn, noise.turn))));
    known
}

/// What a gyro turned over each stretch on which the axles are compared.
pub(crate) fn looks_at(gyro: &Gyro<'_>, base: &Base, settings: &Settings) -> Vec<(f64, Known)> {
    let mut from = base.span().0;
    let mut looks = Vec::new();
    for to in base.boundaries(settings.comparison) {
        // Over a silence nothing is said: the next look begins behind it.
        let silent = Turned { turn: 0.0, time: 0.0, variance: f64::INFINITY };
        let turned = gyro.turned(from, to, &settings.noise).unwrap_or(silent);
        if to > from {
            looks.push((to, Known::Gyro(turned)));
        }
        from = to;
    }
    looks
}

/// Readings within the run's span that are far enough from one another; first and last stay in any case.
fn thinned(
    reference: &[ReferencePose],
    interval: f64,
    (from, to): (f64, f64),
) -> Vec<ReferencePose> {
    let margin = interval.max(0.1);
    let inside = |reading: &&ReferencePose| (from - margin..=to + margin).contains(&reading.t);
    let mut kept: Vec<ReferencePose> = Vec::new();
    for reading in reference.iter().filter(inside) {
        if kept.last().is_none_or(|last| reading.t - last.t >= interval) {
            kept.push(*reading);
        }
    }
    if let Some(last) = reference.iter().rfind(inside)
        && kept.last().is_some_and(|kept| kept.t < last.t)
    {
        if kept.len() > 1 {
            kept.pop();
        }
        kept.push(*last);
    }
    kept
}
