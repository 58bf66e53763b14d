//! Whether a fix may set the pose.

use kerbside_messages::{Fix, FixVerdict, NANOS_PER_SECOND, Nanos};
use nalgebra::Matrix3;

/// A fix may run ahead of the newest travel by so much and is then held until a travel has caught
/// up \[s\]: a fix stamped now is always a little newer than the newest wheel reading.
const LONGEST_WAIT: f64 = 0.25;

/// What is to be done with a fix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ruling {
    /// Judge it again with the next travel.
    Wait,
    /// Done.
    Said(FixVerdict),
}

/// The vehicle's rest, as the wheels tell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rest {
    /// It stands for the configured time.
    pub(crate) standstill: bool,
    /// Stamp of the newest motion.
    pub(crate) moved: Nanos,
}

/// Judges `fix` at `now`, the newest travel's stamp. It sets the pose only of a vehicle that stands
/// and has stood since the fix's stamp, is at most `oldest` seconds old, and carries a covariance.
pub(crate) fn judge(fix: &Fix, now: Nanos, rest: &Rest, oldest: f64) -> Ruling {
    let stamp = fix.header.stamp;
    let ahead = signed_seconds(stamp, now);
    if !is_covariance(&Matrix3::from_row_slice(&fix.covariance)) {
        return Ruling::Said(FixVerdict::Covariance);
    }
    if ahead > LONGEST_WAIT {
        return Ruling::Said(FixVerdict::Future);
    }
    if ahead > 0.0 {
        return Ruling::Wait;
    }
    if -ahead > oldest {
        return Ruling::Said(FixVerdict::Late);
    }
    if !rest.standstill || rest.moved > stamp {
        return Ruling::Said(FixVerdict::Moving);
    }
    Ruling::Said(FixVerdict::Accepted)
}

#[allow(clippy::cast_precision_loss)]
fn signed_seconds(later: Nanos, earlier: Nanos) -> f64 {
    later.wrapping_sub(earlier).cast_signed() as f64 / NANOS_PER_SECOND
}

/// Finite, symmetric and positive semidefinite, rounding allowed for: every principal minor is.
fn is_covariance(matrix: &Matrix3<f64>) -> bool {
    let diagonal = matrix.diagonal();
    if !matrix.iter().all(|entry| entry.is_finite()) || diagonal.min() < 0.0 {
        return false;
    }
    let asymmetry = (matrix - matrix.transpose()).abs().max();
    let minor = |a: usize, b: usize| {
        let bound = matrix[(a, a)] * matrix[(b, b)];
        matrix[(a, b)] * matrix[(a, b)] <= bound * (1.0 + 1e-9)
    };
    let scale = diagonal.x * diagonal.y * diagonal.z;
    asymmetry <= 1e-9 * diagonal.sum()
        && minor(0, 1)
        && minor(0, 2)
        && minor(1, 2)
        && matrix.determinant() >= -1e-9 * scale
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerbside_messages::Header;

    const SECOND: u64 = 1_000_000_000;

    fn fix(stamp: Nanos) -> Fix {
        let covariance = [1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-5];
        Fix { header: Header::stamped(stamp, 0), covariance, ..Fix::default() }
    }

    #[test]
    fn each_reason_is_said() {
        let rest = Rest { standstill: true, moved: 5 * SECOND };
        let now = 10 * SECOND;
        let said = |stamp| judge(&fix(stamp), now, &rest, 6.0);
        assert_eq!(said(9 * SECOND), Ruling::Said(FixVerdict::Accepted));
        assert_eq!(said(now), Ruling::Said(FixVerdict::Accepted));
        assert_eq!(said(now + SECOND / 10), Ruling::Wait);
        assert_eq!(said(now + SECOND), Ruling::Said(FixVerdict::Future));
        assert_eq!(said(3 * SECOND), Ruling::Said(FixVerdict::Late));
        assert_eq!(said(9 * SECOND / 2), Ruling::Said(FixVerdict::Moving));
        let rolling = Rest { standstill: false, ..rest };
        let moving = judge(&fix(9 * SECOND), now, &rolling, 6.0);
        assert_eq!(moving, Ruling::Said(FixVerdict::Moving));
    }

    #[test]
    fn what_is_no_covariance_is_refused() {
        let rest = Rest { standstill: true, moved: 0 };
        for (index, value) in [(0, -1e-9), (1, 1e-6), (4, f64::NAN), (8, f64::INFINITY)] {
            let mut hurt = fix(SECOND);
            hurt.covariance[index] = value;
            let ruling = judge(&hurt, SECOND, &rest, 1.0);
            assert_eq!(ruling, Ruling::Said(FixVerdict::Covariance), "{index}");
        }
        let mut indefinite = fix(SECOND);
        (indefinite.covariance[1], indefinite.covariance[3]) = (2e-4, 2e-4);
        let ruling = judge(&indefinite, SECOND, &rest, 1.0);
        assert_eq!(ruling, Ruling::Said(FixVerdict::Covariance));
        let known = Fix { covariance: [0.0; 9], ..fix(SECOND) };
        assert_eq!(judge(&known, SECOND, &rest, 1.0), Ruling::Said(FixVerdict::Accepted));
    }
}
