//! Where a recorded run begins.

use kerbside_geometry::{Pose, math};
use kerbside_recordings::run_folder::{ReferenceRow, Run};
use kerbside_simulation::{Trajectory, body_from_reference};

use super::input::Case;

const MOVING: &str =
    "the car moves from the start: the reference's first row alone says where that is";

/// Where the body stands at t = 0.
pub(super) struct Start {
    /// The pose.
    pub(super) pose: Pose,
    /// What a person should know of it, a sentence.
    pub(super) note: Option<String>,
}

impl Start {
    fn noted(pose: Pose, note: &str) -> Self {
        Self { pose, note: Some(note.to_owned()) }
    }
}

/// The start of `recorded`: as run.toml states it, else from the reference while the car stands, until `motion` \[s\].
///
/// `drive` simulates the run from a pose; it is needed where the reference shows no yaw.
pub(super) fn start(
    case: &Case,
    recorded: &Run,
    motion: Option<f64>,
    mut drive: impl FnMut(Pose) -> Trajectory,
) -> Start {
    if let Some(pose) = recorded.about.info.start {
        return Start { pose, note: None };
    }
    let rows: Vec<&ReferenceRow> = recorded
        .reference
        .iter()
        .flat_map(|table| &table.rows)
        .filter(|row| row.x.is_some() && row.y.is_some())
        .collect();
    let Some(first) = rows.first() else {
        let note = "nothing says where the run begins: its start is taken as the origin";
        return Start::noted(Pose::default(), note);
    };
    let standing: Vec<&ReferenceRow> =
        rows.iter().copied().filter(|row| motion.is_none_or(|motion| row.t < motion)).collect();
    let (standing, moving) =
        if standing.is_empty() { (vec![*first], true) } else { (standing, false) };
    let mean = |of: &dyn Fn(&ReferenceRow) -> Option<f64>| {
        let (sum, count) = standing
            .iter()
            .filter_map(|row| of(row))
            .fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
        (count > 0.0).then_some(sum / count)
    };
    let x = mean(&|row| row.x).unwrap_or_default();
    let y = mean(&|row| row.y).unwrap_or_default();
    let sin = mean(&|row| row.yaw.map(math::sin));
    let cos = mean(&|row| row.yaw.map(math::cos));
    if let (Some(sin), Some(cos)) = (sin, cos) {
        let shown = Pose::new(x, y, math::atan2(sin, cos));
        let pose = body_from_reference(&case.vehicle, &case.effects, &shown);
        if moving {
            return Start::noted(back(case, &drive(pose), pose, first.t), MOVING);
        }
        return Start { pose, note: None };
    }
    // The marker where it was seen, the heading such that the first way leads where it led.
    let place =
        |shown_yaw| body_from_reference(&case.vehicle, &case.effects, &Pose::new(x, y, shown_yaw));
    let pose = place(0.0);
    let turn = heading(case, &drive(pose), &rows, (x, y));
    let mut pose = place(turn);
    if moving {
        pose = back(case, &drive(pose), pose, first.t);
    }
    let note = "the reference shows no yaw: the heading at the start is that of the first motion";
    Start::noted(pose, note)
}

/// Where a body began that stands at `pose` when the reference stamps `t`, `simulated` being its drive had it begun at
/// `pose`.
fn back(case: &Case, simulated: &Trajectory, pose: Pose, t: f64) -> Pose {
    let reached = body_from_reference(&case.vehicle, &case.effects, &simulated.reference(t));
    pose.compose(&reached.inverse().compose(&pose))
}

/// By how much the simulated way must be turned to lead where the reference's first wheelbase of way led \[rad\].
fn heading(case: &Case, simulated: &Trajectory, rows: &[&ReferenceRow], (x, y): (f64, f64)) -> f64 {
    let (mut dot, mut cross) = (0.0, 0.0);
    let begin = simulated.reference(rows.first().map_or(0.0, |row| row.t));
    for row in rows {
        let (Some(row_x), Some(row_y)) = (row.x, row.y) else { continue };
        let (seen_x, seen_y) = (row_x - x, row_y - y);
        let shown = simulated.reference(row.t);
        let (way_x, way_y) = (shown.x - begin.x, shown.y - begin.y);
        dot += way_x * seen_x + way_y * seen_y;
        cross += way_x * seen_y - way_y * seen_x;
        if math::hypot(seen_x, seen_y) > case.vehicle.wheelbase {
            break;
        }
    }
    math::atan2(cross, dot)
}
