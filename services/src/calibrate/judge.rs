//! Runs that a calibration has not seen: how far dead reckoning ends from what is known of their ends.

use kerbside_calibration::{
    EndError, LeftOut, Parameters, Path, ReferencePose, Run, Settings, Source, dead_reckon,
};
use kerbside_geometry::{Pose, Vehicle, angle, math};

use super::Method;

/// By which sensors dead reckoning is judged.
pub const SOURCES: [Source; 3] = [Source::Rear, Source::Front, Source::All];

/// End errors of `run` by the parameters before and after, per source that its sensors allow; empty where its end is
/// not known or its sensors do not make a path.
pub fn judge(
    run: &Run,
    vehicle: &Vehicle,
    [before, after]: [&Parameters; 2],
    settings: &Settings,
) -> Vec<LeftOut> {
    let error = |parameters: &Parameters, source: Source| {
        let path = dead_reckon(run, vehicle, parameters, settings, source).ok()??;
        end_error(run, &parameters.marker(), &path)
    };
    let (floor_position, floor_yaw) = floor(run, settings);
    let row = |source: Source| {
        Some(LeftOut {
            run: run.name.clone(),
            manoeuvre: run.manoeuvre.clone(),
            source,
            before: error(before, source)?,
            after: error(after, source)?,
            floor_position,
            floor_yaw,
        })
    };
    SOURCES.into_iter().filter_map(row).collect()
}

/// The last reading of the reference within the drive, standing at its end included: there a late reference has come
/// to rest, too.
fn last_reading(run: &Run) -> Option<ReferencePose> {
    let (_, end) = run.span()?;
    run.reference.iter().rfind(|reading| reading.t <= end + 0.1).copied()
}

/// How far `path` ends from what `run` knows of its end, in the frame of the start.
fn end_error(run: &Run, marker: &Pose, path: &Path) -> Option<EndError> {
    let start = path.poses.first()?.1;
    let end = path.poses.last()?.1;
    let seen_from_start = |dx: f64, dy: f64, yaw: Option<f64>| {
        let (sin, cos) = math::sin_cos(start.yaw);
        EndError { x: cos * dx + sin * dy, y: cos * dy - sin * dx, yaw }
    };
    if let Some(reading) = last_reading(run) {
        let marker = pose_at(path, reading.t)?.compose(marker);
        let yaw = reading.yaw.map(|yaw| angle::wrap(marker.yaw - yaw));
        return Some(seen_from_start(marker.x - reading.x, marker.y - reading.y, yaw));
    }
    if let Some(known) = run.end_pose {
        let known = run.start.unwrap_or_default().compose(&known);
        let yaw = Some(angle::wrap(end.yaw - known.yaw));
        return Some(seen_from_start(end.x - known.x, end.y - known.y, yaw));
    }
    let rolled: f64 = path.poses.windows(2).map(|pair| pair[0].1.distance(&pair[1].1)).sum();
    run.distance.map(|distance| EndError { x: rolled - distance, y: 0.0, yaw: None })
}

/// The pose at `t`, between two of the path.
fn pose_at(path: &Path, t: f64) -> Option<Pose> {
    let after = path.poses.partition_point(|(stamp, _)| *stamp < t);
    let (Some(before), Some(next)) = (after.checked_sub(1), path.poses.get(after)) else {
        return path.poses.get(after).or(path.poses.last()).map(|(_, pose)| *pose);
    };
    let (from, to) = (path.poses[before], next);
    let share = (t - from.0) / (to.0 - from.0);
    let between = |a: f64, b: f64| a + share * (b - a);
    let yaw = from.1.yaw + share * angle::wrap(to.1.yaw - from.1.yaw);
    Some(Pose::new(between(from.1.x, to.1.x), between(from.1.y, to.1.y), yaw))
}

/// Deviations of position \[m\] and yaw \[rad\] that the known start and end alone put into an end error.
fn floor(run: &Run, settings: &Settings) -> (f64, f64) {
    let noise = &settings.noise;
    if let ([first, ..], Some(last)) = (&run.reference[..], run.reference.last()) {
        let chord = math::hypot(last.x - first.x, last.y - first.y);
        let position = math::hypot(2.0 * noise.position, noise.yaw * chord);
        return (position, core::f64::consts::SQRT_2 * noise.yaw);
    }
    match run.end_pose {
        Some(_) => (core::f64::consts::SQRT_2 * noise.hand_position, noise.hand_yaw),
        None => (noise.distance, 0.0),
    }
}

/// Root mean squares over runs of the end errors by one source.
#[derive(Clone, Copy, Debug)]
pub struct Rms {
    /// By what.
    pub source: Source,
    /// Runs.
    pub runs: usize,
    /// Distance before and after \[m\], and what the known ends alone put into it.
    pub position: [f64; 2],
    /// See `position` \[m\].
    pub floor_position: f64,
    /// Heading before and after \[rad\]; not a number where no end heading is known.
    pub yaw: [f64; 2],
    /// See `yaw` \[rad\].
    pub floor_yaw: f64,
}

impl Rms {
    /// Over the rows of `table` by `source`; none where there is none.
    pub fn of(table: &[LeftOut], source: Source) -> Option<Self> {
        let rows: Vec<&LeftOut> = table.iter().filter(|row| row.source == source).collect();
        let over = |of: &dyn Fn(&LeftOut) -> Option<f64>| {
            let values: Vec<f64> = rows.iter().filter_map(|row| of(row)).collect();
            let sum: f64 = values.iter().map(|value| value * value).sum();
            // Without a value this is not a number.
            (sum / values.len() as f64).sqrt()
        };
        (!rows.is_empty()).then(|| Self {
            source,
            runs: rows.len(),
            position: [
                over(&|row| Some(row.before.distance())),
                over(&|row| Some(row.after.distance())),
            ],
            floor_position: over(&|row| Some(row.floor_position)),
            yaw: [over(&|row| row.before.yaw), over(&|row| row.after.yaw)],
            floor_yaw: over(&|row| row.after.yaw.map(|_| row.floor_yaw)),
        })
    }

    /// What counts: all sensors together; of the closed form, which knows no steering sensor, the rear axle alone. By
    /// another source where there is none of that.
    pub fn overall(table: &[LeftOut], method: Method) -> Option<Self> {
        let first = match method {
            Method::Joint => Source::All,
            Method::ClosedForm => Source::Rear,
        };
        Self::of(table, first).or_else(|| SOURCES.iter().find_map(|s| Self::of(table, *s)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_found_between_those_of_a_path_and_held_beyond() {
        let poses = vec![(0.0, Pose::default()), (2.0, Pose::new(4.0, 2.0, 1.0))];
        let path = Path { source: Source::All, poses };
        let middle = pose_at(&path, 0.5).unwrap();
        assert_eq!((middle.x, middle.y, middle.yaw), (1.0, 0.5, 0.25));
        assert_eq!(pose_at(&path, -1.0).unwrap().x, 0.0);
        assert_eq!(pose_at(&path, 3.0).unwrap().x, 4.0);
    }
}
