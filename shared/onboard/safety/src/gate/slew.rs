//! Limits of size and of change.

/// Differences below this are rounding, not a cut \[m/s, rad\].
const ROUNDING: f64 = 1e-9;

/// `value` in -`limit`..=`limit`; never panics, whatever the limit.
pub(super) fn within(value: f64, limit: f64) -> f64 {
    value.min(limit).max(-limit)
}

/// From `from` toward `to` by at most `step`.
pub(super) fn toward(from: f64, to: f64, step: f64) -> f64 {
    if (to - from).abs() <= step { to } else { from + step * (to - from).signum() }
}

/// As [`toward`], gaining speed by at most `gain` and losing it by at most `loss`. A change of
/// direction passes through zero.
pub(super) fn speed(from: f64, to: f64, gain: f64, loss: f64) -> f64 {
    if from * to < 0.0 {
        toward(from, 0.0, loss)
    } else if to.abs() < from.abs() {
        toward(from, to, loss)
    } else {
        toward(from, to, gain)
    }
}

/// Equal but for rounding.
pub(super) fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_and_losses_have_limits_of_their_own() {
        assert_eq!(speed(0.2, 0.5, 0.1, 0.01), 0.2 + 0.1);
        assert_eq!(speed(0.2, 0.1, 0.01, 0.05), 0.2 - 0.05);
        assert_eq!(speed(-0.2, -0.1, 0.01, 0.05), -0.2 + 0.05);
        assert_eq!(speed(0.02, -0.5, 1.0, 0.05), 0.0, "reversing passes through zero");
        assert_eq!(speed(0.0, -0.5, 0.1, 0.05), -0.1);
        assert_eq!(within(3.0, 2.0), 2.0);
        assert_eq!(within(-3.0, 2.0), -2.0);
    }
}
