//! Dead reckoning by one axle or all, and how far off it ends.

use kerbside_geometry::{Pose, Vehicle, angle, math};

use crate::condense::Condensed;
use crate::error::CalibrationError;
use crate::known::Known;
use crate::noise::Settings;
use crate::parameters::Parameters;
use crate::rows::{Rows, Used};
use crate::run::Run;
use crate::solve::first_start;

/// Which sensors a dead reckoning takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Source {
    /// The rear wheels (and the steering sensor where there is but one).
    Rear,
    /// The front wheels, turned by their own angles (and the steering sensor where there is but one wheel).
    Front,
    /// All wheels and the steering sensor, weighed by their noise.
    All,
}

impl Source {
    /// Name, as reports write it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rear => "rear",
            Self::Front => "front",
            Self::All => "all",
        }
    }

    fn of(self, run: &Condensed) -> Option<Used> {
        let all = Used::of(run);
        let [fl, fr, rl, rr] = run.wheels;
        let used = match self {
            Self::Rear => all.only([false, false, true, true], !(rl && rr)),
            Self::Front => all.only([true, true, false, false], !(fl && fr)),
            Self::All => all,
        };
        let has_wheel = used.rows[..4].iter().any(|used| *used);
        // Without a sensor the front wheels' angles come from the rear wheels.
        let own = self != Self::Front || all.sensed;
        (has_wheel && own && used.count() >= 2).then_some(used)
    }
}

/// A path by dead reckoning.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// What it was reckoned from.
    pub source: Source,
    /// Stamp \[s\] and body pose in the reference's frame, every few centimetres.
    pub poses: Vec<(f64, Pose)>,
}

/// How far dead reckoning ends from what is known of the end, in the frame of the known start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndError {
    /// Along the start's heading \[m\]; of a run whose distance alone is known, the distance's.
    pub x: f64,
    /// Across \[m\].
    pub y: f64,
    /// Heading \[rad\]; none where unknown.
    pub yaw: Option<f64>,
}

impl EndError {
    /// Distance between the two ends \[m\].
    #[must_use]
    pub fn distance(&self) -> f64 {
        math::hypot(self.x, self.y)
    }
}

/// The path of `run` by `source` and `parameters`, from what is known of its start; none where the run's sensors do
/// not make one.
///
/// # Errors
/// What makes the run useless.
pub fn dead_reckon(
    run: &Run,
    vehicle: &Vehicle,
    parameters: &Parameters,
    settings: &Settings,
    source: Source,
) -> Result<Option<Path>, CalibrationError> {
    let condensed = Condensed::new(run, vehicle, settings)?;
    Ok(reckon(&condensed, parameters, settings, source))
}

pub(crate) fn reckon(
    run: &Condensed,
    parameters: &Parameters,
    settings: &Settings,
    source: Source,
) -> Option<Path> {
    let used = source.of(run)?;
    let mut pose = start_of(run, parameters, settings);
    let mut poses = vec![(run.begin, pose)];
    for block in &run.blocks {
        let rows = Rows::of_block(block, parameters, &settings.noise, used);
        let motion = rows.motion()?;
        pose = pose.advance(motion.distance, motion.turn);
        poses.push((block.until, pose));
    }
    Some(Path { source, poses })
}

/// The known start; where its heading is not known, the first fifth of the path is laid onto the reference.
fn start_of(run: &Condensed, parameters: &Parameters, settings: &Settings) -> Pose {
    let first = run.events.iter().find_map(|event| match event.known {
        Known::Pose { x, y, yaw: Some(yaw), .. } if event.after == 0 => Some(Pose::new(x, y, yaw)),
        _ => None,
    });
    if let Some(marker) = first {
        return marker.compose(&run.marker(parameters).inverse());
    }
    let early = run.blocks.len() / 5;
    let mut beginning = run.clone();
    beginning.events.retain(|event| event.after <= early);
    if beginning.events.len() < 3 {
        beginning.events.clone_from(&run.events);
    }
    first_start(&beginning, parameters, settings)
}

/// How far `path` ends from what `run` knows of its last pose, or its distance.
pub(crate) fn end_error(run: &Condensed, parameters: &Parameters, path: &Path) -> Option<EndError> {
    let start = path.poses.first()?.1;
    let mut error = None;
    for event in &run.events {
        let reckoned = path.poses.get(event.after)?.1;
        match event.known {
            Known::Pose { x, y, yaw, .. } if event.after > 0 => {
                let marker = reckoned.compose(&run.marker(parameters));
                let (dx, dy) = (marker.x - x, marker.y - y);
                let (sin, cos) = math::sin_cos(start.yaw);
                let yaw = yaw.map(|yaw| angle::wrap(marker.yaw - yaw));
                error = Some(EndError { x: cos * dx + sin * dy, y: cos * dy - sin * dx, yaw });
            }
            Known::Distance(distance, _) if error.is_none() => {
                let rolled: f64 =
                    path.poses.windows(2).map(|pair| pair[0].1.distance(&pair[1].1)).sum();
                error = Some(EndError { x: rolled - distance, y: 0.0, yaw: None });
            }
            _ => {}
        }
    }
    error
}

/// Deviations of position \[m\] and yaw \[rad\] that the known start and end alone put into an end error.
pub(crate) fn floor(run: &Condensed, settings: &Settings) -> (f64, f64) {
    let mut poses = run.events.iter().filter_map(|event| match event.known {
        Known::Pose { x, y, position_deviation, yaw_deviation, .. } => {
            Some((x, y, position_deviation, yaw_deviation))
        }
        _ => None,
    });
    let Some(first) = poses.next() else { return (settings.noise.distance, 0.0) };
    let last = poses.next_back().unwrap_or(first);
    let chord = math::hypot(last.0 - first.0, last.1 - first.1);
    let position = 2.0 * (first.2 * first.2 + last.2 * last.2);
    let turned = first.3 * chord;
    ((position + turned * turned).sqrt(), math::hypot(first.3, last.3))
}
