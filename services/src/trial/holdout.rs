//! How far an answer shrinks the gap on drives that no diagnosis saw: simulated from their commands, without and with it.

use kerbside_geometry::{Pose, math};
use kerbside_proving_ground::cases::{Case, Drives, Errors, Plan, Rows};
use kerbside_simulation::{Command, Drive, Effects, Parameter, STEP, Trajectory};

use super::answer::Answer;
use super::plant;

/// Trajectories are laid on each other by their mean pose over so long \[s\].
const WINDOW: f64 = 0.5;
/// Where the gap is not this many times its floor there is nothing to explain.
const EXPLAINABLE: f64 = 1.25;
/// Beyond the last stamp \[s\].
const BEYOND: f64 = 0.5;

/// The effects of an answer in the simulator's terms.
#[must_use]
pub fn overlay(answer: &Answer) -> Effects {
    let mut effects = Effects::NEUTRAL;
    for found in &answer.effects {
        for (name, [value, ..]) in &found.parameters {
            let of = Parameter::of(&found.id).filter(|parameter| {
                let wheel = parameter.wheel().map(|wheel| wheel.name().to_owned());
                parameter.definition().name == name && wheel == found.wheel
            });
            of.for_each(|parameter| effects.set(parameter, *value));
        }
    }
    effects
}

/// Share of the explainable gap in position that `effects` remove from the drives that were held back, against the floor
/// that the labelled effects leave; none where there is no reference or nothing to explain.
#[must_use]
pub fn removed(case: &Case, driver: &dyn Drives, effects: &Effects) -> Option<f64> {
    let truth = plant::of(&case.label().effects);
    let (mut before, mut after, mut floor) = (0.0, 0.0, 0.0);
    for plan in &case.specification.holdout {
        let rows = case.record_by(driver, plan, true, Errors::Drawn(0));
        let error = |effects: &Effects| error(case, plan, &rows, effects);
        before += error(&Effects::NEUTRAL)?;
        after += error(effects)?;
        floor += error(&truth)?;
    }
    (before > EXPLAINABLE * floor && before > 0.0).then(|| (before - after) / (before - floor))
}

/// Simulates a drive with `effects` from its commands.
#[must_use]
pub fn simulated(case: &Case, plan: &Plan, effects: &Effects) -> Trajectory {
    let commands: Vec<Command> = plan
        .commands
        .iter()
        .map(|asked| Command { t: asked.time, speed: asked.speed, steering: asked.steering })
        .collect();
    let (vehicle, start) = (&case.specification.vehicle, plan.start);
    let mut out = Trajectory::new();
    Drive { vehicle, effects: *effects, commands: &commands, start, step: STEP }
        .trajectory(plan.duration + BEYOND, &mut out);
    out
}

/// Root mean square distance between what was measured and what is simulated, from a common start \[m\].
fn error(case: &Case, plan: &Plan, rows: &Rows, effects: &Effects) -> Option<f64> {
    let shown = simulated(case, plan, effects);
    let has_yaw = rows.reference.iter().all(|row| row.value.2.is_some());
    let measured: Vec<(f64, Pose)> = rows
        .reference
        .iter()
        .map(|row| {
            let (x, y, yaw) = row.value;
            (row.time, Pose::new(x, y, yaw.unwrap_or_default()))
        })
        .collect();
    let predicted: Vec<(f64, Pose)> =
        measured.iter().map(|(t, _)| (*t, shown.reference(*t))).collect();
    let [measured, predicted] = [measured, predicted].map(|rows| laid(&rows, has_yaw));
    let squares = measured.iter().zip(&predicted).map(|(m, p)| {
        let (x, y) = (m.0 - p.0, m.1 - p.1);
        x * x + y * y
    });
    let (sum, count) = squares.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
    (count > 0.0).then(|| (sum / count).sqrt())
}

/// Positions in the frame of the mean pose of the first rows; without a yaw only moved.
fn laid(rows: &[(f64, Pose)], has_yaw: bool) -> Vec<(f64, f64)> {
    let Some((first, _)) = rows.first() else { return Vec::new() };
    let (mut x, mut y, mut sin, mut cos, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (_, pose) in rows.iter().take_while(|(t, _)| *t <= first + WINDOW) {
        let (s, c) = math::sin_cos(pose.yaw);
        (x, y, sin, cos, count) = (x + pose.x, y + pose.y, sin + s, cos + c, count + 1.0);
    }
    let (x, y) = (x / count, y / count);
    let (sin, cos) = if has_yaw { math::sin_cos(math::atan2(sin, cos)) } else { (0.0, 1.0) };
    rows.iter()
        .map(|(_, pose)| {
            let (dx, dy) = (pose.x - x, pose.y - y);
            (cos * dx + sin * dy, -sin * dx + cos * dy)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::plant::Simulated;
    use kerbside_proving_ground::cases::{Kind, Request};

    #[test]
    fn the_truth_removes_all_and_nothing_removes_nothing() {
        let mut request = Request::new(Kind::Single);
        (request.ids, request.share, request.duration) = (vec!["wheelbase_scale"], Some(0.5), 8.0);
        let mut cases = (0..50).filter_map(|seed| Case::of(seed, &request));
        let case = cases.find(|case| case.specification.vehicle.reference.is_some()).unwrap();
        let removed = |effects: &Effects| removed(&case, &Simulated, effects).unwrap();
        assert!((removed(&plant::of(&case.label().effects)) - 1.0).abs() < 1e-12);
        assert!(removed(&Effects::NEUTRAL).abs() < 1e-12);
    }
}
