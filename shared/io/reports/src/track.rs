//! Motions over time, and what lies between their samples.

use kerbside_geometry::{Footprint, Pose, angle};

/// A vehicle's motion at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Since the run's start \[s\].
    pub time: f64,
    /// Pose of the rear-axle centre; the yaw may be wrapped or not.
    pub pose: Pose,
    /// Speed of the rear-axle centre, negative in reverse \[m/s\]; not a number where unknown.
    pub speed: f64,
    /// Road-wheel angle \[rad\]; not a number where unknown.
    pub steering: f64,
}

/// Longest time between two samples that may be bridged \[s\].
const LONGEST_BRIDGE: f64 = 1.0;

/// A track that is asked for poses at increasing times.
pub(crate) struct Interpolator<'a> {
    samples: &'a [Motion],
    next: usize,
}

impl<'a> Interpolator<'a> {
    /// `samples` in the order of their times.
    pub(crate) fn new(samples: &'a [Motion]) -> Self {
        Self { samples, next: 0 }
    }

    /// The pose at `time`, not earlier than the time asked before; none outside the track or in a
    /// long hole.
    pub(crate) fn at(&mut self, time: f64) -> Option<Pose> {
        while self.samples.get(self.next).is_some_and(|sample| sample.time < time) {
            self.next += 1;
        }
        let after = self.samples.get(self.next)?;
        if after.time == time {
            return Some(after.pose);
        }
        let before = self.samples.get(self.next.checked_sub(1)?)?;
        let span = after.time - before.time;
        (span > 0.0 && span <= LONGEST_BRIDGE)
            .then(|| between(&before.pose, &after.pose, (time - before.time) / span))
    }
}

fn between(from: &Pose, to: &Pose, share: f64) -> Pose {
    Pose::new(
        from.x + share * (to.x - from.x),
        from.y + share * (to.y - from.y),
        from.yaw + share * angle::wrap(to.yaw - from.yaw),
    )
}

/// The positions of a track.
pub(crate) fn positions(track: &[Motion]) -> Vec<[f64; 2]> {
    track.iter().map(|motion| [motion.pose.x, motion.pose.y]).collect()
}

/// A figure of a track over time.
pub(crate) fn over_time(track: &[Motion], figure: impl Fn(&Motion) -> f64) -> Vec<[f64; 2]> {
    track.iter().map(|motion| [motion.time, figure(motion)]).collect()
}

/// The corners of a vehicle's outline at a pose, counter-clockwise from the rear right.
pub(crate) fn outline(footprint: &Footprint, pose: &Pose) -> [[f64; 2]; 4] {
    let (rear, front) = (-footprint.rear_overhang, footprint.length - footprint.rear_overhang);
    let half = 0.5 * footprint.width;
    [[rear, -half], [front, -half], [front, half], [rear, half]].map(|[x, y]| {
        let (x, y) = pose.transform(x, y);
        [x, y]
    })
}

/// Poses along a track, one whenever about `spacing` \[m\] was rolled, at most `limit`.
pub(crate) fn spaced(track: &[Motion], spacing: f64, limit: usize) -> Vec<Pose> {
    let poses: Vec<_> = track.iter().map(|motion| motion.pose).filter(Pose::is_finite).collect();
    let rolled: f64 = poses.windows(2).map(|pair| pair[0].distance(&pair[1])).sum();
    let spacing = spacing.max(rolled / limit.max(1) as f64);
    let (mut chosen, mut since) = (Vec::new(), 0.0);
    for pair in poses.windows(2) {
        since += pair[0].distance(&pair[1]);
        if since >= spacing && chosen.len() < limit {
            chosen.push(pair[1]);
            since = 0.0;
        }
    }
    chosen
}

/// Stretches of one travel direction: (first, last) sample of each; standing belongs to neither.
pub(crate) fn segments(track: &[Motion]) -> Vec<(usize, usize)> {
    const STANDING: f64 = 1e-3;
    let mut segments: Vec<(usize, usize, bool)> = Vec::new();
    for (index, motion) in track.iter().enumerate() {
        if motion.speed.is_nan() || motion.speed.abs() < STANDING {
            continue;
        }
        let forward = motion.speed > 0.0;
        match segments.last_mut() {
            Some((_, last, direction)) if *direction == forward => *last = index,
            _ => segments.push((index, index, forward)),
        }
    }
    segments.into_iter().map(|(first, last, _)| (first, last)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    fn motion(time: f64, x: f64, yaw: f64, speed: f64) -> Motion {
        Motion { time, pose: Pose::new(x, 0.0, yaw), speed, steering: 0.0 }
    }

    #[test]
    fn poses_between_samples_turn_the_short_way() {
        let track = [motion(0.0, 0.0, PI - 0.1, 0.0), motion(1.0, 2.0, 0.1 - PI, 0.0)];
        let mut interpolator = Interpolator::new(&track);
        assert_eq!(interpolator.at(-0.1), None);
        let middle = interpolator.at(0.5).unwrap();
        assert!((middle.x - 1.0).abs() < 1e-12 && (middle.yaw - PI).abs() < 1e-12);
        assert_eq!(interpolator.at(1.0).unwrap().x, 2.0);
        assert_eq!(interpolator.at(1.1), None);
    }

    #[test]
    fn a_long_hole_is_not_bridged() {
        let track = [motion(0.0, 0.0, 0.0, 0.0), motion(5.0, 5.0, 0.0, 0.0)];
        assert_eq!(Interpolator::new(&track).at(2.0), None);
    }

    #[test]
    fn directions_make_segments() {
        let speeds = [0.0, 0.1, 0.2, 0.0, -0.1, f64::NAN, -0.1, 0.0, 0.3];
        let track: Vec<_> = speeds.iter().map(|speed| motion(0.0, 0.0, 0.0, *speed)).collect();
        assert_eq!(segments(&track), [(1, 2), (4, 6), (8, 8)]);
    }

    #[test]
    fn outlines_are_spaced_and_bounded() {
        let track: Vec<_> = (0..1001).map(|i| motion(0.0, f64::from(i) * 0.01, 0.0, 1.0)).collect();
        assert_eq!(spaced(&track, 0.995, 50).len(), 10);
        assert!(spaced(&track, 0.001, 50).len() <= 50);
        assert!(spaced(&[], 1.0, 50).is_empty());
    }
}
