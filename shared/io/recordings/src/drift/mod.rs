//! How far an estimate drifts from a reference. Pure.
//!
//! # What is measured
//! Estimate and reference live in frames that need not agree, so an error is always seen from an
//! *alignment*: the rigid transform that lays the estimate on the reference at one place.
//!
//! - Compared is the **marker**: each estimated pose of the body, interpolated at a reference's
//!   stamp, is moved to the marker by `body_from_marker`.
//! - **Distance** is what the estimate has rolled, in either direction. The reference's own path
//!   is longer than the drive by its noise.
//! - A **window** begins at each reference sample and ends at the first one that is a window's
//!   length farther on. The length is a tenth of the distance, but at least 1 m and at most
//!   100 m, and never more than half the distance.
//! - The estimate is aligned at the window's beginning. **Position drift** is the distance of the
//!   two positions at the window's end over the distance driven in it, in percent. **Heading
//!   drift** is what the estimate turned beyond the reference, per metre, positive where it
//!   turned too far to the left.
//! - **End error** is the same once over the whole run.
//!
//! Figures are medians over all windows. The reference's own noise is in them, the more the
//! shorter the window.
//!
//! # Alignment
//! A reference **with yaw** aligns at one pose; where the car stands at the run's beginning or
//! end, at the mean over that stand, the pose next to the motion left out.
//!
//! A reference **without yaw** gives a direction only along a path: over the first and the last
//! tenth of a window the estimate's positions are rigidly fitted to the reference's (least
//! squares, by Horn's method in the plane), the angle is the fit's, and at the beginning the first
//! positions are laid on each other. Heading drift is then per metre between the middles of the
//! two tenths.

mod align;
mod samples;

use kerbside_geometry::{Pose, angle, math};
use kerbside_messages::Nanos;

use align::Alignment;
use samples::{Sample, samples_of};

/// A pose as the odometry under test states it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EstimatedPose {
    /// When it held \[ns\].
    pub stamp: Nanos,
    /// Pose of the body, in the estimate's frame.
    pub pose: Pose,
    /// Distance rolled in either direction since the start \[m\].
    pub distance: f64,
}

/// A pose of the marker as a reference states it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferencePose {
    /// When it held \[ns\].
    pub stamp: Nanos,
    /// Position in the reference's frame \[m\].
    pub x: f64,
    /// Position in the reference's frame \[m\].
    pub y: f64,
    /// Heading in the reference's frame, wrapped or not \[rad\].
    pub yaw: Option<f64>,
}

/// How the estimate was laid on the reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AlignedBy {
    /// At a pose: the reference has yaw.
    Pose,
    /// By a rigid fit over a stretch of path: the reference has none.
    Path,
}

/// The error at the end of a run, the estimate being aligned at its beginning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndError {
    /// Estimate minus reference along the x of the reference's frame \[m\].
    pub x: f64,
    /// Estimate minus reference along the y of the reference's frame \[m\].
    pub y: f64,
    /// Estimate minus reference, wrapped \[rad\].
    pub yaw: f64,
}

impl EndError {
    /// Distance of the two positions \[m\].
    #[must_use]
    pub fn distance(&self) -> f64 {
        math::hypot(self.x, self.y)
    }
}

/// How far an estimate drifts from a reference; the module says how each figure is defined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Median position drift \[% of distance\].
    pub position_percent: f64,
    /// Largest position drift of a window \[% of distance\].
    pub position_percent_max: f64,
    /// Median size of the heading drift \[rad/m\].
    pub heading_rad_per_m: f64,
    /// Mean heading drift with its sign, positive to the left \[rad/m\].
    pub heading_bias_rad_per_m: f64,
    /// At the end of the run.
    pub end_error: EndError,
    /// How the estimate was laid on the reference.
    pub aligned_by: AlignedBy,
    /// Distance rolled while there was a reference \[m\].
    pub distance: f64,
    /// Length of a window \[m\].
    pub window: f64,
    /// How many windows there are.
    pub windows: usize,
}

/// Why no drift can be stated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DriftError {
    /// No two reference samples lie within the time of the estimate.
    #[error("estimate and reference have no time in common")]
    Apart,
    /// The car hardly moved on.
    #[error("rolled {distance:.3} m only: a drift per distance needs at least {SHORTEST} m")]
    Short {
        /// Distance \[m\].
        distance: f64,
    },
    /// A reference without yaw, on which no direction can be found.
    #[error("the reference has no yaw, and no stretch of its path gives a direction")]
    NoDirection,
}

/// Least distance that a drift per distance is stated for \[m\].
pub const SHORTEST: f64 = 0.2;

/// A car that rolled less than this stands, for the mean over a stand \[m\].
const STAND: f64 = 1e-4;

/// The drift of `estimates` against `references`, both in order of their stamps, the marker being
/// at `body_from_marker`.
///
/// References are used as with yaw where every one in the estimate's time has it.
///
/// # Errors
/// [`DriftError`] where too little is there to compare.
pub fn drift(
    estimates: &[EstimatedPose],
    references: &[ReferencePose],
    body_from_marker: &Pose,
) -> Result<Drift, DriftError> {
    let samples = samples_of(estimates, references, body_from_marker);
    let [first, .., last] = samples.as_slice() else { return Err(DriftError::Apart) };
    let distance = last.distance - first.distance;
    if distance < SHORTEST {
        return Err(DriftError::Short { distance });
    }
    let by = aligned_by(&samples);
    let window = window_length(distance);
    let spans: Vec<Span> =
        windows(&samples, window).filter_map(|part| window_span(part, by)).collect();
    let whole = run_span(&samples, by).filter(|_| !spans.is_empty());
    let end_error = whole.ok_or(DriftError::NoDirection)?.error;
    let percent = sorted(spans.iter().map(Span::percent));
    let heading = sorted(spans.iter().map(|span| span.heading_drift().abs()));
    Ok(Drift {
        position_percent: median(&percent),
        position_percent_max: percent.last().copied().unwrap_or_default(),
        heading_rad_per_m: median(&heading),
        heading_bias_rad_per_m: mean(spans.iter().map(Span::heading_drift)),
        end_error,
        aligned_by: by,
        distance,
        window,
        windows: spans.len(),
    })
}

