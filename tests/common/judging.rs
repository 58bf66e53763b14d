//! What a fault did to the vehicle, judged on its truth.

use kerbside_messages::Nanos;
use kerbside_safety::bounds;

use super::Seen;

/// Speed below which the vehicle stands \[m/s\].
const REST: f64 = 1e-3;
/// Speed below which it only rolls out: what is left is its lag's exponential tail \[m/s\].
pub(crate) const ROLLING_OUT: f64 = 1e-2;

/// How the vehicle stopped after a fault.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Halt {
    /// The fastest from the fault on \[m/s\].
    pub(crate) speed: f64,
    /// Rolled after it \[m\].
    pub(crate) distance: f64,
    /// Time until it stood \[s\].
    pub(crate) seconds: f64,
}

impl Halt {
    /// How the vehicle stopped after a fault at `at`.
    ///
    /// # Panics
    /// Where it was not seen, or did not drive.
    pub(crate) fn after(seen: &Seen, at: Nanos) -> Self {
        let before = seen.truth.iter().rev().find(|truth| truth.stamp <= at).unwrap();
        assert!(before.speed.abs() > 0.05, "the vehicle does not drive: {before:?}");
        let last = seen.truth.last().unwrap();
        assert!(last.speed.abs() < ROLLING_OUT, "the vehicle does not stand: {last:?}");
        let moving = seen.truth.iter().rev().find(|truth| truth.speed.abs() >= REST).unwrap();
        let seconds = kerbside_messages::seconds(moving.stamp.saturating_sub(at));
        let fastest = seen.truth.iter().rev().take_while(|truth| truth.stamp >= before.stamp);
        let speed = fastest.map(|truth| truth.speed.abs()).fold(0.0, f64::max);
        Self { speed, distance: last.distance - before.distance, seconds }
    }

    /// Holds it against what the stop-distance inequality allows from that speed with the shipped configuration.
    ///
    /// # Panics
    /// Where it rolled farther or longer.
    pub(crate) fn assert_in_time(&self, what: &str) {
        let mut stack = kerbside::configuration::stack(None, None).unwrap();
        stack.vehicle.limits.speed = self.speed;
        let distance = bounds::stop_distance(&stack.vehicle, stack.safety(false));
        let time = bounds::stop_times(&stack.vehicle, stack.safety(false)).stop.as_secs_f64();
        let Self { speed, distance: rolled, seconds } = *self;
        println!(
            "{what}: from {speed:.3} m/s {:.1} cm of {:.1} in {seconds:.3} s of {time:.3}",
            100.0 * rolled,
            100.0 * distance
        );
        assert!(rolled <= distance, "{what}: rolled {rolled:.3} m, {distance:.3} are allowed");
        assert!(seconds <= time, "{what}: took {seconds:.3} s, {time:.3} are allowed");
    }
}

/// How much the estimate's error changed from a fault to the end \[m\].
///
/// # Panics
/// Where there is no valid estimate.
pub(crate) fn pose_jump(seen: &Seen, at: Nanos) -> f64 {
    let before = error_at(seen, |stamp| stamp <= at);
    let after = error_at(seen, |stamp| stamp > at);
    (after.0 - before.0).hypot(after.1 - before.1)
}

/// Error of the newest valid estimate at such a time against the truth at that time.
fn error_at(seen: &Seen, at: impl Fn(Nanos) -> bool) -> (f64, f64) {
    let valid = |line: &&super::OdometryLine| line.valid && at(line.stamp);
    let estimate = seen.odometry.iter().rev().find(valid).expect("a valid estimate");
    let truth = seen.truth.iter().min_by_key(|truth| truth.stamp.abs_diff(estimate.stamp)).unwrap();
    (estimate.x - truth.x, estimate.y - truth.y)
}
