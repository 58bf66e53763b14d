//! The steering sensor against the front wheels' own travel, which needs no steering.

use kerbside_geometry::math;

use crate::ackermann::rear_from_front_travel;
use crate::parameters::{Parameter, Parameters};
use crate::run::Run;

/// Travel of a window \[m\] per wheelbase.
const WINDOW: f64 = 1.0;
/// A window in which the reading moves by more than this is not used \[rad\].
const STEADY: f64 = 0.02;

/// The sensor's reading as a line over the angle that the front wheels' travel implies (form d):
/// reading = zero + gain * angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteeringCheck {
    /// Windows compared.
    pub windows: usize,
    /// Windows refused: beyond 40 degrees, or with travels that no rolling car makes.
    pub refused: usize,
    /// Reading at angle 0 \[rad\].
    pub zero: f64,
    /// Its standard deviation \[rad\].
    pub zero_deviation: f64,
    /// Reading per angle; none where the angles do not differ enough to tell.
    pub gain: Option<f64>,
    /// Root mean square of what the line leaves \[rad\].
    pub residual: f64,
}

/// Compares sensor and front wheels by `parameters`; none where `runs` have no sensor, no two front wheels, or no
/// steady window.
#[must_use]
pub fn check_steering(runs: &[&Run], parameters: &Parameters) -> Option<SteeringCheck> {
    let mut pairs = Vec::new();
    let mut refused = 0;
    for run in runs {
        refused += windows(run, parameters, &mut pairs).unwrap_or(0);
    }
    line(&pairs, refused)
}

/// Collects (angle by travel, reading) of the run's windows of one direction; counts those refused.
fn windows(run: &Run, p: &Parameters, pairs: &mut Vec<(f64, f64)>) -> Option<usize> {
    let steering = run.steering.as_ref()?;
    let (left, right) = (run.rotation[0].as_ref()?, run.rotation[1].as_ref()?);
    let (track, base) = (p.get(Parameter::TrackFront), p.get(Parameter::Wheelbase));
    if track <= 0.0 {
        return None;
    }
    let travel = |t: f64| (p.values[0] * left.at(t), p.values[1] * right.at(t));
    let (from, to) = run.span()?;
    let mut refused = 0;
    let mut begin = (from, travel(from));
    let mut direction = 0.0;
    for t in left.t.iter().copied().filter(|t| *t > from && *t <= to) {
        let now = travel(t);
        let gone = 0.5 * (now.0 - begin.1.0 + now.1 - begin.1.1);
        if gone == 0.0 {
            // At rest the wheels may be steered without rolling.
            begin.0 = t;
            continue;
        }
        if gone * direction < 0.0 || gone.abs() < direction.abs() {
            // Turned round: the window is given up.
            begin = (t, now);
            direction = 0.0;
            continue;
        }
        direction = gone;
        if gone.abs() < WINDOW * base {
            continue;
        }
        let middle = 0.5 * (begin.0 + t);
        let (first, second) = (steering.mean(begin.0, middle), steering.mean(middle, t));
        if let (Some(first), Some(second)) = (first, second)
            && (first - second).abs() < STEADY
        {
            let (l, r) = (now.0 - begin.1.0, now.1 - begin.1.1);
            match rear_from_front_travel(l, r, track, base) {
                Some((distance, turn)) => {
                    pairs.push((math::atan(base * turn / distance), 0.5 * (first + second)));
                }
                None => refused += 1,
            }
        }
        begin = (t, now);
        direction = 0.0;
    }
    Some(refused)
}

/// Least squares of a line; only its zero where the angles do not differ.
fn line(pairs: &[(f64, f64)], refused: usize) -> Option<SteeringCheck> {
    if pairs.len() < 3 {
        return None;
    }
    #[allow(clippy::cast_precision_loss)] // windows
    let count = pairs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let (angle, reading) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let spread: f64 = pairs.iter().map(|(a, _)| (a - angle) * (a - angle)).sum();
    let common: f64 = pairs.iter().map(|(a, r)| (a - angle) * (r - reading)).sum();
    let tells = spread / count > STEADY * STEADY;
    let slope = if tells { common / spread } else { 1.0 };
    let zero = reading - slope * angle;
    let left: f64 = pairs.iter().map(|(a, r)| (r - zero - slope * a).powi(2)).sum();
    let residual = (left / (count - 2.0).max(1.0)).sqrt();
    let lever = if tells { angle * angle / spread } else { 0.0 };
    Some(SteeringCheck {
        windows: pairs.len(),
        refused,
        zero,
        zero_deviation: residual * (1.0 / count + lever).sqrt(),
        gain: tells.then_some(slope),
        residual,
    })
}
