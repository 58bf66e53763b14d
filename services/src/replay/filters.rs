//! A recorded drive by each filter, in one process.

use std::path::{Path, PathBuf};

use kerbside_geometry::Pose;
use kerbside_odometry::Filter;
use kerbside_recordings::drift::Drift;
use kerbside_recordings::input::Source;
use kerbside_recordings::run_folder::stamp_of;

use super::comparison::Comparison;
use super::{Job, ReplayArgs, job, path_of, pure};
use crate::exit::Failure;
use crate::output;

/// How far one filter drifts on a drive.
#[derive(Clone, Debug)]
pub struct FilterDrift {
    /// Which.
    pub filter: Filter,
    /// Error of position over the distance, median over windows \[%\], of heading \[rad/m\], and the end's error.
    pub drift: Option<(f64, f64, Pose)>,
}

/// A drive by every filter.
#[derive(Clone, Debug)]
pub struct Filtered {
    /// Its file or folder.
    pub input: PathBuf,
    /// Its name.
    pub name: String,
    /// Distance rolled by the first filter \[m\].
    pub distance: f64,
    /// Per filter, in the order given.
    pub drifts: Vec<FilterDrift>,
    /// Why there is no drift.
    pub why: Option<String>,
    /// What a person should know of the input, a sentence each.
    pub notes: Vec<String>,
}

/// Replays the drive at `source` with each of `filters`; `folder` takes its vehicle's file.
///
/// # Errors
/// [`Failure`] where the drive is refused.
pub fn by_filters(
    args: &ReplayArgs,
    source: &Source,
    folder: &Path,
    filters: &[Filter],
) -> Result<Filtered, Failure> {
    output::make(folder)?;
    let mut job = job(args, source, folder)?;
    let mut filtered = Filtered {
        input: path_of(source).to_owned(),
        name: job.input.drive.name().to_owned(),
        distance: f64::NAN,
        drifts: Vec::new(),
        why: None,
        notes: job.input.notices.clone(),
    };
    for filter in filters {
        let (distance, comparison) = reckoned(&mut job, *filter)?;
        if filtered.drifts.is_empty() {
            filtered.distance = distance;
        }
        let drift = match &comparison.drift {
            Ok(drift) => {
                let end = Pose::new(drift.end_error.x, drift.end_error.y, drift.end_error.yaw);
                Some((drift.position_percent, drift.heading_rad_per_m, end))
            }
            Err(why) => {
                filtered.why = Some(why.clone());
                None
            }
        };
        filtered.drifts.push(FilterDrift { filter: *filter, drift });
    }
    Ok(filtered)
}

/// Drift by the default filter of the drive at `source`, of its readings within (from, to) \[s\] alone where that is given;
/// none where it cannot be known. `folder` takes its vehicle's file.
///
/// # Errors
/// [`Failure`] where the drive is refused.
pub fn drift_within(
    args: &ReplayArgs,
    source: &Source,
    folder: &Path,
    within: Option<(f64, f64)>,
) -> Result<Option<Drift>, Failure> {
    let mut job = job(args, source, folder)?;
    if let Some((from, to)) = within {
        let (from, to) = (stamp_of(from), stamp_of(to));
        job.input.raws.retain(|raw| (from..=to).contains(&raw.arrival));
    }
    let (_, comparison) = reckoned(&mut job, Filter::default())?;
    Ok(comparison.drift.ok())
}

/// Distance rolled \[m\] and comparison by one filter.
fn reckoned(job: &mut Job, filter: Filter) -> Result<(f64, Comparison), Failure> {
    job.service.stack.estimator.filter = filter;
    let track = pure::run(&job.service, &job.input.raws)?.track;
    let comparison = Comparison::of(&job.input, &track)?;
    Ok((track.distance(), comparison))
}
