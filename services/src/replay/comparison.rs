//! Odometry against the input's reference, where there is one.

use kerbside_geometry::Pose;
use kerbside_messages::{
    EstimatorState, NANOS_PER_SECOND, Nanos, Odometry, OdometryModel, ResetReason,
};
use kerbside_recordings::drift::{AlignedBy, Drift, ReferencePose, drift, reference_from_estimate};
use kerbside_recordings::input::Reference;

use super::input::Input;
use super::sensing;
use super::track::Track;
use crate::exit::{Exit, Failure};

/// Share of refused corrections beyond which it is worth a word.
const MANY_GATED: f64 = 0.05;

/// What the comparison found.
#[derive(Debug)]
pub struct Comparison {
    /// The reference, of its marker.
    pub references: Vec<ReferencePose>,
    /// The marker's place on the vehicle.
    pub body_from_marker: Pose,
    /// The odometry's frame in the reference's; none without a reference.
    pub reference_from_odometry: Option<Pose>,
    /// The drift, or why it cannot be known.
    pub drift: Result<Drift, String>,
}

impl Comparison {
    /// Holds `track` against the reference of `input`.
    ///
    /// # Errors
    /// [`Failure`] where the reference cannot be read.
    pub fn of(input: &Input, track: &Track) -> Result<Self, Failure> {
        let reference = input.drive.reference().map_err(|error| Failure::new(Exit::Data, error))?;
        let marker = input.vehicle.vehicle.reference.map(|reference| reference.marker);
        let (references, body_from_marker) = match reference {
            Reference::None => return Ok(Self::without("there is no reference")),
            Reference::Truth(poses) => (poses, Pose::default()),
            Reference::Marker(poses) => match marker {
                Some(marker) => (poses, marker),
                None => {
                    let why = "vehicle.toml has no [reference]: the marker's place is not known";
                    return Ok(Self::without(why));
                }
            },
        };
        let measured = drift(&track.poses, &references, &body_from_marker);
        Ok(Self {
            drift: measured.map_err(|error| error.to_string()),
            reference_from_odometry: reference_from_estimate(
                &track.poses,
                &references,
                &body_from_marker,
            ),
            references,
            body_from_marker,
        })
    }

    fn without(why: &str) -> Self {
        Self {
            references: Vec::new(),
            body_from_marker: Pose::default(),
            reference_from_odometry: None,
            drift: Err(why.to_owned()),
        }
    }

    /// How the drift was measured, for people.
    pub fn basis(drift: &Drift) -> String {
        let aligned = match drift.aligned_by {
            AlignedBy::Pose => "the two being aligned by pose at a window's beginning",
            AlignedBy::Path => {
                "the two being aligned over a window's first tenth: the reference has no heading"
            }
        };
        format!(
            "Medians over {} windows of {:.2} m, {aligned}; at the end of the run, aligned at its \
             beginning, odometry minus reference along the axes of the reference's frame. Largest \
             of a window: {:.2} %. The reference's own noise is in these figures.",
            drift.windows, drift.window, drift.position_percent_max
        )
    }

    /// What a person should know of the odometry, a sentence each.
    pub fn notes(&self, input: &Input, track: &Track) -> Vec<String> {
        let mut notes = Vec::new();
        if let Err(why) = &self.drift {
            notes.push(format!("no drift: {why}"));
        }
        let Some(newest) = &track.newest else {
            notes.push("no odometry came of it".to_owned());
            return notes;
        };
        let model = OdometryModel::from_code(newest.model).unwrap_or(OdometryModel::None);
        notes.extend(sensing::lacks(model, super::report::filter_of(track), &input.sensors));
        notes.extend(caution(track));
        match track.gaps.len() {
            0 => {}
            1 => notes.push("1 gap in the readings, bridged by one arc".to_owned()),
            gaps => notes.push(format!("{gaps} gaps in the readings, each bridged by one arc")),
        }
        if newest.unusable > 0 {
            let travels = if newest.unusable == 1 { "travel" } else { "travels" };
            notes.push(format!("{} {travels} without usable wheels", newest.unusable));
        }
        notes.extend(by_hand(input, track));
        notes
    }
}

/// What of the odometry must not be overlooked.
pub fn caution(track: &Track) -> Option<String> {
    let newest = track.newest.as_ref()?;
    let said: Vec<_> = lost(track, newest).into_iter().chain(gated(newest)).collect();
    (!said.is_empty()).then(|| said.join("; ") + ".")
}

/// Seconds of the drive at `stamp`.
pub fn time_of(track: &Track, stamp: Nanos) -> f64 {
    let first = track.poses.first().map_or(stamp, |pose| pose.stamp);
    #[allow(clippy::cast_precision_loss)] // seconds of a drive
    let time = stamp.cast_signed().wrapping_sub(first.cast_signed()) as f64 / NANOS_PER_SECOND;
    time
}

fn lost(track: &Track, newest: &Odometry) -> Option<String> {
    let at = time_of(track, track.lost?);
    let reason = ResetReason::from_code(newest.reset_reason).map_or("unknown", ResetReason::name);
    let ended = match EstimatorState::from_code(newest.state) {
        Some(EstimatorState::Lost) => "ended lost",
        _ => "was lost",
    };
    Some(format!(
        "The pose {ended}: from {at:.2} s on ({reason}) motion is missing that no wheel tells of"
    ))
}

fn gated(newest: &Odometry) -> Option<String> {
    let (taken, refused) = (f64::from(newest.corrections), f64::from(newest.gated));
    let share = refused / (taken + refused);
    (share > MANY_GATED).then(|| {
        format!(
            "{:.0}\u{202f}% of the corrections were refused by the gate: front and rear wheels do not \
             agree with each other or with the steering angle",
            100.0 * share
        )
    })
}

/// What was measured by tape.
fn by_hand(input: &Input, track: &Track) -> Option<String> {
    let tape = input.drive.run()?.about.info.distance.filter(|tape| *tape > 0.0)?;
    let rolled = track.distance();
    Some(format!(
        "measured by tape {tape:.3} m, rolled by odometry {rolled:.3} m: {:+.2} %",
        100.0 * (rolled / tape - 1.0)
    ))
}
