//! When the tracker gives up.

use kerbside_messages::{EstimatorState, Odometry, TrackingStop};

use crate::TrackerSettings;
use crate::kanayama::Errors;

/// Why the vehicle must not go on; `None` where it may. What is not a number is beyond any limit.
pub(crate) fn objection(
    settings: &TrackerSettings,
    odometry: &Odometry,
    resets: u32,
    errors: &Errors,
) -> TrackingStop {
    let (position, yaw) = deviations(&odometry.covariance);
    if !is_valid(odometry) || odometry.resets != resets {
        TrackingStop::Pose
    } else if beyond(position, settings.position_noise) || beyond(yaw, settings.yaw_noise) {
        TrackingStop::Covariance
    } else if beyond(errors.distance(), settings.corridor)
        || beyond(errors.yaw.abs(), settings.corridor_yaw)
    {
        TrackingStop::Corridor
    } else {
        TrackingStop::None
    }
}

/// Whether the estimate is a pose in the plan's frame.
pub(crate) fn is_valid(odometry: &Odometry) -> bool {
    odometry.state == EstimatorState::Valid.code()
}

/// Standard deviation of the position along its worst direction \[m\], and of the heading \[rad\].
fn deviations(covariance: &[f64; 9]) -> (f64, f64) {
    let [xx, xy, _, _, yy, _, _, _, yaw] = *covariance;
    let half_difference = 0.5 * (xx - yy);
    let worst = 0.5 * (xx + yy) + (half_difference * half_difference + xy * xy).sqrt();
    (worst.sqrt(), yaw.sqrt())
}

fn beyond(value: f64, limit: f64) -> bool {
    value.is_nan() || value > limit
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standing() -> Odometry {
        Odometry { state: EstimatorState::Valid.code(), resets: 3, ..Odometry::default() }
    }

    fn judge(odometry: &Odometry, errors: Errors) -> TrackingStop {
        objection(&TrackerSettings::default(), odometry, 3, &errors)
    }

    #[test]
    fn each_limit_has_its_own_reason() {
        let errors = Errors::default();
        assert_eq!(judge(&standing(), errors), TrackingStop::None);
        assert_eq!(judge(&Odometry { resets: 4, ..standing() }, errors), TrackingStop::Pose);
        assert_eq!(judge(&Odometry { state: 2, ..standing() }, errors), TrackingStop::Pose);
        let far = Errors { along: 0.11, across: -0.11, yaw: 0.0 };
        assert_eq!(judge(&standing(), far), TrackingStop::Corridor);
        let askew = Errors { yaw: -0.36, ..errors };
        assert_eq!(judge(&standing(), askew), TrackingStop::Corridor);
        let unknown = Errors { across: f64::NAN, ..errors };
        assert_eq!(judge(&standing(), unknown), TrackingStop::Corridor);
    }

    #[test]
    fn the_uncertainty_is_judged_along_its_worst_direction() {
        let along = |deviation: f64| {
            // All of the variance along the diagonal: 0.7 of it shows on each axis.
            let half = 0.5 * deviation * deviation;
            let covariance = [half, half, 0.0, half, half, 0.0, 0.0, 0.0, 0.0];
            judge(&Odometry { covariance, ..standing() }, Errors::default())
        };
        assert_eq!(along(0.049), TrackingStop::None);
        assert_eq!(along(0.051), TrackingStop::Covariance);
        let mut heading = standing();
        heading.covariance[8] = 0.102 * 0.102;
        assert_eq!(judge(&heading, Errors::default()), TrackingStop::Covariance);
    }
}
