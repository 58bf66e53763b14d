//! A drive whose reference is given to the estimator as fixes for a while: what it learns of the vehicle, and how far
//! the odometry drifts on the rest, with and without.

use kerbside_geometry::{Pose, Vehicle};
use kerbside_messages::{Fix, FixVerdict, Header, Nanos, Odometry};
use kerbside_odometry::{Filter, InitialPose, Parameter, ParameterEstimate, Sensors};
use kerbside_recordings::drift::{Drift, ReferencePose, drift};

use super::Job;
use super::chain::Chain;
use super::comparison::Comparison;
use super::track::Track;
use crate::exit::{Exit, Failure};

/// What is asked.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// Share of the drive's time with fixes.
    pub share: f64,
    /// Fixes per second \[Hz\].
    pub rate: f64,
}

/// A parameter of the vehicle, as the filter has learnt it.
#[derive(Clone, Copy, Debug)]
pub struct Learnt {
    /// Which.
    pub parameter: Parameter,
    /// What the vehicle's file says \[m, rad or rad/s\].
    pub nominal: f64,
    /// What it is by now.
    pub value: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// Standard deviation at the start.
    pub prior: f64,
}

/// What came of a drive with fixes.
#[derive(Debug)]
pub struct Lesson {
    /// Share of the drive's time with fixes.
    pub share: f64,
    /// Fixes given, and taken.
    pub given: u64,
    /// Fixes that corrected the pose.
    pub taken: u64,
    /// How often the filter widened its covariance as fixes contradicted it again and again.
    pub widened: u64,
    /// The parameters when the fixes ended.
    pub learnt: Vec<Learnt>,
    /// Drift on the rest of an estimator without fixes, or why it cannot be known.
    pub without: Result<Drift, String>,
    /// The same of the one that had learnt.
    pub with: Result<Drift, String>,
}

/// A share of the time, exclusive of both ends.
///
/// # Errors
/// What was found and what is allowed.
pub fn parse_share(text: &str) -> Result<f64, String> {
    let allowed = "a share of the time between 0 and 1";
    number(text).filter(|share| *share < 1.0).ok_or_else(|| refused(text, allowed))
}

/// A rate.
///
/// # Errors
/// What was found and what is allowed.
pub fn parse_rate(text: &str) -> Result<f64, String> {
    let allowed = "a number of fixes per second above 0, at most 1000";
    number(text).filter(|rate| *rate <= 1000.0).ok_or_else(|| refused(text, allowed))
}

fn number(text: &str) -> Option<f64> {
    text.parse::<f64>().ok().filter(|number| number.is_finite() && *number > 0.0)
}

fn refused(text: &str, allowed: &str) -> String {
    format!("found {text:?}, allowed is {allowed}")
}

/// Replays `job` once more, the reference's poses up to a share of its time given as fixes; `track` is the odometry
/// without.
///
/// # Errors
/// [`Failure`] where the reference cannot be given, or the filter takes none.
pub(super) fn learn(
    job: &mut Job,
    comparison: &Comparison,
    track: &Track,
    asked: &Asked,
) -> Result<Lesson, Failure> {
    let path = job.input.drive.path().display().to_string();
    let data = |why: String| Failure::new(Exit::Data, format!("{path}: --fixes: {why}"));
    if job.service.stack.estimator.filter != Filter::Fused {
        let why = "--fixes: estimator.filter is not \"fused\", the only filter that takes fixes in motion";
        return Err(Failure::new(Exit::Configuration, why));
    }
    let (Some(first), Some(last)) = (track.poses.first(), track.poses.last()) else {
        return Err(data("no odometry came of the drive".to_owned()));
    };
    let sensor = job.service.vehicle.reference;
    let noise = sensor.map(|sensor| [sensor.position_noise, sensor.yaw_noise]);
    let noise = noise.filter(|noise| noise.iter().all(|noise| *noise > 0.0));
    let noise = noise.ok_or_else(|| {
        data(
            "vehicle.toml needs reference.noise.position and reference.noise.yaw above 0"
                .to_owned(),
        )
    })?;
    let until = between(first.stamp, last.stamp, asked.share);
    let fixes = fixes(comparison, (first.stamp, until), asked.rate, noise);
    let Some(begin) = fixes.first() else {
        let why = "the reference has no pose with a heading while the wheels were read";
        return Err(data(why.to_owned()));
    };
    let start =
        Pose::new(begin.x, begin.y, begin.yaw).compose(&comparison.body_from_marker.inverse());
    let before = job.service.stack.estimator.initial_pose.replace(InitialPose {
        pose: start,
        // It may have moved before the reference began; the first fix comes at once.
        position_noise: 3.0 * noise[0],
        yaw_noise: 3.0 * noise[1],
    });
    let driven = drive(job, &fixes, until);
    job.service.stack.estimator.initial_pose = before;
    let driven = driven?;
    let rest: Vec<ReferencePose> =
        comparison.references.iter().filter(|pose| pose.stamp > until).copied().collect();
    let judge = |track: &Track| {
        drift(&track.poses, &rest, &comparison.body_from_marker).map_err(|error| error.to_string())
    };
    let (vehicle, sensors) = (&job.service.vehicle, &job.input.sensors);
    Ok(Lesson {
        share: asked.share,
        given: fixes.len() as u64,
        taken: driven.taken,
        widened: driven.widened,
        learnt: learnt(vehicle, sensors, &driven.first, &driven.then),
        without: judge(track),
        with: judge(&driven.track),
    })
}

