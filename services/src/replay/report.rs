//! The report of a replay: from what was computed to what is drawn.

use kerbside_geometry::{Pose, WHEELS};
use kerbside_messages::{FilterKind, OdometryModel};
use kerbside_reports::{
    Drift, Gap, Model, Motion, Provenance, RefusalCount, ReplayReport, WheelTravel,
};

use super::comparison::{Comparison, caution, time_of};
use super::track::Track;
use super::{Finished, sensing};

/// The report of `one`.
pub fn of(one: &Finished) -> ReplayReport {
    let (job, comparison) = (&one.job, &one.comparison);
    ReplayReport {
        input: job.input.drive.name().to_owned(),
        vehicle: job.service.vehicle.name.clone(),
        mode: one.mode_in_words(),
        problem: one.problem.clone(),
        caution: caution(&one.track),
        duration: one.duration,
        distance: one.track.distance(),
        samples: job.input.raws.len() as u64,
        speed_factor: one.speed_factor(),
        odometry_sha256: one.hash.clone(),
        model: model(one),
        odometry: odometry(one),
        reference: reference(one),
        drift: comparison.drift.as_ref().ok().map(|drift| Drift {
            position_percent: drift.position_percent,
            heading_per_metre: drift.heading_rad_per_m,
            end_error: Pose::new(drift.end_error.x, drift.end_error.y, drift.end_error.yaw),
            basis: Comparison::basis(drift),
        }),
        travel: travel(one),
        gaps: gaps(one),
        refusals: one
            .refusals
            .iter()
            .map(|(reason, count)| RefusalCount { reason: (*reason).to_owned(), count: *count })
            .collect(),
        notes: one.notes.clone(),
        provenance: provenance(one),
    }
}

/// The model that the odometry says it was computed by.
pub fn model_of(one: &Finished) -> OdometryModel {
    let code = one.track.newest.map_or(0, |odometry| odometry.model);
    OdometryModel::from_code(code).unwrap_or(OdometryModel::None)
}

/// The filter that the odometry says it was computed by.
pub fn filter_of(track: &Track) -> FilterKind {
    let code = track.newest.map_or(0, |odometry| odometry.filter);
    FilterKind::from_code(code).unwrap_or(FilterKind::Rear)
}

fn model(one: &Finished) -> Model {
    let (model, filter, sensors) = (model_of(one), filter_of(&one.track), &one.job.input.sensors);
    Model {
        name: model.name().to_owned(),
        uses: sensing::uses(model, filter, sensors),
        missing: sensing::lacks(model, filter, sensors),
    }
}

fn odometry(one: &Finished) -> Vec<Motion> {
    let (track, comparison) = (&one.track, &one.comparison);
    let marker = |pose: &Pose| match &comparison.reference_from_odometry {
        Some(frame) => frame.compose(pose).compose(&comparison.body_from_marker),
        None => *pose,
    };
    let motion = |(pose, motion): (&kerbside_recordings::drift::EstimatedPose, &[f64; 2])| Motion {
        time: time_of(track, pose.stamp),
        pose: marker(&pose.pose),
        speed: motion[0],
        steering: motion[1],
    };
    track.poses.iter().zip(&track.motions).map(motion).collect()
}

/// Without a common frame the reference cannot be drawn beside the odometry.
fn reference(one: &Finished) -> Vec<Motion> {
    if one.comparison.reference_from_odometry.is_none() {
        return Vec::new();
    }
    let motion = |pose: &kerbside_recordings::drift::ReferencePose| Motion {
        time: time_of(&one.track, pose.stamp),
        pose: Pose::new(pose.x, pose.y, pose.yaw.unwrap_or(f64::NAN)),
        speed: f64::NAN,
        steering: f64::NAN,
    };
    one.comparison.references.iter().map(motion).collect()
}

fn travel(one: &Finished) -> Vec<WheelTravel> {
    let track = &one.track;
    let read = WHEELS.into_iter().filter(|wheel| one.job.input.sensors.wheels[wheel.index()]);
    read.map(|wheel| {
        let point = |(pose, rolled): (&kerbside_recordings::drift::EstimatedPose, &[f64; 4])| {
            [time_of(track, pose.stamp), rolled[wheel.index()]]
        };
        WheelTravel { wheel, points: track.poses.iter().zip(&one.rolled).map(point).collect() }
    })
    .collect()
}

fn gaps(one: &Finished) -> Vec<Gap> {
    let track = &one.track;
    let gap = |gap: &super::track::Stretch| Gap {
        start: time_of(track, gap.from),
        end: time_of(track, gap.to),
        text: "no readings; bridged by one arc, its uncertainty added".to_owned(),
    };
    track.gaps.iter().map(gap).collect()
}

fn provenance(one: &Finished) -> Provenance {
    let service = &one.job.service;
    let live = one.speeds.live.is_some();
    let recording = one.recording.as_ref().map(|path| path.display().to_string());
    let mut configuration = vec![one.job.input.drive.vehicle().origin.display().to_string()];
    configuration.extend(service.args.config.as_ref().map(|path| path.display().to_string()));
    Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: None,
        command_line: one.job.command_line.clone(),
        configuration,
        instance: if live { service.instance.name().to_owned() } else { String::new() },
        recording: recording.unwrap_or_default(),
        machine: crate::machine::facts(),
    }
}
