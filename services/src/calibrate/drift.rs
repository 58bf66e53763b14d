//! Drift of runs that the fit has not seen: the estimator's own odometry, with the nominal and with the calibrated
//! vehicle, as `replay --pure` reports it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use kerbside_recordings::drift::{AlignedBy, Drift};
use kerbside_recordings::input::Source;

use super::Case;
use super::fit::Found;
use super::output::{self, Provenance};
use crate::exit::Failure;
use crate::output as folders;
use crate::replay::{self, ReplayArgs};

/// Share of the nominal drift that a calibration is to reach, ...
pub const SHARE: f64 = 0.5;
/// ... or this multiple of what the reference's own noise puts into a drift.
pub const FLOORS: f64 = 1.5;

/// Drift of one run, medians over its windows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drifted {
    /// Of position, share of the distance \[%\].
    pub percent: f64,
    /// Of heading \[rad/m\].
    pub heading: f64,
}

/// Drift of one run that was left out, before and after.
#[derive(Clone, Debug)]
pub struct RunDrift {
    /// The run.
    pub run: String,
    /// By the nominal vehicle.
    pub before: Drifted,
    /// By the calibrated one.
    pub after: Drifted,
    /// What the reference's stated noise alone puts into them.
    pub floor: Drifted,
    /// Length of its windows \[m\].
    pub window: f64,
}

/// Medians over runs.
#[derive(Clone, Copy, Debug)]
pub struct Medians {
    /// Runs.
    pub runs: usize,
    /// By the nominal vehicle.
    pub before: Drifted,
    /// By the calibrated one.
    pub after: Drifted,
    /// What the reference's stated noise alone puts into them.
    pub floor: Drifted,
}

impl Medians {
    /// Over `runs`; none where there is none.
    pub fn of(runs: &[RunDrift]) -> Option<Self> {
        let over = |of: fn(&RunDrift) -> Drifted| Drifted {
            percent: median(runs.iter().map(|run| of(run).percent).collect()),
            heading: median(runs.iter().map(|run| of(run).heading).collect()),
        };
        (!runs.is_empty()).then(|| Self {
            runs: runs.len(),
            before: over(|run| run.before),
            after: over(|run| run.after),
            floor: over(|run| run.floor),
        })
    }

    /// Whether the drift of position is at most half of the nominal one, or 1.5 times the reference's floor.
    pub fn position_reached(&self) -> bool {
        reached(self.before.percent, self.after.percent, self.floor.percent)
    }

    /// The same of the heading.
    pub fn heading_reached(&self) -> bool {
        reached(self.before.heading, self.after.heading, self.floor.heading)
    }
}

fn reached(before: f64, after: f64, floor: f64) -> bool {
    after <= (SHARE * before).max(FLOORS * floor)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => f64::NAN,
        count if count % 2 == 1 => values[middle],
        _ => 0.5 * (values[middle - 1] + values[middle]),
    }
}

/// Where a run was recorded, and from when to when it is taken \[s\].
pub type Recorded = BTreeMap<String, (PathBuf, Option<(f64, f64)>)>;

/// Drift of the runs named `runs` by the nominal vehicle and by what was `found`; `folder` takes the two vehicles' files.
///
/// Runs whose drift cannot be known (too short, no reference) are not in it.
///
/// # Errors
/// [`Failure`] where a file cannot be written, or a recording cannot be read.
pub fn drifts(
    case: &Case,
    found: &Found,
    provenance: &Provenance<'_>,
    runs: &[&str],
    folder: &Path,
) -> Result<Vec<RunDrift>, Failure> {
    folders::make(folder)?;
    let files = [folder.join("before.toml"), folder.join("after.toml")];
    folders::write(&files[0], &case.text)?;
    folders::write(&files[1], &output::text_of(case, found, provenance)?)?;
    let mut table = Vec::new();
    for run in runs {
        let Some((recorded, within)) = case.recorded.get(*run) else { continue };
        let source = Source::Run(recorded.clone());
        let drift = |vehicle: &Path| {
            let args = replay_of(recorded, vehicle);
            replay::drift_within(&args, &source, folder, *within)
        };
        if let (Some(before), Some(after)) = (drift(&files[0])?, drift(&files[1])?) {
            table.push(RunDrift {
                run: (*run).to_owned(),
                before: of(&before),
                after: of(&after),
                floor: floor(case, &before),
                window: before.window,
            });
        }
    }
    Ok(table)
}

fn of(drift: &Drift) -> Drifted {
    Drifted { percent: drift.position_percent, heading: drift.heading_rad_per_m }
}

fn replay_of(path: &Path, vehicle: &Path) -> ReplayArgs {
    ReplayArgs {
        path: path.to_owned(),
        speed: None,
        pure: true,
        fixes: None,
        fix_rate: 2.0,
        vehicle: Some(vehicle.display().to_string()),
        config: None,
        instance: None,
        out: None,
        json: false,
        log: None,
    }
}

/// What the reference's stated noise puts into the drift over a window, standard deviations.
///
/// With heading: two poses' positions, and the first one's heading over the window. Without: a tenth of the window gives
/// the direction by its positions, a straight line through them.
fn floor(case: &Case, drift: &Drift) -> Drifted {
    let Some(reference) = case.vehicle().reference else {
        return Drifted { percent: f64::NAN, heading: f64::NAN };
    };
    let (position, window) = (reference.position_noise, drift.window);
    let (heading, apart) = match drift.aligned_by {
        AlignedBy::Pose => (reference.yaw_noise, window),
        AlignedBy::Path => {
            #[allow(clippy::cast_precision_loss)] // windows, about one a reading
            let per_metre = drift.windows as f64 / (drift.distance - window).max(window);
            let readings = (0.1 * window * per_metre).max(2.0);
            (position * (12.0 / readings).sqrt() / (0.1 * window), 0.9 * window)
        }
    };
    let end = (2.0 * position).hypot(heading * window);
    Drifted { percent: 100.0 * end / window, heading: core::f64::consts::SQRT_2 * heading / apart }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(before: f64, after: f64) -> RunDrift {
        let drifted = |percent| Drifted { percent, heading: 0.01 * percent };
        let (before, after) = (drifted(before), drifted(after));
        RunDrift { run: String::new(), before, after, floor: drifted(0.1), window: 1.0 }
    }

    #[test]
    fn half_of_the_nominal_drift_or_the_floor_is_asked() {
        let medians = Medians::of(&[run(4.0, 1.0), run(2.0, 1.5), run(1.0, 0.4)]).unwrap();
        assert_eq!((medians.before.percent, medians.after.percent), (2.0, 1.0));
        assert!(medians.position_reached() && medians.heading_reached());
        let missed = Medians::of(&[run(2.0, 1.1)]).unwrap();
        assert!(!missed.position_reached());
        let floor = Medians::of(&[run(0.2, 0.15)]).unwrap();
        assert!(floor.position_reached(), "no reference could tell it from none");
        assert!(Medians::of(&[]).is_none());
    }
}