/// The stamp at a share of the time between two.
#[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, clippy::cast_sign_loss)]
fn between(first: Nanos, last: Nanos, share: f64) -> Nanos {
    first + (share * last.saturating_sub(first) as f64) as Nanos
}

/// The reference's poses of that time, so many per second at most.
fn fixes(
    comparison: &Comparison,
    (from, until): (Nanos, Nanos),
    rate: f64,
    [position, yaw]: [f64; 2],
) -> Vec<Fix> {
    let marker = comparison.body_from_marker;
    let (along, turned) = (position * position, yaw * yaw);
    let interval = kerbside_messages::nanos(0.999 / rate);
    let mut next = from;
    let mut fixes = Vec::new();
    for pose in comparison.references.iter().filter(|pose| (from..=until).contains(&pose.stamp)) {
        let Some(heading) = pose.yaw.filter(|_| pose.stamp >= next) else { continue };
        next = pose.stamp + interval;
        let sequence = 1 + fixes.len() as u64;
        fixes.push(Fix {
            header: Header { sequence, ..Header::stamped(pose.stamp, 0) },
            x: pose.x,
            y: pose.y,
            yaw: heading,
            covariance: [along, 0.0, 0.0, 0.0, along, 0.0, 0.0, 0.0, turned],
            marker_x: marker.x,
            marker_y: marker.y,
            marker_yaw: marker.yaw,
            ..Fix::default()
        });
    }
    fixes
}

/// A drive with fixes.
struct Driven {
    track: Track,
    taken: u64,
    widened: u64,
    /// The first sample, and that with the last fix.
    first: Odometry,
    then: Odometry,
}

fn drive(job: &Job, fixes: &[Fix], until: Nanos) -> Result<Driven, Failure> {
    let mut chain = Chain::new(&job.service)?;
    let mut track = Track::with_capacity(job.input.raws.len());
    let mut waiting = fixes.iter().peekable();
    let (mut first, mut then, mut judged) = (None, Odometry::default(), 0);
    let (mut taken, mut widened) = (0, 0);
    for raw in &job.input.raws {
        let fix = waiting.next_if(|fix| fix.header.stamp <= raw.arrival);
        let Some(odometry) = chain.step_with(raw, fix) else { continue };
        if odometry.fix_sequence != judged {
            judged = odometry.fix_sequence;
            let widen = odometry.fix_verdict == FixVerdict::Widened.code();
            widened += u64::from(widen);
            taken += u64::from(widen || odometry.fix_verdict == FixVerdict::Accepted.code());
        }
        first.get_or_insert(*odometry);
        if odometry.header.stamp <= until {
            then = *odometry;
        }
        track.push(odometry);
    }
    Ok(Driven { track, taken, widened, first: first.unwrap_or_default(), then })
}

/// What was known at first and then, of the parameters that the drive's sensors have to do with.
fn learnt(vehicle: &Vehicle, sensors: &Sensors, first: &Odometry, then: &Odometry) -> Vec<Learnt> {
    let known = |odometry: &Odometry| ParameterEstimate::of(&odometry.filter_state);
    let (Some(prior), Some(now)) = (known(first), known(then)) else { return Vec::new() };
    let wheels = sensors.wheels;
    let concerned = |parameter: &Parameter| match parameter {
        Parameter::TrackFront => wheels[0] && wheels[1],
        Parameter::TrackRear => wheels[2] && wheels[3],
        Parameter::Wheelbase => wheels[0] || wheels[1] || sensors.steering,
        Parameter::SteeringZero => sensors.steering,
        Parameter::GyroBias => sensors.gyro,
        radius => wheels[radius.index()],
    };
    let told = |parameter: Parameter| {
        let index = parameter.index();
        let (nominal, per_one) = parameter.basis(vehicle);
        let deviation =
            |known: &ParameterEstimate| per_one * known.covariance[(index, index)].max(0.0).sqrt();
        Learnt {
            parameter,
            nominal,
            value: nominal + per_one * now.deviation[index],
            deviation: deviation(&now),
            prior: deviation(&prior),
        }
    };
    Parameter::ALL.into_iter().filter(concerned).map(told).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_rates_say_what_is_allowed() {
        assert_eq!((parse_share("0.5"), parse_rate("2")), (Ok(0.5), Ok(2.0)));
        for text in ["0", "1", "-1", "NaN", "half", ""] {
            let said = parse_share(text).unwrap_err();
            assert!(said.contains("between 0 and 1") && said.contains(&format!("{text:?}")));
        }
        assert!(["0", "inf", "1e9"].iter().all(|text| parse_rate(text).is_err()));
    }

    #[test]
    fn a_reference_is_thinned_to_the_rate_and_ends_with_its_share() {
        let references = (0..100_u64)
            .map(|index| ReferencePose {
                stamp: index * 20_000_000,
                x: 0.1,
                y: 0.0,
                yaw: (index != 50).then_some(0.0),
            })
            .collect();
        let comparison = Comparison {
            references,
            body_from_marker: Pose::new(0.2, 0.0, 0.0),
            reference_from_odometry: None,
            drift: Err(String::new()),
        };
        let found = fixes(&comparison, (0, 1_000_000_000), 10.0, [0.01, 0.02]);
        let stamps: Vec<u64> = found.iter().map(|fix| fix.header.stamp / 20_000_000).collect();
        assert_eq!(stamps, [0, 5, 10, 15, 20, 25, 30, 35, 40, 45]);
        assert_eq!((found[3].header.sequence, found[0].marker_x), (4, 0.2));
        assert!((found[0].covariance[8] - 4e-4).abs() < 1e-18);
        assert_eq!(between(100, 300, 0.25), 150);
    }
}