/// The pose of the estimate's frame in the reference's, as the two are aligned at the run's beginning
/// for the end error; none where no direction can be found.
#[must_use]
pub fn reference_from_estimate(
    estimates: &[EstimatedPose],
    references: &[ReferencePose],
    body_from_marker: &Pose,
) -> Option<Pose> {
    let samples = samples_of(estimates, references, body_from_marker);
    let by = aligned_by(&samples);
    Some(Alignment::over(beginning(&samples, by), by)?.reference_from_estimate)
}

fn aligned_by(samples: &[Sample]) -> AlignedBy {
    let with_yaw = samples.iter().all(|sample| sample.reference_yaw.is_some());
    if with_yaw { AlignedBy::Pose } else { AlignedBy::Path }
}

/// Length of a window for a drive of `distance` \[m\].
fn window_length(distance: f64) -> f64 {
    (0.1 * distance).clamp(1.0, 100.0).min(0.5 * distance)
}

/// The windows of `length` \[m\], each from its first to its last sample.
fn windows(samples: &[Sample], length: f64) -> impl Iterator<Item = &[Sample]> {
    let mut end = 0;
    samples.iter().enumerate().map_while(move |(start, first)| {
        let beyond = samples[end..].iter().position(|s| s.distance - first.distance >= length)?;
        end += beyond;
        Some(&samples[start..=end])
    })
}

fn window_span(window: &[Sample], by: AlignedBy) -> Option<Span> {
    match by {
        AlignedBy::Pose => Span::between(window.get(..1)?, window.get(window.len() - 1..)?, by),
        AlignedBy::Path => path_span(window),
    }
}

fn run_span(samples: &[Sample], by: AlignedBy) -> Option<Span> {
    match by {
        AlignedBy::Pose => {
            let end = tail(samples, STAND);
            Span::between(beginning(samples, by), &end[usize::from(end.len() > 1)..], by)
        }
        AlignedBy::Path => path_span(samples),
    }
}

/// The place at a run's beginning where the two are aligned.
///
/// Of a stand the pose next to the motion is left out, at the end as well: the car may have begun to
/// move, or may not have come to rest, less than a count ago.
fn beginning(samples: &[Sample], by: AlignedBy) -> &[Sample] {
    match by {
        AlignedBy::Pose => {
            let stand = head(samples, STAND);
            &stand[..stand.len().saturating_sub(1).max(1).min(stand.len())]
        }
        AlignedBy::Path => head(samples, tenth(samples)),
    }
}

fn path_span(samples: &[Sample]) -> Option<Span> {
    let (start, end) = (beginning(samples, AlignedBy::Path), tail(samples, tenth(samples)));
    Span::between(start, end, AlignedBy::Path)
}

/// A tenth of the distance \[m\]; 0 where there is none.
fn tenth(samples: &[Sample]) -> f64 {
    let distance = |sample: Option<&Sample>| sample.map_or(0.0, |sample| sample.distance);
    0.1 * (distance(samples.last()) - distance(samples.first()))
}

/// The samples up to `length` \[m\] from the first.
fn head(samples: &[Sample], length: f64) -> &[Sample] {
    let start = samples.first().map_or(0.0, |first| first.distance);
    &samples[..samples.partition_point(|sample| sample.distance - start <= length)]
}

/// The samples from `length` \[m\] before the last.
fn tail(samples: &[Sample], length: f64) -> &[Sample] {
    let end = samples.last().map_or(0.0, |last| last.distance);
    &samples[samples.partition_point(|sample| end - sample.distance > length)..]
}

/// The error that grew from one place to another.
struct Span {
    /// At the second place, the estimate being aligned at the first.
    error: EndError,
    /// Distance between the places \[m\].
    distance: f64,
    /// Distance between what the two headings stand for \[m\].
    heading_distance: f64,
}

impl Span {
    fn between(head: &[Sample], tail: &[Sample], by: AlignedBy) -> Option<Self> {
        let start = Alignment::over(head, by)?;
        let end = Alignment::over(tail, by)?;
        let at_end = match by {
            AlignedBy::Pose => tail,
            AlignedBy::Path => &tail[tail.len() - 1..],
        };
        let (x, y) = start.error_of(at_end);
        let yaw = angle::wrap(start.angle() - end.angle());
        Some(Self {
            error: EndError { x, y, yaw },
            distance: tail.last()?.distance - head.first()?.distance,
            heading_distance: end.middle - start.middle,
        })
    }

    fn percent(&self) -> f64 {
        100.0 * self.error.distance() / self.distance
    }

    fn heading_drift(&self) -> f64 {
        self.error.yaw / self.heading_distance
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Median of sorted values; 0 where there are none.
fn median(sorted: &[f64]) -> f64 {
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => 0.0,
        count if count % 2 == 1 => sorted[middle],
        _ => 0.5 * (sorted[middle - 1] + sorted[middle]),
    }
}

#[allow(clippy::cast_precision_loss)] // Fewer than 2^53 values.
fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
}

#[cfg(test)]
mod tests;
